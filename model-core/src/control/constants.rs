//! Parameters of the tracking law, and their validation.

use crate::control::budget::Budget;
use crate::control::hold::HoldTimes;
use crate::control::reference::Reachable;
use core::fmt;

/// Parameters of the law. All times in samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracking<T> {
    /// y*, the friction to hold, of the flow itself (before sensor effects).
    pub reference: T,
    /// Reachable references.
    pub reachable: Reachable<T>,
    /// Fastest change of the reference, y per sample; 0 follows steps without a ramp.
    pub slope: T,
    /// Shortest on and off times.
    pub hold: HoldTimes,
    /// How far the law looks beyond the arrival of an opening and of a closing, in half samples. At half of the shortest
    /// time the ripple is centred on the reference if the flow moves at constant rates; a flow that settles within the
    /// shortest time reaches its centre earlier.
    pub anticipation: HoldTimes,
    /// Limits on switching and air.
    pub budget: Budget,
    /// Prediction horizon of the bias estimate, at least 1 and at most the shortest delay.
    pub lead: u16,
    /// Samples from an opening command to half the jet strength (valve, edge delays).
    pub opening: u16,
    /// Samples from a closing command to half the jet strength.
    pub closing: u16,
    /// Share of each residual that corrects the estimate, 0–1: 0 trusts the
    /// model alone, 1 the sensor alone.
    pub observer: T,
    /// Share of each prediction error that enters its average, 0–1 per sample.
    pub bias_rate: T,
    /// Integral action, 1 per sample.
    pub integral_rate: T,
    /// Dead band of the bias, y: deviations of the averaged prediction error that noise alone explains. 0 for
    /// none.
    pub play: T,
    /// Final rate of the integral relative to its first rate, above 0 and at most 1. The rate decreases as readings
    /// accumulate, as a Kalman gain for a constant does, and is reset when the prediction error leaves its dead band or
    /// the reference changes. With 1 the rate is constant.
    pub settled: T,
    /// Limit of bias and integral, y.
    pub correction_limit: T,
    /// Limit of a residual, y, which bounds the influence of a single outlier.
    pub residual_limit: T,
}

/// An invalid parameter of the law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unusable {
    /// A share or rate is not within 0–1, or a limit is negative or not finite.
    Constant(&'static str),
    /// The memory for predictions has fewer samples than the sum of dead time, valve delay and anticipation.
    LookAhead,
    /// Tracking needs the full model; an averaged model (eq. 15) does not resolve single switches.
    AveragedModel,
}

impl fmt::Display for Unusable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Constant(name) => write!(f, "`{name}` of the tracking law is out of range"),
            Self::LookAhead => f.write_str(
                "the law predicts over the sum of dead time, valve delay and anticipation, which is more samples \
                    than it can store; use shorter hold times, or a model with a longer sample period",
            ),
            Self::AveragedModel => f.write_str(
                "the tracking law needs a full model; identify without averaging",
            ),
        }
    }
}

impl core::error::Error for Unusable {}
