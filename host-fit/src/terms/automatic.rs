//! The structure of a base model, chosen by held-out error: as many lags as earn
//! their place, the delay law that does better, the sensor's zero where it is off.

use super::bench::Bench;
use super::judge::{Judge, Judged};
use super::search::{Hypothesis, Search};
use super::term::take_delay_law;
use super::{Known, RULES};
use crate::data::Record;
use crate::model::{Delay, Model};
use crate::simulate::SimulateError;
use model_core::effects::SaturatingDelay;
use std::sync::atomic::{AtomicBool, Ordering};

/// From which level of y on, in inner units, a delay is tried as that of the attached flow …
const LEVEL: f64 = 0.6;
/// … and by how many samples at least it differs from that at rest.
const LEAST_RISE: f64 = 4.0;

/// A base model and what its search took.
#[derive(Clone, Debug)]
pub struct Automatic {
    /// The model, in the user's units.
    pub model: Model,
    /// Structures that were refitted in full.
    pub tried: usize,
}

/// The base model of `records`, its input delays after the best of `laws`. Delays
/// between samples are kept where they pay, or `always`.
///
/// # Errors
/// [`SimulateError`] when no law gives a stable free run; nothing to learn from is
/// `None`.
pub fn base_model(
    records: &[Record],
    laws: &[Delay],
    always: bool,
    interrupt: &AtomicBool,
    progress: &(dyn Fn(&str) + Sync),
) -> Option<Result<Automatic, SimulateError>> {
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
        interrupt,
        progress,
    };
    let with_law = |law: &Delay| Model {
        delay: law.clone(),
        ..given.clone()
    };
    let mut roots: Vec<Hypothesis> = Vec::new();
    let mut refused = None;
    for law in laws {
        progress("the leanest model");
        match search.root(&with_law(law), mid_run) {
            Ok(root) => roots.push(root),
            Err(error) => refused = Some(error),
        }
    }
    let by_score = |a: &&Hypothesis, b: &&Hypothesis| a.judged.size().total_cmp(&b.judged.size());
    let Some(root) = roots.iter().min_by(by_score) else {
        return refused.map(Err);
    };
    let mut found = search.run(root.clone(), || None);
    // With the lags that were found another law may do better than the one that was chosen without them.
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
            found = search.run(start, || None);
            found.tried += tried;
        }
    }
    let judged = if always {
        found.best.judged
    } else {
        on_samples_unless_it_costs(&judge, found.best.judged)
    };
    Some(Ok(Automatic {
        model: units.model_out(&judge.final_fit(&judged).model),
        tried: found.tried,
    }))
}

/// The law that ends at a level, about as the law of `model` is.
fn saturating(model: &Model) -> Delay {
    let at = |level: f64| model.delay.present(level, model.sample_period_s);
    let rise = at(0.0) - at(LEVEL);
    let rise = if rise.abs() < 1.0 { LEAST_RISE } else { rise };
    let parameters = [at(0.0) - rise, rise, LEVEL, 0.0];
    Delay::of::<SaturatingDelay<f64>>(&parameters, model.delay.factors(), true)
}

/// The model with its delays rounded to samples, as eq. (4) has them, if the held-out
/// error bears it.
fn on_samples_unless_it_costs(judge: &Judge, judged: Judged) -> Judged {
    let mut model = judged.model().clone();
    model.delay_on_samples();
    match judge.refitted(&model) {
        Ok(rounded) if rounded.rmse() < (1.0 + RULES.rounding) * judged.rmse() => rounded,
        _ => judged,
    }
}
