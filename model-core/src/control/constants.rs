//! The constants of the tracking law, and what makes them unusable.

use crate::control::budget::Budget;
use crate::control::hold::HoldTimes;
use crate::control::reference::Reachable;
use core::fmt;

/// The constants of the law. All times in samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracking<T> {
    /// y*, the friction to hold, of the flow itself (before sensor effects).
    pub reference: T,
    /// What can be held.
    pub reachable: Reachable<T>,
    /// Fastest change of the reference, y per sample; 0 follows steps as steps.
    pub slope: T,
    /// Shortest on and off times.
    pub hold: HoldTimes,
    /// Limits on switching and air.
    pub budget: Budget,
    /// How far ahead predictions are judged, at least 1 and at most the shortest delay.
    pub lead: u16,
    /// From an opening command to half the jet strength (valve, edge delays).
    pub opening: u16,
    /// From a closing command to half the jet strength.
    pub closing: u16,
    /// Share of each residual that corrects the estimate, 0–1: 0 trusts the
    /// model alone, 1 the sensor alone.
    pub observer: T,
    /// Share of each prediction error that enters its average, 0–1 per sample.
    pub bias_rate: T,
    /// Integral action, 1 per sample.
    pub integral_rate: T,
    /// How far the averaged prediction error may be from what is believed of it, y: as far as noise alone carries it.
    /// 0 believes every average.
    pub play: T,
    /// What is left of the integral's rate in the long run, above 0 and at most 1. It begins whole and falls as the
    /// readings add up, as the gain of a Kalman filter does that knows a constant better and better, and begins
    /// anew when the prediction error leaves its play or the reference changes; 1 keeps it.
    pub settled: T,
    /// Neither bias nor integral corrects more than this, y.
    pub correction_limit: T,
    /// A residual counts as no more than this, y: one bad reading does no harm.
    pub residual_limit: T,
}

/// A constant of the law that makes no sense.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unusable {
    /// A share or rate is not within 0–1, or a limit is negative or not finite.
    Constant(&'static str),
    /// The look-ahead memory has fewer samples than the delay, valve and half a
    /// hold time together.
    LookAhead,
    /// Tracking needs the full model; an averaged model (eq. 15) does not see
    /// single switches.
    AveragedModel,
}

impl fmt::Display for Unusable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Constant(name) => write!(f, "`{name}` of the tracking law is out of range"),
            Self::LookAhead => f.write_str(
                "delay, valve and half a hold time together are more samples than the law can look ahead; \
                 take shorter hold times, or a model with a longer sample period",
            ),
            Self::AveragedModel => f.write_str(
                "the tracking law needs a full model; identify without averaging",
            ),
        }
    }
}

impl core::error::Error for Unusable {}
