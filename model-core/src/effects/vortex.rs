//! Common part of the starting and the stopping vortex: a state that one kind of edge increases, that decays, and
//! that is added to the jet.

use crate::real::Real;

/// ẇ = −w/τ + edges; the flow receives g·w.
///
/// `strength` is the mean of w over the sample, because the flow integrates its drive. A change within a sample or
/// at its start therefore gives the same vortex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shedding<T> {
    gain: T,
    /// Factor by which a vortex decays over a sample.
    kept: T,
    /// Mean, over a sample, of a vortex of strength 1 created at the start of the sample.
    mean: T,
}

/// The vortex and the jet that made it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vortex<T> {
    strength: T,
    jet: T,
}

impl<T: Real> Shedding<T> {
    /// A vortex with `gain` g that decays in τ = `decay`, s.
    pub(super) fn new(gain: T, decay: T, period: T) -> Self {
        let kept = (-period / decay).exp();
        Self {
            gain,
            kept,
            mean: (T::ONE - kept) * decay / period,
        }
    }

    /// The drive of the flow after a sample in which the jet changes to `jet`; `edge` selects the changes of the
    /// jet that create a vortex.
    #[inline(always)]
    pub(super) fn step(&self, vortex: &mut Vortex<T>, jet: T, edge: impl Fn(T) -> T) -> T {
        let fed = edge(jet - vortex.jet).at_least(T::ZERO);
        vortex.jet = jet;
        vortex.strength = vortex.strength * self.kept + fed * self.mean;
        self.gain * vortex.strength
    }
}

impl<T: Real> Vortex<T> {
    pub(super) fn none() -> Self {
        Self {
            strength: T::ZERO,
            jet: T::ZERO,
        }
    }
}

/// ∫w dt = τ for an edge of 1, whatever the sample period: the total contribution of the rising and the falling
/// edge of a pulse.
#[cfg(test)]
pub(super) fn areas(effect: &impl crate::Effect<f64>) -> [f64; 2] {
    let jet = |k| if (100..600).contains(&k) { 1.0 } else { 0.0 };
    let j = super::bench::jets(effect, jet);
    [100..600, 600..1000].map(|part| part.map(|k| j[k] - jet(k)).sum::<f64>() * 0.001)
}
