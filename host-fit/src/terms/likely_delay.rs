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
    let Delay::Fixed { delays } = &model.delay else {
        return None;
    };
    let is_negative = |delay: &u16| f64::from(*delay) + samples < 0.0;
    if delays.iter().any(is_negative) {
        return None;
    }
    let mut moved = model.clone();
    moved.delay_later(samples);
    Some(moved)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Record, Use};
    use crate::fit::FitOptions;

    /// A heated plate with a dead time of 30 s in a room whose temperature drifts, and white noise.
    fn plate() -> Record {
        let (mut level, mut random, mut held) = (0.0, 5_u32, 0.0);
        let mut noise = || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(random) / f64::from(u32::MAX) - 0.5
        };
        let u: Vec<f64> = (0..6000)
            .map(|k| {
                if k % 23 == 0 {
                    held = f64::from(u8::from(noise() > 0.0));
                }
                held
            })
            .collect();
        let y = (0..u.len()).map(|k| {
            let drift = 0.06 * (k as f64 / 700.0).sin();
            let shown = level + drift + 0.002 * noise();
            let arrived = k.checked_sub(3).map_or(0.0, |k| u[k]);
            level += 0.01 * (arrived - level);
            shown
        });
        Record::new("plate", Use::Identify, 10.0, u.clone(), y.collect())
    }

    /// The squared error is that of the drift, so a second lag with no dead time has as small an error.
    #[test]
    fn a_drift_does_not_hide_the_dead_time() {
        let judge = Judge::new(&[plate()], None, FitOptions::default()).expect("a record");
        let without = Model {
            sample_period_s: 10.0,
            state_lags: vec![1, 2],
            a: vec![1.5, -0.505],
            b: vec![0.005],
            product_lags: Vec::new(),
            c: Vec::new(),
            delay: Delay::Fixed { delays: vec![0] },
            ..Model::default()
        };
        let judged = judge.refitted(&without).expect("stable");
        let likely = at_the_likely_delay(&judge, judged.clone(), &AtomicBool::new(false));
        assert_eq!(likely.model().delay, Delay::Fixed { delays: vec![3] });
        assert!(likely.rmse() <= (1.0 + RULES.rounding) * judged.rmse());
    }

    #[test]
    fn no_delay_becomes_negative() {
        let at = |delays: &[u16], by: f64| {
            let model = Model {
                b: vec![0.1; delays.len()],
                delay: Delay::Fixed {
                    delays: delays.to_vec(),
                },
                ..Model::default()
            };
            moved(&model, by).map(|model| model.delay)
        };
        assert_eq!(at(&[0, 4], -1.0), None);
        assert_eq!(at(&[1, 4], -1.0), Some(Delay::Fixed { delays: vec![0, 3] }));
    }
}
