//! The commands of the program, one file each: arguments in, library calls, words or one JSON document out.

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

pub(crate) mod average;
pub(crate) mod codegen;
pub(crate) mod compare;
pub(crate) mod delay;
pub(crate) mod demo;
pub(crate) mod design;
pub(crate) mod diagnose;
mod effect_files;
pub(crate) mod effects;
pub(crate) mod extend;
pub(crate) mod identify;
mod interrupt;
mod scores;
pub(crate) mod simulate;

/// How a command talks to the user.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Console {
    /// Standard output carries one JSON document and nothing else.
    pub(crate) json: bool,
}

impl Console {
    /// Prints a result in words; silent with `--json`.
    pub(crate) fn say(self, text: &str) -> anyhow::Result<()> {
        if self.json {
            return Ok(());
        }
        print(text)
    }

    /// Warns at once, before a long computation: on standard error where that is a terminal, otherwise among the words
    /// of the result; with `--json` the document is to carry it.
    pub(crate) fn warn(self, text: &str) -> anyhow::Result<()> {
        if io::stderr().is_terminal() {
            return Ok(writeln!(io::stderr(), "warning: {text}")?);
        }
        self.say(&format!("warning: {text}"))
    }

    /// Prints the JSON document of the command; silent without `--json`.
    pub(crate) fn document(self, value: &impl serde::Serialize) -> anyhow::Result<()> {
        if !self.json {
            return Ok(());
        }
        print(&serde_json::to_string_pretty(value)?)
    }

    /// A progress bar on standard error; invisible when that is no terminal.
    #[allow(clippy::unused_self)]
    pub(crate) fn progress(self, length: u64, template: &str) -> ProgressBar {
        if !io::stderr().is_terminal() {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::new(length);
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(200));
        bar
    }

    /// A sign of life on standard error while `what` goes on; invisible when that is no terminal.
    pub(crate) fn spinner(self, what: &str) -> ProgressBar {
        let bar = self.progress(0, "{spinner} {msg} ({elapsed})");
        bar.set_message(what.to_owned());
        bar
    }
}

/// Prints a text and a line end; a reader that has gone away (`| head`) is no error.
fn print(text: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => Ok(other?),
    }
}
