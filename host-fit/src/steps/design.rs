//! Design of a control law and its trials in closed loop.

use serde::Serialize;

use super::memory::Work;
use super::prepared::prepared;
use super::{StepError, check_period};
use crate::data::{DataSet, Record};
use crate::design::{
    DesignError, Margin, MaximiseRequest, Optimum, PossibleFlow, Proof, RULES, TrackDesign,
    TrackRequest, Trial, Trials, held, margin, maximise, possible_flows, prove, prove_pulses,
    track,
};
use crate::fit::RULES as FIT;
use crate::indicators::score;
use crate::model::{Law, Model};
use crate::parallel;
use crate::terms::{Units, resting_at_zero};
use closed_loop::Controlled;

/// Goal of a law. Levels are sensor readings, offset included, in the unit of the records; costs and rates
/// are in the same unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DesignRequest {
    /// Hold the friction at a value.
    Track(TrackRequest),
    /// The highest mean friction minus the price of the air.
    Maximise(MaximiseRequest),
}

/// A designed law. Serialises to the keys of `design --json` except the trials, which belong to [`Proof`].
#[derive(Clone, Debug, Serialize)]
pub struct Design {
    /// The model with its law.
    #[serde(skip)]
    pub model: Model,
    /// Sample period of the loop, the unit of the law's times, s.
    pub sample_period_s: f64,
    /// The law.
    pub law: Law,
    /// Sensor offset: the reading without friction, y. Levels here and in trials include it; those of the law do
    /// not.
    pub sensor_zero: f64,
    /// Figures of the design.
    #[serde(flatten)]
    pub outcome: DesignOutcome,
    /// Size of y; the rules of the design assume 1.
    #[serde(skip)]
    pub(crate) size: f64,
    /// Sensor noise of the trials as a multiple of that of a typical hot film for a flow with y of order one.
    #[serde(skip)]
    pub noise: f64,
}

/// Figures of a design.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum DesignOutcome {
    /// Figures of a tracking law.
    Track(TrackDesign),
    /// Figures of a maximising law.
    Maximise(Optimum),
}

impl Design {
    /// Root mean square of the sensor noise in the trials, y.
    #[must_use]
    pub fn noise_rms(&self) -> f64 {
        self.noise * self.size * noise_rms()
    }

    /// This design; its law notes the trials in which attachment was lost.
    #[must_use]
    pub fn which_lost(self, trials: Vec<String>) -> Self {
        let law = self.law.clone().which_lost(trials);
        let model = Model {
            law: Some(law.clone()),
            ..self.model
        };
        Self { model, law, ..self }
    }
}

/// Units in which y of `model` is of order one without sensor offset.
#[must_use]
pub fn units_of_order_one(model: &Model) -> Units {
    let zero = model.zero_among(&model.values());
    let [low, high] = model.training.y_range;
    let size = (low - zero).abs().max((high - zero).abs());
    let as_it_is = (FIT.order_one_low..FIT.order_one_high).contains(&size) || size <= 0.0;
    Units {
        zero,
        y: if as_it_is { 1.0 } else { size },
        command: model.command,
        ..Units::NONE
    }
}

impl TrackRequest {
    fn inward(&self, units: &Units) -> Self {
        Self {
            target: (self.target - units.zero) / units.y,
            ramp_per_s: self.ramp_per_s.map(|ramp| ramp / units.y),
            slow_noise: self.slow_noise.map(|noise| noise / units.y),
            ..*self
        }
    }
}

/// Longest time in a request, samples: beyond it the search takes more than minutes, and the board's command
/// memory is shorter.
const LONGEST: f64 = 100_000.0;

/// Rejects times outside the range of a search.
fn check_times(model: &Model, request: &DesignRequest) -> Result<(), StepError> {
    let (min_on_s, min_off_s, period_s, horizon_s) = match request {
        DesignRequest::Track(r) => (r.min_on_s, r.min_off_s, None, None),
        DesignRequest::Maximise(r) => (r.min_on_s, r.min_off_s, r.longest_period_s, r.horizon_s),
    };
    let longest_s = LONGEST * model.sample_period_s;
    for (what, time_s) in [
        ("shortest on time", Some(min_on_s)),
        ("shortest off time", Some(min_off_s)),
        ("longest period", period_s),
        ("horizon", horizon_s),
    ] {
        if let Some(time_s) = time_s.filter(|t| !(0.0..=longest_s).contains(t)) {
            return Err(StepError::DesignTime {
                what,
                time_s,
                longest_s,
            });
        }
    }
    Ok(())
}

impl TrackDesign {
    fn outward(mut self, units: &Units, target: f64) -> Self {
        let level = |y: f64| y * units.y + units.zero;
        self.target = target;
        self.certificate = self.certificate.scaled(units.y);
        self.reachable = self.reachable.map(level);
        for steady in [&mut self.natural, &mut self.blown] {
            steady.friction = level(steady.friction);
            steady.reading = level(steady.reading);
        }
        let law = &mut self.law;
        law.reachable = law.reachable.map(|y| y * units.y);
        for y in [
            &mut law.reference,
            &mut law.slope,
            &mut law.play,
            &mut law.correction_limit,
            &mut law.residual_limit,
        ] {
            *y *= units.y;
        }
        self
    }
}

impl Optimum {
    fn outward(mut self, units: &Units) -> Self {
        let level = |y: f64| y * units.y + units.zero;
        self.law.air_price *= units.y;
        for y in [
            &mut self.mean,
            &mut self.mean_after_minutes,
            &mut self.mean_detuned,
        ] {
            *y = level(*y);
        }
        let weighed = &mut self.weighed;
        weighed.air_price *= units.y;
        weighed.value = level(weighed.value);
        weighed.steady_value = weighed.steady_value.map(level);
        weighed.pulses_pay_from = weighed.pulses_pay_from.map(|price| price * units.y);
        if let Some(pulses) = &mut weighed.pulses {
            pulses.mean = level(pulses.mean);
            pulses.value = level(pulses.value);
        }
        self.range = self.range.map(level);
        self.steady_mean = self.steady_mean.map(level);
        self.refused_mean = self.refused_mean.map(level);
        if let Some(outside) = &mut self.outside {
            outside.friction *= units.y;
        }
        if let Some(planned) = &mut self.planned {
            planned.value = level(planned.value);
            planned.steady_value = level(planned.steady_value);
        }
        self
    }
}

/// Designs the law that `request` specifies and puts it into the model.
///
/// ```
/// use host_fit::design::TrackRequest;
/// use host_fit::model::{Law, Model};
/// use host_fit::steps::{DesignOutcome, DesignRequest, design};
///
/// let model = Model::load("../data/paper/table-2-state-dependent.toml".as_ref())?;
/// let request = DesignRequest::Track(TrackRequest::holding(0.8));
/// // Only the one-step convention is stable under steady blowing.
/// let model = Model { convention: model_core::recursion::LagConvention::OneStep, ..model };
/// let designed = design(&model, &request)?;
/// let DesignOutcome::Track(track) = &designed.outcome else { unreachable!() };
/// assert!((track.equivalent_duty - 0.713).abs() < 1e-3);
/// assert!(matches!(designed.model.law, Some(Law::Track(_))));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`StepError::Design`] with the reason: out of reach, a model that does not settle, a sample period that is no
/// law's (0.2 ms to 1 h).
pub fn design(model: &Model, request: &DesignRequest) -> Result<Design, StepError> {
    check_times(model, request)?;
    let model = &resting_at_zero(model);
    let units = units_of_order_one(model);
    let inner = units.model_in(model);
    let outward = |error: DesignError| error.outward(&units);
    let (law, outcome, noise) = match request {
        DesignRequest::Track(request) => {
            let inward = request.inward(&units);
            let design = track(&inner, &inward).map_err(outward)?;
            let design = design.outward(&units, request.target);
            let noise = inward
                .slow_noise
                .map_or(1.0, |noise| noise / RULES.usual_slow_noise);
            (
                Law::Track(design.law.clone()),
                DesignOutcome::Track(design),
                noise,
            )
        }
        DesignRequest::Maximise(request) => {
            let inward = MaximiseRequest {
                air_price: request.air_price / units.y,
                ..*request
            };
            let optimum = maximise(&inner, &inward).map_err(outward)?.outward(&units);
            let law = Law::Maximise(optimum.law.clone());
            (law, DesignOutcome::Maximise(optimum), 1.0)
        }
    };
    Ok(Design {
        model: Model {
            law: Some(law.clone()),
            ..model.clone()
        },
        sample_period_s: model.sample_period_s,
        law,
        sensor_zero: units.zero,
        outcome,
        size: units.y,
        noise,
    })
}

/// Root mean square of the noise of a typical hot film, for a flow with y of order one.
fn noise_rms() -> f64 {
    RULES.white_noise.hypot(RULES.coloured_noise)
}

/// The sensor noise averaged over 64 samples, y, from the free-run error of `model` on `set`; the ratio of average to
/// sample is that of a hot film. `None` if a record is an average over repeats: a single reading has more noise.
///
/// # Errors
/// [`StepError`]: other sampling period, a missing channel, a model whose free run diverges.
pub fn slow_noise(model: &Model, set: &DataSet) -> Result<Option<f64>, StepError> {
    check_period(model, set)?;
    let averaged = |r: &Record| r.y_sd.is_some() || r.y_min.is_some() || r.y_max.is_some();
    if set.records.iter().any(averaged) {
        return Ok(None);
    }
    let (scores, _) = score(model, &prepared(set)?.records)?;
    let rmse = scores.held_out().map(|all| all.rmse);
    Ok(rmse.map(|rmse| rmse * RULES.usual_slow_noise / noise_rms()))
}

/// The plants that `set` does not exclude, in addition to `model`; a law must keep attachment on them.
///
/// # Errors
/// [`StepError`]: other sampling period, a missing channel, a model whose free run diverges.
pub fn possible(model: &Model, set: &DataSet) -> Result<Vec<PossibleFlow>, StepError> {
    check_period(model, set)?;
    Work::Design.fits(set)?;
    Ok(possible_flows(model, &prepared(set)?)?)
}

/// Runs the law of `design` on its model, on `possible` plants and on those under `stress`; figures are
/// sensor readings, offset included. Noise is repeatable by `seed`.
pub fn try_out<F>(
    design: &Design,
    possible: &[PossibleFlow],
    stress: &[Trial<F>],
    seed: u64,
) -> Proof
where
    F: Controlled + Clone + Sync,
{
    let trials = Trials {
        possible,
        stress,
        noise: design.noise * design.size,
        seed,
    };
    let proof = match (&design.law, &design.outcome) {
        (Law::Maximise(law), DesignOutcome::Maximise(optimum)) => {
            // Pulses have no reference: they are compared with steady blowing, or with their own level if
            // that diverges.
            let blown = optimum.steady_mean.unwrap_or(optimum.mean) - design.sensor_zero;
            prove_pulses(&design.model, law, blown, &trials)
        }
        (Law::Maximise(law), DesignOutcome::Track(_)) => {
            prove_pulses(&design.model, law, 0.0, &trials)
        }
        (Law::Track(law), _) => prove(&design.model, law, &trials),
    };
    proof.shown_by(design.sensor_zero)
}

/// The robustness margin of a tracking law, with pairs of errors if `planes` is set. `None` for pulses, which
/// use no measurement.
#[must_use]
pub fn law_margin(design: &Design, seed: u64, planes: bool) -> Option<Margin> {
    let Law::Track(law) = &design.law else {
        return None;
    };
    let noise = design.noise * design.size;
    Some(margin(&design.model, law, noise, seed, planes))
}

/// Whether a law for a target passes all trials on plants consistent with the records.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TargetVerdict {
    /// The target, in the sensor's units.
    pub target: f64,
    /// Whether the law holds the target on the model and passes all trials on plants consistent with the records.
    pub passes: bool,
    /// Reason of a failure: the trials that lose attachment, a target that is not held, or the error of the design.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// A level at `share` of an interval, to two digits of the interval.
fn level_within([low, high]: [f64; 2], share: f64) -> f64 {
    let decimals = (1.0 - (high - low).log10().floor()).clamp(0.0, 9.0) as usize;
    let exact = low + share * (high - low);
    // The sum with 0 is not −0.
    format!("{exact:.decimals$}").parse().unwrap_or(exact) + 0.0
}

/// The command that follows a finished model: a law that holds the middle of the reachable levels of the records, or the export of
/// the model if no law can be designed from it.
pub(super) fn command_after(model: &Model) -> String {
    let units = units_of_order_one(model);
    match held(&units.model_in(model)) {
        Ok(held) => {
            let ends = [held.reachable.low, held.reachable.high];
            let [low, high] = ends.map(|y| y * units.y + units.zero);
            // A model may reach levels that no record contains.
            let [least, most] = model.training.y_range;
            let [least, most] = [low.max(least), high.min(most)];
            let ends = if least < most {
                [least, most]
            } else {
                [low, high]
            };
            let target = level_within(ends, 0.5);
            format!("host-fit design model.toml DATASET --target {target} -o controlled.toml")
        }
        Err(_) => "host-fit codegen model.toml --lang python -o identified.py".into(),
    }
}

/// The targets over the reachable interval that pass, with `request` otherwise unchanged.
#[must_use]
pub fn passing_targets(
    model: &Model,
    request: &TrackRequest,
    reachable: [f64; 2],
    possible: &[PossibleFlow],
    seed: u64,
) -> Vec<TargetVerdict> {
    let steps = RULES.targets;
    let [low, high] = reachable;
    let verdict = |step: u32| {
        let share = f64::from(step) / f64::from(steps);
        let target = level_within([low, high], share);
        let request = DesignRequest::Track(TrackRequest { target, ..*request });
        let reason = match design(model, &request) {
            Ok(design) => {
                let proof = try_out::<NoStress>(&design, possible, &[], seed);
                let lost = proof.lost();
                match lost.is_empty() {
                    false => Some(lost.join(", ")),
                    true if proof.holds() => None,
                    true => Some("the law does not hold the target on the model".to_owned()),
                }
            }
            Err(error) => Some(error.to_string()),
        };
        TargetVerdict {
            target,
            passes: reason.is_none(),
            reason,
        }
    };
    parallel::each((1..steps).collect::<Vec<u32>>(), verdict)
}

/// Placeholder type for runs without stress trials.
#[derive(Clone, Copy, Debug)]
pub enum NoStress {}

impl Controlled for NoStress {
    fn sample_period_s(&self) -> f64 {
        match *self {}
    }
    fn step(&mut self, _: bool) -> Option<f64> {
        match *self {}
    }
    fn friction(&self) -> f64 {
        match *self {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A first-order flow that ends at 0.8.
    fn flow() -> Model {
        Model {
            a: vec![0.97],
            b: vec![0.024],
            ..Model::default()
        }
    }

    /// A sensor that reads 0.1 more than the law assumes: the law holds the reading, which is what a user sees.
    #[test]
    fn a_plant_is_judged_by_what_its_sensor_reads() {
        let model = flow();
        let request = DesignRequest::Track(TrackRequest::holding(0.4));
        let law = design(&model, &request).expect("a law");
        let mut off = model.clone();
        off.add(model_core::effects::ZERO_OFFSET, &[0.1], None);
        let possible = PossibleFlow {
            name: "off".to_owned(),
            p_value: 0.5,
            model: off,
        };
        let proof = try_out::<NoStress>(&law, &[possible], &[], 1);
        let mean = |name: &str| {
            let mut cases = proof.cases.iter();
            let case = cases.find(|case| case.name == name);
            case.expect("the trial").figures.mean
        };
        assert!((mean("off") - 0.4).abs() < 0.03, "{}", mean("off"));
        assert!((mean("off") - mean("the model, noisy sensor")).abs() < 0.03);
    }

    /// The error of the model is the noise of single readings, unless the records are averages.
    #[test]
    fn the_noise_of_a_law_is_that_of_the_records() {
        let model = flow();
        let u: Vec<f64> = (0..2000)
            .map(|k| f64::from(u8::from(k / 90 % 2 == 1)))
            .collect();
        let mut y = vec![0.0];
        for u in &u {
            y.push(0.97 * y[y.len() - 1] + 0.024 * u);
        }
        let read = |k: usize, y: f64| y + if k.is_multiple_of(2) { 0.02 } else { -0.02 };
        let y: Vec<f64> = y
            .iter()
            .take(2000)
            .enumerate()
            .map(|(k, y)| read(k, *y))
            .collect();
        let record = Record::new("r", crate::data::Use::Identify, 0.001, u, y);
        let set = |record| DataSet::from_records(None, vec![record]).expect("records");
        let noise = slow_noise(&model, &set(record.clone()))
            .expect("stable")
            .expect("single readings");
        let expected = 0.02 * RULES.usual_slow_noise / noise_rms();
        assert!((noise / expected - 1.0).abs() < 0.05, "{noise} {expected}");
        let averaged = Record {
            y_sd: Some(vec![0.02; 2000]),
            ..record
        };
        assert_eq!(slow_noise(&model, &set(averaged)).expect("stable"), None);
    }

    #[test]
    fn a_finished_model_leads_to_a_law_or_to_an_export() {
        let flow = flow();
        assert_eq!(
            command_after(&flow),
            "host-fit design model.toml DATASET --target 0.4 -o controlled.toml"
        );
        let slow = Model {
            sample_period_s: 7200.0,
            ..flow
        };
        assert!(command_after(&slow).starts_with("host-fit codegen model.toml --lang python"));
    }
}
