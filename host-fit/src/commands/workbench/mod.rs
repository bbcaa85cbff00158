//! `host-fit workbench`: the complete workflow on a local page.

mod bench;
mod colours;
mod data;
mod own;
mod request;
mod task;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::{Console, threads};
use bench::ModelBench;

/// Serve a local page: import recordings, view them, identify, compare, diagnose, extend, design a law.
///
/// The page is served on 127.0.0.1 only, to clients that have the printed address. All results are kept in
/// the project folder: models that every other command reads, the tree of their origins, the log of commands.
///
/// Example: host-fit workbench DATASET
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder with dataset.toml, or one CSV file; without it, files are imported on the page.
    #[arg(value_name = "DATASET")]
    dataset: Option<PathBuf>,
    /// A model to start from.
    #[arg(long, value_name = "model.toml")]
    model: Option<PathBuf>,
    /// Project folder [default: the data set's name (or `new`) and .workbench, in the current folder].
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
    threads::needed("the workbench")?;
    let project = match (&args.project, &args.dataset) {
        (Some(folder), _) => folder.clone(),
        (None, Some(dataset)) => named_by(dataset)?,
        (None, None) => PathBuf::from("new.workbench"),
    };
    let bench = ModelBench::open(args.dataset.as_deref(), &project)?;
    if let Some(model) = &args.model {
        bench.bring(model)?;
    }
    workbench::serve(bench, args.port, |address| {
        let told = match console.json {
            true => console.document(
                &serde_json::json!({"address": address, "project": project.to_string_lossy()}),
            ),
            false => console.say(&format!(
                "the workbench is at {address}\nproject folder {}; Ctrl-C ends it, all results are saved",
                project.display()
            )),
        };
        // A closed pipe does not stop the server.
        drop(told);
        if !args.no_open {
            open(address);
        }
    })?;
    Ok(())
}

/// The project folder of a data set.
fn named_by(dataset: &Path) -> anyhow::Result<PathBuf> {
    let whole = std::fs::canonicalize(dataset)?;
    let named = match whole.file_name().is_some_and(|n| n == "dataset.toml") {
        true => whole.parent().unwrap_or(&whole),
        false => &whole,
    };
    let name = named.file_stem().unwrap_or_default().to_string_lossy();
    Ok(PathBuf::from(format!("{name}.workbench")))
}

/// Folder of an imported data set within a project.
const IMPORTED: &str = "data";

/// Names of the files with this ending in a folder, sorted; empty without the folder. Symbolic links are
/// ignored, because they may lead out of the project.
fn names_in(folder: &Path, ending: &str) -> Vec<String> {
    let is_link = std::fs::symlink_metadata(folder).is_ok_and(|found| found.is_symlink());
    let entries = (!is_link).then(|| std::fs::read_dir(folder));
    let entries = entries.into_iter().flatten().flatten().flatten();
    let entries = entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_file()));
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|name| name.ends_with(ending)).collect();
    names.sort();
    names
}

/// Opens the browser if the system provides a command for it; the address is printed in any case.
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
    // Without a browser the user opens the address.
    drop(quiet);
}
