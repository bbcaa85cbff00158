//! Corrections of a tracking law for model errors. The low-pass-filtered error of predictions made one delay
//! earlier is added to the present predictions (Smith predictor), and a slow integral removes the remaining
//! offset. Both respond to noise as little as possible: the bias has a dead band, and the integral slows down
//! while the bias is constant.

use crate::control::constants::Tracking;
use crate::history::{DelayLine, Memory, Past};
use crate::real::Real;

/// Bias and integral of a law that predicts fewer than `A` samples ahead.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Correction<T, const A: usize> {
    /// Bias in use.
    pub(crate) bias: T,
    /// Filtered error of past predictions.
    missed: T,
    pub(crate) integral: T,
    /// Consecutive samples without a reading, saturating.
    pub(crate) lost: u32,
    /// Predictions `lead` samples ahead; the newest is the last one made.
    predictions: DelayLine<T, A>,
    /// Samples since the start, saturating.
    age: u32,
    /// Rate of the integral relative to its first rate.
    share: T,
    /// Reference for which the integral was determined.
    reference: T,
}

impl<T: Real, const A: usize> Correction<T, A> {
    /// No corrections yet.
    pub(crate) fn none() -> Self {
        Self {
            bias: T::ZERO,
            missed: T::ZERO,
            integral: T::ZERO,
            lost: 0,
            predictions: DelayLine::new(),
            age: 0,
            share: T::ONE,
            reference: T::ZERO,
        }
    }

    /// Updates the corrections with the residual of the `estimate` and the prediction `lead` samples ahead.
    /// The valve has been at `on` for `since` samples.
    pub(crate) fn update(
        &mut self,
        law: &Tracking<T>,
        reference: T,
        estimate: T,
        residual: Option<T>,
        at_lead: T,
        (on, since): (bool, u32),
    ) {
        self.predictions.push(at_lead);
        self.age = self.age.saturating_add(1);
        let Some(residual) = residual else {
            self.lost = self.lost.saturating_add(1);
            return;
        };
        self.lost = 0;
        // The first prediction can be compared `lead` samples after the start.
        if self.age <= u32::from(law.lead) {
            return;
        }
        let flow = estimate + residual;
        let missed = flow - self.predictions.back(usize::from(law.lead));
        if reference != self.reference {
            // The model error differs at another level of y, so the integral starts again with its
            // full rate.
            self.reference = reference;
            self.share = T::ONE;
        }
        let integral_rate = self.share * law.integral_rate;
        let missed = self.missed + law.bias_rate * (missed - self.missed);
        self.missed = limited(missed, law.correction_limit);
        let bias = self
            .bias
            .at_least(self.missed - law.play)
            .at_most(self.missed + law.play);
        if bias != self.bias {
            // The model error has changed, so the integral rate is reset too.
            self.bias = bias;
            self.share = T::ONE;
        }
        // Anti-windup: the integral stops while the valve already is in the position towards which the integral
        // drives it.
        let error = reference - flow;
        let pushes_on = error > T::ZERO;
        let still = since >= 4 * u32::from(law.lead);
        if !(still && pushes_on == on) {
            let integral = self.integral + integral_rate * error;
            self.integral = limited(integral, law.correction_limit);
            // The gain g of a drifting offset follows a Riccati equation: dg/dt = (settled gain)² −
            // g².
            let falls = self.share * self.share - law.settled * law.settled;
            self.share = self.share - law.integral_rate * falls;
        }
    }
}

/// `value` within ±`limit`.
#[inline]
pub(crate) fn limited<T: Real>(value: T, limit: T) -> T {
    value.at_most(limit).at_least(-limit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::budget::Budget;
    use crate::control::{HoldTimes, Reachable};

    const LAW: Tracking<f64> = Tracking {
        reference: 0.5,
        reachable: Reachable {
            low: 0.0,
            high: 1.0,
        },
        slope: 0.0,
        hold: HoldTimes { on: 1, off: 1 },
        anticipation: HoldTimes { on: 1, off: 1 },
        budget: Budget {
            switches: None,
            air: None,
        },
        lead: 3,
        opening: 0,
        closing: 0,
        observer: 0.0,
        bias_rate: 0.5,
        integral_rate: 0.01,
        settled: 1.0,
        play: 0.0,
        correction_limit: 0.3,
        residual_limit: 1.0,
    };

    /// Predictions that are 0.1 too low: the flow is at 0.6 with the reference 0.5.
    fn after(samples: u32, since: u32, on: bool) -> Correction<f64, 8> {
        let mut correction = Correction::none();
        for _ in 0..samples {
            correction.update(&LAW, LAW.reference, 0.55, Some(0.05), 0.5, (on, since));
        }
        correction
    }

    #[test]
    fn the_bias_becomes_the_error_of_predictions_once_they_come_due() {
        assert_eq!(after(LAW.lead.into(), 0, true).bias, 0.0);
        assert!((after(4, 0, true).bias - 0.05).abs() < 1e-12);
        assert!((after(60, 0, true).bias - 0.1).abs() < 1e-12);
    }

    #[test]
    fn the_integral_grows_to_its_limit_and_waits_for_a_valve_that_can_give_no_more() {
        assert!((after(13, 0, false).integral + 0.01).abs() < 1e-12);
        assert_eq!(after(1000, 0, false).integral, -0.3);
        // The friction is above the reference. After a long time with the valve closed the integral stops; with
        // the valve open it does not.
        assert_eq!(after(1000, 12, false).integral, 0.0);
        assert_eq!(after(1000, 12, true).integral, -0.3);
    }

    /// The corrections after `samples` samples with a constant prediction error `missed` and a ripple of 0.01.
    fn learnt(law: &Tracking<f64>, samples: u32, missed: f64) -> Correction<f64, 8> {
        let mut correction = Correction::none();
        for k in 0..samples {
            let wobble = if k / 20 % 2 == 0 { 0.01 } else { -0.01 };
            let residual = Some(missed + wobble);
            correction.update(law, law.reference, 0.5, residual, 0.5, (true, 0));
        }
        correction
    }

    #[test]
    fn what_noise_explains_moves_no_bias_and_slows_the_integral_to_its_share() {
        let law = Tracking {
            play: 0.02,
            settled: 0.2,
            ..LAW
        };
        let quiet = learnt(&law, 3000, 0.0);
        assert_eq!(quiet.bias, 0.0);
        // The rate falls to the final rate of the Riccati equation and no lower.
        assert!((quiet.share - 0.2).abs() < 0.005, "{}", quiet.share);
        // A changed model error moves the bias beyond its dead band, and resets the integral rate.
        let mut wrong = quiet;
        for _ in 0..20 {
            wrong.update(&law, law.reference, 0.6, Some(0.0), 0.5, (true, 0));
        }
        assert!((wrong.bias - 0.08).abs() < 1e-3, "{}", wrong.bias);
        assert!(wrong.share > 0.8, "{}", wrong.share);
        // A new reference resets the integral rate as well.
        let mut other = quiet;
        other.update(&law, 0.6, 0.6, Some(0.0), 0.6, (true, 0));
        assert!(other.share > 0.98, "{}", other.share);
        // Without a dead band the bias follows every average.
        assert!(learnt(&LAW, 3000, 0.0).bias != 0.0);
    }

    #[test]
    fn without_a_reading_nothing_is_learnt_and_the_gap_is_counted() {
        let mut correction = after(60, 0, true);
        let (bias, integral) = (correction.bias, correction.integral);
        for _ in 0..5 {
            correction.update(&LAW, LAW.reference, 0.55, None, 0.5, (true, 0));
        }
        assert_eq!((correction.bias, correction.integral), (bias, integral));
        assert_eq!(correction.lost, 5);
        correction.update(&LAW, LAW.reference, 0.55, Some(0.05), 0.5, (true, 0));
        assert_eq!(correction.lost, 0);
    }
}
