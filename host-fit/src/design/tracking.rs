//! Parameters of the tracking law, from the model and the valve's limits.

use super::bench::{Player, hold_times};
use super::certificate::{Certificate, certificate};
use super::error::{DesignError, check_period};
use super::rules::RULES;
use super::steady::{Steady, steady, time_constants};
use crate::model::{Delay, Model, Track};
use crate::picture::time;
use closed_loop::{AHEAD, Figures, ModelFlow, TrackingController, run};
use model_core::control::Unusable;
use model_core::control::budget::{Air, Budget};
use model_core::control::{HoldTimes, Reachable, Tracking};
use model_core::delay::Transport;
use serde::Serialize;

/// Requirements on a tracking law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackRequest {
    /// The friction to hold: y of the flow for [`track`]; the sensor's reading, offset included, for
    /// [`steps::design`](crate::steps::design).
    pub target: f64,
    /// Shortest on time of the valve, s.
    pub min_on_s: f64,
    /// Shortest off time of the valve, s.
    pub min_off_s: f64,
    /// Switches per second that the valve can give in the long run.
    pub switches_per_s: Option<f64>,
    /// Share of the air of steady blowing that may be used in the long run, 0–1.
    pub air: Option<f64>,
    /// Fastest change of the reference, y/s; `None` follows steps.
    pub ramp_per_s: Option<f64>,
    /// Choose the switching rate that takes the least air on the model, instead of
    /// the fastest one, which ripples least.
    pub least_air: bool,
    /// Standard deviation of the sensor's noise averaged over 64 samples, y; `None`: that of a usual hot film.
    pub slow_noise: Option<f64>,
}

impl TrackRequest {
    /// A request to hold `target` without further limits, with shortest times of the valve of 10 ms, or of a sample if
    /// that is longer.
    #[must_use]
    pub fn holding(target: f64) -> Self {
        Self {
            target,
            min_on_s: 0.010,
            min_off_s: 0.010,
            switches_per_s: None,
            air: None,
            ramp_per_s: None,
            least_air: false,
            slow_noise: None,
        }
    }
}

/// A tracking law and the figures of its design. Serialises to the keys under `track` of `design --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrackDesign {
    /// The law.
    #[serde(skip)]
    pub law: Track,
    /// The friction that is held, y.
    pub target: f64,
    /// Open interval of friction that on/off blowing can hold, y.
    pub reachable: [f64; 2],
    /// The flow with the valve closed.
    pub natural: Steady,
    /// The flow under steady blowing.
    pub blown: Steady,
    /// The duty u_eq that holds the reference when switching is fast:
    /// (α·y* − d)/(Σb + y*·Σc).
    pub equivalent_duty: f64,
    /// The duty that the law takes on the model.
    #[serde(rename = "duty_on_model")]
    pub duty: f64,
    /// Ultimate bound of y on the model, if one can be proven.
    pub certificate: Certificate,
    /// Remarks for the user.
    pub remarks: Vec<String>,
}

/// Steady states of a model with the valve closed and open, and the levels of y between them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Held {
    natural: Steady,
    blown: Steady,
    /// The open interval of friction between both.
    pub(crate) reachable: Reachable<f64>,
}

/// The levels that on/off blowing can hold on `model`; [`DesignError`] if no law can be designed for any level.
pub(crate) fn held(model: &Model) -> Result<Held, DesignError> {
    check_period(model)?;
    if model.averaging.averaged_model {
        return Err(Unusable::AveragedModel.into());
    }
    let (natural, blown) = (steady(model, false)?, steady(model, true)?);
    if blown.friction <= natural.friction {
        return Err(DesignError::NoEffect {
            low: natural.friction,
            high: blown.friction,
        });
    }
    let reachable = Reachable {
        // A small remainder of the initial transient is not a natural friction.
        low: if natural.friction.abs() < RULES.no_natural * blown.friction {
            0.0
        } else {
            natural.friction
        },
        high: blown.friction,
    };
    Ok(Held {
        natural,
        blown,
        reachable,
    })
}

/// Designs the law that holds `request.target` on `model`.
///
/// # Errors
/// [`DesignError`]: a reference out of reach (with the interval), a model that
/// does not settle, is averaged or starts in mid-run, an air budget that is too small.
pub fn track(model: &Model, request: &TrackRequest) -> Result<TrackDesign, DesignError> {
    let Held {
        natural,
        blown,
        reachable,
    } = held(model)?;
    reachable.check(request.target)?;
    let mut remarks = Vec::new();
    for (modulus, valve) in [(natural.modulus, "closed"), (blown.modulus, "open")] {
        if modulus > 1.0 + RULES.grows {
            remarks.push(format!(
                "with the valve {valve} the model is slightly unstable (largest pole modulus {modulus:.5}); \
                the law stabilises it, but a long free run is not valid"
            ));
        }
    }

    let bench = Player::<f64>::of(model);
    let (shortest, longest) = bench.first_arrival(RULES.swing * blown.friction);
    let (opening, closing) = bench.valve();
    let equivalent_duty = equivalent_duty(model, request.target);
    let period_s = model.sample_period_s;
    let asked = hold_times(request.min_on_s, request.min_off_s, period_s);
    let mut hold = asked;
    if let Delay::Law(law) = &model.delay
        && let Some(transport) = law.transport(model.sample_period_s)
    {
        let [rising, falling] = transport.held_back();
        let varies = transport.bounds().is_none_or(|[low, high]| low < high);
        if varies || law.shapes_command() {
            // A pulse or gap shorter than the dispersion of its edges never arrives.
            let sure = |held: f64| held.ceil() as u32 + RULES.sure_pulse;
            hold.on = hold.on.max(sure(rising));
            hold.off = hold.off.max(sure(falling));
        }
    }
    if hold.on > asked.on || hold.off > asked.off {
        let [on, off] = [hold.on, hold.off].map(|samples| time(f64::from(samples) * period_s, 4));
        remarks.push(format!(
            "shortest times are {on} on and {off} off: shorter pulses may not reach the flow \
            completely"
        ));
    }
    let air = request.air.map(|share| {
        [
            (share * 1000.0).round().clamp(0.0, 1000.0) as u32,
            Air::SAVED,
        ]
    });
    if let Some(allowed) = request.air
        && equivalent_duty > allowed
    {
        return Err(DesignError::Air {
            reference: request.target,
            needed: equivalent_duty,
            allowed,
        });
    }

    let lead = shortest.max(1);
    let range = reachable.high - reachable.low;
    // Low-frequency power density of the noise, y²·s.
    let slow_noise = request.slow_noise.unwrap_or(RULES.usual_slow_noise);
    let density = 64.0 * period_s * slow_noise.powi(2);
    let observer = observer(
        time_constants(model, natural.friction, blown.friction),
        density,
        range,
        period_s,
    );
    let bias_rate = RULES.bias_in_a_delay / f64::from(lead.max(RULES.bias_delay));
    let mut law = Track {
        reference: request.target,
        reachable: [reachable.low, reachable.high],
        slope: request
            .ramp_per_s
            .map_or(0.0, |slope| slope * model.sample_period_s),
        hold,
        anticipation: None,
        switches: None,
        air,
        lead,
        opening,
        closing,
        look_ahead: longest
            .saturating_add(opening.max(closing))
            .saturating_add(half(hold))
            .saturating_add(3),
        observer,
        bias_rate,
        integral_rate: RULES.integral_in_a_delay / f64::from(lead.max(RULES.integral_delay)),
        play: RULES.play * passed(bias_rate, density, period_s),
        settled: 1.0,
        correction_limit: RULES.correction * range,
        // An outlier moves the estimate by the observer gain times the whole range.
        residual_limit: range,
        lost: Vec::new(),
    };
    let duty_of = |law: &Track| {
        let tracking: Tracking<f64> = law.tracking();
        tracking.validate::<_, AHEAD>(&bench.prepared, longest)?;
        Ok::<_, DesignError>(on_model(&bench, tracking))
    };
    let figures = duty_of(&law)?;
    let mut duty = figures.air;
    if let Some(rate) = request.switches_per_s {
        law = paced(&law, rate * period_s, duty);
        duty = duty_of(&law)?.air;
    }
    if request.least_air {
        // Switches per sample.
        let fastest = request.switches_per_s.unwrap_or(f64::INFINITY) * period_s;
        let a_thousand = bench.span(1000) as f64;
        let paces = RULES.paces.map(|pace| pace / a_thousand);
        for rate in paces.into_iter().filter(|rate| *rate < fastest) {
            let slower = paced(&law, rate, duty);
            // Rates that the look-ahead cannot hold or at which the model diverges are excluded.
            let Ok(figures) = duty_of(&slower) else { break };
            if figures.air < (1.0 - RULES.worthwhile_saving) * duty
                && figures.offset.abs() < RULES.paced_offset * range
            {
                (law, duty) = (slower, figures.air);
            }
        }
    }
    // A switching rate that saves air accepts a larger ripple on purpose.
    if !request.least_air {
        law = anticipating(law, |law| Some(duty_of(law).ok()?.rms));
    }
    let final_figures = duty_of(&law)?;
    duty = final_figures.air;
    if final_figures.switches_per_s == 0.0 {
        let length = |samples: u32| time(f64::from(samples) * period_s, 4);
        remarks.push(format!(
            "on the model the valve does not switch after the start: shortest times of {} open and {} closed \
             are too long for its response; choose another target, or allow shorter times: `--min-on`, `--min-off`; times \
             shorter than those of the records need records with such pulses, or a measured valve (`--rig rig.toml`)",
            length(law.hold.on),
            length(law.hold.off)
        ));
    }
    let ripple = final_figures.rms;
    law.settled = settled(law.integral_rate, ripple, density, period_s);
    if let Some(allowed) = request.air
        && duty > allowed + RULES.air_margin
    {
        return Err(DesignError::Air {
            reference: request.target,
            needed: duty,
            allowed,
        });
    }
    Ok(TrackDesign {
        certificate: certificate(model, &law),
        law,
        target: request.target,
        reachable: [reachable.low, reachable.high],
        natural,
        blown,
        equivalent_duty,
        duty,
        remarks,
    })
}

/// u_eq = (α·y* − d)/(Σb + y*·Σc), theory 3.1; without effects.
fn equivalent_duty(model: &Model, reference: f64) -> f64 {
    let alpha = 1.0 - model.a.iter().sum::<f64>();
    let gain = model.b.iter().sum::<f64>() + reference * model.c.iter().sum::<f64>();
    (alpha * reference - model.constant) / gain
}

/// The observer gain per sample: the stationary Kalman gain for a flow with its faster time constant τ and a
/// model error σ = `model_error` of the `range`. With the process noise q = 2σ²/τ and the sensor noise
/// `density` S (y²·s), the bandwidth is √(1/τ² + q/S) − 1/τ per second.
fn observer(time_constants_s: [f64; 2], density: f64, range: f64, period_s: f64) -> f64 {
    let tau = time_constants_s[0].min(time_constants_s[1]);
    let pushed = 2.0 * (RULES.model_error * range).powi(2) / tau;
    let rate = (tau.powi(-2) + pushed / density).sqrt() - 1.0 / tau;
    // Without noise the rate is infinite and the limit applies.
    (rate * period_s).min(RULES.observer_most)
}

/// Noise at the output of a first-order filter of `rate` (per sample) for noise of `density` (y²·s):
/// √(S·g/2), y rms.
fn passed(rate: f64, density: f64, period_s: f64) -> f64 {
    (density * rate / period_s / 2.0).sqrt()
}

/// Long-term rate of an integrator that starts at `rate` (per sample): its noise is a given share of the
/// `ripple` (y rms) that the valve's hold times cause anyway.
fn settled(rate: f64, ripple: f64, density: f64, period_s: f64) -> f64 {
    if density <= 0.0 {
        return 1.0;
    }
    let share = RULES.noise_beside_ripple * ripple / passed(rate, density, period_s);
    share.powi(2).clamp(RULES.least_settled, 1.0)
}

/// `law` limited to `rate` switches per sample, for a flow that needs `duty`.
///
/// The switching budget fixes the time between two openings, whatever duty the flow needs. The hold time of
/// the shorter part is slightly less than its duration, so that the law knows its ripple, but the budget
/// limits the switching rate.
fn paced(law: &Track, rate: f64, duty: f64) -> Track {
    let cycle = 2.0 / rate;
    let duty = duty.clamp(0.02, 0.98);
    let mut paced = law.clone();
    let share = |of: f64| (RULES.paced_hold * of * cycle).round() as u32;
    if duty > 0.5 {
        paced.hold.off = law.hold.off.max(share(1.0 - duty));
    } else {
        paced.hold.on = law.hold.on.max(share(duty));
    }
    paced.look_ahead = law
        .look_ahead
        .saturating_add(half(paced.hold) - half(law.hold));
    paced.switches = Some([
        (1.0 / rate - 1e-6).ceil().max(1.0) as u32,
        RULES.saved_switches,
    ]);
    paced
}

/// `law` with the anticipation of the least `rms` on the model. Half of the shortest times centres the ripple of a flow
/// that moves at constant rates; a flow that settles within a shortest time moves mostly at its beginning.
fn anticipating(law: Track, rms: impl Fn(&Track) -> Option<f64>) -> Track {
    let hold = [law.hold.of(true), law.hold.of(false)];
    let Some(mut least) = rms(&law) else {
        return law;
    };
    let mut best = law;
    for share in RULES.anticipations {
        let other = Track {
            anticipation: Some(hold.map(|hold| (share * f64::from(hold)).round() as u32)),
            ..best.clone()
        };
        match rms(&other) {
            Some(rms) if rms < (1.0 - RULES.anticipated) * least => (best, least) = (other, rms),
            _ => break,
        }
    }
    best
}

/// Half of the valve's longer hold time, samples.
fn half(hold: HoldTimes) -> u16 {
    hold.on.max(hold.off).div_ceil(2).min(10_000) as u16
}

/// The law on the model itself, after the initial transient, without air budget.
fn on_model(bench: &Player<f64>, tracking: Tracking<f64>) -> Figures {
    let free = Tracking {
        budget: Budget {
            air: None,
            ..tracking.budget
        },
        ..tracking
    };
    let mut law = TrackingController::new(
        &bench.prepared,
        free,
        bench.at_rest(),
        bench.channels.clone(),
    );
    let mut flow = ModelFlow::new(
        &bench.prepared,
        bench.at_rest(),
        bench.channels.clone(),
        bench.period_s,
    );
    let trace = run(
        &mut law,
        &mut flow,
        std::iter::repeat_n(tracking.reference, bench.span(RULES.model_run)),
    );
    Figures::of(&trace, bench.span(RULES.model_run_from))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use model_core::effects::StateDependentDelay;
    use model_core::model::Averaging;
    use model_core::recursion::LagConvention;

    fn paper(convention: LagConvention) -> Model {
        Model {
            convention,
            delay: Delay::Fixed { delays: vec![49] },
            ..Model::default()
        }
    }

    /// Table II, state-dependent delay.
    pub(in super::super) fn paper_state_dependent(convention: LagConvention) -> Model {
        Model {
            state_lags: vec![1, 44, 123, 479, 496],
            a: vec![0.9759, 0.0141, 0.0025, -0.0042, 0.0055],
            product_lags: vec![1, 73, 242, 264, 299, 335, 414, 477, 494, 500],
            b: vec![0.0080],
            c: vec![
                -0.0228, 0.0138, 0.0621, -0.0286, -0.0186, -0.0121, -0.0035, -0.0056, 0.0189,
                -0.0049,
            ],
            delay: Delay::of::<StateDependentDelay<f64>>(&[47.35, 12.69, 20.18], vec![1.0], false),
            ..paper(convention)
        }
    }

    /// Table II, fixed delay.
    pub(in super::super) fn paper_fixed(convention: LagConvention) -> Model {
        Model {
            state_lags: vec![1, 48, 352, 371, 496],
            a: vec![0.9744, 0.0171, -0.0028, 0.0040, 0.0009],
            product_lags: vec![1, 66, 242, 249, 260, 276, 300, 409, 475, 491],
            b: vec![0.0063],
            c: vec![
                -0.0116, 0.0070, 0.0483, 0.0253, -0.0455, -0.0243, -0.0038, -0.0014, -0.0074,
                0.0138,
            ],
            ..paper(convention)
        }
    }

    /// Table IV, averaged model, fixed delays, columns read as theory 2.1.
    pub(in super::super) fn paper_averaged() -> Model {
        Model {
            averaging: Averaging {
                window: 250,
                averaged_model: true,
            },
            state_lags: vec![1, 269],
            a: vec![1.0027, -0.0027],
            product_lags: vec![1, 307],
            b: vec![0.0009, 0.0030],
            c: vec![-0.0008, 0.0045, -0.0085, 0.0010],
            delay: Delay::Fixed {
                delays: vec![49, 417],
            },
            ..paper(LagConvention::Literal)
        }
    }

    #[test]
    fn the_papers_model_gets_the_law_of_the_theory() {
        let design = track(
            &paper_state_dependent(LagConvention::OneStep),
            &TrackRequest::holding(0.8),
        )
        .unwrap();
        assert!((design.equivalent_duty - 0.713).abs() < 0.001);
        assert!((design.duty - 0.713).abs() < 0.04, "{}", design.duty);
        assert_eq!(design.law.lead, 47);
        assert_eq!((design.law.opening, design.law.closing), (0, 0));
        assert!(design.law.look_ahead >= 60 + 5);
    }

    #[test]
    fn what_cannot_be_held_is_refused_with_the_interval() {
        let model = paper_state_dependent(LagConvention::OneStep);
        for target in [-0.1, 0.0, 1.2, f64::NAN] {
            let error = track(&model, &TrackRequest::holding(target)).unwrap_err();
            assert!(error.to_string().contains("between 0.0000 and"), "{error}");
            assert!(matches!(error, DesignError::Unreachable(_)));
        }
        let thirsty = TrackRequest {
            air: Some(0.5),
            ..TrackRequest::holding(0.8)
        };
        assert!(matches!(
            track(&model, &thirsty),
            Err(DesignError::Air { .. })
        ));
        assert_eq!(
            track(&paper_averaged(), &TrackRequest::holding(0.8)),
            Err(DesignError::Unusable(Unusable::AveragedModel))
        );
    }

    #[test]
    fn a_switching_budget_lengthens_the_binding_hold_time() {
        let model = paper_state_dependent(LagConvention::OneStep);
        let calm = TrackRequest {
            switches_per_s: Some(20.0),
            ..TrackRequest::holding(0.8)
        };
        let design = track(&model, &calm).unwrap();
        // The cycle lasts 100 ms. The valve is closed for 28.7 % of it, of which the hold time is the larger part.
        assert_eq!(design.law.hold.on, 10);
        assert!((20..=25).contains(&design.law.hold.off), "{design:?}");
        assert_eq!(design.law.switches, Some([50, 10]));
    }

    /// A flow that settles within the shortest times, held at half of steady blowing: the square wave with equal on
    /// and off times has the least ripple. It swings between its upper end and e^{−m/τ} times that value.
    #[test]
    fn the_ripple_is_least_for_times_longer_than_the_flow_takes() {
        let (tau, shortest) = (20.0_f64, 40.0);
        let pole = (-1.0 / tau).exp();
        let model = Model {
            state_lags: vec![1],
            product_lags: Vec::new(),
            a: vec![pole],
            b: vec![1.0 - pole],
            c: Vec::new(),
            ..paper(LagConvention::OneStep)
        };
        let request = TrackRequest {
            min_on_s: 0.001 * shortest,
            min_off_s: 0.001 * shortest,
            ..TrackRequest::holding(0.5)
        };
        let design = track(&model, &request).unwrap();
        let figures = on_model(&Player::of(&model), design.law.tracking());
        let decay = (-shortest / tau).exp();
        // Mean square of (1 − high·e^{−t/τ}) − 1/2 over one part of the cycle, with high = 1/(1 +
        // decay).
        let high = 1.0 / (1.0 + decay);
        let mean_square = 0.25 - high * tau / shortest * (1.0 - decay)
            + high.powi(2) * tau / (2.0 * shortest) * (1.0 - decay.powi(2));
        let least = mean_square.sqrt();
        assert!(
            (0.99..1.05).contains(&(figures.rms / least)),
            "{} {least}",
            figures.rms
        );
        assert!(figures.offset.abs() < 0.01, "{}", figures.offset);
        assert!(design.law.anticipation.is_some());
    }

    #[test]
    fn valves_and_edges_are_looked_through() {
        let mut model = paper_state_dependent(LagConvention::OneStep);
        let spec = model_core::effects::spec("valve-lag").unwrap();
        model.add(spec, &[0.010, 0.020], None);
        let design = track(&model, &TrackRequest::holding(0.8)).unwrap();
        assert!(
            (5..=7).contains(&design.law.opening),
            "{}",
            design.law.opening
        );
        assert!(
            (12..=14).contains(&design.law.closing),
            "{}",
            design.law.closing
        );
        let spec = model_core::effects::spec("edge-dependent-delay").unwrap();
        let mut model = paper_state_dependent(LagConvention::OneStep);
        model.add(spec, &[0.060, 0.045], None);
        let design = track(&model, &TrackRequest::holding(0.8)).unwrap();
        assert_eq!(design.law.hold, HoldTimes { on: 18, off: 10 });
        assert!((14..=16).contains(&design.law.opening));
        assert_eq!(design.law.lead, 45);
    }
}
