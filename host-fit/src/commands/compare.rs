//! `host-fit compare`: indicators of a model on a data set, and where it fails.

use std::path::{Path, PathBuf};

use host_fit::output::{Staging, write_atomic};
use host_fit::steps;

use super::drawings::overlays;
use super::load::ModelAndData;
use super::words::describe;
use super::{Console, page};

/// Run a model free over every record and say how well it matches, and where it does not.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    from: ModelAndData,
    /// Write a report page with pictures.
    #[arg(long, value_name = "out.html")]
    report: Option<PathBuf>,
    /// Write one picture (SVG) per record into this folder.
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let (model, set) = args.from.load()?;
    let found = steps::compare(&model, &set)?;
    if let Some(folder) = &args.pictures {
        let records = model.targets(&set.records);
        let pictures = overlays(&records, &[("model", &found.runs)]);
        let mut staging = Staging::new(folder)?;
        for (index, (name, svg)) in pictures.iter().enumerate() {
            let file = format!("{}-{}.svg", index + 1, file_name(name));
            staging.write(&file, |out| out.write_all(svg.as_bytes()))?;
        }
        staging.commit()?;
    }
    if let Some(path) = &args.report {
        let page = page::comparison(&model, &set, &found, &page::command_line());
        write_atomic(path, |out| out.write_all(page.as_bytes()))?;
    }
    console.say(&describe(&model))?;
    let written = args.report.iter().chain(&args.pictures);
    let written: Vec<&Path> = written.map(PathBuf::as_path).collect();
    console.show(&found, &[], &written)
}

/// A record's name with only what every file system takes.
fn file_name(name: &str) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() || c == '-' || c == '_' {
            c
        } else {
            '_'
        }
    };
    name.chars().map(plain).collect()
}
