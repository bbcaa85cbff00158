//! The dead time under the noise model.
//!
//! Slow disturbances dominate the squared error of a free run, and the dead time of the smallest squared error then
//! fits them and not the edges of the response. The noise model gives a slow disturbance little weight, because it
//! hardly changes from one sample to the next.

use super::RULES;
use super::certificate::MostLikely;
use super::judge::{Judge, Judged};
use crate::model::{Delay, Model};
use crate::parallel;
use std::sync::atomic::{AtomicBool, Ordering};

/// `judged` with its whole-sample delays moved together to the largest likelihood, if the validation error rises by no
/// more than rounding of the delays may raise it. The parameters are refitted.
pub(super) fn at_the_likely_delay(judge: &Judge, judged: Judged, interrupt: &AtomicBool) -> Judged {
    let model = judged.model();
    if !matches!(model.delay, Delay::Fixed { .. }) {
        return judged;
    }
    let Some(start) = MostLikely::of(judge, model) else {
        return judged;
    };
    let mut best = (start.log_likelihood, model.clone());
    // A likelihood with one maximum: only one direction can lead on.
    let mut directions = vec![1.0, -1.0];
    while !interrupt.load(Ordering::Relaxed) {
        let next = parallel::some(&directions, |by| {
            let moved = moved(&best.1, *by)?;
            let likely = MostLikely::of(judge, &moved)?.log_likelihood;
            (likely > best.0).then_some((*by, likely, moved))
        });
        match next.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((by, likely, moved)) => (directions, best) = (vec![by], (likely, moved)),
            None => break,
        }
    }
    if best.1.delay == model.delay {
        return judged;
    }
    match judge.refitted(&best.1) {
        Ok(likely) if likely.rmse() <= (1.0 + RULES.rounding) * judged.rmse() => likely,
        _ => judged,
    }
}

/// The model with all its delays longer by some samples; `None` if one would be negative.
fn moved(model: &Model, samples: f64) -> Option<Model> {
    let mut moved = model.clone();
    moved.delay_later(samples);
    let sum = |model: &Model| match &model.delay {
        Delay::Fixed { delays } => delays.iter().map(|delay| f64::from(*delay)).sum(),
        Delay::Law(_) => f64::NAN,
    };
    let count = model.b.len() as f64;
    (sum(&moved) == sum(model) + count * samples).then_some(moved)
}
