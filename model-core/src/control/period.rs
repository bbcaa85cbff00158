//! Loop periods and times in samples.
//!
//! Times are stated in seconds (shortest times of a valve, timeouts) and converted to samples here, for host and
//! board alike.

/// Shortest supported loop period of laws and boards, µs.
pub const SHORTEST_US: u32 = 200;
/// Longest supported loop period of laws and boards, µs.
pub const LONGEST_US: u32 = 100_000;

/// The nearest period in whole microseconds, which is the unit of the boards' timers. `None` outside of
/// [`SHORTEST_US`] to [`LONGEST_US`].
///
/// ```
/// use model_core::control::period::loop_period_us;
/// assert_eq!(loop_period_us(0.001), Some(1000));
/// assert_eq!(loop_period_us(0.1), Some(100_000));
/// assert_eq!(loop_period_us(1e-4), None);
/// assert_eq!(loop_period_us(f64::NAN), None);
/// ```
#[must_use]
pub const fn loop_period_us(period_s: f64) -> Option<u32> {
    // The conversion saturates; NaN becomes 0.
    let us = (period_s * 1e6 + 0.5) as u32;
    if us >= SHORTEST_US && us <= LONGEST_US {
        Some(us)
    } else {
        None
    }
}

/// The fewest samples that last at least `time_s`: rounded up, and at least 1. An excess of up to a thousandth of a
/// sample counts as rounding of a printed time, or of an `f32`.
///
/// ```
/// use model_core::control::period::samples_at_least;
/// assert_eq!(samples_at_least(0.010, 0.001), 10);
/// assert_eq!(samples_at_least(0.0101, 0.001), 11);
/// assert_eq!(samples_at_least(0.010, 0.1), 1);
/// assert_eq!(samples_at_least(0.004_f32.into(), 0.001_f32.into()), 4);
/// ```
#[must_use]
pub const fn samples_at_least(time_s: f64, period_s: f64) -> u32 {
    let samples = time_s / period_s - 1e-3;
    // The conversion saturates; NaN becomes 0.
    let whole = samples as u32;
    let up = if (whole as f64) < samples {
        whole.saturating_add(1)
    } else {
        whole
    };
    if up == 0 { 1 } else { up }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_kept_whatever_the_period() {
        for period in [2e-4, 1e-3, 1.0 / 1024.0, 0.01, 0.1] {
            for time in [1e-5, 4e-3, 0.0123, 0.5, 7.0] {
                let samples = samples_at_least(time, period);
                let kept = f64::from(samples) * period;
                assert!(
                    kept >= time - 1.1e-3 * period,
                    "{time} at {period}: {samples}"
                );
                assert!(
                    samples == 1 || kept < time + period,
                    "{time} at {period}: {samples}"
                );
            }
        }
        assert_eq!(samples_at_least(f64::INFINITY, 0.001), u32::MAX);
        assert_eq!(samples_at_least(f64::NAN, 0.001), 1);
        assert_eq!(samples_at_least(-1.0, 0.001), 1);
    }

    #[test]
    fn the_ends_belong_to_the_range() {
        assert_eq!(loop_period_us(2e-4), Some(SHORTEST_US));
        assert_eq!(loop_period_us(0.1_f32.into()), Some(LONGEST_US));
        assert_eq!(loop_period_us(1.9e-4), None);
        assert_eq!(loop_period_us(0.11), None);
        assert_eq!(loop_period_us(1e12), None);
        assert_eq!(loop_period_us(-0.001), None);
    }
}
