//! Candidates against the model they were added to: size, significance, chance,
//! and which of them the data cannot tell apart.

use super::bench::{Bench, Judged, LEVEL, Round};
use super::evidence::{HeldOut, decoys, last_of_both, p_value};
use super::{Ranked, estimates};
use crate::residual::NoiseSource;
use model_core::effect::Spec;

/// An effect must lower the held-out error by this fraction to be worth its parameters …
pub(super) const WORTHWHILE: f64 = 0.015;
/// … by this one where neither the noise is known nor anything shows that the base
/// errs by more than noise …
const WORTHWHILE_IN_THE_DARK: f64 = 0.1;
/// … and the excess error of the base by this one: what a model's own coarseness
/// leaves (its sampling, the shape of a threshold) is no effect.
const MINOR: f64 = 0.01;
/// A simpler candidate may fall short of the best one's gain by this share.
const NEARLY_ALL: f64 = 0.1;
/// Held-out errors that differ by less than this are the same for any purpose.
const ALIKE: f64 = 0.005;

/// Whether the data cannot tell two models apart: by chance or by size.
pub(super) fn alike(a: &HeldOut, b: &HeldOut) -> bool {
    let (better, worse) = if a.rmse() <= b.rmse() { (a, b) } else { (b, a) };
    worse.rmse() <= (1.0 + ALIKE) * better.rmse() || p_value(worse, better) >= LEVEL
}

/// Which of two ends of a search to keep: the clearly better one, and among equals
/// the one with fewer parameters.
pub(super) fn prefers(a: (&Judged, usize), b: (&Judged, usize)) -> bool {
    let ((a, effects_a), (b, effects_b)) = (a, b);
    let ratio = a.held_out.rmse() / b.held_out.rmse();
    if effects_a != effects_b && (ratio - 1.0).abs() < WORTHWHILE {
        return effects_a < effects_b;
    }
    if (ratio - 1.0).abs() < ALIKE {
        return a.parameters() < b.parameters();
    }
    ratio < 1.0
}

impl Bench<'_> {
    /// Ranks candidates against the model they were added to, best first; among
    /// those that match the best, the one with the fewest parameters leads.
    pub(super) fn rank(&self, base: &Judged, current: &Judged, round: &Round) -> Vec<Ranked> {
        let candidates = &round.candidates;
        let mut order: Vec<usize> = (0..candidates.len()).collect();
        let error = |i: &usize| candidates[*i].1.held_out.rmse();
        order.sort_by(|a, b| error(a).total_cmp(&error(b)));
        let p: Vec<f64> = candidates
            .iter()
            .map(|(_, judged)| p_value(&current.held_out, &judged.held_out))
            .collect();
        let adjusted = holm(&p);
        let worth = MINOR * self.excess(&base.held_out);
        let in_the_dark = self.noise_source == NoiseSource::Scatter && !self.is_above_floor(base);
        let worthwhile = if in_the_dark {
            WORTHWHILE_IN_THE_DARK
        } else {
            WORTHWHILE
        };
        if let Some(best) = order.first().copied() {
            let square = |i: usize| candidates[i].1.held_out.rmse().powi(2);
            let gain = current.held_out.rmse().powi(2) - square(best);
            let doubtful = is_unidentified(&candidates[best].1, candidates[best].0);
            let matches = |i: &usize| {
                let (a, b) = (&candidates[*i].1.held_out, &candidates[best].1.held_out);
                let short = square(*i) - square(best);
                let not_worth_it = a.rmse() < (1.0 + WORTHWHILE) * b.rmse() && short < worth;
                (alike(a, b) && short < NEARLY_ALL * gain) || (doubtful && not_worth_it)
            };
            let leading = order.iter().take_while(|i| matches(i)).count();
            // A stable sort: the smaller error first among equals.
            order[..leading].sort_by_key(|i| {
                let (spec, judged) = &candidates[*i];
                (is_unidentified(judged, spec), judged.parameters())
            });
        }
        let mut ranked: Vec<Ranked> = order
            .iter()
            .map(|i| {
                let (spec, judged) = &candidates[*i];
                let (before, after) = (current.held_out.rmse(), judged.held_out.rmse());
                let reduction = 1.0 - after / before;
                let chance = self.best_decoy(current, judged);
                Ranked {
                    effect: spec.name.to_owned(),
                    validate_rmse: after,
                    error_reduction_percent: 100.0 * reduction,
                    p_value: adjusted[*i],
                    best_decoy_percent: 100.0 * chance,
                    parameters: estimates(&judged.fits[0], spec),
                    confounded_with: Vec::new(),
                    significant: adjusted[*i] < LEVEL
                        && reduction > worthwhile
                        && before * before - after * after > worth
                        && reduction > chance
                        && !self.drifts_more(judged, current)
                        && !is_shapeless(judged, spec),
                }
            })
            .collect();
        for a in 0..ranked.len() {
            for b in 0..ranked.len() {
                let (x, y) = (&candidates[order[a]].1, &candidates[order[b]].1);
                let both = ranked[a].significant && ranked[b].significant;
                if a != b && both && alike(&x.held_out, &y.held_out) {
                    let other = ranked[b].effect.clone();
                    ranked[a].confounded_with.push(other);
                }
            }
        }
        ranked
    }

    /// The best reduction of the held-out rms error among the decoys.
    fn best_decoy(&self, current: &Judged, candidate: &Judged) -> f64 {
        let change = |with: &HeldOut, without: &HeldOut| -> Vec<Vec<f64>> {
            let pairs = with.errors.iter().zip(&without.errors);
            pairs
                .map(|(with, without)| {
                    let (with, without) = last_of_both(with, without);
                    without.iter().zip(with).map(|(b, w)| b - w).collect()
                })
                .collect()
        };
        let learning = change(&candidate.learned, &current.learned);
        let judging = change(&candidate.held_out, &current.held_out);
        decoys(
            (&current.learned, &learning),
            (&current.held_out, &judging),
            &self.shifts,
        )
        .into_iter()
        .map(|energy| 1.0 - (1.0 - energy).max(0.0).sqrt())
        .fold(0.0, f64::max)
    }
}

/// Whether the data leave a parameter anywhere in its range: the effect then
/// stands for something simpler.
fn is_unidentified(judged: &Judged, spec: &Spec) -> bool {
    unidentified(judged, spec) > 0
}

/// Whether the data leave every parameter anywhere in its range: whatever the
/// effect does to the error, it is not known to be there.
fn is_shapeless(judged: &Judged, spec: &Spec) -> bool {
    let count = unidentified(judged, spec);
    count > 0 && count == spec.parameters.len()
}

/// Parameters that the data leave anywhere in their range.
fn unidentified(judged: &Judged, spec: &Spec) -> usize {
    let estimates = estimates(&judged.fits[0], spec);
    let anywhere = spec.parameters.iter().filter(|parameter| {
        let whole = parameter.high - parameter.low;
        let of = estimates.get(parameter.name);
        whole > 0.0 && of.is_some_and(|e| e.high - e.low >= 0.99 * whole)
    });
    anywhere.count()
}

/// Holm's step-down adjustment: valid under any dependence.
fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|a, b| p[*a].total_cmp(&p[*b]));
    let mut adjusted = vec![1.0; p.len()];
    let mut running: f64 = 0.0;
    for (rank, i) in order.iter().enumerate() {
        running = running.max(p[*i] * (p.len() - rank) as f64).min(1.0);
        adjusted[*i] = running;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holm_is_bonferroni_for_the_smallest_and_never_falls() {
        assert_eq!(holm(&[0.01, 0.04, 0.03]), [0.03, 0.06, 0.06]);
        assert_eq!(holm(&[0.9, 0.8]), [1.0, 1.0]);
    }
}
