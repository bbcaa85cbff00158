//! The structure of a base model, chosen by the validation error: the number of lags, the delay law, and the
//! sensor's offset.

use super::bench::Bench;
use super::evidence::p_value;
use super::hypothesis::Hypothesis;
use super::judge::{Judge, Judged};
use super::laws::at_another_average;
use super::likely_delay::at_the_likely_delay;
use super::linear::{self, second_order};
use super::search::{Found, Search};
use super::settled::{Settled, settled};
use super::term::{Term, take_delay_law};
use super::{Known, RULES};
use crate::data::Record;
use crate::excitation::bears_little;
use crate::model::{Delay, Model};
use crate::parallel;
use crate::search::{Progress, Settings, StopReason};
use crate::simulate::SimulateError;
use model_core::effects::{ConstantDelay, SaturatingDelay};
use std::sync::atomic::{AtomicBool, Ordering};

/// Level of y, in inner units, above which a separate delay of the attached flow is tried.
const LEVEL: f64 = 0.6;
/// Least difference between the delay of the attached flow and the delay at rest, samples.
const LEAST_RISE: f64 = 4.0;

/// A base model and the effort of its search.
#[derive(Clone, Debug)]
pub struct Automatic {
    /// The model, in the user's units.
    pub model: Model,
    /// Structures that were refitted in full.
    pub tried: usize,
    /// Evaluations of the direct search over the delays.
    pub evaluations: usize,
    /// Why that ended.
    pub stop: StopReason,
}

/// How the base model is searched.
pub struct Frame<'a> {
    /// Delay laws of which the best is kept.
    pub laws: &'a [Delay],
    /// Whether delays between samples are kept even if they do not lower the error enough.
    pub interpolated: bool,
    /// The direct search over the delays.
    pub settings: Settings,
}

/// The base model of `records`: the structure by validation error, then the best delay law, then lags and delays by
/// mesh adaptive direct search on the free run.
///
/// # Errors
/// [`SimulateError`] if no law gives a stable free run; `None` without data to fit.
pub fn base_model(
    records: &[Record],
    how: &Frame<'_>,
    interrupt: &AtomicBool,
    progress: &(dyn Fn(&str) + Sync),
    snapshots: &dyn Progress,
) -> Option<Result<Automatic, SimulateError>> {
    let laws = how.laws;
    let frame = Model {
        sample_period_s: records.first()?.sample_period_s,
        ..Model::default()
    };
    let first = Model {
        delay: laws.first()?.clone(),
        ..frame
    };
    let Bench {
        units,
        judge,
        given,
        mid_run,
        ..
    } = Bench::of(&first, records)?;
    let search = Search {
        judge: &judge,
        known: Known::of(&judge.learning(0)),
        effects: false,
        most_effects: 0,
        most_parameters: usize::MAX,
        interrupt,
        progress,
    };
    let may_be_constant = laws.iter().any(|law| matches!(law, Delay::Fixed { .. }));
    if bears_little(records) && may_be_constant {
        progress("first and second order with dead time");
        if let Some(model) = linear::alone(&judge, &given) {
            return Some(Ok(Automatic {
                model: units.model_out(&model),
                tried: 2,
                evaluations: 0,
                stop: StopReason::LocallyOptimal,
            }));
        }
    }
    let with_law = |law: &Delay| Model {
        delay: law.clone(),
        ..given.clone()
    };
    let mut roots: Vec<Hypothesis> = Vec::new();
    let mut refused = None;
    for law in laws {
        progress("the model with the fewest lags");
        match search.root(&with_law(law), mid_run) {
            Ok(root) => roots.push(root),
            Err(error) => refused = Some(error),
        }
    }
    let by_score = |a: &&Hypothesis, b: &&Hypothesis| a.judged.size().total_cmp(&b.judged.size());
    progress("averaging times of the delay law");
    // A law that the user requests keeps the averaging time of eq. (1).
    let may_average = laws.len() > 1;
    let of_roots = roots.iter().filter(|_| may_average);
    let of_roots = of_roots.map(|root| (root.judged.model(), &root.judged.model().delay));
    let averaged = at_another_average(&judge, of_roots);
    progress("first and second order with dead time");
    let linear = match may_be_constant {
        true => linear::baselines(&given, &judge.learning(0)),
        false => Vec::new(),
    };
    let linear: Vec<Hypothesis> = parallel::some(&linear, |model| {
        judge.refitted(model).ok().map(Hypothesis::new)
    });
    let Some(root) = roots
        .iter()
        .min_by(by_score)
        .or(linear.iter().min_by(by_score))
    else {
        return refused.map(Err);
    };
    // The search starts from a delay law only if it is significantly better than a constant delay.
    let root = Hypothesis::new(without_needless_law(&judge, root.judged.clone(), laws));
    progress("second order with the same delay");
    let second = second_order(&judge, &root, may_be_constant);
    // The averaging time is a parameter and must lower the error like every other parameter.
    let averaged = averaged.filter(|averaged| averaged.size() + RULES.price < root.judged.size());
    let mut found = search.run(root, Some(&|| second.iter().cloned().collect()));
    // Lags that were found at another averaging time can stand for the law.
    if let Some(averaged) = averaged {
        let other = search.run(Hypothesis::new(averaged), None);
        let tried = found.tried + other.tried;
        if other.best.score() < found.best.score() {
            found = other;
        }
        found.tried = tried;
    }
    // Input coefficients of both signs (a zero, as of an inverse response) are outside first and second order. If
    // such a model is clearly better than the best structure so far, the search starts again from it.
    let lead = |hypothesis: &&Hypothesis| {
        let b = &hypothesis.judged.model().b;
        b.iter().any(|b| *b > 0.0) && b.iter().any(|b| *b < 0.0)
    };
    if let Some(better) = linear.iter().filter(lead).min_by(by_score)
        && better.judged.size() + RULES.linear_better < found.best.judged.size()
    {
        let tried = found.tried;
        found = search.run(better.clone(), None);
        found.tried += tried;
    }
    if let Some(plain) = plain_enough(&found) {
        found.best = plain;
    }
    // With the lags that were found, another law may have a lower error than the one that was chosen without them.
    let mut others: Vec<Delay> = roots
        .iter()
        .map(|root| root.judged.model().delay.clone())
        .collect();
    if laws.len() > 1 {
        others.push(saturating(found.best.judged.model()));
    }
    for law in &others {
        let mut model = found.best.judged.model().clone();
        if model.delay.is_alike(law) || interrupt.load(Ordering::Relaxed) {
            continue;
        }
        take_delay_law(&mut model, law);
        let Ok(judged) = judge.refitted(&model) else {
            continue;
        };
        if judged.size() < found.best.judged.size() {
            let start = Hypothesis {
                terms: found.best.terms.clone(),
                ..Hypothesis::new(judged)
            };
            let tried = found.tried;
            found = search.run(start, None);
            found.tried += tried;
        }
    }
    if may_average && !interrupt.load(Ordering::Relaxed) {
        progress("averaging times of the delay law");
        let own = found.best.judged.model();
        let lawful = others.iter().chain([&own.delay]);
        let best = at_another_average(&judge, lawful.map(|law| (own, law)));
        // The averaging time is a parameter and must lower the error like every other parameter.
        if let Some(best) = best.filter(|best| best.size() + RULES.price < found.best.judged.size())
        {
            found.best.judged = best;
            progress("removing terms that are not needed");
            found.best = search.pruned(found.best, &found.root);
        }
    }
    let lawful = without_needless_law(&judge, found.best.judged, laws);
    let judged = if how.interpolated {
        lawful
    } else {
        on_samples_unless_it_costs(&judge, lawful)
    };
    progress("lags and delays by direct search");
    let Settled {
        judged,
        evaluations,
        stop,
    } = settled(&judge, judged, &how.settings, snapshots, interrupt);
    progress("the dead time under the noise model");
    let judged = at_the_likely_delay(&judge, judged, interrupt);
    let final_model = |judged: &Judged| units.model_out(&judge.final_fit(judged).model);
    let mut others: Vec<&Hypothesis> = found.all.iter().chain(&roots).collect();
    others.sort_by(|a, b| a.judged.size().total_cmp(&b.judged.size()));
    let others = others.into_iter().map(|other| final_model(&other.judged));
    let model = stable_one(final_model(&judged), others, records);
    Some(Ok(Automatic {
        model,
        tried: found.tried,
        evaluations,
        stop,
    }))
}

/// `best` if its free run does not diverge, neither over the records nor if the shortest of them is followed by as long a
/// time with the input off, or fully on; otherwise the first of the `others` of which this holds. `best` if all diverge.
/// Close to an instability, rounding in other units may decide whether a run diverges.
fn stable_one(best: Model, others: impl Iterator<Item = Model>, records: &[Record]) -> Model {
    let shortest = records.iter().min_by_key(|record| record.len());
    let is_stable = |model: &Model| {
        let ends = [model.command.off, model.command.full];
        let longer = shortest.map(|record| ends.map(|u| followed_by(record, u)));
        let all: Vec<&Record> = records.iter().chain(longer.iter().flatten()).collect();
        parallel::all(&all, |record| model.free_run(record).ok()).is_some()
    };
    if is_stable(&best) {
        return best;
    }
    let mut others = others;
    others.find(is_stable).unwrap_or(best)
}

/// A record that is followed by as many samples with the constant command `u`; everything measured stays as at its end,
/// and what a run follows at the start stays what it is.
fn followed_by(record: &Record, u: f64) -> Record {
    let n = 2 * record.len();
    let hold = |series: &mut Vec<f64>| {
        if let Some(&last) = series.last() {
            series.resize(n, last);
        }
    };
    let mut longer = record.clone();
    longer.u.resize(n, u);
    let Record {
        y,
        y_sd,
        y_min,
        y_max,
        channels,
        ..
    } = &mut longer;
    hold(y);
    [y_sd, y_min, y_max].into_iter().flatten().for_each(hold);
    channels.values_mut().for_each(hold);
    longer
}

/// The best first- or second-order model among the fitted structures, if its score is close to that of the best
/// structure and the difference is not significant. Longer lags and dispersed delays imitate a second time constant
/// and bias the delay.
fn plain_enough(found: &Found) -> Option<Hypothesis> {
    let is_plain = |hypothesis: &&Hypothesis| {
        let mut terms = hypothesis.terms.iter();
        terms.all(|term| matches!(term, Term::Inertia(_) | Term::Offset))
    };
    let plain = found.all.iter().filter(is_plain);
    let plain = plain.min_by(|a, b| a.score().total_cmp(&b.score()))?;
    let best = &found.best;
    let told = p_value(&plain.judged.held_out, &best.judged.held_out) <= RULES.law_level;
    let near = plain.score() < best.score() + RULES.linear_better;
    (near && !told && !is_plain(&best)).then(|| plain.clone())
}

/// The model with a constant delay, if its law is not distinguishable from a constant over the levels of the records. A
/// law must vary by more than a sample, be positive, and have a significantly smaller error.
fn without_needless_law(judge: &Judge, judged: Judged, laws: &[Delay]) -> Judged {
    let model = judged.model();
    let constant_allowed = laws.iter().any(|law| matches!(law, Delay::Fixed { .. }));
    let Delay::Law(law) = &model.delay else {
        return judged;
    };
    if law.spec.base || !constant_allowed {
        return judged;
    }
    let mut levels: Vec<f64> = judge
        .learning(0)
        .iter()
        .flat_map(|record| record.y.iter().copied())
        .collect();
    levels.sort_by(f64::total_cmp);
    let quantile = |share: f64| {
        let at = (share * levels.len() as f64) as usize;
        let level = levels.get(at.min(levels.len().saturating_sub(1)));
        model.delay.present(
            level.copied().unwrap_or(0.0).max(0.0),
            model.sample_period_s,
        )
    };
    let delays = [0.02, 0.25, 0.5, 0.75, 0.98].map(quantile);
    let shortest = delays.iter().copied().fold(f64::INFINITY, f64::min);
    let longest = delays.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut constant = model.clone();
    let middle = 0.5 * (shortest + longest).max(0.0);
    let factors = model.delay.factors();
    constant.delay = Delay::of::<ConstantDelay<f64>>(&[middle], factors, true);
    constant.averaging = Model::default().averaging;
    let Ok(constant) = judge.refitted(&constant) else {
        return judged;
    };
    let varies = longest - shortest > RULES.least_rise && shortest >= 0.0;
    let p = p_value(&constant.held_out, &judged.held_out);
    if varies && p < RULES.law_level && constant.size() > judged.size() {
        judged
    } else {
        constant
    }
}

/// The saturating delay law that is closest to the law of `model`.
fn saturating(model: &Model) -> Delay {
    let at = |level: f64| model.delay.present(level, model.sample_period_s);
    let rise = at(0.0) - at(LEVEL);
    let rise = if rise.abs() < 1.0 { LEAST_RISE } else { rise };
    let parameters = [at(0.0) - rise, rise, LEVEL, 0.0];
    Delay::of::<SaturatingDelay<f64>>(&parameters, model.delay.factors(), true)
}

/// The model with its delays rounded to samples, as in eq. (4), if the validation error rises only slightly.
fn on_samples_unless_it_costs(judge: &Judge, judged: Judged) -> Judged {
    let mut model = judged.model().clone();
    model.delay_on_samples();
    match judge.refitted(&model) {
        Ok(rounded) if rounded.rmse() < (1.0 + RULES.rounding) * judged.rmse() => rounded,
        _ => judged,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;
    use model_core::effects::{LEVEL_RATE, READING_CURVE, SENSOR_RESONANCE, StateDependentDelay};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A flow of first order behind a dead time of `delay` samples, which is given the run of y so far.
    fn carried(seed: u64, delay: impl Fn(&[f64]) -> usize) -> Record {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut u = Vec::new();
        while u.len() < 4000 {
            let (rest, blow) = (rng.random_range(40..300), rng.random_range(40..300));
            u.extend(std::iter::repeat_n(0.0, rest));
            u.extend(std::iter::repeat_n(1.0, blow));
        }
        u.truncate(4000);
        let mut y = vec![0.0];
        for k in 0..u.len() - 1 {
            let jet = k.checked_sub(delay(&y)).map_or(0.0, |from| u[from]);
            y.push(y[k] + (jet - y[k]) / 40.0);
        }
        y.iter_mut()
            .for_each(|y| *y += 0.01 * rng.random_range(-1.0..1.0));
        let role = match seed % 2 {
            0 => Use::Identify,
            _ => Use::Validate,
        };
        Record::new(&format!("r{seed}"), role, 0.001, u, y)
    }

    /// Jets that the flow carries arrive when their way is covered. The delay of eq. (2) follows the mean of eq. (1). No
    /// curve of the flow stands for the law.
    #[test]
    fn a_law_averages_y_over_the_time_in_which_the_flow_carries_the_jets() {
        let way = |y: &[f64]| {
            let steps = y.iter().rev().scan(0.0, |way, y| {
                *way += (1.0 + y) / 60.0;
                Some(*way)
            });
            steps.take_while(|way| *way < 1.0).count()
        };
        let mean = |y: &[f64]| {
            let last = &y[y.len().saturating_sub(249)..];
            let mean = last.iter().sum::<f64>() / 250.0;
            (30.0 + 30.0 * (-2.0 * mean).exp()).round() as usize
        };
        let window = |delay: &dyn Fn(&[f64]) -> usize| {
            let records: Vec<Record> = (0..4).map(|seed| carried(seed, delay)).collect();
            let laws = [
                Delay::Fixed { delays: vec![50] },
                Delay::of::<StateDependentDelay<f64>>(&[40.0, 10.0, 4.0], vec![1.0], true),
            ];
            let how = Frame {
                laws: &laws,
                interpolated: true,
                settings: Settings::default(),
            };
            let found = base_model(&records, &how, &AtomicBool::new(false), &|_| (), &());
            let model = found.expect("data").expect("stable").model;
            let is_curved =
                model.has_effect(READING_CURVE.name) || model.has_effect(LEVEL_RATE.name);
            (model.averaging.window, is_curved)
        };
        assert_eq!(window(&way), (50, false));
        assert_eq!(window(&mean), (250, false));
    }

    #[test]
    fn a_model_that_diverges_gives_way_to_the_next_one() {
        let u: Vec<f64> = (0..2000).map(|k| f64::from(u8::from(k >= 100))).collect();
        let record = Record::new("step", Use::Identify, 0.001, u.clone(), u);
        let with_pole = |a: f64| Model {
            a: vec![a],
            b: vec![0.1],
            ..Model::default()
        };
        let chosen = |best: f64, others: &[f64]| {
            let others = others.iter().map(|a| with_pole(*a));
            stable_one(with_pole(best), others, std::slice::from_ref(&record)).a[0]
        };
        assert_eq!(chosen(0.9, &[0.5]), 0.9);
        // It does not diverge within the record, but soon after.
        assert_eq!(chosen(1.001, &[0.5]), 0.5);
        assert_eq!(chosen(1.05, &[1.02, 0.5, 0.6]), 0.5);
        assert_eq!(chosen(1.05, &[1.02]), 1.05);
    }

    /// A flow of first order behind a dead time, read by a balance that swings at 23 Hz: neither long lags nor an effect
    /// stand for the swing.
    #[test]
    fn a_balance_that_swings_is_part_of_the_sensor() {
        const STEPS: usize = 20;
        let (frequency, damping) = (23.0, 0.03);
        let record = |seed: u64, role: Use| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let (mut left, mut on) = (100, false);
            let command = (0..5000).map(|_| {
                left -= 1;
                if left == 0 {
                    (left, on) = (rng.random_range(40..400), !on);
                }
                f64::from(u8::from(on))
            });
            let u: Vec<f64> = command.collect();
            let omega = std::f64::consts::TAU * frequency;
            let step = 1e-3 / STEPS as f64;
            let (mut flow, mut shown, mut speed) = (0.0, 0.0, 0.0);
            let response = (0..u.len()).map(|k| {
                let read = shown + 0.02 * (rng.random::<f64>() - 0.5);
                let jet = k.checked_sub(25).map_or(0.0, |k| u[k]);
                for _ in 0..STEPS {
                    flow += step * (0.8 * jet - flow) / 0.04;
                    speed +=
                        step * (omega * omega * (flow - shown) - 2.0 * damping * omega * speed);
                    shown += step * speed;
                }
                read
            });
            let y = response.collect();
            Record::new("balance", role, 0.001, u, y)
        };
        let records = [
            record(1, Use::Identify),
            record(2, Use::Identify),
            record(3, Use::Validate),
        ];
        let how = Frame {
            laws: &[Model::default().delay],
            interpolated: true,
            settings: Settings::default(),
        };
        let never = AtomicBool::new(false);
        let found = base_model(&records, &how, &never, &|_| {}, &());
        let model = found.expect("data").expect("stable").model;
        let mut effects = model.effects.iter();
        let swing = effects.find(|added| added.name == SENSOR_RESONANCE.name);
        let [hz, share] = swing.expect("the swing").parameters[..] else {
            panic!("{model:?}");
        };
        assert!((hz / frequency - 1.0).abs() < 0.01, "{hz}");
        assert!((share / damping - 1.0).abs() < 0.1, "{share}");
        assert!(model.state_lags.len() <= 2, "{:?}", model.state_lags);
    }
}
