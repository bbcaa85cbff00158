//! The lockstep cases with their measured cost on the board.

use crate::stack;
use firmware::cases::Rigs;
use firmware::link::lockstep::{Cases, Report};

/// A clock that measures the duration of a function.
pub trait Stopwatch {
    /// The result of `work`, and its duration in ticks.
    fn measure<R>(&mut self, work: impl FnOnce() -> R) -> (R, u32);
}

/// The cases, timed.
pub struct Measured<S> {
    rigs: Rigs,
    stopwatch: S,
    report: Report,
}

impl<S: Stopwatch> Measured<S> {
    /// No case started yet.
    #[must_use]
    pub fn new(stopwatch: S) -> Self {
        Self {
            rigs: Rigs::new(),
            stopwatch,
            report: Report::default(),
        }
    }
}

impl<S: Stopwatch> Cases for Measured<S> {
    fn start(&mut self, case: u8) -> bool {
        self.report = Report::default();
        self.rigs.start(case)
    }

    #[inline(never)]
    fn step(&mut self, counts: u16, channel: u16) -> (f32, bool) {
        let rigs = &mut self.rigs;
        let (result, ticks) = self.stopwatch.measure(|| rigs.step(counts, channel));
        self.report.steps = self.report.steps.wrapping_add(1);
        self.report.ticks = self.report.ticks.wrapping_add(u64::from(ticks));
        self.report.most = self.report.most.max(ticks);
        result
    }

    fn report(&mut self) -> Report {
        Report {
            stack: stack::deepest(),
            ..self.report
        }
    }
}
