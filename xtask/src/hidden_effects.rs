//! The hidden-effects campaign: what the diagnosis finds in rigs that hide something.

use crate::Task;
use crate::shell::{cargo, run, scenario};

pub(crate) const TASK: Task = Task {
    name: "hidden-effects",
    does: "the diagnosis on rigs of all families that hide something; --help for its options",
    run: hidden_effects,
};

fn hidden_effects(arguments: &[String]) -> anyhow::Result<()> {
    run(&mut cargo(&["build", "--release", "--package", "host-fit"]))?;
    run(scenario("hidden-effects").args(arguments))
}
