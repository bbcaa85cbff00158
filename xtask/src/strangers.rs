//! Records as strangers bring them: `cargo xtask strangers`.

use crate::Task;
use crate::shell::{cargo, root, run, scenario};
use anyhow::{Context, Result};
use std::process::Stdio;

pub(crate) const TASK: Task = Task {
    name: "strangers",
    does: "the program on records as strangers bring them, beside the baselines; --page writes docs/strangers.md, --help has the other options",
    run: strangers,
};

const HEAD: &str = "\
# Records as strangers bring them

Written by `cargo xtask strangers --page`. The sets are described in
[tests/data/strangers](../tests/data/strangers/README.md). FIT in percent, on the validation records, or on the
estimation records where nothing was held out (own). FOPDT and SOPDT: first and second order with dead time, fitted in
free run; ARX: ARX(2,2). *edges* is the mean delay that `delay` measures, in samples.

";

fn strangers(arguments: &[String]) -> Result<()> {
    run(&mut cargo(&["build", "--release", "--package", "host-fit"]))?;
    let rest: Vec<&String> = arguments.iter().filter(|a| *a != "--page").collect();
    if rest.len() == arguments.len() {
        return run(scenario("strangers").args(arguments));
    }
    // What is wrong stands on the page: its exit code does not matter here.
    let output = scenario("strangers")
        .args(rest)
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .context("the table of strangers")?;
    let table = String::from_utf8_lossy(&output.stdout);
    anyhow::ensure!(table.starts_with('|'), "no table was printed");
    let page = root().join("docs/strangers.md");
    std::fs::write(&page, format!("{HEAD}{table}")).with_context(|| page.display().to_string())?;
    println!("written: docs/strangers.md");
    Ok(())
}
