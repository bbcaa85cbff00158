//! `host-fit workbench`: the whole way on a local page.

mod bench;
mod request;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use bench::ModelBench;
use host_fit::data::DataSet;

use super::Console;

/// Serve a page on this machine: see the records, identify, compare, find what is missing, add it, undo, download.
///
/// The page is served on 127.0.0.1 alone, to whoever has the address that is printed. Whatever is done there is kept in
/// the project folder: models that every other command reads, the tree of how they came about, the log of commands.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder with dataset.toml, or one CSV file.
    #[arg(value_name = "DATASET")]
    dataset: PathBuf,
    /// A model to start from.
    #[arg(long, value_name = "model.toml")]
    model: Option<PathBuf>,
    /// Project folder [default: the data set's name and .workbench, in the current folder].
    #[arg(long, value_name = "DIR")]
    project: Option<PathBuf>,
    /// Port to serve on; 0 takes any free one.
    #[arg(long, value_name = "N", default_value_t = 0)]
    port: u16,
    /// Do not open the browser.
    #[arg(long)]
    no_open: bool,
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let set = DataSet::load(&args.dataset)?;
    let project = match &args.project {
        Some(folder) => folder.clone(),
        None => beside(&args.dataset)?,
    };
    let bench = ModelBench::open(&args.dataset, set, &project)?;
    if let Some(model) = &args.model {
        bench.bring(model)?;
    }
    workbench::serve(bench, args.port, |address| {
        let told = match console.json {
            true => console.document(&serde_json::json!({"address": address, "project": project})),
            false => console.say(&format!(
                "the workbench is at {address}\nproject folder {}; Ctrl-C ends it, nothing is lost",
                project.display()
            )),
        };
        // A reader that has gone away is no reason not to serve.
        drop(told);
        if !args.no_open {
            open(address);
        }
    })?;
    Ok(())
}

fn beside(dataset: &Path) -> anyhow::Result<PathBuf> {
    let whole = std::fs::canonicalize(dataset)?;
    let named = match whole.file_name().is_some_and(|n| n == "dataset.toml") {
        true => whole.parent().unwrap_or(&whole),
        false => &whole,
    };
    let name = named.file_stem().unwrap_or_default().to_string_lossy();
    Ok(PathBuf::from(format!("{name}.workbench")))
}

/// Opens the browser where the system knows how; the address is printed anyway.
fn open(address: &str) {
    let (program, arguments): (&str, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        "windows" => ("cmd", &["/C", "start", ""]),
        _ => ("xdg-open", &[]),
    };
    let quiet = Command::new(program)
        .args(arguments)
        .arg(address)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    // Not there: the user opens it.
    drop(quiet);
}
