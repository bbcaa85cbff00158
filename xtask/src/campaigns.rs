//! Campaigns on simulated rigs: diagnosis of hidden effects, and search for unknown terms.

use crate::Task;
use crate::shell::{cargo, output, program, root, run, scenario};
use anyhow::Context;

pub(crate) const EFFECTS: Task = Task {
    name: "hidden-effects",
    does: "runs the diagnosis on simulated rigs of all families with hidden effects; --help lists the options",
    run: |arguments| campaign("hidden-effects", arguments),
};

pub(crate) const CALIBRATE: Task = Task {
    name: "calibrate",
    does: "counts error rates, coverage and power of the diagnosis for docs/calibration.md; a thousand rigs take ten \
         hours, and `--first 200` takes two hours; a stopped run continues; the options are those of hidden-effects",
    run: calibrate,
};

pub(crate) const TERMS: Task = Task {
    name: "hidden-terms",
    does: "runs the search for unknown terms on rigs with physics that the catalogue lacks; --help lists the options",
    run: |arguments| campaign("hidden-terms", arguments),
};

pub(crate) const LITERATURE: Task = Task {
    name: "literature",
    does: "runs the diagnosis on published flows with realistic instruments; --help lists the options",
    run: |arguments| campaign("literature", arguments),
};

pub(crate) const LAWS: Task = Task {
    name: "laws",
    does: "tests laws on rigs whose plants share no code with the model; counts wrong refusals, laws that lose \
         attachment, and wrong margins; --help lists the options",
    run: |arguments| campaign("laws", arguments),
};

pub(crate) const KEPT: Task = Task {
    name: "kept-rigs",
    does: "runs tests of the diagnosis that CI leaves out: rigs that once got a wrong answer, and measured \
         sets in ../shared",
    run: |_| {
        program()?;
        run(&mut cargo(
            "test --release --no-fail-fast --package=scenarios --test=hidden_effects \
                --test=hidden_terms --test=real_data --test=strangers -- --ignored --nocapture \
                --test-threads=1",
        ))
    },
};

fn campaign(name: &str, arguments: &[String]) -> anyhow::Result<()> {
    program()?;
    run(scenario(name).args(arguments))
}

/// The complete campaign with stored results: a stopped one continues, and the page shows the results so far.
const CALIBRATION: &str = "--draws 4 --altered 17 --nulls 300 --pairs 0 --outside 0 --units 0 --power 3 --jobs 2 \
                           --seed 2026 --rows target/calibration.jsonl --calibration";

fn calibrate(arguments: &[String]) -> anyhow::Result<()> {
    program()?;
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
