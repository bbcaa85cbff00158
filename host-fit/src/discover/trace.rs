//! Input reconstruction: for each place, the signal w(t) that would explain the model error.
//!
//! w is linear between knots and changes the free run by J·w to first order. With a Gaussian prior for a
//! small and smooth w, the posterior mean and band are those of a ridge regression; the strength of the prior
//! maximises the marginal likelihood (latent force models: Rogers & Friis 2022). The model's own parameters
//! are free as well, one set for all records, because a base fitted without w is biased. The same marginal
//! likelihood, compared between places, gives the probability of each; errors correlated over c samples count
//! as n/c.

use super::RULES;
use crate::curves::{Entry, ON, Place, RULES as CURVES, room};
use crate::data::Record;
use crate::fit::sensitivities;
use crate::model::Model;
use crate::parallel;
use crate::terms::{Judge, Judged, Units};
use crate::user_effect::Definition;
use numerics::linalg::{Cholesky, dot};
use serde::Serialize;
use std::collections::BTreeMap;

/// The reconstructed signals and the probability of each place.
#[derive(Clone, Debug, Serialize)]
pub struct Trace {
    /// The place, if it is probable enough: see [`odds`](Self::odds).
    pub place: Option<Place>,
    /// Posterior probability of each place, with equal priors.
    pub odds: BTreeMap<&'static str, f64>,
    /// The signals of each record.
    #[serde(skip)]
    pub records: Vec<TracedRecord>,
}

/// The reconstructed signals of one record.
#[derive(Clone, Debug)]
pub struct TracedRecord {
    /// The record's name.
    pub name: String,
    /// Times of the knots, s.
    pub t: Vec<f64>,
    /// A signal for each place, in the order of [`TRACED`].
    pub signals: Vec<Signal>,
}

/// w at the knots with its 95 % band, in the user's units.
#[derive(Clone, Debug, Default)]
pub struct Signal {
    /// w.
    pub value: Vec<f64>,
    /// Half width of the band.
    pub half: Vec<f64>,
}

/// The entries that are reconstructed, one for each place.
pub const TRACED: [Entry; 4] = [Entry::Jet, Entry::Delay, Entry::Level, Entry::Reading];

impl Trace {
    /// All signals as a table: record, time, and for each place w with its band.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut text = "record,t".to_owned();
        for place in TRACED.map(Entry::place) {
            let word = place.word();
            text += &format!(",{word},{word}_low,{word}_high");
        }
        text.push('\n');
        for record in &self.records {
            for (i, t) in record.t.iter().enumerate() {
                text += &format!("\"{}\",{t}", record.name.replace('"', "\"\""));
                for signal in &record.signals {
                    match (signal.value.get(i), signal.half.get(i)) {
                        (Some(w), Some(half)) => text += &format!(",{w},{},{}", w - half, w + half),
                        _ => text += ",,,",
                    }
                }
                text.push('\n');
            }
        }
        text
    }
}

/// Number of knots that one run's expression can hold.
const KNOTS_AT_ONCE: usize = 40;

/// The regression of one record at one place, in inner units.
struct Part {
    /// JᵀJ, row-major.
    gram: Vec<f64>,
    /// Jᵀe.
    right: Vec<f64>,
    /// JᵀK by the columns of K, the sensitivities of the model's own parameters.
    mixed: Vec<Vec<f64>>,
    /// KᵀK, row-major, and Kᵀe.
    own_gram: Vec<f64>,
    own_right: Vec<f64>,
    /// Prior precision of w for a strength of 1.
    prior: Vec<f64>,
    /// ln |prior|.
    log_prior: f64,
    knots: usize,
}

/// All records at one place for one strength of the prior.
struct Explained {
    /// ln of the marginal likelihood.
    log_likelihood: f64,
    /// Variance per independent error.
    variance: f64,
    strength: f64,
    /// Posterior precision of the model's own parameters given w, as a Cholesky factor, and the changes of these
    /// parameters.
    own: Cholesky,
    change: Vec<f64>,
}

/// The reconstruction for `judged`; `None` if its free run diverges or no place can be reconstructed.
pub(super) fn trace(judge: &Judge, judged: &Judged, units: &Units) -> Option<Trace> {
    let model = judged.model();
    let records = judge.first_fold();
    let together = judged.held_out.correlated();
    let errors: Vec<Vec<f64>> = records
        .iter()
        .map(|record| {
            let run = model.free_run(record).ok()?;
            Some(record.y.iter().zip(run).map(|(y, sim)| y - sim).collect())
        })
        .collect::<Option<_>>()?;
    let knots: Vec<Vec<f64>> = records.iter().map(|r| knots(model, r)).collect();
    let free = judge.free(model);
    let entries: Vec<Option<(Vec<Part>, Explained)>> = parallel::each(&TRACED[..], |entry| {
        let parts = parallel::all(0..records.len(), |i| {
            Part::of(*entry, model, &free, records[i], &errors[i], &knots[i])
        })?;
        let energy: f64 = errors.iter().map(|e| dot(e, e)).sum();
        let samples: usize = errors.iter().map(Vec::len).sum();
        let explained = explained(&parts, energy, samples as f64 / together)?;
        Some((parts, explained))
    });
    let traced = entries.iter().flatten();
    let best = traced.map(|(_, e)| e.log_likelihood).reduce(f64::max)?;
    let weight = |entry: &Option<(Vec<Part>, Explained)>| {
        entry
            .as_ref()
            .map_or(0.0, |(_, e)| (e.log_likelihood - best).exp())
    };
    let all: f64 = entries.iter().map(weight).sum();
    let odds: BTreeMap<&'static str, f64> = TRACED
        .iter()
        .zip(&entries)
        .map(|(entry, found)| (entry.place().word(), weight(found) / all))
        .collect();
    let likely = TRACED.iter().map(|entry| entry.place());
    let place = likely
        .into_iter()
        .find(|place| odds[place.word()] >= RULES.likely);
    let traced = |i: usize| {
        let signal = |(entry, found): (&Entry, &Option<(Vec<Part>, Explained)>)| {
            let own = found
                .as_ref()
                .and_then(|(parts, explained)| parts[i].signal(explained));
            own.map_or_else(Signal::default, |signal| signal.times(entry.scale(units)))
        };
        TracedRecord {
            name: records[i].name.clone(),
            t: knots[i].iter().map(|t| t * units.time).collect(),
            signals: TRACED.iter().zip(&entries).map(signal).collect(),
        }
    };
    Some(Trace {
        place,
        odds,
        records: (0..records.len()).map(traced).collect(),
    })
}

/// The knots of w, half a time constant of the flow apart; further apart in long records.
fn knots(model: &Model, record: &Record) -> Vec<f64> {
    let period = record.sample_period_s;
    let length = record.len() as f64 * period;
    let apart = (0.5 * model.time_constant())
        .max(length / RULES.knots as f64)
        .max(4.0 * period);
    let count = (length / apart).ceil() as usize;
    (0..=count).map(|i| i as f64 * apart).collect()
}

/// The model with w as parameters at the knots, at first 0; outside the knots w is 0.
fn with_signal(entry: Entry, model: &Model, knots: &[f64]) -> Option<Model> {
    let apart = knots.get(1).map_or(1.0, |next| next - knots[0]);
    let inside = knots
        .iter()
        .enumerate()
        .map(|(i, t)| format!("{t:?}, w{i}"));
    let points: Vec<String> = inside.collect();
    let (before, after) = (knots.first()? - apart, knots.last()? + apart);
    let table = format!(
        "table(t, {before:?}, 0.0, {}, {after:?}, 0.0)",
        points.join(", ")
    );
    let shift = room(entry, model);
    let longest = shift + CURVES.longest_delay_s;
    let mut text = format!(
        "name = \"trace\"\nplace = \"{}\"\nsummary = \"the missing signal\"\nexpression = \"{}\"\n",
        entry.of_effect(),
        entry.expression(&table, shift, longest, 2.0 * ON)
    );
    for i in 0..knots.len() {
        text += &format!(
            "[[parameter]]\nname = \"w{i}\"\nunit = \"{}\"\nlow = -5.0\nhigh = 5.0\nstarts = [0.0]\n",
            entry.unit().symbol()
        );
    }
    let definition = Definition::from_toml(&text, "a trace").ok()?;
    let mut with = model.clone();
    with.define(definition).ok()?;
    with.delay_later(-shift / model.sample_period_s);
    with.add(definition.spec(), &vec![0.0; knots.len()], None);
    Some(with)
}

impl Part {
    fn of(
        entry: Entry,
        model: &Model,
        free: &[usize],
        record: &Record,
        error: &[f64],
        knots: &[f64],
    ) -> Option<Self> {
        let n = knots.len();
        let mut columns: Vec<Vec<f64>> = Vec::with_capacity(n);
        for some in knots.chunks(KNOTS_AT_ONCE) {
            let with = with_signal(entry, model, some)?;
            let coordinates = with.coordinates();
            let own = |i: &usize| coordinates[*i].name.starts_with("trace.");
            let indices: Vec<usize> = (0..coordinates.len()).filter(own).collect();
            columns.extend(sensitivities(&with, record, &indices)?.1);
        }
        let own = sensitivities(model, record, free)?.1;
        let products = |a: &[Vec<f64>], b: &[Vec<f64>]| -> Vec<f64> {
            let cells = a.iter().flat_map(|a| b.iter().map(move |b| dot(a, b)));
            cells.collect()
        };
        let with_error = |columns: &[Vec<f64>]| columns.iter().map(|c| dot(c, error)).collect();
        let mixed = own
            .iter()
            .map(|k| columns.iter().map(|j| dot(j, k)).collect());
        let prior = prior(n);
        Some(Self {
            gram: products(&columns, &columns),
            right: with_error(&columns),
            mixed: mixed.collect(),
            own_gram: products(&own, &own),
            own_right: with_error(&own),
            log_prior: log_determinant(&Cholesky::new(&prior, n), n),
            prior,
            knots: n,
        })
    }

    /// Posterior precision JᵀJ + `strength`·prior.
    fn posterior(&self, strength: f64) -> Cholesky {
        let pairs = self.gram.iter().zip(&self.prior);
        let sum: Vec<f64> = pairs.map(|(gram, prior)| gram + strength * prior).collect();
        Cholesky::new(&sum, self.knots)
    }

    /// Posterior mean with twice its standard deviation.
    fn signal(&self, explained: &Explained) -> Option<Signal> {
        let posterior = self.posterior(explained.strength);
        let mut right = self.right.clone();
        for (mixed, change) in self.mixed.iter().zip(&explained.change) {
            let pairs = right.iter_mut().zip(mixed);
            pairs.for_each(|(right, x)| *right -= change * x);
        }
        let value = posterior.backward(posterior.forward(&right));
        let mixed: Vec<Vec<f64>> = self.mixed.iter().map(|m| posterior.forward(m)).collect();
        let half = (0..self.knots).map(|i| {
            let unit: Vec<f64> = (0..self.knots)
                .map(|j| f64::from(u8::from(i == j)))
                .collect();
            let root = posterior.forward(&unit);
            let along: Vec<f64> = mixed.iter().map(|m| dot(m, &root)).collect();
            let by_own = explained.own.forward(&along);
            let spread = dot(&root, &root) + dot(&by_own, &by_own);
            1.96 * (explained.variance * spread).sqrt()
        });
        let half: Vec<f64> = half.collect();
        value
            .iter()
            .all(|w| w.is_finite())
            .then_some(Signal { value, half })
    }
}

impl Signal {
    fn times(mut self, scale: f64) -> Self {
        let all = self.value.iter_mut().chain(&mut self.half);
        all.for_each(|w| *w *= scale);
        self
    }
}

/// Prior precision: second differences, and a small weight on w itself.
fn prior(n: usize) -> Vec<f64> {
    let mut prior = vec![0.0; n * n];
    for i in 0..n {
        prior[i * n + i] += RULES.smallness;
    }
    for i in 1..n.saturating_sub(1) {
        let row = [(i - 1, 1.0), (i, -2.0), (i + 1, 1.0)];
        for (a, x) in row {
            for (b, y) in row {
                prior[a * n + b] += x * y;
            }
        }
    }
    prior
}

fn log_determinant(factor: &Cholesky, n: usize) -> f64 {
    let known = (0..n).map(|i| factor.inverse(i)).filter(|x| *x > 0.0);
    -2.0 * known.map(f64::ln).sum::<f64>()
}

/// The strength of the prior with the largest marginal likelihood.
fn explained(parts: &[Part], energy: f64, independent: f64) -> Option<Explained> {
    let count: usize = parts.iter().map(|part| part.knots).sum();
    let trace = |part: &Part| {
        (0..part.knots)
            .map(|i| part.gram[i * part.knots + i])
            .sum::<f64>()
    };
    let size = parts.iter().map(trace).sum::<f64>() / count.max(1) as f64;
    let each = (-12..=16).map(|step| {
        let strength = size * 10_f64.powf(0.5 * f64::from(step));
        let (mut left, mut log) = (energy, 0.0);
        let p = parts.first().map_or(0, |part| part.own_right.len());
        let (mut gram, mut right) = (vec![0.0; p * p], vec![0.0; p]);
        for part in parts {
            let posterior = part.posterior(strength);
            let root = posterior.forward(&part.right);
            left -= dot(&root, &root);
            let mixed: Vec<Vec<f64>> = part.mixed.iter().map(|m| posterior.forward(m)).collect();
            for i in 0..p {
                right[i] += part.own_right[i] - dot(&mixed[i], &root);
                for j in 0..p {
                    gram[i * p + j] += part.own_gram[i * p + j] - dot(&mixed[i], &mixed[j]);
                }
            }
            let n = part.knots as f64;
            log += 0.5
                * (part.log_prior + n * strength.ln() - log_determinant(&posterior, part.knots));
        }
        let own = Cholesky::new(&gram, p);
        let root = own.forward(&right);
        left -= dot(&root, &root);
        log -= 0.5 * log_determinant(&own, p);
        let change = own.backward(root);
        Explained {
            own,
            change,
            log_likelihood: log - 0.5 * independent * (left / independent).ln(),
            variance: left / independent,
            strength,
        }
    });
    let known = each.filter(|e| e.log_likelihood.is_finite());
    known.max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::plants::{base, records};
    use crate::terms::Bench;

    /// A jet that weakens as its plenum empties: the signal is found at the jet, negative during long
    /// blowing.
    #[test]
    fn a_droop_is_traced_to_the_jet() {
        let records = records(&["plenum-droop"], &[], 4);
        let model = base(&records);
        let bench = Bench::of(&model, &records).expect("records to learn from");
        let judged = bench.judge.refitted(&bench.given).expect("a stable model");
        let found = trace(&bench.judge, &judged, &bench.units).expect("a trace");
        println!("{:?}", found.odds);
        assert_eq!(found.place, Some(Place::Jet));
        let mut blown = (0.0, 0.0);
        for (traced, record) in found.records.iter().zip(&records) {
            let jet = &traced.signals[0];
            for ((t, w), half) in traced.t.iter().zip(&jet.value).zip(&jet.half) {
                let k = (t / record.sample_period_s) as usize;
                let long = k >= 600
                    && record
                        .u
                        .get(k - 600..=k)
                        .is_some_and(|u| u.iter().all(|u| *u > 0.5));
                if long {
                    blown.0 += w;
                    blown.1 += half;
                }
            }
        }
        assert!(blown.1 > 0.0 && blown.0 < -blown.1, "{blown:?}");
        let csv = found.csv();
        let lines = 1 + found.records.iter().map(|r| r.t.len()).sum::<usize>();
        assert_eq!(csv.lines().count(), lines);
        assert!(
            csv.lines().all(|line| line.matches(',').count() == 13),
            "{csv}"
        );
    }
}
