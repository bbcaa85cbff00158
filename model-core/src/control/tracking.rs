//! The tracking law: holds the friction at a reference with an on/off valve.
//!
//! A command issued at sample k arrives at κ(k) = min{m ≥ k : m − h(ỹ_m) ≥ k}. The law predicts the flow with the
//! model from its present estimate. The prediction contains every command already issued up to κ(k), with the delay
//! evaluated at each sample, and continues over the law's anticipation with the *other* valve position. The law
//! switches if the flow would then be on the other side of the reference. With an anticipation of half a hold time, the
//! ripple that a hold time causes is centred on the reference. At a hold time of one sample this is the one-step-optimal
//! choice u = 1 ⇔ y* − F > G/2.
//!
//! Three corrections handle model errors: an observer corrects the estimate by a share of each residual, and
//! bias and integral correct the reference.

use crate::checks::look_ahead;
use crate::control::ahead::{self, Foreknown};
use crate::control::budget::{Air, Purse};
use crate::control::constants::{Tracking, Unusable};
use crate::control::correction::{Correction, limited};
use crate::control::hold::{Hold, HoldTimes};
use crate::control::reference::{Unreachable, ramp};
use crate::effect::Effect;
use crate::history::Memory;
use crate::model::{Input, Parts, StateOf, observe};
use crate::real::Real;

/// A sensor reading; `None` (or a non-finite number) if there is none.
pub type Measurement<T> = Option<T>;

/// State of the law: the model's state `S` and look-ahead memory for `A` samples.
#[derive(Clone, Copy, Debug)]
pub struct TrackingState<T, S, const A: usize> {
    /// The model state at the present estimate; read only.
    pub model: S,
    /// Memory of the look-ahead.
    ahead: [T; A],
    foreknown: Foreknown<T>,
    correction: Correction<T, A>,
    hold: Hold,
    purse: Purse,
    reference: T,
}

impl<T: Copy, S, const A: usize> TrackingState<T, S, A> {
    /// The reference of the last sample (ramped).
    #[inline]
    pub fn reference(&self) -> T {
        self.reference
    }
}

/// The decision at a sample with its intermediate results.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision<T> {
    /// The valve's position from now to the next sample.
    pub on: bool,
    /// The reference at this sample (ramped).
    pub reference: T,
    /// Predicted friction at the decision, corrections included.
    pub foreseen: T,
    /// Samples from now to the arrival of this decision.
    pub delay: u16,
    /// The estimate of the present friction.
    pub estimate: T,
    /// Reading minus predicted reading, limited; 0 without a reading.
    pub residual: T,
    /// Filtered error of past predictions.
    pub bias: T,
    /// Consecutive samples without a reading: the law runs on the model alone.
    pub lost: u32,
}

impl<T: Real> Tracking<T> {
    /// Checks the constants for `model` and a look-ahead memory of `A` samples.
    ///
    /// # Errors
    /// [`Unusable`] names the problem.
    pub fn validate<M: Parts<T>, const A: usize>(
        &self,
        model: &M,
        longest_delay: u16,
    ) -> Result<(), Unusable> {
        if model.averaging().averaged_model {
            return Err(Unusable::AveragedModel);
        }
        for (name, share) in [
            ("observer", self.observer),
            ("bias_rate", self.bias_rate),
            ("integral_rate", self.integral_rate),
        ] {
            if !(share >= T::ZERO && share <= T::ONE) {
                return Err(Unusable::Constant(name));
            }
        }
        for (name, limit) in [
            ("correction_limit", self.correction_limit),
            ("residual_limit", self.residual_limit),
            ("slope", self.slope),
            ("play", self.play),
        ] {
            if !(limit >= T::ZERO && limit.value() < f64::MAX) {
                return Err(Unusable::Constant(name));
            }
        }
        if !(self.settled > T::ZERO && self.settled <= T::ONE) {
            return Err(Unusable::Constant("settled"));
        }
        if self.lead == 0 {
            return Err(Unusable::Constant("lead"));
        }
        if look_ahead(self, usize::from(longest_delay)) > A {
            return Err(Unusable::LookAhead);
        }
        Ok(())
    }

    /// The law at rest; `model_state` comes from [`Parts::on_off_state`] or
    /// [`Parts::graded_state`].
    pub fn start<S, const A: usize>(&self, model_state: S) -> TrackingState<T, S, A> {
        const { assert!(A > 1, "the law looks ahead at least one sample") };
        TrackingState {
            model: model_state,
            ahead: [T::ZERO; A],
            foreknown: Foreknown::new(),
            correction: Correction::none(),
            hold: Hold::closed(),
            purse: self.budget.full(),
            reference: T::ZERO,
        }
    }

    /// Changes the reference.
    ///
    /// # Errors
    /// [`Unreachable`]; the reference then stays unchanged.
    pub fn set_reference(&mut self, reference: T) -> Result<(), Unreachable> {
        self.reachable.check(reference)?;
        self.reference = reference;
        Ok(())
    }

    /// Changes the air budget, 1 to 1000 thousandths of the time; the store of a new budget starts empty.
    ///
    /// # Errors
    /// [`Unusable`]; the budget then stays unchanged.
    pub fn set_air(&mut self, per_mille: u32) -> Result<(), Unusable> {
        if !(1..=1000).contains(&per_mille) {
            return Err(Unusable::Constant("air"));
        }
        self.budget.air = Some(match self.budget.air {
            Some(air) => Air { per_mille, ..air },
            None => Air::of(per_mille),
        });
        Ok(())
    }

    /// One sample: decides on the valve's position with the readings before it, then accepts the present reading.
    /// At the first sample there is no earlier reading, and the valve stays closed. A reading therefore acts one
    /// sample later, and the decision does not wait for the converter.
    ///
    /// Costs at most `A` + 1 model steps, of N1 + N3·(N2 + 1) multiply–adds each.
    pub fn step<M, Y, J, const A: usize>(
        &self,
        model: &M,
        state: &mut TrackingState<T, StateOf<T, M, Y, J>, A>,
        measured: Measurement<T>,
        channels: &[T],
    ) -> Decision<T>
    where
        M: Parts<T>,
        Y: Memory<T>,
        J: Memory<T>,
        <M::Effects as Effect<T>>::State: Clone,
    {
        state.reference = ramp(state.reference, self.reference, self.slope);
        let was_on = state.hold.is_on();
        let target = state.reference + state.correction.integral - state.correction.bias;
        let may_switch = state.hold.may_switch(&self.hold);
        // At the first sample the cache is filled, which costs as much as a prediction; no decision is made.
        let looks = !state
            .foreknown
            .begin(&model.recursion(), &state.model.outputs);
        // If the valve may switch, the other position is evaluated, otherwise the present one.
        let look = if looks {
            self.look_ahead(model, state, was_on != may_switch, channels)
        } else {
            Look::none(state.model.outputs.back(0))
        };
        let wanted = if !may_switch || !looks {
            was_on
        } else if was_on {
            look.foreseen <= target
        } else {
            look.foreseen < target
        };
        let wanted = self
            .budget
            .allow(&state.purse, &state.hold, &self.hold, wanted);
        let on = state.hold.pass(&self.hold, wanted);
        self.budget.book(&mut state.purse, was_on, on);

        let input = Input {
            command: if on { T::ONE } else { T::ZERO },
            channels,
        };
        let output = observe(model, &mut state.model, &input);
        let residual = measured
            .filter(|y| y.abs() < T::from_f64(f64::MAX))
            .map(|y| limited(y - output.measured, self.residual_limit));
        let stands = (state.hold.is_on(), state.hold.since());
        let correction = &mut state.correction;
        correction.update(
            self,
            state.reference,
            output.flow,
            residual,
            look.at_lead,
            stands,
        );
        let next = output.next + self.observer * residual.unwrap_or(T::ZERO);
        state.model.advance(next, model.averaging().window);
        Decision {
            on,
            reference: state.reference,
            foreseen: look.foreseen + correction.bias - correction.integral,
            delay: look.delay,
            estimate: output.flow,
            residual: residual.unwrap_or(T::ZERO),
            bias: correction.bias,
            lost: correction.lost,
        }
    }

    /// Predicts the flow with the valve at `on` from now.
    fn look_ahead<M, Y, J, const A: usize>(
        &self,
        model: &M,
        state: &mut TrackingState<T, StateOf<T, M, Y, J>, A>,
        on: bool,
        channels: &[T],
    ) -> Look<T>
    where
        M: Parts<T>,
        Y: Memory<T>,
        J: Memory<T>,
    {
        let HoldTimes {
            on: opening,
            off: closing,
        } = self.anticipation;
        let halves = if on { opening } else { closing };
        let valve = u32::from(if on { self.opening } else { self.closing });
        // If the anticipation ends between two samples, the mean of both is used.
        let (near, far) = (valve + halves / 2, valve + halves.div_ceil(2));
        let input = Input {
            command: if on { T::ONE } else { T::ZERO },
            channels,
        };
        let flow = state.model.outputs.back(0);
        let mut look = Look::none(flow);
        let lead = usize::from(self.lead);
        let mut arrived_for = 0;
        ahead::run(
            model,
            &state.model,
            &mut state.foreknown,
            &mut state.ahead,
            &input,
            |i, output, arrived| {
                if i + 1 == lead {
                    look.at_lead = output.next;
                }
                if !arrived {
                    look.foreseen = output.next;
                    look.delay = (i + 1) as u16;
                    return false;
                }
                arrived_for += 1;
                if arrived_for <= near {
                    look.foreseen = output.next;
                } else if near == 0 && arrived_for == 1 {
                    look.foreseen = output.flow;
                }
                let enough = arrived_for >= far && i + 1 >= lead;
                if enough && far > near {
                    look.foreseen = (look.foreseen + output.next) / (T::ONE + T::ONE);
                }
                enough
            },
        );
        look
    }
}

/// Result of a look-ahead.
struct Look<T> {
    /// Friction after the arrival and the anticipation.
    foreseen: T,
    /// Friction `lead` samples from now.
    at_lead: T,
    /// Samples from now to the arrival.
    delay: u16,
}

impl<T: Copy> Look<T> {
    /// Without a look-ahead: the present `flow`.
    fn none(flow: T) -> Self {
        Self {
            foreseen: flow,
            at_lead: flow,
            delay: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::budget::Budget;
    use crate::control::reference::Reachable;
    use crate::history::Past;
    use crate::paper::table_two;
    use crate::recursion::LagConvention;
    use crate::step;

    fn law<T: Real>(reference: f64, dwell: u32) -> Tracking<T> {
        Tracking {
            reference: T::from_f64(reference),
            reachable: Reachable {
                low: T::ZERO,
                high: T::from_f64(1.0667),
            },
            slope: T::ZERO,
            hold: HoldTimes {
                on: dwell,
                off: dwell,
            },
            anticipation: HoldTimes {
                on: dwell,
                off: dwell,
            },
            budget: Budget::default(),
            lead: 47,
            opening: 0,
            closing: 0,
            observer: T::from_f64(0.1),
            bias_rate: T::from_f64(0.005),
            integral_rate: T::ZERO,
            settled: T::ONE,
            play: T::ZERO,
            correction_limit: T::from_f64(0.3),
            residual_limit: T::from_f64(0.15),
        }
    }

    /// The law on its own model. `each` receives sample, friction, law and decision, and may replace the next
    /// reading.
    fn on_its_model<T: Real>(
        convention: LagConvention,
        mut law: Tracking<T>,
        samples: usize,
        mut each: impl FnMut(usize, f64, &mut Tracking<T>, Decision<T>) -> Option<Measurement<T>>,
    ) {
        let model = table_two::<T>(convention);
        law.validate::<_, 96>(&model, 60).unwrap();
        let mut plant = model.on_off_state::<512, 4>();
        let mut state = law.start::<_, 96>(model.on_off_state::<512, 4>());
        let mut other = None;
        for k in 0..samples {
            let y = plant.outputs.back(0);
            let decision = law.step(&model, &mut state, other.unwrap_or(Some(y)), &[]);
            let input = Input {
                command: if decision.on { T::ONE } else { T::ZERO },
                channels: &[],
            };
            step(&model, &mut plant, &input);
            other = each(k, y.value(), &mut law, decision);
        }
    }

    /// The first sample fills the cache of the look-ahead, which costs as much as a prediction; the second decides.
    #[test]
    fn the_first_sample_makes_no_decision() {
        let mut decisions = [true; 2];
        on_its_model::<f64>(
            LagConvention::OneStep,
            law(0.5, 1),
            2,
            |k, _, _, decision| {
                decisions[k] = decision.on;
                None
            },
        );
        assert_eq!(decisions, [false, true]);
    }

    struct Run {
        rms: f64,
        mean: f64,
        peak_to_peak: f64,
        switches_per_s: f64,
        duty: f64,
    }

    /// The law on its own model, scored from 5 s to 20 s.
    fn run<T: Real>(convention: LagConvention, reference: f64, dwell: u32) -> Run {
        let law = law::<T>(reference, dwell);
        let (mut sum, mut squares, mut low, mut high) = (0.0, 0.0, f64::MAX, f64::MIN);
        let (mut switches, mut open, mut before, mut count) = (0.0, 0.0, false, 0.0);
        on_its_model(convention, law, 20_000, |k, y, _, decision| {
            let on = decision.on;
            if k >= 5000 {
                sum += y;
                squares += (y - reference) * (y - reference);
                low = low.min(y);
                high = high.max(y);
                switches += f64::from(u8::from(on != before));
                open += f64::from(u8::from(on));
                count += 1.0;
            }
            before = on;
            None
        });
        Run {
            rms: (squares / count).sqrt(),
            mean: sum / count,
            peak_to_peak: high - low,
            switches_per_s: switches / 15.0,
            duty: open / count,
        }
    }

    /// Theory 3.2, hold times of 10 samples: a predicting relay gives rms .012 and .025 at 0.5, .016 and .028 at
    /// 0.8, .016 and .035 at 0.95 (literal and one-step lags). Centring the ripple on the reference reduces these
    /// errors.
    #[test]
    fn the_papers_model_is_held_more_closely_than_by_a_predicting_relay() {
        let literal = [(0.5, 0.012), (0.8, 0.016), (0.95, 0.016)];
        let one_step = [(0.5, 0.025), (0.8, 0.028), (0.95, 0.035)];
        for (convention, rows) in [
            (LagConvention::Literal, literal),
            (LagConvention::OneStep, one_step),
        ] {
            for (reference, relay) in rows {
                let run = run::<f64>(convention, reference, 10);
                let place = std::format!("{convention:?} {reference}: rms {}", run.rms);
                assert!(run.rms < 0.66 * relay, "{place}");
                assert!(
                    (run.mean - reference).abs() < 0.005,
                    "{place}, mean {}",
                    run.mean
                );
                assert!(
                    run.switches_per_s < 90.0,
                    "{place}, {}/s",
                    run.switches_per_s
                );
            }
        }
    }

    /// Theory 3.2, no hold times: rms .002, .003 and .003 with one-step lags.
    #[test]
    fn without_hold_times_the_error_is_that_of_single_samples() {
        for reference in [0.5, 0.8, 0.95] {
            let run = run::<f64>(LagConvention::OneStep, reference, 1);
            assert!(run.rms < 0.0032, "{reference}: {}", run.rms);
            assert!((run.mean - reference).abs() < 0.001);
        }
    }

    /// Theory 3.1 and 3.3: the duty is u_eq = α·y*/(b + y*·Σc), and at 0.8 the shortest closed time limits the
    /// switching: 2·(1 − u_eq)/m0 switches per sample, swing m0·α·y*.
    #[test]
    fn the_limit_cycle_is_that_of_the_formulae() {
        let alpha = 1.0 - 0.9938;
        for (reference, dwell) in [(0.5, 1), (0.8, 1), (0.8, 10)] {
            let run = run::<f64>(LagConvention::OneStep, reference, dwell);
            let u_eq = alpha * reference / (0.0080 - 0.0013 * reference);
            assert!(
                (run.duty - u_eq).abs() < 0.04,
                "{reference}: {} for {u_eq}",
                run.duty
            );
        }
        let run = run::<f64>(LagConvention::OneStep, 0.8, 10);
        let switches = 2.0 * (1.0 - 0.713) / 0.010;
        assert!(
            (run.switches_per_s / switches - 1.0).abs() < 0.15,
            "{}",
            run.switches_per_s
        );
        assert!(
            (run.peak_to_peak / 0.050 - 1.0).abs() < 0.15,
            "{}",
            run.peak_to_peak
        );
    }

    #[test]
    fn single_precision_holds_as_well_as_double() {
        let single = run::<f32>(LagConvention::OneStep, 0.8, 10);
        let double = run::<f64>(LagConvention::OneStep, 0.8, 10);
        assert!((single.rms - double.rms).abs() < 0.001);
        assert!((single.mean - double.mean).abs() < 0.001);
        assert!((single.switches_per_s - double.switches_per_s).abs() < 3.0);
    }

    /// The level decays and recovers without readings.
    #[test]
    fn without_readings_the_model_keeps_the_flow_where_it_is() {
        let mut worst = 0.0_f64;
        let law = law::<f64>(0.8, 10);
        on_its_model(LagConvention::OneStep, law, 10_000, |k, y, _, decision| {
            assert_eq!(decision.lost > 0, (5000..6000).contains(&k));
            if k > 4000 {
                worst = worst.max((y - 0.8).abs());
            }
            match k + 1 {
                5000..5500 => Some(None),
                5500..6000 => Some(Some(f64::NAN)),
                6000..6005 => Some(Some(1e30)),
                _ => None,
            }
        });
        assert!(worst < 0.06, "{worst}");
    }

    #[test]
    fn reference_steps_and_saturation() {
        let mut law = law::<f64>(0.9, 10);
        assert!(law.set_reference(1.2).is_err());
        assert_eq!(law.reference, 0.9);
        // Above the reachable interval the valve stays open, and no integrator winds up.
        law.reference = 1.5;
        let (mut back_at, mut last) = (None, 0.0);
        on_its_model(LagConvention::OneStep, law, 9000, |k, y, law, decision| {
            if (200..5000).contains(&k) {
                assert!(decision.on, "sample {k}");
            }
            if k == 4999 {
                law.reference = 0.5;
            }
            if k > 5000 && y < 0.5 && back_at.is_none() {
                back_at = Some(k - 5000);
            }
            last = y;
            None
        });
        // The model needs 0.4 s to fall from 1.05 to 0.5, and the valve closes at once.
        assert!(back_at.is_some_and(|k| k < 700), "{back_at:?}");
        assert!((last - 0.5).abs() < 0.05);
    }

    #[test]
    fn budgets_bind_the_law() {
        use crate::control::{Air, Switches};
        let mut law = law::<f64>(0.8, 10);
        law.budget = Budget {
            switches: Some(Switches {
                samples_per_switch: 50,
                saved: 10,
            }),
            air: Some(Air {
                per_mille: 600,
                saved: 500,
            }),
        };
        let (mut open, mut switches, mut before) = (0, 0, false);
        on_its_model(LagConvention::OneStep, law, 20_000, |_, _, _, decision| {
            open += u32::from(decision.on);
            switches += u32::from(decision.on != before);
            before = decision.on;
            None
        });
        assert!(open <= 12_000 + 510, "{open}");
        assert!(switches <= 400 + 12, "{switches}");
    }

    /// The air budget is changed in operation. The share of time with the valve open must fall to the new budget, and
    /// invalid values must change nothing.
    #[test]
    fn the_air_budget_changes_in_operation() {
        let mut law = law::<f64>(0.8, 10);
        for nonsense in [0, 1001, u32::MAX] {
            assert_eq!(law.set_air(nonsense), Err(Unusable::Constant("air")));
        }
        assert_eq!(law.budget.air, None);
        let mut open = [0, 0];
        on_its_model(
            LagConvention::OneStep,
            law,
            30_000,
            |k, _, law, decision| {
                if k == 10_000 {
                    law.set_air(400).unwrap();
                }
                if let Some(open) = open.get_mut(usize::from(k >= 10_000)) {
                    *open += u32::from(decision.on);
                }
                None
            },
        );
        assert!(open[0] > 6_500, "{open:?}");
        assert!((7_500..=8_010).contains(&open[1]), "{open:?}");
    }

    #[test]
    fn senseless_constants_are_named() {
        let model = table_two::<f64>(LagConvention::OneStep);
        let good = law::<f64>(0.8, 10);
        assert_eq!(
            Tracking {
                observer: f64::NAN,
                ..good
            }
            .validate::<_, 96>(&model, 60),
            Err(Unusable::Constant("observer"))
        );
        assert_eq!(
            Tracking { lead: 0, ..good }.validate::<_, 96>(&model, 60),
            Err(Unusable::Constant("lead"))
        );
        assert_eq!(good.validate::<_, 60>(&model, 60), Err(Unusable::LookAhead));
    }
}
