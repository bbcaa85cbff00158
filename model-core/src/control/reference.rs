//! References: reachable interval and ramp.

use crate::real::Real;
use crate::recursion::Bilinear;
use core::fmt;

/// The friction that on/off blowing can hold: above the level without jets and below that of steady blowing. In y,
/// of the flow itself (before sensor effects).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reachable<T> {
    /// Friction without jets; 0 in the paper.
    pub low: T,
    /// Friction under steady blowing, y_ss(u = 1).
    pub high: T,
}

/// A reference outside the reachable interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unreachable {
    /// The requested reference.
    pub reference: f64,
    /// The reachable interval.
    pub reachable: Reachable<f64>,
}

impl fmt::Display for Unreachable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the reference {} cannot be held: the levels that on/off blowing can hold lie between {:.4} and \
                 {:.4}; choose a reference inside",
            self.reference, self.reachable.low, self.reachable.high
        )
    }
}

impl core::error::Error for Unreachable {}

impl<T: Real> Reachable<T> {
    /// From the coefficients, theory 2.2: y_ss(u = 1) = (d + Σb)/(1 − Σa − Σc) and d/(1 − Σa) without jets.
    /// `None` where no steady state exists (an integrating or unstable model).
    ///
    /// Valid for models without jet and flow effects; otherwise simulate the model.
    #[must_use]
    pub fn of(recursion: &Bilinear<'_, T>) -> Option<Self> {
        let without = recursion.relaxation(|_| T::ZERO);
        let with = recursion.relaxation(|_| T::ONE);
        if !(with > T::ZERO && without >= T::ZERO) {
            return None;
        }
        let low = if recursion.constant == T::ZERO {
            T::ZERO
        } else if without > T::ZERO {
            recursion.constant / without
        } else {
            return None;
        };
        let mut drive = recursion.constant;
        for b in recursion.b {
            drive = drive + *b;
        }
        let high = drive / with;
        (high > low).then_some(Self { low, high })
    }

    /// Refuses a reference outside the open interval: the condition
    /// 0 < u_eq < 1 for the existence of a sliding motion.
    ///
    /// # Errors
    /// [`Unreachable`] with the interval.
    pub fn check(&self, reference: T) -> Result<(), Unreachable> {
        if reference > self.low && reference < self.high {
            Ok(())
        } else {
            Err(Unreachable {
                reference: reference.value(),
                reachable: Reachable {
                    low: self.low.value(),
                    high: self.high.value(),
                },
            })
        }
    }
}

/// Moves a reference towards its goal by at most `slope` per sample; a slope of
/// 0 is a step.
#[inline]
#[must_use]
pub fn ramp<T: Real>(now: T, goal: T, slope: T) -> T {
    if slope > T::ZERO {
        goal.at_most(now + slope).at_least(now - slope)
    } else {
        goal
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Parts;
    use crate::paper::table_two;
    use crate::recursion::LagConvention;

    #[test]
    fn the_papers_model_reaches_1_067() {
        let model = table_two::<f64>(LagConvention::OneStep);
        let reachable = Reachable::of(&model.recursion()).unwrap();
        assert_eq!(reachable.low, 0.0);
        assert!((reachable.high - 0.0080 / 0.0075).abs() < 1e-9);
        assert!(reachable.check(1.05).is_ok());
        for outside in [0.0, -0.1, 1.07, f64::NAN] {
            let refused = reachable.check(outside).unwrap_err();
            assert!((refused.reachable.high - 1.0667).abs() < 1e-4);
        }
    }

    #[test]
    fn a_ramp_arrives_and_stays() {
        let mut reference = 0.0_f32;
        for k in 1..=30 {
            reference = ramp(reference, 0.5, 0.02);
            let expected = (0.02 * k as f32).min(0.5);
            assert!((reference - expected).abs() < 1e-5);
        }
        assert_eq!(ramp(reference, 0.2, 0.0), 0.2);
    }
}
