//! Detectable effect sizes: the amplitude at which the diagnosis of these records would name each effect in
//! 80 % of cases.
//!
//! The amplitude is limited by what the base model can imitate. The part of the effect's change of the free run
//! that the model's own parameters can follow is subtracted. Further lags and unnamed terms are subtracted too, as
//! long as each lowers the error by more than the penalty of its parameters. The remaining part must exceed the
//! practical margin and be significant over all candidates. A gain x²·‖z‖² has the standard deviation 2x·S, with S²
//! = Σ (z·e)² over blocks longer than the correlation time of the error e. The threshold must be exceeded by 0.84
//! of this standard deviation.

use crate::data::Record;
use crate::diagnose::RULES as NAMED;
use crate::fit::channel_reference;
use crate::model::Model;
use crate::parallel;
use crate::picture::significant;
use crate::rules;
use crate::simulate::SimulateError;
use crate::terms::{
    Bench, HeldOut, Judge, Known, Left, MostLikely, RULES as TERMS, Screen, Shown, Units, Unnamed,
};
use model_core::effect::{Parameter, Spec};
use model_core::effects::SPECS;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal};

rules! {
    /// Detectable effect sizes.
    pub struct Rules in "power";

    /// Power: an effect counts as detectable if it is found in this share of cases.
    power: f64 = 0.8, "share of cases", "convention; counted by `cargo xtask calibrate`";
    /// Largest number of unnamed terms that may imitate the effect.
    terms: usize = 6, "", "number of terms that `identify` adds for a flow with two memories";
    /// Penalty of each of these terms, in parameters.
    term_cost: f64 = 2.0, "parameters", "a lag and its weight";
    /// Factor on the first-order detectable amplitude, because a search that moves all lags imitates more.
    margin: f64 = 2.0, "times the amplitude", "`cargo xtask calibrate`: without this factor 13 of 37 effects of the stated size were named, with the factor 9 of 15";
    /// Iterations for an effect that is not linear in its amplitude.
    probes: usize = 4, "", "judgement";
}

/// The smallest detectable amplitude of an effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Detectable {
    /// The effect.
    pub effect: String,
    /// Name of the amplitude parameter.
    pub parameter: String,
    /// The amplitude's unit.
    pub unit: String,
    /// The amplitude that is named with 80 % power; none if this holds for no amplitude in the parameter's range.
    pub amplitude: Option<f64>,
    /// All parameters of the effect at that amplitude, in the order of its card.
    pub parameters: Vec<f64>,
    /// The amplitude in words, beginning with `subject`.
    pub words: String,
    /// The words of the effect.
    #[serde(skip)]
    pub(crate) subject: &'static str,
}

/// The detectable amplitude of each effect of the catalogue that has an amplitude, is not in the model and
/// can be tried on these records. Other parameters are at the middle of the catalogue's starting values.
///
/// # Errors
/// A missing channel of the model's own, or a free run that diverges.
pub fn detectable(model: &Model, records: &[Record]) -> Result<Vec<Detectable>, SimulateError> {
    let Some(bench) = Bench::of(model, records) else {
        return Ok(Vec::new());
    };
    let held_out = bench.judge.held_out(|_| &bench.given)?;
    let Some(screen) = Screen::new(&bench.judge, &bench.given) else {
        return Ok(Vec::new());
    };
    let known = Known::of(&bench.judge.learning(0));
    let detector = Detector {
        unnamed: Unnamed::of(&screen, &known),
        block: held_out.block(),
        asked: Asked::of(&bench.judge, &bench.given, &held_out),
        units: &bench.units,
        screen,
    };
    Ok(parallel::some(SPECS, |spec| {
        let pointless = detector.screen.pointless(spec).is_some();
        (!pointless).then(|| detector.smallest(spec)).flatten()
    }))
}

/// The threshold for naming an effect.
struct Asked {
    /// Least amplitude, in standard deviations of its estimate.
    deviations: f64,
    /// Threshold on the energy, as a share of the energy of the validation error.
    share: f64,
    /// Quantile of the normal distribution for the required power.
    often: f64,
}

impl Asked {
    fn of(judge: &Judge, given: &Model, held_out: &HeldOut) -> Self {
        // The evidence of the effect must exceed a penalty for the level of the test, for the number of models
        // tried, and for the coefficients of the model without it, because all of these coefficients change to
        // imitate the effect. An amplitude t standard deviations from 0 has an evidence of t²/2 nats, with
        // standard deviation t.
        let likely = MostLikely::of(judge, given);
        let prior = likely.and_then(|likely| Some(likely.log_likelihood - likely.evidence(judge)?));
        let nats = prior.unwrap_or(0.0) - NAMED.level_of_search.ln() + (SPECS.len() as f64).ln();
        let often = Normal::standard().inverse_cdf(RULES.power);
        // Amplitudes are estimated from all records.
        let all: usize = judge.scored_records().iter().map(Record::len).sum();
        let held_out_share = (held_out.samples as f64 / all.max(1) as f64).min(1.0);
        // If the error is at the noise level already, no effect can be detected in it.
        let from_floor = (judge.over_noise(held_out.rmse()) / TERMS.at_the_floor).powi(2);
        let taken = (1.0 - from_floor).clamp(0.0, 0.99);
        Self {
            deviations: (often + (often * often + 2.0 * nats.max(0.0)).sqrt())
                * held_out_share.sqrt(),
            share: taken / (1.0 - taken),
            often,
        }
    }

    /// The factor on the amplitude at which the remaining part passes the threshold.
    fn passes(&self, left: &Left, error: f64) -> f64 {
        let scatter = self.often * left.deviation;
        let wanted = scatter * scatter + left.energy * self.share * error;
        (scatter + wanted.sqrt()).max(self.deviations * left.deviation) / left.energy
    }

    /// The factor on the amplitude at which the effect is detected: the rule `margin` times the factor that passes the
    /// threshold. The model has every unnamed term that lowers the error by more than its penalty. A pair of terms may
    /// lower the error although a single one does not: two neighbouring lags imitate an echo.
    fn multiple(&self, shown: &Shown) -> f64 {
        let (mut x, mut beside) = (0.0_f64, 0);
        while let Some(left) = shown.beside.get(beside) {
            x = x.max(RULES.margin * self.passes(left, shown.error));
            let score = |(terms, left): (usize, &Left)| {
                let size = 0.5 * (shown.error + x * x * left.energy).ln();
                size + TERMS.price * RULES.term_cost * terms as f64
            };
            let more = shown.beside.iter().enumerate().skip(beside);
            let best = more.min_by(|a, b| score(*a).total_cmp(&score(*b)));
            match best {
                Some((terms, _)) if terms > beside => beside = terms,
                _ => return x,
            }
        }
        f64::INFINITY
    }
}

struct Detector<'a> {
    screen: Screen<'a>,
    /// The unnamed terms of the model.
    unnamed: Unnamed,
    /// Block length in samples; blocks count as independent.
    block: usize,
    asked: Asked,
    units: &'a Units,
}

impl Detector<'_> {
    fn smallest(&self, spec: &'static Spec) -> Option<Detectable> {
        let card = spec.amplitude?;
        let index = spec.parameter(card.parameter)?;
        let parameter = &spec.parameters[index];
        let middle = |p: &Parameter| p.starts.get(p.starts.len() / 2).copied();
        let mut parameters: Vec<f64> = spec.parameters.iter().map(middle).collect::<Option<_>>()?;
        let set = |parameters: &mut Vec<f64>, value: f64| {
            if card.together {
                parameters.fill(value);
            } else {
                parameters[index] = value;
            }
        };
        let first = parameters[index];
        set(&mut parameters, first);
        let mut found = None;
        for _ in 0..RULES.probes {
            let seen = self.seen(spec, &parameters, parameters[index].abs());
            found = seen;
            let Some(x) = seen else { break };
            let next = x.clamp(parameter.low.max(1e-9 * parameter.high), parameter.high);
            set(&mut parameters, next);
        }
        let amplitude = found.filter(|x| *x <= parameter.high);
        set(&mut parameters, amplitude.unwrap_or(0.0));
        for (value, own) in parameters.iter_mut().zip(spec.parameters) {
            *value = self.units.value_out(own.unit, *value);
        }
        let amplitude = amplitude.map(|x| self.units.value_out(parameter.unit, x));
        let (value, unit) = match card.said {
            Some(said) => said(&parameters),
            None => parameter.unit.spoken(parameters[index]),
        };
        let words = match amplitude {
            Some(_) => format!(
                "{} above {} {unit} would have been detected",
                card.words,
                significant(value, 2)
            ),
            None => format!("{} is not detectable at any size", card.words),
        };
        Some(Detectable {
            effect: spec.name.to_owned(),
            parameter: parameter.name.to_owned(),
            unit: parameter.unit.to_string(),
            amplitude,
            parameters,
            words,
            subject: card.words,
        })
    }

    /// The detectable amplitude, given the change of the free run by `parameters`.
    fn seen(&self, spec: &'static Spec, parameters: &[f64], size: f64) -> Option<f64> {
        let mut model = self.screen.model().clone();
        let reference = channel_reference(spec, self.screen.records()).ok()?;
        model.add(spec, parameters, reference);
        let shown = self
            .screen
            .shown(&self.unnamed, &model, self.block, RULES.terms)?;
        let x = size * self.asked.multiple(&shown);
        x.is_finite().then_some(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::{Options, diagnose};
    use crate::residual::plants::{base, records};
    use model_core::effects::spec;
    use std::sync::atomic::AtomicBool;

    /// The verdict of a diagnosis on records with `effect` at `times` its detectable amplitude.
    fn named(model: &Model, records: &[Record], effect: &str, times: f64) -> Vec<String> {
        let found = detectable(model, records).expect("stable");
        let found = found.iter().find(|d| d.effect == effect).expect("judged");
        let spec = spec(effect).expect("in the catalogue");
        let mut parameters = found.parameters.clone();
        let index = spec.parameter(&found.parameter).expect("known");
        parameters[index] = times * found.amplitude.expect("visible");
        println!("{}: {parameters:?}", found.words);
        let mut with = model.clone();
        with.add(spec, &parameters, None);
        let put_in = |record: &Record| {
            let (with, without) = (with.free_run(record), model.free_run(record));
            let change = with
                .expect("stable")
                .into_iter()
                .zip(without.expect("stable"));
            let y = record
                .y
                .iter()
                .zip(change)
                .map(|(y, (with, without))| y + with - without);
            Record {
                y: y.collect(),
                ..record.clone()
            }
        };
        let records: Vec<Record> = records.iter().map(put_in).collect();
        let go_on = AtomicBool::new(false);
        let found = diagnose(
            &base(&records),
            &records,
            &Options::default(),
            &go_on,
            &|_| (),
        );
        found.expect("a diagnosis").missing
    }

    #[test]
    fn what_is_said_to_be_seen_is_named() {
        let records = records(&[], &[], 2);
        let model = base(&records);
        let effect = "hot-film-lag";
        // `cargo xtask hidden-effects --group power` counts how often effects of this and of smaller sizes are named.
        assert_eq!(named(&model, &records, effect, 0.75), [effect]);
    }
}
