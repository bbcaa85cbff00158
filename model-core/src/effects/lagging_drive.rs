//! The drive of the flow lags the jets; with a positive reversal it first responds in the opposite direction.
//!
//! This is not a missing effect but a property of separated flows: an effective incidence lags, and jets cut the
//! old vortex off before they attach the flow. It belongs to the base model, so that vortices and echoes do not
//! imitate it.

use crate::effect::{
    Amplitude, Effect, Instant, Parameter, Physics, Place, Setting, Spec, Unit, take,
};
use crate::real::Real;

/// τ·ẇ = j − w; the flow receives (1 + g)·w − g·j. The reversal g puts a zero in the right half plane at 1/(g·τ);
/// without it the drive is a plain lag. Exact for a jet that is constant over the sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaggingDrive<T> {
    reversal: T,
    /// Decay factor of w per sample.
    kept: T,
    /// Mean of the decay over the sample.
    mean: T,
}

impl<T: Real> Effect<T> for LaggingDrive<T> {
    /// w.
    type State = T;
    fn start(&self) -> T {
        T::ZERO
    }
    #[inline(always)]
    fn jet(&self, lagging: &mut T, jet: T, _at: &Instant<'_, T>) -> T {
        // An integrating flow receives the mean of the drive over the sample.
        let left = (jet - *lagging) * self.mean;
        *lagging = jet + (*lagging - jet) * self.kept;
        jet - (T::ONE + self.reversal) * left
    }
}

impl<T: Real> Physics<T> for LaggingDrive<T> {
    const SPEC: Spec = Spec {
        name: "lagging-drive",
        rust: "lagging_drive::LaggingDrive",
        place: Place::Jet,
        summary: "the flow follows the jets with a lag, and may first respond in the opposite direction",
        equation: "τ·ẇ = j − w; the flow receives (1 + g)·w − g·j",
        parameters: &[
            Parameter::new("reversal", Unit::None, [0.0, 5.0], &[0.5]),
            Parameter::new("lag", Unit::Second, [0.002, 0.3], &[0.008, 0.025, 0.08]),
        ],
        amplitude: Some(Amplitude::new("reversal", "an inverse response")),
        base: true,
        source: "inverse response of the lift: Kerstens et al., AIAA J. 49 (2011); lagging incidence: Goman \
             and Khrabrov, J. Aircraft 31 (1994)",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [reversal, time] = take(parameters);
        let kept = (-setting.period / time).exp();
        Self {
            reversal,
            kept,
            mean: (T::ONE - kept) * time / setting.period,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::bench::{jets, prepared};

    #[test]
    fn it_falls_by_the_reversal_first_and_ends_at_full_strength() {
        let wrong: LaggingDrive<f64> = prepared(&[0.5, 0.030]);
        let j = jets(&wrong, |k| if k < 500 { 1.0 } else { 0.0 });
        assert!((j[0] + 0.5).abs() < 0.03, "{}", j[0]);
        assert!((j[499] - 1.0).abs() < 1e-6);
        // At the falling edge the inverse response has the opposite sign.
        assert!((j[500] - 1.5).abs() < 0.03, "{}", j[500]);
        assert!(j[999].abs() < 1e-6);
        // The exact area is ∫(j − 1) dt = −(1 + g)·τ.
        let area: f64 = j[..500].iter().map(|j| (j - 1.0) * 0.001).sum();
        assert!((area + 1.5 * 0.030).abs() < 1e-5, "{area}");
    }

    #[test]
    fn it_is_no_entry_of_the_catalogue_of_missing_effects() {
        let name = LaggingDrive::<f64>::SPEC.name;
        assert!(crate::effects::SPECS.iter().all(|spec| spec.name != name));
        assert_eq!(crate::effects::spec(name).map(|spec| spec.name), Some(name));
    }
}
