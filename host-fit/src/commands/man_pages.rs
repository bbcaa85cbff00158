//! `man-pages`: a manual page for each command, as part of a release.

use std::path::{Path, PathBuf};

use clap_mangen::Man;
use host_fit::output::Staging;

use super::Console;

/// Write a manual page for each command.
///
/// Example: host-fit man-pages -o ~/.local/share/man/man1
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder for the pages.
    #[arg(short, long, visible_alias = "out", value_name = "DIR", value_hint = clap::ValueHint::DirPath)]
    output: PathBuf,
}

/// Runs the command for the program's `command` line.
pub(crate) fn run(args: &Args, command: clap::Command, console: Console) -> anyhow::Result<()> {
    let mut command = command.disable_help_subcommand(true);
    command.build();
    let shown = command.get_subcommands().filter(|one| !one.is_hide_set());
    let mut pages = Vec::new();
    for one in [&command].into_iter().chain(shown) {
        let man = Man::new(one.clone());
        let mut text = Vec::new();
        man.render(&mut text)?;
        pages.push((man.get_filename(), text));
    }
    let mut staging = Staging::new(&args.output)?;
    for (name, text) in &pages {
        staging.write(name, |file| file.write_all(text))?;
    }
    staging.commit()?;
    let names: Vec<&str> = pages.iter().map(|(name, _)| name.as_str()).collect();
    console.say(&names.join("\n"))?;
    let output: &Path = &args.output;
    console.document(&serde_json::json!({ "output": output.to_string_lossy(), "pages": names }))
}
