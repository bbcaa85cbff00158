//! A day of the board's loop, and many steps of the models.

use crate::Task;
use crate::shell::{run, scenario};

pub(crate) const TASK: Task = Task {
    name: "long-run",
    does: "runs the board's loop for 24 hours of samples with random faults and commands, and 10⁸ steps of each model \
         in single against double precision; --ticks N, --steps N, --seed S",
    run: |arguments| run(scenario("long-run").args(arguments)),
};
