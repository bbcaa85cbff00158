//! Conditions that generated constants must satisfy, checked at compile time.

use crate::control::{HoldTimes, Tracking};
use crate::recursion::LagConvention;

/// Whether all coefficients are finite.
#[must_use]
pub const fn finite(coefficients: &[f32]) -> bool {
    let mut i = 0;
    while i < coefficients.len() {
        if !coefficients[i].is_finite() {
            return false;
        }
        i += 1;
    }
    true
}

/// Number of outputs to store for `lags`: one more than the longest lag needs.
#[must_use]
pub const fn outputs_for(lags: &[u16], convention: LagConvention) -> usize {
    let mut longest = 0;
    let mut i = 0;
    while i < lags.len() {
        let reach = convention.behind_newest(lags[i]);
        if reach > longest {
            longest = reach;
        }
        i += 1;
    }
    longest + 1
}

/// The shortest of `delays`, samples; 0 if there is none.
#[must_use]
pub const fn shortest(delays: &[u16]) -> usize {
    let mut shortest = u16::MAX;
    let mut i = 0;
    while i < delays.len() {
        if delays[i] < shortest {
            shortest = delays[i];
        }
        i += 1;
    }
    if i == 0 { 0 } else { shortest as usize }
}

/// The smallest of `values`; infinite if there is none.
#[must_use]
pub const fn smallest(values: &[f32]) -> f32 {
    let mut smallest = f32::INFINITY;
    let mut i = 0;
    while i < values.len() {
        if values[i] < smallest {
            smallest = values[i];
        }
        i += 1;
    }
    smallest
}

/// Whether the constants of a tracking law are within their ranges, and its reference is reachable.
#[must_use]
pub const fn law(law: &Tracking<f32>) -> bool {
    let shares = [law.observer, law.bias_rate, law.integral_rate];
    let limits = [law.correction_limit, law.residual_limit, law.slope];
    if !(law.settled > 0.0 && law.settled <= 1.0 && law.play >= 0.0 && law.play.is_finite()) {
        return false;
    }
    let mut i = 0;
    while i < shares.len() {
        if !(shares[i] >= 0.0 && shares[i] <= 1.0 && limits[i] >= 0.0 && limits[i].is_finite()) {
            return false;
        }
        i += 1;
    }
    law.lead > 0 && law.reference > law.reachable.low && law.reference < law.reachable.high
}

/// Number of samples that a tracking law predicts if its command arrives after `delay` samples.
#[must_use]
pub const fn look_ahead<T>(law: &Tracking<T>, delay: usize) -> usize {
    let HoldTimes { on, off } = law.anticipation;
    let halves = if on > off { on } else { off } as usize;
    let valve = if law.opening > law.closing {
        law.opening
    } else {
        law.closing
    } as usize;
    let needed = delay + valve + halves.div_ceil(2) + 2;
    let lead = law.lead as usize + 1;
    if needed > lead { needed } else { lead }
}

/// Whether the pulses of a period are in order and keep the hold times, also from the last pulse to the first of
/// the next period. Steady blowing is one pulse as long as the period.
#[must_use]
pub const fn train(period: u32, pulses: &[(u32, u32)], hold: HoldTimes) -> bool {
    if pulses.is_empty() {
        return false;
    }
    // Steady blowing.
    if pulses.len() == 1 && pulses[0].1 == period {
        return true;
    }
    let mut i = 0;
    while i < pulses.len() {
        let (first, length) = pulses[i];
        let next = if i + 1 < pulses.len() {
            pulses[i + 1].0
        } else {
            pulses[0].0.saturating_add(period)
        };
        let end = first.saturating_add(length);
        if first >= period || length < hold.on || next < end.saturating_add(hold.off) {
            return false;
        }
        i += 1;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Reachable;
    use crate::control::budget::Budget;

    #[test]
    fn laws_out_of_range_are_seen() {
        let good = Tracking {
            reference: 0.5,
            reachable: Reachable {
                low: 0.0,
                high: 1.0,
            },
            slope: 0.0,
            hold: HoldTimes { on: 7, off: 4 },
            anticipation: HoldTimes { on: 7, off: 4 },
            budget: Budget {
                switches: None,
                air: None,
            },
            lead: 40,
            opening: 3,
            closing: 5,
            observer: 0.1,
            bias_rate: 0.1,
            integral_rate: 0.0,
            settled: 1.0,
            play: 0.0,
            correction_limit: 0.3,
            residual_limit: 0.3,
        };
        assert!(law(&good));
        assert_eq!(look_ahead(&good, 50), 50 + 5 + 4 + 2);
        assert_eq!(look_ahead(&good, 0), 41);
        for bad in [
            Tracking {
                reference: 1.0,
                ..good
            },
            Tracking {
                reference: f32::NAN,
                ..good
            },
            Tracking {
                observer: 1.1,
                ..good
            },
            Tracking {
                integral_rate: f32::NAN,
                ..good
            },
            Tracking {
                slope: f32::INFINITY,
                ..good
            },
            Tracking {
                residual_limit: -0.1,
                ..good
            },
            Tracking { lead: 0, ..good },
        ] {
            assert!(!law(&bad), "{bad:?}");
        }
        assert_eq!((shortest(&[9, 3, 5]), shortest(&[])), (3, 0));
        assert_eq!(smallest(&[0.5, -1.0]), -1.0);
    }

    #[test]
    fn trains_that_a_valve_cannot_follow_are_seen() {
        let hold = HoldTimes { on: 10, off: 20 };
        assert!(train(100, &[(0, 10), (30, 50)], hold));
        assert!(train(100, &[(95, 50)], hold));
        assert!(train(1, &[(0, 1)], hold), "steady blowing");
        for bad in [
            &[][..],
            &[(0, 9)],
            &[(100, 10)],
            &[(0, 90)],
            &[(30, 20), (0, 10)],
            &[(0, 20), (30, 20)],
            &[(0, 10), (70, 20)],
        ] {
            assert!(!train(100, bad, hold), "{bad:?}");
        }
    }

    #[test]
    fn they_say_what_is_needed() {
        assert!(finite(&[0.0, -1.5]));
        assert!(!finite(&[0.0, f32::NAN]));
        assert!(!finite(&[f32::INFINITY]));
        assert_eq!(outputs_for(&[1, 500, 7], LagConvention::Literal), 501);
        assert_eq!(outputs_for(&[1, 500, 7], LagConvention::OneStep), 500);
    }
}
