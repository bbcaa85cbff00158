//! Who watches a step at work.

use std::sync::atomic::AtomicBool;

use crate::identify::Watcher;
use crate::model::Model;
use crate::search::{Progress, Snapshot};

/// Someone who watches a step at work, and may ask it to end. The unit type `()` watches nothing and never asks.
pub trait Onlooker: Sync {
    /// A piece of work begins: what it is, in words.
    fn begins(&self, _what: &str) {}
    /// What the piece of work is at now, in words.
    fn now(&self, _what: &str) {}
    /// How far a search has come.
    fn sees(&self, _snapshot: &Snapshot) {}
    /// The model that the search has found so far. It is made when it is asked for, and the search waits meanwhile.
    fn finds(&self, _best: &dyn Fn() -> Option<Model>) {}
    /// The piece of work is over.
    fn ends(&self) {}
    /// Something to know before a long computation, not after it.
    fn hears(&self, _warning: &str) {}
    /// Raised from outside when the best so far is wanted at once.
    fn interrupt(&self) -> &AtomicBool;
}

static NEVER: AtomicBool = AtomicBool::new(false);

impl Onlooker for () {
    fn interrupt(&self) -> &AtomicBool {
        &NEVER
    }
}

/// An onlooker as a search knows one.
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

/// Runs a piece of work that an onlooker sees begin and end.
pub(super) fn watched<T>(onlooker: &dyn Onlooker, what: &str, work: impl FnOnce() -> T) -> T {
    onlooker.begins(what);
    let result = work();
    onlooker.ends();
    result
}
