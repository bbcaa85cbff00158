//! The structure of a base model, chosen by held-out error: as many lags as earn
//! their place, the delay law that does better, the sensor's zero where it is off.

use super::bench::Bench;
use super::judge::{Judge, Judged};
use super::search::{Hypothesis, Search};
use super::{Known, RULES};
use crate::data::Record;
use crate::model::{Delay, Model};
use crate::simulate::SimulateError;
use std::sync::atomic::AtomicBool;

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
    let mut best: Option<(f64, Hypothesis)> = None;
    let mut refused = None;
    for law in laws {
        progress("the leanest model");
        match search.root(&with_law(law), mid_run) {
            Ok(root) => {
                let parameters = root.judged.model().coordinates().len() as f64;
                let score = root.judged.rmse().ln() + RULES.price * parameters;
                if best.as_ref().is_none_or(|(least, _)| score < *least) {
                    best = Some((score, root));
                }
            }
            Err(error) => refused = Some(error),
        }
    }
    let Some((_, root)) = best else {
        return refused.map(Err);
    };
    let found = search.run(root, || None);
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
