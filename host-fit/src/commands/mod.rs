//! The commands of the program, one file each. They parse, call [`host_fit::steps`] and pass the result to one of
//! three renderers: [`words`], [`page`] with its [`drawings`], and JSON, which is the serialised result
//! ([`Console::show`]).

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use anyhow::Context;
use host_fit::data::{visible, visible_json};
use host_fit::output::check_writable;
use host_fit::search::Snapshot;
use host_fit::steps::Onlooker;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use words::Words;

pub(crate) mod average;
pub(crate) mod codegen;
pub(crate) mod compare;
pub(crate) mod completions;
pub(crate) mod delay;
pub(crate) mod demo;
pub(crate) mod design;
pub(crate) mod diagnose;
pub(crate) mod discover;
mod drawings;
mod effect_files;
mod effect_names;
pub(crate) mod effects;
pub(crate) mod extend;
pub(crate) mod identify;
pub(crate) mod import;
mod interrupt;
mod load;
pub(crate) mod man_pages;
mod page;
mod page_parts;
pub(crate) mod record;
mod rig_constants;
pub(crate) mod rules;
pub(crate) mod simulate;
pub(crate) mod threads;
mod time_span;
mod tried;
pub(crate) mod watch;
mod words;
pub(crate) mod workbench;

/// Output of a command to the user.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Console {
    /// Standard output carries one JSON document and nothing else.
    pub(crate) json: bool,
}

impl Console {
    /// Prints a result: in words with the names of the `written` files, or as one JSON document. The document has
    /// the files of `keys` first, then the result's own keys.
    pub(crate) fn show<T: Words + Serialize>(
        self,
        result: &T,
        keys: &[(&str, &Path)],
        written: &[&Path],
    ) -> anyhow::Result<()> {
        #[derive(Serialize)]
        struct Document<'a, T> {
            /// The paths are stored as text, because JSON strings are UTF-8. A file name with other bytes is
            /// still accepted.
            #[serde(flatten)]
            files: BTreeMap<&'a str, Cow<'a, str>>,
            #[serde(flatten)]
            result: &'a T,
        }
        if self.json {
            let named = keys
                .iter()
                .map(|(key, path)| (*key, path.to_string_lossy()));
            let files = named.collect();
            return self.document(&Document { files, result });
        }
        print(&result.words())?;
        for path in written {
            print(&format!("written to {}", path.display()))?;
        }
        Ok(())
    }

    /// Prints a text; silent with `--json`.
    pub(crate) fn say(self, text: &str) -> anyhow::Result<()> {
        if self.json {
            return Ok(());
        }
        print(text)
    }

    /// Prints a JSON document; silent without `--json`.
    pub(crate) fn document(self, value: &impl Serialize) -> anyhow::Result<()> {
        if !self.json {
            return Ok(());
        }
        let document = serde_json::to_string_pretty(value)?;
        write_out(&visible_json(&document))
    }

    /// A progress bar on standard error; invisible if that is not a terminal.
    #[allow(clippy::unused_self)]
    pub(crate) fn progress(self, length: u64, template: &str) -> ProgressBar {
        if !io::stderr().is_terminal() {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::new(length);
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        // The ticks of a progress bar need their own thread.
        if threads::are_given() {
            bar.enable_steady_tick(Duration::from_millis(200));
        }
        bar
    }

    /// Shows the progress of a step on standard error; Ctrl-C makes it return its best result so far.
    pub(crate) fn watch(self) -> Watch {
        let mut watch = self.show_progress();
        watch.interrupt = interrupt::watch();
        watch
    }

    /// Shows progress of a step without intermediate results: Ctrl-C ends the program.
    pub(crate) fn show_progress(self) -> Watch {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Watch {
            console: self,
            bar: self.progress(0, "{spinner} {msg} ({elapsed})"),
            interrupt: &NEVER,
        }
    }
}

/// Progress display of a step.
pub(crate) struct Watch {
    console: Console,
    bar: ProgressBar,
    interrupt: &'static AtomicBool,
}

impl Onlooker for Watch {
    fn begins(&self, what: &str) {
        self.now(what);
        self.bar.reset_elapsed();
    }

    fn now(&self, what: &str) {
        self.bar.set_message(visible(what).into_owned());
    }

    fn sees(&self, snapshot: &Snapshot) {
        self.bar.set_message(format!(
            "{} evaluations, best {:.5}",
            snapshot.evaluations, snapshot.best
        ));
    }

    /// A warning goes to standard error if that is a terminal, otherwise to the words of the result; with `--json`
    /// the document contains it.
    fn hears(&self, warning: &str) {
        let text = format!("warning: {}", visible(warning));
        if io::stderr().is_terminal() {
            self.bar.suspend(|| eprintln!("{text}"));
        } else {
            // A closed pipe is not an error.
            let _ = self.console.say(&text);
        }
    }

    fn interrupt(&self) -> &AtomicBool {
        self.interrupt
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// The message as one paragraph; causes that the message already contains are not repeated.
pub(crate) fn paragraph(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.contains(&cause) {
            text.push_str(&format!(": {cause}"));
        }
    }
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Refuses outputs that cannot be written before the work starts.
pub(crate) fn check_outputs<'a>(
    files: impl IntoIterator<Item = &'a PathBuf>,
) -> anyhow::Result<()> {
    let mut files = files.into_iter();
    Ok(files.try_for_each(|file| check_writable(file))?)
}

/// Prints a text and a line end, with control characters escaped, because names in it come from files.
fn print(text: &str) -> anyhow::Result<()> {
    write_out(&visible(text))
}

/// Writes a text and a line end; a closed pipe (`| head`) is not an error.
fn write_out(text: &str) -> anyhow::Result<()> {
    let mut out = io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("standard output cannot be written"),
    }
}
