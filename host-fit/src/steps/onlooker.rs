//! Observer of a running step.

use std::sync::atomic::AtomicBool;

use crate::identify::Watcher;
use crate::model::Model;
use crate::search::{Progress, Snapshot};

/// Observer of a running step, which may also interrupt it. The unit type `()` ignores everything and never
/// interrupts.
pub trait Onlooker: Sync {
    /// A task with this name starts.
    fn begins(&self, _what: &str) {}
    /// Progress of the task, in words.
    fn now(&self, _what: &str) {}
    /// Progress of a search.
    fn sees(&self, _snapshot: &Snapshot) {}
    /// The best model of a search so far. It is built when the closure is called, and the search waits
    /// meanwhile.
    fn finds(&self, _best: &dyn Fn() -> Option<Model>) {}
    /// The task is finished.
    fn ends(&self) {}
    /// A warning before a long computation.
    fn hears(&self, _warning: &str) {}
    /// When this flag is set, the step returns its best result so far.
    fn interrupt(&self) -> &AtomicBool;
}

static NEVER: AtomicBool = AtomicBool::new(false);

impl Onlooker for () {
    fn interrupt(&self) -> &AtomicBool {
        &NEVER
    }
}

/// Adapter from a step's observer to a search's.
pub(super) struct Searching<'a>(pub(super) &'a dyn Onlooker);

impl Progress for Searching<'_> {
    fn report(&self, snapshot: &Snapshot) {
        self.0.sees(snapshot);
    }
}

impl Watcher for Searching<'_> {
    fn model(&self, best: &dyn Fn() -> Option<Model>) {
        self.0.finds(best);
    }
}

/// Runs a task between `begins` and `ends` of its observer.
pub(super) fn watched<T>(onlooker: &dyn Onlooker, what: &str, work: impl FnOnce() -> T) -> T {
    onlooker.begins(what);
    let result = work();
    onlooker.ends();
    result
}
