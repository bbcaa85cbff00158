//! Records from other loggers: `cargo xtask strangers`.

use crate::Task;
use crate::shell::{cargo, root, run, scenario};
use anyhow::{Context, Result};
use std::process::Stdio;

pub(crate) const TASK: Task = Task {
    name: "strangers",
    does: "identifies and diagnoses records from other loggers and compares with baseline models; --drawn COUNT draws records from a seed; --page writes docs/strangers.md, --help has the other options",
    run: strangers,
};

const HEAD: &str = "\
# Records from other loggers

Written by `cargo xtask strangers --page`. The sets are described in
[tests/data/strangers](../tests/data/strangers/README.md). FIT is in percent, on the validation records. \"(own)\" marks
a FIT on the estimation records of a set without a validation record. FOPDT and SOPDT are models of first and second
order with dead time, fitted in free run; ARX is ARX(2,2). *edges* is the mean delay that `delay` measures, in samples.

";
/// The drawn sets of the page.
const DRAWN: [&str; 4] = ["--drawn", "420", "--seed", "2041"];
const DRAWN_HEAD: &str = "
## Drawn from a seed

`cargo xtask strangers --drawn 420 --seed 2041`: records of linear plants with a dead time and one to three lags, a
resonance or an integrator, written in the formats of different loggers; twenty records of each of 21 kinds. A case is
right if all of these hold:

- no effect is named that the plant does not have, and another input that drives y is named;
- the interval of the dead time contains the true one;
- the FIT of the model is at most one point below that of the best baseline;
- every printed error equals the error of the written file.

The shares have 95 % bounds.

";

fn strangers(arguments: &[String]) -> Result<()> {
    run(&mut cargo("build --release --package host-fit"))?;
    let rest: Vec<&String> = arguments.iter().filter(|a| *a != "--page").collect();
    if rest.len() == arguments.len() {
        return run(scenario("strangers").args(arguments));
    }
    let rest: Vec<&str> = rest.into_iter().map(String::as_str).collect();
    let (sets, drawn) = (table(&rest)?, table(&DRAWN)?);
    let page = root().join("docs/strangers.md");
    std::fs::write(&page, format!("{HEAD}{sets}{DRAWN_HEAD}{drawn}"))
        .with_context(|| page.display().to_string())?;
    println!("written: docs/strangers.md");
    Ok(())
}

/// The output of the program, which contains any errors; the exit code is not needed here.
fn table(arguments: &[&str]) -> Result<String> {
    let output = scenario("strangers")
        .args(arguments)
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .context("the table of strangers")?;
    let table = String::from_utf8(output.stdout)?;
    anyhow::ensure!(table.starts_with('|'), "no table was printed");
    Ok(table)
}
