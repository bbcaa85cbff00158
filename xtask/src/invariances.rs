//! Invariances of the program's answer: `cargo xtask invariances`.

use crate::Task;
use crate::shell::{cargo, run, scenario};

pub(crate) const TASK: Task = Task {
    name: "invariances",
    does: "tests that certain changes of records do not change the answer, on rigs drawn at random; --help lists the \
         options",
    run: |arguments| {
        run(&mut cargo("build --release --package host-fit"))?;
        run(scenario("invariances").args(arguments))
    },
};
