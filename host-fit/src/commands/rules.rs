//! `host-fit rules`: every threshold, with its meaning and where it was calibrated.

use host_fit::steps::rulebooks;

use super::Console;
use super::words::Words;

/// List the thresholds by which the tool decides, with their meaning and origin.
///
/// `--set NAME=VALUE` on any command gives one another value for that run.
///
/// Example: host-fit rules residual
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Only this group of rules, for example `residual`.
    #[arg(value_name = "ROOM")]
    room: Option<String>,
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let mut books = rulebooks();
    let rooms: Vec<&str> = books.iter().map(|book| book.room).collect();
    if let Some(room) = &args.room {
        anyhow::ensure!(
            rooms.contains(&room.as_str()),
            "there is no group `{}` of rules; the groups are: {}",
            room.escape_debug(),
            rooms.join(", ")
        );
        books.retain(|book| book.room == room);
    }
    for book in &books {
        console.say(&book.words())?;
    }
    console.document(&books)
}
