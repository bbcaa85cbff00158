//! SysTick, 25 MHz: under `-icount shift=5` a tick is 1.25 instructions.

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;

const FULL: u32 = 0x00FF_FFFF;

/// Counts down 24 bits, again and again.
pub struct Ticks {
    /// Ticks between two readings with nothing between them.
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
        // The second measurement runs from warm code.
        ticks.measure(|| ());
        ticks.overhead = ticks.measure(|| ()).1;
        ticks
    }

    /// What `work` gives, and the ticks it took (at most 0.67 s).
    #[inline(always)]
    pub fn measure<R>(&mut self, work: impl FnOnce() -> R) -> (R, u32) {
        let before = SYST::get_current();
        let result = work();
        let after = SYST::get_current();
        let ticks = before.wrapping_sub(after) & FULL;
        (result, ticks.saturating_sub(self.overhead))
    }

    /// Waits until `period` ticks have gone by since the last wait ended.
    pub fn wait(&mut self, period: u32) {
        let due = self.due.wrapping_sub(period) & FULL;
        // In the future while less than half the range behind the count.
        while SYST::get_current().wrapping_sub(due) & FULL < FULL / 2 {}
        self.due = due;
    }
}
