//! `completions`: the script by which a shell completes commands, options, files and effect names.

use std::io::{self, Write};

use anyhow::Context;
use clap_complete::aot::{Shell, generate};

use super::Console;

/// Print the script by which a shell completes commands, options, files and names of effects.
///
/// bash: host-fit completions bash > ~/.local/share/bash-completion/completions/host-fit.
/// zsh: write it as _host-fit into a folder of $fpath. fish: ~/.config/fish/completions/host-fit.fish.
///
/// Example: host-fit completions bash > host-fit.bash
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

/// Runs the command for the program's `command` line.
pub(crate) fn run(args: &Args, mut command: clap::Command, console: Console) -> anyhow::Result<()> {
    let mut script = Vec::new();
    generate(args.shell, &mut command, "host-fit", &mut script);
    let mut script = String::from_utf8(script)?;
    if args.shell == Shell::Bash {
        // clap_complete 4.6.11 spells a program name with a hyphen in two ways and then does not find its
        // options.
        script = script.replace("host__subcmd__fit__", "host__fit__");
    }
    if console.json {
        let shell = args.shell.to_string();
        return console.document(&serde_json::json!({ "shell": shell, "script": script }));
    }
    // The script is printed without escaping, because it contains characters that are otherwise hidden from a
    // terminal.
    let mut out = io::stdout().lock();
    match out.write_all(script.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("standard output cannot be written"),
    }
}
