//! Runs the campaign on published flows and prints its table as Markdown.

use std::process::ExitCode;

use clap::Parser;
use scenarios::campaign::Ledger;
use scenarios::campaign::literature::{Row, cases, run, table};

/// The diagnosis on flows that others published, behind the instruments of a real rig.
///
/// A third of the cases hide nothing. One line a case is kept in a file: a campaign that was stopped goes on where
/// it was. Rows belong to the program that made them; take a new file for a new program.
#[derive(Debug, Parser)]
#[command(name = "literature")]
struct Arguments {
    #[command(flatten)]
    ledger: Ledger,
    /// How many cases; eighteen hold two effects and a null of every model.
    #[arg(long, default_value_t = 18)]
    cases: usize,
    /// White noise alone: no converter, no dead time of the valve, the same zero every day.
    #[arg(long)]
    ideal_instruments: bool,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let real = !arguments.ideal_instruments;
    let wanted = cases(arguments.cases, real, arguments.ledger.seed);
    let told = |rows: &[Row]| table(rows);
    match (arguments.ledger).keep("literature", wanted, run, tell, told) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("literature: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// A line for whoever watches.
fn tell(row: &Row) {
    let over = |over: Option<f64>| over.map_or("-".to_owned(), |over| format!("{over:.3}"));
    eprintln!(
        "{}: {} | {} -> {} x noise, {:.0} + {:.0} CPU s",
        row.key,
        row.said(),
        over(row.given_over_noise),
        over(row.over_noise),
        row.identify.cpu_s.unwrap_or_default(),
        row.diagnose.cpu_s.unwrap_or_default(),
    );
}
