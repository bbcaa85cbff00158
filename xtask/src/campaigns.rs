//! Campaigns on rigs that hide something: what the diagnosis finds of effects, and the search of terms that no
//! catalogue has.

use crate::Task;
use crate::shell::{cargo, output, root, run, scenario};
use anyhow::Context;

pub(crate) const EFFECTS: Task = Task {
    name: "hidden-effects",
    does: "the diagnosis on rigs of all families that hide something; --help for its options",
    run: |arguments| campaign("hidden-effects", arguments),
};

pub(crate) const CALIBRATE: Task = Task {
    name: "calibrate",
    does: "error rates, coverage and power of the diagnosis: docs/calibration.md; a thousand mixed rigs take ten hours, `--first 200` two, and rows are kept; takes the options of hidden-effects",
    run: calibrate,
};

pub(crate) const TERMS: Task = Task {
    name: "hidden-terms",
    does: "the search for unknown terms on rigs with physics that the catalogue lacks; --help for its options",
    run: |arguments| campaign("hidden-terms", arguments),
};

fn campaign(name: &str, arguments: &[String]) -> anyhow::Result<()> {
    run(&mut cargo(&["build", "--release", "--package", "host-fit"]))?;
    run(scenario(name).args(arguments))
}

/// The whole campaign, its rows kept: what was stopped goes on, and the page tells of the rows that there are.
const CALIBRATION: &str = "--draws 4 --altered 17 --nulls 300 --pairs 0 --outside 0 --units 0 --power 3 --jobs 2 \
                           --seed 2026 --rows target/calibration.jsonl --calibration";

fn calibrate(arguments: &[String]) -> anyhow::Result<()> {
    run(&mut cargo(&["build", "--release", "--package", "host-fit"]))?;
    let page = root().join("docs/calibration.md");
    let text = output(
        scenario("hidden-effects")
            .args(CALIBRATION.split_whitespace())
            .args(arguments),
    )?;
    std::fs::write(&page, text).with_context(|| page.display().to_string())?;
    println!("written: docs/calibration.md");
    Ok(())
}
