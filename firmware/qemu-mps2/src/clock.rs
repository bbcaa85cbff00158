//! SysTick, 25 MHz: under `-icount shift=5` a tick is 1.25 instructions.

use board::lockstep::Stopwatch;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;

const FULL: u32 = 0x00FF_FFFF;

/// A 24-bit down counter that reloads.
pub struct Ticks {
    /// Ticks of an empty measurement.
    overhead: u32,
    /// Count at which the last wait ended.
    due: u32,
}

impl Ticks {
    /// Starts counting.
    #[must_use]
    pub fn new(mut syst: SYST) -> Self {
        syst.set_clock_source(SystClkSource::Core);
        syst.set_reload(FULL);
        syst.clear_current();
        syst.enable_counter();
        let mut ticks = Self {
            overhead: 0,
            due: SYST::get_current(),
        };
        // The first measurement is discarded, because it runs new code.
        ticks.measure(|| ());
        ticks.overhead = ticks.measure(|| ()).1;
        ticks
    }

    /// Starts the first period now.
    pub fn begin(&mut self) {
        self.due = SYST::get_current();
    }

    /// Waits for the next multiple of `period` ticks since the last wait ended, and returns the number of periods:
    /// more than 1 if the call was late.
    pub fn wait(&mut self, period: u32) -> u32 {
        let mut periods = 0;
        loop {
            let due = self.due.wrapping_sub(period) & FULL;
            if periods > 0 && !is_past(due) {
                return periods;
            }
            while !is_past(due) {}
            self.due = due;
            periods += 1;
        }
    }
}

/// Whether the count has reached `due`; valid for half of its range.
#[inline]
fn is_past(due: u32) -> bool {
    SYST::get_current().wrapping_sub(due) & FULL >= FULL / 2
}

impl Stopwatch for Ticks {
    #[inline(always)]
    fn measure<R>(&mut self, work: impl FnOnce() -> R) -> (R, u32) {
        let before = SYST::get_current();
        let result = work();
        let after = SYST::get_current();
        let ticks = before.wrapping_sub(after) & FULL;
        (result, ticks.saturating_sub(self.overhead))
    }
}
