//! Fuzzing of every reader of untrusted input.

use anyhow::Result;

use crate::Task;
use crate::shell::{run, scenario};

pub(crate) const TASK: Task = Task {
    name: "fuzz",
    does: "gives mutated files, frames and texts to every reader; --minutes N: total time of all readers; NAMES: \
         only the named readers",
    run: |arguments| run(scenario("fuzz").args(arguments)),
};

/// A short run of each target.
pub(crate) fn brief() -> Result<()> {
    run(scenario("fuzz").args(["--minutes", "1.5"]))
}
