//! Runs the campaign on published flows and prints its table as Markdown.

use clap::Parser;
use scenarios::campaign::Ledger;
use scenarios::campaign::literature::{Row, cases, run, table};

/// The diagnosis on flows from the literature with realistic instruments.
///
/// A third of the cases hide nothing. Results are kept in a file, one line per case; a stopped campaign
/// continues there. Results belong to one version of the program: use a new file for a new version.
#[derive(Debug, Parser)]
#[command(name = "literature")]
struct Arguments {
    #[command(flatten)]
    ledger: Ledger,
    /// Number of cases; eighteen include two effects and a null case of every model.
    #[arg(long, default_value_t = 18)]
    cases: usize,
    /// White noise only: no converter, no valve dead time, constant offset.
    #[arg(long)]
    ideal_instruments: bool,
}

fn main() -> anyhow::Result<()> {
    let arguments = Arguments::parse();
    let real = !arguments.ideal_instruments;
    let wanted = cases(arguments.cases, real, arguments.ledger.seed);
    let told = |rows: &[Row]| table(rows);
    (arguments.ledger).keep("literature", wanted, run, tell, told)
}

/// A progress line.
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
