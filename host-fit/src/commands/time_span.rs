//! A time on the command line, in samples or seconds.

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// A time option: `300` is 300 samples, `0.3s` (also `300ms`, `5min`) is in units of time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum TimeSpan {
    /// A number of sampling periods.
    Samples(u32),
    /// Seconds, finite and at least 0.
    Seconds(f64),
}

/// Units and their seconds. Longer names first: `ms` ends with `s`.
const UNITS: [(&str, f64); 6] = [
    ("min", 60.0),
    ("ms", 1e-3),
    ("us", 1e-6),
    ("µs", 1e-6),
    ("h", 3600.0),
    ("s", 1.0),
];

impl TimeSpan {
    /// Samples of `period_s` seconds, rounded; at most `u32::MAX`.
    ///
    /// `TimeSpan::Seconds(0.3)` at 1 kHz is 300 samples, at 10 Hz it is 3.
    pub(crate) fn samples(self, period_s: f64) -> u32 {
        match self {
            Self::Samples(samples) => samples,
            Self::Seconds(seconds) => {
                let samples = (seconds / period_s).round();
                if samples.is_nan() {
                    0
                } else {
                    // Saturates.
                    samples as u32
                }
            }
        }
    }

    /// [`samples`](Self::samples), rejected outside `range`; the message names `option`, both bounds and the
    /// period.
    pub(crate) fn samples_within(
        self,
        period_s: f64,
        option: &str,
        range: RangeInclusive<u32>,
    ) -> anyhow::Result<u32> {
        let samples = self.samples(period_s);
        if range.contains(&samples) {
            return Ok(samples);
        }
        let (least, most) = (*range.start(), *range.end());
        anyhow::bail!(
            "{option} {self} corresponds to {samples} samples of {period_s} s; give {least} to {most} samples \
                 ({:.6}s to {:.6}s)",
            f64::from(least) * period_s,
            f64::from(most) * period_s
        )
    }
}

impl fmt::Display for TimeSpan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Samples(samples) => write!(f, "{samples}"),
            Self::Seconds(seconds) => write!(f, "{seconds}s"),
        }
    }
}

/// A text that is not a time.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "`{0}` is not a time: give samples as a whole number (300), or a time with its unit (0.3s, 300ms, 5min)"
)]
pub(crate) struct NotATime(String);

impl FromStr for TimeSpan {
    type Err = NotATime;

    fn from_str(text: &str) -> Result<Self, NotATime> {
        let bad = || NotATime(text.to_owned());
        let trimmed = text.trim();
        if let Ok(samples) = trimmed.parse::<u32>() {
            return Ok(Self::Samples(samples));
        }
        let (number, scale) = UNITS
            .iter()
            .find_map(|(unit, scale)| Some((trimmed.strip_suffix(unit)?.trim_end(), scale)))
            .ok_or_else(bad)?;
        let seconds = number.parse::<f64>().map_err(|_| bad())? * scale;
        if seconds.is_finite() && seconds >= 0.0 {
            Ok(Self::Seconds(seconds))
        } else {
            Err(bad())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_and_times_are_told_by_the_unit() {
        for (text, expected) in [
            ("300", TimeSpan::Samples(300)),
            ("0.3s", TimeSpan::Seconds(0.3)),
            ("2 s", TimeSpan::Seconds(2.0)),
            ("5min", TimeSpan::Seconds(300.0)),
            ("1e-2s", TimeSpan::Seconds(0.01)),
        ] {
            assert_eq!(text.parse(), Ok(expected), "{text}");
        }
        assert_eq!("300ms".parse::<TimeSpan>().unwrap().samples(0.001), 300);
        for text in ["", "s", "0.3", "-1", "-1s", "nan s", "infs", "3 weeks"] {
            let error = text.parse::<TimeSpan>().unwrap_err().to_string();
            assert!(error.contains("0.3s"), "{error}");
        }
    }

    #[test]
    fn the_same_time_at_every_period() {
        let time = TimeSpan::Seconds(0.3);
        assert_eq!(
            [0.0001, 0.001, 0.1].map(|p| time.samples(p)),
            [3000, 300, 3]
        );
        assert_eq!(TimeSpan::Samples(30).samples(8.0), 30);
        assert_eq!(TimeSpan::Seconds(1e300).samples(0.001), u32::MAX);
    }

    #[test]
    fn a_time_out_of_range_says_what_to_give() {
        let error = TimeSpan::Seconds(0.3)
            .samples_within(8.0, "--reach", 4..=10_000)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("--reach 0.3s corresponds to 0 samples of 8 s")
                && error.contains("32.000000s"),
            "{error}"
        );
        let fits = TimeSpan::Seconds(40.0).samples_within(8.0, "--reach", 4..=10_000);
        assert_eq!(fits.unwrap(), 5);
    }
}
