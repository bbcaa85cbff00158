//! A designed law and what came of trying it in the loop.

use host_fit::design::Proof;
use host_fit::steps::Design;
use serde::Serialize;

use super::words::Words;

/// A law and how it did on the simulated plants.
#[derive(Serialize)]
pub(super) struct Tried {
    #[serde(flatten)]
    pub(super) design: Design,
    #[serde(flatten)]
    pub(super) proof: Option<Proof>,
    /// What the plants are without, one sentence each.
    pub(super) not_tried: Vec<String>,
}

impl Tried {
    /// Why the law must not be written; `switch` is what writes it all the same.
    pub(super) fn refused(&self, switch: &str) -> Option<String> {
        let lost = self.design.law.lost();
        (!lost.is_empty()).then(|| {
            format!(
                "the law was not written: it loses attachment with {}. Choose a target that is further inside of what can \
                 be held, or find out whether the rig has that and `extend` the model; {switch} writes the law as it is, and \
                 the file says so",
                lost.join(", ")
            )
        })
    }
}

impl Words for Tried {
    fn words(&self) -> String {
        let notes = self.not_tried.iter().map(|why| format!("note: {why}"));
        let told = std::iter::once(self.design.words()).chain(notes);
        let told = told.chain(self.proof.as_ref().map(Words::words));
        told.collect::<Vec<_>>().join("\n")
    }
}
