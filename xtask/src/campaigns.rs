//! Campaigns on rigs that hide something: what the diagnosis finds of effects, and the search of terms that no
//! catalogue has.

use crate::Task;
use crate::shell::{cargo, run, scenario};

pub(crate) const EFFECTS: Task = Task {
    name: "hidden-effects",
    does: "the diagnosis on rigs of all families that hide something; --help for its options",
    run: |arguments| campaign("hidden-effects", arguments),
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
