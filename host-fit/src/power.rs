//! What would have been seen, had it been there: the amplitude of each effect at which
//! the diagnosis of these records names it in eight cases of ten.
//!
//! The amplitude has to pass what decides there. Whoever has such records identifies a model on them
//! first, and its lags imitate what they can: what the effect changes in the free run, less what the
//! model's own parameters do in its place and less ever more lags and other terms without a name, as long as
//! each is worth its price, must be worth a name and be significant among all alternatives. A gain x²·‖z‖² scatters by 2x·S, S² = Σ (z·e)² over blocks longer
//! than the correlation of the error e; what is asked for has to be passed by 0.84 of that.

use crate::data::Record;
use crate::diagnose::RULES as NAMED;
use crate::fit::channel_reference;
use crate::model::Model;
use crate::picture::significant;
use crate::residual::NoiseSource;
use crate::rules;
use crate::simulate::SimulateError;
use crate::terms::{Bench, Judge, Known, Left, RULES as TERMS, Screen, Shown, Units, Unnamed};
use model_core::effect::{Parameter, Spec};
use model_core::effects::SPECS;
use rayon::prelude::*;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal};

rules! {
    /// Which amplitude of an effect would have been seen.
    pub struct Rules in "power";

    /// What is seen is seen so often.
    power: f64 = 0.8, "share of cases", "convention; `cargo xtask calibrate` counts";
    /// Lags and other terms without a name that may imitate it …
    terms: usize = 6, "", "what `identify` takes of a flow with two memories";
    /// … each for the price of so many parameters.
    term_cost: f64 = 2.0, "parameters", "a lag and its weight";
    /// What passes to first order has to be so many times as large: a search that lets all lags move imitates more.
    margin: f64 = 2.0, "times the amplitude", "`cargo xtask calibrate`: 13 of 37 were named without it, 9 of 15 with it before pairs of lags counted as one term";
    /// An effect that is not linear in its amplitude is probed this often, ever nearer to the amplitude that comes out.
    probes: usize = 4, "", "judgement";
}

/// The smallest amplitude that would have been seen.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Detectable {
    /// The effect.
    pub effect: String,
    /// The parameter that is its amplitude.
    pub parameter: String,
    /// The amplitude's unit.
    pub unit: String,
    /// The amplitude that is named with 80 % power; none if no amplitude in the
    /// parameter's range is.
    pub amplitude: Option<f64>,
    /// All parameters of the effect of that amplitude, in the order of its card.
    pub parameters: Vec<f64>,
    /// The same in words.
    pub words: String,
}

/// For each effect of the catalogue that has an amplitude, is not in the model
/// and can be tried on these records: the amplitude that would have been named. The effect's
/// other parameters are at the middle of the catalogue's starting values. `usual` is the share of
/// the held-out energy that noise alone lets the best of all effects take
/// ([`Diagnosis::usual_by_chance`](crate::diagnose::Diagnosis::usual_by_chance)).
///
/// # Errors
/// A missing channel of the model's own, or a free run that diverges.
pub fn detectable(
    model: &Model,
    records: &[Record],
    usual: f64,
) -> Result<Vec<Detectable>, SimulateError> {
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
        asked: Asked::of(&bench.judge, held_out.rmse(), usual),
        units: &bench.units,
        screen,
    };
    let specs = SPECS.par_iter();
    let found: Vec<Option<Detectable>> = specs
        .filter(|spec| detector.screen.pointless(spec).is_none())
        .map(|spec| detector.smallest(spec))
        .collect();
    Ok(found.into_iter().flatten().collect())
}

/// What has to be left of an effect.
struct Asked {
    /// Energy, as a share of that of the validation error.
    share: f64,
    /// Standard deviations by which it is passed in so many cases.
    often: f64,
}

impl Asked {
    fn of(judge: &Judge, rmse: f64, usual: f64) -> Self {
        // Where no noise floor is known, a name has to take more.
        let worthwhile = match judge.noise_source {
            NoiseSource::Measured | NoiseSource::Repeats => NAMED.worthwhile,
            NoiseSource::Scatter => NAMED.worthwhile_in_the_dark,
        };
        // What leaves the error at the floor is not looked for.
        let from_floor = (judge.over_noise(rmse) / TERMS.at_the_floor).powi(2);
        let taken = (1.0 - (1.0 - worthwhile).powi(2))
            .max(usual.min(0.99))
            .max(1.0 - from_floor);
        Self {
            share: taken / (1.0 - taken),
            often: Normal::standard().inverse_cdf(RULES.power),
        }
    }

    /// The multiple that passes with what is left.
    fn passes(&self, left: &Left, error: f64) -> f64 {
        let scatter = self.often * left.deviation;
        let wanted = scatter * scatter + left.energy * self.share * error;
        (scatter + wanted.sqrt()) / left.energy
    }

    /// The multiple of what is shown that is seen: `margin` times what passes beside as many terms as are worth it then. One of
    /// them may be worth little without the next: two lags side by side are an echo.
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
    /// What the model may have without a name.
    unnamed: Unnamed,
    /// Samples that count as independent of the next as many.
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
                "{} above {} {unit} would have been seen",
                card.words,
                significant(value, 2)
            ),
            None => format!("{} of any size could have stayed unseen", card.words),
        };
        Some(Detectable {
            effect: spec.name.to_owned(),
            parameter: parameter.name.to_owned(),
            unit: parameter.unit.to_string(),
            amplitude,
            parameters,
            words,
        })
    }

    /// The amplitude that is named, from the change that `parameters` of that size make.
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

    /// What the diagnosis says of records into which `effect` was put, `times` as large as
    /// what is said to be seen.
    fn named(model: &Model, records: &[Record], effect: &str, times: f64) -> Vec<String> {
        let found = detectable(model, records, 0.01).expect("stable");
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
    fn what_is_said_to_be_seen_is_named_and_a_sixth_of_it_is_not() {
        let records = records(&[], &[], 2);
        let model = base(&records);
        let effect = "hot-film-lag";
        assert_eq!(named(&model, &records, effect, 0.75), [effect]);
        assert!(named(&model, &records, effect, 0.16).is_empty());
    }
}
