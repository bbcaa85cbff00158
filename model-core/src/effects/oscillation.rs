//! The free oscillation q̈ + 2ζω·q̇ + ω²·q = 0 over a sample.

use crate::real::Real;

/// Transition of (q, q̇/ω) over a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transition<T> {
    /// What q contributes to the new q and the new rate.
    pub(super) from_q: [T; 2],
    /// What the rate contributes to them.
    pub(super) from_rate: [T; 2],
}

/// ω (rad/s), ζ limited to below 1, and the exact transition of an oscillation of this frequency (Hz) and damping ratio.
pub(super) fn transition<T: Real>(frequency: T, damping: T, period: T) -> (T, T, Transition<T>) {
    let omega = frequency * T::from_f64(core::f64::consts::TAU);
    let damping = damping.at_most(T::from_f64(0.999));
    let damped = (T::ONE - damping * damping).sqrt();
    let angle = omega * damped * period;
    let decay = (-damping * omega * period).exp();
    let (sin, cos) = (angle.sin() * decay / damped, angle.cos() * decay);
    let over_a_sample = Transition {
        from_q: [cos + damping * sin, -sin],
        from_rate: [sin, cos - damping * sin],
    };
    (omega, damping, over_a_sample)
}
