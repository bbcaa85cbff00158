//! Agreement of the exported models between languages: `cargo xtask agreement`.

use crate::Task;
use crate::shell::{run, scenario};

pub(crate) const TASK: Task = Task {
    name: "agreement",
    does: "every model, effect and law in C, Python and Octave beside the host, as a table; --all: none may be missing; --in-turn: one kind of graded commands an effect; --pace: seconds of 10^6 samples",
    run: |arguments| run(scenario("agreement").args(arguments)),
};
