//! The designed law against what people use, on plants that are not its model.

use crate::Task;
use crate::shell::{cargo, run};

pub(crate) const TASK: Task = Task {
    name: "bench-law",
    does: "the designed law against relay, PI, Smith predictor and open loop: one table",
    run: bench_law,
};

fn bench_law(_arguments: &[String]) -> anyhow::Result<()> {
    run(&mut cargo(&[
        "run",
        "--release",
        "--package",
        "scenarios",
        "--bin",
        "bench-law",
    ]))
}
