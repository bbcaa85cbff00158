//! Budgets of valve and compressor: switches and air per time.
//!
//! Both are integer counters that are refilled at a constant rate, so they have neither drift nor rounding errors.

use crate::control::hold::{Hold, HoldTimes};

/// A limit on the mean switching rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Switches {
    /// Samples that one switch costs: the sample rate over the allowed switches per second.
    pub samples_per_switch: u32,
    /// Switches that can be accumulated, at least 2 (one pulse).
    pub saved: u32,
}

/// A limit on the mean air consumption.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Air {
    /// Allowed long-run share of time with the valve open, in 1/1000; 1000 means no limit.
    pub per_mille: u32,
    /// Longest continuous blowing that a full store of air allows beyond the allowed share,
    /// samples.
    pub saved: u32,
}

/// Both budgets; `None` means no limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Budget {
    /// Budget of the valve.
    pub switches: Option<Switches>,
    /// Budget of the compressor.
    pub air: Option<Air>,
}

/// State of the budgets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Purse {
    /// Store of switches, in samples: a switch costs `samples_per_switch`.
    switches: u32,
    /// Store of air, in thousandths of a sample of blowing.
    air: u32,
}

impl Budget {
    /// Full stores of both.
    #[must_use]
    pub fn full(&self) -> Purse {
        Purse {
            switches: self.switches.map_or(0, |s| s.capacity()),
            air: self.air.map_or(0, |a| a.capacity()),
        }
    }

    /// The permitted valve position for a requested one.
    ///
    /// A pulse starts only if there is air for its shortest length and a switch to end it; blowing ends when
    /// the air is used up. Hold times are applied afterwards.
    #[must_use]
    pub fn allow(&self, purse: &Purse, hold: &Hold, times: &HoldTimes, wanted: bool) -> bool {
        if !hold.is_on() && wanted {
            let switches = self
                .switches
                .is_none_or(|s| purse.switches >= s.samples_per_switch.saturating_mul(2));
            let air = self.air.is_none_or(|a| {
                purse.air >= a.drain().saturating_mul(times.of(true)).min(a.capacity())
            });
            return switches && air;
        }
        if hold.is_on() && wanted {
            return self.air.is_none_or(|a| purse.air >= a.drain());
        }
        wanted
    }

    /// Records the valve's action at this sample.
    pub fn book(&self, purse: &mut Purse, was_on: bool, is_on: bool) {
        if let Some(s) = self.switches {
            let spent = if was_on == is_on {
                0
            } else {
                s.samples_per_switch
            };
            purse.switches = purse
                .switches
                .saturating_add(1)
                .min(s.capacity())
                .saturating_sub(spent);
        }
        if let Some(a) = self.air {
            purse.air = if is_on {
                purse.air.saturating_sub(a.drain())
            } else {
                purse.air.saturating_add(a.per_mille).min(a.capacity())
            };
        }
    }
}

impl Switches {
    fn capacity(&self) -> u32 {
        self.samples_per_switch.saturating_mul(self.saved.max(2))
    }
}

impl Air {
    /// Samples of continuous blowing that a full store of a designed budget gives.
    pub const SAVED: u32 = 1000;

    /// A limit of `per_mille` thousandths of the time, with a store of [`SAVED`](Self::SAVED)
    /// samples.
    #[must_use]
    pub const fn of(per_mille: u32) -> Self {
        Self {
            per_mille,
            saved: Self::SAVED,
        }
    }

    /// Net consumption of air per sample of blowing.
    fn drain(&self) -> u32 {
        1000_u32.saturating_sub(self.per_mille)
    }
    fn capacity(&self) -> u32 {
        self.drain().max(1).saturating_mul(self.saved.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMES: HoldTimes = HoldTimes { on: 5, off: 5 };

    /// Samples open, and switches, over 100 s of a requested command.
    fn run(budget: Budget, wish: impl Fn(u32) -> bool) -> (u32, u32) {
        let mut purse = budget.full();
        let mut hold = Hold::closed();
        let (mut open, mut switches) = (0, 0);
        for k in 0..100_000 {
            let was = hold.is_on();
            let wanted = budget.allow(&purse, &hold, &TIMES, wish(k));
            let on = hold.pass(&TIMES, wanted);
            budget.book(&mut purse, was, on);
            open += u32::from(on);
            switches += u32::from(on != was);
        }
        (open, switches)
    }

    #[test]
    fn the_air_is_the_allowed_share_and_what_was_saved() {
        let air = Some(Air {
            per_mille: 400,
            saved: 2000,
        });
        let (open, _) = run(
            Budget {
                air,
                switches: None,
            },
            |_| true,
        );
        assert!((40_000..=42_010).contains(&open), "{open}");
        let (open, _) = run(
            Budget {
                air,
                switches: None,
            },
            |k| k % 10 < 3,
        );
        assert!(open >= 30_000, "a wish below the budget is granted: {open}");
    }

    #[test]
    fn the_switches_are_the_allowed_rate_and_what_was_saved() {
        let switches = Some(Switches {
            samples_per_switch: 25,
            saved: 10,
        });
        let (_, count) = run(
            Budget {
                air: None,
                switches,
            },
            |k| k % 12 < 6,
        );
        assert!((3_900..=4_011).contains(&count), "{count}");
    }
}
