//! Minimum on and off times, applied last before the valve.

/// The shortest times a valve may stay open and closed.
///
/// ```
/// use model_core::control::{Hold, HoldTimes};
/// let times = HoldTimes { on: 3, off: 2 }; // samples: 3 ms and 2 ms at 1 kHz
/// let mut hold = Hold::closed();
/// let wanted = [true, false, false, false, true, true];
/// let valve = wanted.map(|wanted| hold.pass(&times, wanted));
/// assert_eq!(valve, [true, true, true, false, false, true]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HoldTimes {
    /// Shortest on time, samples; 0 counts as 1.
    pub on: u32,
    /// Shortest off time, samples; 0 counts as 1.
    pub off: u32,
}

impl HoldTimes {
    /// The hold time of the present position, samples, at least 1.
    #[inline]
    #[must_use]
    pub fn of(&self, on: bool) -> u32 {
        if on { self.on.max(1) } else { self.off.max(1) }
    }
}

/// Valve position, and time since the valve moved there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hold {
    on: bool,
    /// Samples in this position, saturating.
    since: u32,
}

impl Hold {
    /// A valve that has been closed for a long time and may open at once.
    #[must_use]
    pub const fn closed() -> Self {
        Self {
            on: false,
            since: u32::MAX,
        }
    }

    /// Whether the valve is open.
    #[inline]
    #[must_use]
    pub const fn is_on(&self) -> bool {
        self.on
    }

    /// Time in the present position, samples; saturates at `u32::MAX`.
    #[inline]
    #[must_use]
    pub const fn since(&self) -> u32 {
        self.since
    }

    /// Whether the valve may change position at this sample.
    #[inline]
    #[must_use]
    pub fn may_switch(&self, times: &HoldTimes) -> bool {
        self.since >= times.of(self.on)
    }

    /// Closes the valve regardless of hold times.
    #[inline]
    pub fn shut(&mut self) {
        self.since = if self.on {
            1
        } else {
            self.since.saturating_add(1)
        };
        self.on = false;
    }

    /// The valve position for a requested one.
    #[inline]
    pub fn pass(&mut self, times: &HoldTimes, wanted: bool) -> bool {
        if wanted != self.on && self.may_switch(times) {
            self.on = wanted;
            self.since = 1;
        } else {
            self.since = self.since.saturating_add(1);
        }
        self.on
    }
}
