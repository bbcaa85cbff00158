//! Axes: safe ranges, round ticks, readable labels.

use super::format::{fixed, power_of_ten};

/// Larger magnitudes are left out of a range: no measurement reaches them, and their differences overflow.
const LARGEST: f64 = 1e150;

/// A range of values and how it maps to [0, 1]. Always `lo < hi`, both finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    lo: f64,
    hi: f64,
    /// Values are logarithms to base 10; tick labels show the original values.
    decades: bool,
    /// Values are angles in degrees: ticks divide a turn.
    degrees: bool,
}

/// A tick of an axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    pub(super) value: f64,
    pub(super) label: String,
}

/// Smallest and largest finite value, if any.
pub(super) fn extent(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values
        .into_iter()
        .filter(|v| v.abs() <= LARGEST)
        .fold(None, |range, v| match range {
            None => Some((v, v)),
            Some((lo, hi)) => Some((f64::min(lo, v), f64::max(hi, v))),
        })
}

impl Axis {
    /// Linear axis over exactly `range`. It is widened if it is too narrow to draw, and [0, 1] without a range.
    pub(super) fn linear(range: Option<(f64, f64)>) -> Self {
        let (lo, hi) = match range {
            Some((a, b)) if a.abs() <= LARGEST && b.abs() <= LARGEST => (a.min(b), a.max(b)),
            _ => (0.0, 1.0),
        };
        let magnitude = lo.abs().max(hi.abs());
        let narrowest = (magnitude * 1e-9).max(1.0 / LARGEST);
        let (lo, hi) = if hi - lo >= narrowest {
            (lo, hi)
        } else {
            let half = if magnitude > 1.0 / LARGEST {
                magnitude * 0.1
            } else {
                0.5
            };
            (lo - half, hi + half)
        };
        Self {
            lo,
            hi,
            decades: false,
            degrees: false,
        }
    }

    /// Axis of an angle in degrees over `range`.
    pub(super) fn degrees(range: (f64, f64)) -> Self {
        Self {
            degrees: true,
            ..Self::linear(Some(range))
        }
    }

    /// Logarithmic axis over `range`, whose ends are logarithms to base 10.
    pub(super) fn decades(range: Option<(f64, f64)>) -> Self {
        Self {
            decades: true,
            ..Self::linear(range)
        }
    }

    /// Linear axis with a margin of `share` of the range at both ends.
    pub(super) fn padded(range: Option<(f64, f64)>, share: f64) -> Self {
        let Self { lo, hi, .. } = Self::linear(range);
        let margin = (hi - lo) * share;
        Self::linear(Some((lo - margin, hi + margin)))
    }

    /// Lower and upper end.
    pub(super) fn ends(&self) -> (f64, f64) {
        (self.lo, self.hi)
    }

    /// Position of `value` on the axis, 0 at the lower end and 1 at the upper, clamped; `None` for NaN.
    pub(super) fn place(&self, value: f64) -> Option<f64> {
        if value.is_nan() {
            return None;
        }
        let value = value.clamp(self.lo, self.hi);
        let place = (value - self.lo) / (self.hi - self.lo);
        Some(place.clamp(0.0, 1.0))
    }

    /// About `count` ticks at round values.
    pub(super) fn ticks(&self, count: usize) -> Vec<Tick> {
        if self.decades {
            return self.decade_ticks(count);
        }
        let rough = (self.hi - self.lo) / count.clamp(1, 50) as f64;
        let decade = 10f64.powi(rough.log10().floor() as i32);
        let round = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade);
        let divides_a_turn = [15.0, 30.0, 45.0, 90.0, 180.0, 360.0];
        let angle = self.degrees && (15.0..=360.0).contains(&rough);
        let steps: &[f64] = if angle { &divides_a_turn } else { &round };
        let wide = steps.iter().find(|step| **step >= rough * 0.75);
        let step = wide.copied().unwrap_or(10.0 * decade);
        let first = (self.lo / step - 1e-6).ceil();
        let last = (self.hi / step + 1e-6).floor();
        let values: Vec<f64> = (0..=60)
            .map(|i| first + f64::from(i))
            .take_while(|multiple| *multiple <= last)
            .map(|multiple| multiple * step)
            .collect();
        let largest = values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let exponent = step.log10().floor() as i32;
        // A step of 0.05 has the exponent −2 and needs two decimals. No step needs more decimals
        // than its exponent says.
        let decimals = (-exponent).clamp(0, 12) as usize;
        let plain = largest < 1e6 && (exponent >= -4 || largest >= 0.1);
        values
            .into_iter()
            .map(|value| Tick {
                value,
                label: if value == 0.0 {
                    "0".to_owned()
                } else if plain {
                    fixed(value, decimals, false)
                } else {
                    let span = (value.abs().log10() - f64::from(exponent)).ceil();
                    power_of_ten(value, span.clamp(0.0, 12.0) as usize)
                },
            })
            .collect()
    }

    /// Ticks at 1, 2 and 5 times powers of ten, or only at powers if those suffice.
    fn decade_ticks(&self, count: usize) -> Vec<Tick> {
        let (first, last) = (self.lo.floor() as i32, self.hi.ceil() as i32);
        let at = |multiples: &[f64]| -> Vec<Tick> {
            let powers = (first..=last).take(60);
            powers
                .flat_map(|power| multiples.iter().map(move |m| (power, *m)))
                .map(|(power, m)| (m.log10() + f64::from(power), m * 10f64.powi(power)))
                .filter(|(place, _)| (self.lo..=self.hi).contains(place))
                .map(|(value, number)| Tick {
                    value,
                    label: super::format::significant(number, 2),
                })
                .collect()
        };
        let fine = at(&[1.0, 2.0, 5.0]);
        if fine.len() <= count.max(2) {
            fine
        } else {
            at(&[1.0])
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn labels(axis: Axis, count: usize) -> Vec<String> {
        axis.ticks(count).into_iter().map(|t| t.label).collect()
    }

    #[test]
    fn ticks_are_round_and_evenly_written() {
        assert_eq!(
            labels(Axis::linear(Some((-0.07, 1.12))), 6),
            ["0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(
            labels(Axis::linear(Some((-0.06, 0.06))), 4),
            ["−0.05", "0", "0.05"]
        );
        assert_eq!(
            labels(Axis::linear(Some((0.0, 4e-5))), 4),
            ["0", "10⁻⁵", "2×10⁻⁵", "3×10⁻⁵", "4×10⁻⁵"]
        );
    }

    #[test]
    fn a_logarithmic_axis_is_labelled_in_its_unit() {
        assert_eq!(
            labels(Axis::decades(Some((0.0, 1.0))), 6),
            ["1", "2", "5", "10"]
        );
        assert_eq!(
            labels(Axis::decades(Some((-1.2, 2.5))), 5),
            ["0.1", "1", "10", "100"]
        );
    }

    #[test]
    fn angles_are_labelled_at_parts_of_a_turn() {
        assert_eq!(
            labels(Axis::degrees((-400.0, 10.0)), 5),
            ["−360", "−270", "−180", "−90", "0"]
        );
    }

    #[test]
    fn constants_and_nothing_still_make_an_axis() {
        assert_eq!(Axis::linear(None).ends(), (0.0, 1.0));
        assert_eq!(Axis::linear(Some((0.0, 0.0))).ends(), (-0.5, 0.5));
        let (lo, hi) = Axis::linear(Some((7.0, 7.0))).ends();
        assert!(lo < 7.0 && hi > 7.0);
        assert_eq!(extent([f64::NAN, f64::INFINITY, 1e300]), None);
        assert_eq!(extent([3.0, f64::NAN, -1.0]), Some((-1.0, 3.0)));
    }

    proptest! {
        #[test]
        fn any_range_gives_few_ordered_ticks_inside(a: f64, b: f64, count in 0usize..20) {
            let axis = Axis::linear(Some((a, b)));
            let (lo, hi) = axis.ends();
            prop_assert!(lo < hi && lo.is_finite() && hi.is_finite());
            let ticks = axis.ticks(count);
            prop_assert!(ticks.len() <= 61);
            let slack = (hi - lo) * 0.01;
            for pair in ticks.windows(2) {
                prop_assert!(pair[0].value < pair[1].value);
            }
            for tick in &ticks {
                prop_assert!(tick.value >= lo - slack && tick.value <= hi + slack);
            }
            let place = axis.place(a);
            prop_assert!(a.is_nan() || place.is_some_and(|p| (0.0..=1.0).contains(&p)));
        }
    }
}
