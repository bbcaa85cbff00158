//! Plants that the records do not exclude, on which a law must keep attachment.
//!
//! Each is the model with one change as large as the records allow and everything else refitted: delay, gain
//! and time constants at the ends of their 95 % intervals; each effect of the catalogue at the largest size
//! not excluded; delay laws that fit equally well; and for each effect of the model the other members of its
//! equivalence set. In addition: effects at the size that a diagnosis detects with 80 % power. If that size
//! is larger than the records allow, the trial only gives a warning.

use super::bench::Player;
use super::record_judge::{RecordJudge, Refitted};
use super::rules::RULES;
use crate::data::Record;
use crate::fit::{FitOptions, fit, fit_with_effect, starts};
use crate::model::{Delay, Model};
use crate::parallel;
use crate::picture::{significant, time};
use crate::power::detectable;
use crate::preparation::Preparation;
use crate::simulate::SimulateError;
use crate::terms::Units;
use model_core::effect::{Place, Spec, Unit};

/// Half width of a 95 % interval in standard errors.
const DEVIATES: f64 = 1.96;

/// A plant that the records do not exclude, or an effect below the detectable size.
#[derive(Clone, Debug, PartialEq)]
pub struct PossibleFlow {
    /// The difference from the model, in words.
    pub name: String,
    /// One-sided p-value of the records under this plant; 0.025 at the end of a 95 % interval. A plant with a smaller
    /// p-value is excluded, and its trial only gives a warning. Its effect has the size that is detected in 80 % of
    /// cases ([`detectable`](crate::power::detectable)).
    pub p_value: f64,
    /// The plant in the units of the given model.
    pub model: Model,
}

impl PossibleFlow {
    /// Whether the plant is consistent with the records.
    #[must_use]
    pub fn is_possible(&self) -> bool {
        self.p_value >= RULES.not_excluded
    }
}

/// The plants, other than `model`, that the records of `prepared` do not exclude. None if the records
/// contain no information about `model`.
///
/// # Errors
/// A missing channel, or a model whose free run diverges.
pub fn possible_flows(
    model: &Model,
    prepared: &Preparation,
) -> Result<Vec<PossibleFlow>, SimulateError> {
    let units = Units::of(model, prepared);
    let records = model.targets(&prepared.records);
    let inner = records
        .iter()
        .map(|record| units.record_in(record))
        .collect();
    let Some(judge) = RecordJudge::of(&units.model_in(model), inner)? else {
        return Ok(Vec::new());
    };
    let mut flows = intervals(&judge);
    flows.extend(unseen(&judge, model, &records, &units));
    let specs: Vec<&'static Spec> = judge.best.candidates().collect();
    let largest = parallel::some(&specs, |spec| {
        can_be_tried(&judge, spec).then(|| match spec.place {
            Place::Delay => delay_laws(&judge, spec),
            Place::Jet | Place::Flow | Place::Sensor => largest_sizes(&judge, spec, &units),
        })
    });
    flows.extend(largest.into_iter().flatten());
    flows.extend(equivalents(&judge));
    for flow in &mut flows {
        flow.model = units.model_out(&flow.model);
    }
    Ok(flows)
}

/// Whether an effect is not in the model and would be visible on the records. An effect that only the dead time hides
/// may still be present.
fn can_be_tried(judge: &RecordJudge, spec: &Spec) -> bool {
    let on_off = judge.records().iter().all(|record| record.is_on_off());
    let present = judge
        .best
        .effect_names()
        .iter()
        .any(|name| name == spec.name);
    !present && spec.channel.is_none() && spec.needs.unmet(on_off, f64::INFINITY).is_none()
}

/// The model with each effect at its detectable size, everything else refitted.
fn unseen(
    judge: &RecordJudge,
    model: &Model,
    records: &[Record],
    units: &Units,
) -> Vec<PossibleFlow> {
    // A model at the stability limit has no detectable sizes.
    let found = detectable(model, records).unwrap_or_default();
    parallel::some(&found, |found| {
        found.amplitude?;
        let spec = judge
            .best
            .spec(&found.effect)
            .filter(|spec| can_be_tried(judge, spec))?;
        let inner: Vec<f64> = spec
            .parameters
            .iter()
            .zip(&found.parameters)
            .map(|(card, value)| units.value_in(card.unit, *value))
            .collect();
        let flow = judge.refitted(&with_effect(judge, spec, &inner))?;
        Some(PossibleFlow {
            name: format!(
                "{}{}, not seen",
                spec.name,
                in_words(spec, &found.parameters)
            ),
            p_value: flow.p_value,
            model: flow.model,
        })
    })
}

/// Characteristics of a step response: delay in samples, gain in y, time constants in samples.
fn step_figures(model: &Model, length: usize) -> Option<[f64; 4]> {
    let bench = Player::<f64>::of(model);
    let mut state = bench.at_rest();
    let mut play = |on: bool| -> Vec<f64> {
        (0..length)
            .map(|_| bench.step(&mut state, on).next)
            .collect()
    };
    let (rise, fall) = (play(true), play(false));
    let (high, low) = (*rise.last()?, *fall.last()?);
    let delay = model.delay.present(0.5 * high, model.sample_period_s);
    // The area above a step response is the mean delay, dead time included.
    let area = |run: &[f64], end: f64| run.iter().map(|y| y - end).sum::<f64>() / (high - low);
    let figures = [
        delay,
        high,
        -area(&rise, high) - delay,
        area(&fall, low) - delay,
    ];
    figures.iter().all(|x| x.is_finite()).then_some(figures)
}

/// Names of [`step_figures`].
const FIGURES: [&str; 4] = ["delay", "gain", "attachment time", "separation time"];

/// The model with delay, gain and time constants at either end of their 95 % intervals.
fn intervals(judge: &RecordJudge) -> Vec<PossibleFlow> {
    let length = Player::<f64>::of(&judge.best).span(RULES.settled_mean);
    let Some(at_best) = step_figures(&judge.best, length) else {
        return Vec::new();
    };
    let values = judge.best.values();
    let places: Vec<usize> = judge.places(&judge.best).into_iter().flatten().collect();
    let n = places.len();
    let deviations: Vec<f64> = (0..n).map(|i| judge.covariance[i * n + i].sqrt()).collect();
    // Gradients by central differences over a tenth of a standard error, within the linear range.
    let gradients: Vec<Option<[f64; 4]>> = parallel::each(0..n, |i| {
        let step = 0.1 * deviations[i];
        let moved = |by: f64| {
            let mut moved = values.clone();
            moved[places[i]] += by;
            step_figures(&judge.best.with_values(&moved), length)
        };
        let (above, below) = (moved(step)?, moved(-step)?);
        let slope = |q: usize| (above[q] - below[q]) / (2.0 * step);
        Some([slope(0), slope(1), slope(2), slope(3)])
    });
    let mut flows = Vec::new();
    for (q, name) in FIGURES.iter().enumerate() {
        let slope = |i: usize| gradients[i].map_or(0.0, |g| g[q]);
        // C·g, the direction in which the characteristic varies most within the confidence region.
        let along: Vec<f64> = (0..n)
            .map(|i| (0..n).map(|j| judge.covariance[i * n + j] * slope(j)).sum())
            .collect();
        let variance: f64 = (0..n).map(|i| slope(i) * along[i]).sum();
        if variance.is_nan() || variance <= 0.0 {
            continue;
        }
        for side in [-1.0, 1.0] {
            // The step is shortened below 1.96 standard errors if the linear approximation fails.
            let ends = (0..RULES.interval_steps).map(|step| 0.8_f64.powf(f64::from(step)));
            let flow = ends.into_iter().find_map(|share| {
                let mut moved = values.clone();
                for (place, along) in places.iter().zip(&along) {
                    moved[*place] += share * side * DEVIATES * along / variance.sqrt();
                }
                let flow = judge.as_it_is(judge.best.with_values(&moved))?;
                (flow.p_value >= RULES.not_excluded).then_some(flow)
            });
            let Some(flow) = flow else { continue };
            let Some(now) = step_figures(&flow.model, length) else {
                continue;
            };
            let change = 100.0 * (now[q] / at_best[q] - 1.0);
            flows.push(PossibleFlow {
                name: format!("{name} {}{} %", sign(change), significant(change.abs(), 2)),
                p_value: flow.p_value,
                model: flow.model,
            });
        }
    }
    flows
}

fn sign(x: f64) -> &'static str {
    if x < 0.0 { "−" } else { "+" }
}

/// Parameters between two ends; logarithmic if they span orders of magnitude.
fn between(spec: &Spec, mild: &[f64], worst: &[f64], size: f64) -> Vec<f64> {
    let ends = spec.parameters.iter().zip(mild.iter().zip(worst));
    ends.map(|(card, (mild, worst))| {
        if card.is_logarithmic() && *mild > 0.0 && *worst > 0.0 {
            mild * (worst / mild).powf(size)
        } else {
            mild + size * (worst - mild)
        }
    })
    .collect()
}

/// Paths along which an effect grows from 0 to its largest size.
fn ways(judge: &RecordJudge, spec: &'static Spec) -> Vec<[Vec<f64>; 2]> {
    let records: Vec<_> = judge.records().iter().collect();
    let rows = starts(&judge.best, spec, &records);
    let Some(middle) = rows.get(rows.len() / 2) else {
        return Vec::new();
    };
    if spec.parameters.is_empty() {
        return vec![[Vec::new(), Vec::new()]];
    }
    if let Some(card) = spec.amplitude
        && let Some(index) = spec.parameter(card.parameter)
    {
        let parameter = &spec.parameters[index];
        let most = rows.iter().map(|row| row[index].abs()).fold(0.0, f64::max);
        let with = |amplitude: f64| {
            let mut parameters = middle.clone();
            let amplitude = amplitude.clamp(parameter.low, parameter.high);
            if card.together {
                parameters.fill(amplitude);
            } else {
                parameters[index] = amplitude;
            }
            parameters
        };
        let mut ways = vec![[with(0.0), with(most)]];
        if parameter.low < 0.0 {
            ways.push([with(0.0), with(-most)]);
        }
        return ways;
    }
    // Without an amplitude, the path leads from the corner of the parameter ranges with the smallest change of the run
    // to the starting values with the largest.
    let change = |parameters: &Vec<f64>| {
        let flow = judge.refitted(&with_effect(judge, spec, parameters));
        flow.map_or(f64::INFINITY, |flow| flow.change)
    };
    let corners =
        crate::fit::combinations(spec.parameters.iter().map(|card| vec![card.low, card.high]));
    let by_change = |a: &Vec<f64>, b: &Vec<f64>| change(a).total_cmp(&change(b));
    let finite = rows.iter().filter(|row| change(row).is_finite()).cloned();
    match (
        corners.into_iter().min_by(by_change),
        finite.max_by(by_change),
    ) {
        (Some(mild), Some(worst)) => vec![[mild, worst]],
        _ => Vec::new(),
    }
}

fn with_effect(judge: &RecordJudge, spec: &'static Spec, parameters: &[f64]) -> Model {
    let mut model = judge.best.clone();
    model.add(spec, parameters, None);
    model
}

/// The effect at the largest size that the records do not exclude, in each of its directions.
fn largest_sizes(judge: &RecordJudge, spec: &'static Spec, units: &Units) -> Vec<PossibleFlow> {
    let found = ways(judge, spec).into_iter().filter_map(|[mild, worst]| {
        let (size, parameters, flow) = largest_size(judge, spec, &mild, &worst)?;
        let said: Vec<f64> = spec
            .parameters
            .iter()
            .zip(&parameters)
            .map(|(card, value)| units.value_out(card.unit, *value))
            .collect();
        let any = if size >= 1.0 {
            ", the largest usual size"
        } else {
            ""
        };
        Some(PossibleFlow {
            name: format!("{}{}{any}", spec.name, in_words(spec, &said)),
            p_value: flow.p_value,
            model: flow.model,
        })
    });
    found.collect()
}

fn in_words(spec: &Spec, parameters: &[f64]) -> String {
    let amplitude = spec.amplitude.and_then(|card| {
        let index = spec.parameter(card.parameter)?;
        Some(match card.said {
            Some(said) => said(parameters),
            None => spec.parameters[index].unit.spoken(parameters[index]),
        })
    });
    match amplitude {
        Some((value, unit)) => format!(" of {} {unit}", significant(value, 2))
            .trim_end()
            .to_owned(),
        None if parameters.is_empty() => String::new(),
        None => {
            let each = spec.parameters.iter().zip(parameters);
            let each: Vec<String> = each
                .map(|(card, value)| {
                    let value = significant(*value, 2);
                    match card.unit {
                        Unit::None => format!("{} {value}", card.name),
                        unit => format!("{} {value} {unit}", card.name),
                    }
                })
                .collect();
            format!(" ({})", each.join(", "))
        }
    }
}

/// Doubles the size until the records exclude it, then halves the step.
fn largest_size(
    judge: &RecordJudge,
    spec: &'static Spec,
    mild: &[f64],
    worst: &[f64],
) -> Option<(f64, Vec<f64>, Refitted)> {
    let mut start: Option<Model> = None;
    let at = |size: f64, start: &Option<Model>| {
        let parameters = between(spec, mild, worst, size);
        let fresh = with_effect(judge, spec, &parameters);
        // The refit starts from the refit at a smaller size.
        let model = match start {
            Some(model) => Model {
                effects: fresh.effects,
                ..model.clone()
            },
            None => fresh,
        };
        let flow = judge.refitted(&model)?;
        (flow.p_value >= RULES.not_excluded).then_some((size, parameters, flow))
    };
    let mut largest = None;
    let mut excluded = f64::INFINITY;
    let mut size = RULES.smallest_size;
    for _ in 0..RULES.sizes {
        match at(size, &start) {
            Some(found) => {
                start = Some(found.2.model.clone());
                largest = Some(found);
            }
            None => excluded = size,
        }
        let low = largest.as_ref().map_or(0.0, |(size, _, _)| *size);
        if low >= 1.0 {
            break;
        }
        size = if excluded.is_finite() {
            0.5 * (low + excluded)
        } else {
            (2.0 * low).min(1.0)
        };
    }
    largest
}

/// Plants with another delay law: the best fit, and the ends of the interval of its variation.
fn delay_laws(judge: &RecordJudge, spec: &'static Spec) -> Vec<PossibleFlow> {
    let records: Vec<_> = judge.records().iter().collect();
    let options = FitOptions {
        constant: judge.best.constant != 0.0,
        iterations: RULES.law_iterations,
        ..FitOptions::default()
    };
    let fits = starts(&judge.best, spec, &records)
        .into_iter()
        .filter_map(|parameters| {
            fit(&with_effect(judge, spec, &parameters), &records, &options).ok()
        });
    let by_square =
        |a: &crate::fit::Fit, b: &crate::fit::Fit| a.mean_square().total_cmp(&b.mean_square());
    let Some(best) = fits.min_by(by_square) else {
        return Vec::new();
    };
    let variation = |model: &Model| match &model.delay {
        Delay::Law(law) => {
            let [low, high] = law.range(model.sample_period_s);
            let edges = law.transport(model.sample_period_s).map_or([0.0; 2], |t| {
                use model_core::delay::Transport;
                t.held_back()
            });
            high - low + (edges[0] - edges[1]).abs()
        }
        Delay::Fixed { .. } => 0.0,
    };
    let values = best.model.values();
    let n = best.free.len();
    let known = |i: usize, j: usize| {
        best.covariance
            .get(i * n + j)
            .copied()
            .filter(|v| v.is_finite())
            .unwrap_or(0.0)
    };
    let slopes: Vec<f64> = best
        .free
        .iter()
        .enumerate()
        .map(|(i, index)| {
            let step = 0.1 * known(i, i).max(0.0).sqrt();
            if step <= 0.0 {
                return 0.0;
            }
            let moved = |by: f64| {
                let mut moved = values.clone();
                moved[*index] += by;
                variation(&best.model.with_values(&moved))
            };
            (moved(step) - moved(-step)) / (2.0 * step)
        })
        .collect();
    let along: Vec<f64> = (0..n)
        .map(|i| (0..n).map(|j| known(i, j) * slopes[j]).sum())
        .collect();
    let variance: f64 = slopes.iter().zip(&along).map(|(s, a)| s * a).sum();
    let mut models = vec![best.model.clone()];
    if variance > 0.0 {
        let mut moved = values.clone();
        for (index, along) in best.free.iter().zip(&along) {
            moved[*index] += DEVIATES * along / variance.sqrt();
        }
        models.push(best.model.with_values(&moved));
    }
    let judged = models.into_iter().filter_map(|model| {
        let said = variation(&model) * model.sample_period_s;
        let flow = judge.as_it_is(model)?;
        (flow.p_value >= RULES.not_excluded).then(|| PossibleFlow {
            name: format!("{} that varies by {}", spec.name, time(said, 2)),
            p_value: flow.p_value,
            model: flow.model,
        })
    });
    judged.collect()
}

/// The model with one effect replaced by another that fits equally well.
fn equivalents(judge: &RecordJudge) -> Vec<PossibleFlow> {
    let records: Vec<_> = judge.records().iter().collect();
    let options = FitOptions {
        constant: judge.best.constant != 0.0,
        ..FitOptions::default()
    };
    let named = judge.best.effects.iter().filter_map(|added| {
        let spec = judge
            .best
            .candidates()
            .find(|spec| spec.name == added.name)?;
        Some((added, spec))
    });
    let pairs: Vec<(String, Model, &'static Spec)> = named
        .flat_map(|(added, own)| {
            let mut without = judge.best.clone();
            without.effects.retain(|other| other.name != added.name);
            let others = judge
                .best
                .candidates()
                .filter(|spec| spec.place == own.place);
            others
                .filter(|spec| can_be_tried(judge, spec))
                .map(|spec| (added.name.clone(), without.clone(), spec))
                .collect::<Vec<_>>()
        })
        .collect();
    parallel::some(&pairs, |(name, without, spec)| {
        let fitted = fit_with_effect(without, spec, &records, &options).ok()?;
        let flow = judge.as_it_is(fitted.model)?;
        (flow.p_value >= RULES.not_excluded).then(|| PossibleFlow {
            name: format!("{} in the place of {name}", spec.name),
            p_value: flow.p_value,
            model: flow.model,
        })
    })
}
