//! Agreement of the exported models between languages: `cargo xtask agreement`.

use crate::Task;
use crate::shell::{run, scenario};

pub(crate) const TASK: Task = Task {
    name: "agreement",
    does: "compares every model, effect and law in C, Python and Octave with the host, as a table; --all: fails if a language is missing; --in-turn: one kind of graded command for each effect; --pace: prints the time of 10^6 samples",
    run: |arguments| run(scenario("agreement").args(arguments)),
};
