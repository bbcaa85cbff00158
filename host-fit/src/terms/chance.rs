//! Distribution of the best candidate's gain under noise alone.
//!
//! Wild cluster bootstrap of the maximum: the error of each record (or of pieces longer than its correlation
//! time, if records are few) is multiplied by a random sign. This keeps its spectrum and size and destroys
//! whatever a candidate could explain in all records. Candidates are screened on each such error as on the
//! measured one: coefficients from the estimation samples, gains on the validation samples. (White 2000, A
//! reality check for data snooping; Cameron, Gelbach & Miller 2008, Bootstrap-based improvements for
//! inference with clustered errors.)

use super::RULES;
use super::screen::Screen;
use crate::linalg::{dot, solve_symmetric};
use crate::model::Model;
use crate::order;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::ops::Range;

/// Bootstrap draws of the error under the null hypothesis, in the screen's joined series.
pub(crate) struct Noise {
    error: Vec<f64>,
    /// Blocks of the joined series that get one sign each; none spans two records.
    blocks: Vec<Range<usize>>,
    /// A sign for each block, per draw.
    signs: Vec<Vec<f64>>,
    /// Projection of each draw on the directions that the model's own parameters can follow.
    along: Vec<Vec<f64>>,
    /// Energy of each draw on the validation samples after the model was refitted to it.
    held_out: Vec<f64>,
}

/// Share of the energy of one draw that a candidate explains.
#[derive(Clone, Copy, Debug)]
pub(super) struct Taken {
    /// On the estimation samples.
    learned: f64,
    /// On the validation samples.
    held_out: f64,
}

impl Noise {
    /// The error of `last` with random signs per `block` samples. `last` is the model without candidates for
    /// a test, and the model with one for the gain that noise gives beside it. `None` if its free run
    /// diverges.
    pub(crate) fn new(screen: &Screen, last: &Model, block: usize, seed: u64) -> Option<Self> {
        let error = screen.error_of(last)?;
        let blocks = screen.blocks(block);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let signs: Vec<Vec<f64>> = (0..RULES.draws)
            .map(|_| {
                let sign = |_| if rng.random_bool(0.5) { 1.0 } else { -1.0 };
                blocks.iter().map(sign).collect()
            })
            .collect();
        let mut noise = Self {
            error,
            blocks,
            signs,
            along: Vec::new(),
            held_out: Vec::new(),
        };
        let learned = screen.learned;
        let sums: Vec<Vec<f64>> = screen.basis.iter().map(|q| noise.sums(q)).collect();
        let products: Vec<f64> = screen
            .basis
            .iter()
            .flat_map(|p| {
                screen
                    .basis
                    .iter()
                    .map(|q| dot(&p[learned..], &q[learned..]))
            })
            .collect();
        let energy = dot(&noise.error[learned..], &noise.error[learned..]);
        let n = sums.len();
        for signs in &noise.signs {
            let (along, beside): (Vec<f64>, Vec<f64>) = sums
                .iter()
                .map(|sums| noise.halves(sums, signs, learned))
                .unzip();
            let mut left = energy - 2.0 * dot(&along, &beside);
            for i in 0..n {
                left += along[i] * dot(&along, &products[i * n..(i + 1) * n]);
            }
            noise.along.push(along);
            noise.held_out.push(left);
        }
        Some(noise)
    }

    /// Column times error, block by block.
    fn sums(&self, column: &[f64]) -> Vec<f64> {
        let of = |block: &Range<usize>| dot(&column[block.clone()], &self.error[block.clone()]);
        self.blocks.iter().map(of).collect()
    }

    /// The block sums under `signs`, added over the estimation samples and over the validation samples.
    fn halves(&self, sums: &[f64], signs: &[f64], learned: usize) -> (f64, f64) {
        let first = self.blocks.partition_point(|block| block.start < learned);
        let (sums, others) = sums.split_at(first);
        let (signs, other_signs) = signs.split_at(first);
        (dot(sums, signs), dot(others, other_signs))
    }

    /// What a residualised column explains of each draw; 0 if its coefficient is not feasible.
    pub(super) fn taken(
        &self,
        screen: &Screen,
        column: &[f64],
        makes_sense: impl Fn(f64) -> bool,
    ) -> Vec<Taken> {
        let learned = screen.learned;
        let sums = self.sums(column);
        let (own, other) = column.split_at(learned);
        let (own, other_square) = (dot(own, own).max(f64::MIN_POSITIVE), dot(other, other));
        let beside: Vec<f64> = screen
            .basis
            .iter()
            .map(|q| dot(&q[learned..], other))
            .collect();
        let draws = self.signs.iter().zip(&self.along).zip(&self.held_out);
        let taken = draws.map(|((signs, along), energy)| {
            let (with_learned, with_held_out) = self.halves(&sums, signs, learned);
            let scale = with_learned / own;
            if !makes_sense(scale) {
                return Taken {
                    learned: 0.0,
                    held_out: 0.0,
                };
            }
            let with_held_out = with_held_out - dot(along, &beside);
            let gain = scale * (2.0 * with_held_out - scale * other_square);
            Taken {
                learned: scale * with_learned,
                held_out: gain / energy.max(f64::MIN_POSITIVE),
            }
        });
        taken.collect()
    }

    /// The share of each draw's validation energy that residualised columns explain together; `None` if they
    /// are linearly dependent.
    pub(crate) fn taken_together(&self, screen: &Screen, columns: &[&[f64]]) -> Option<Vec<f64>> {
        let learned = screen.learned;
        let square = screen.square(columns, RULES.ridge);
        let sums: Vec<Vec<f64>> = columns.iter().map(|column| self.sums(column)).collect();
        let columns: Vec<&[f64]> = columns.iter().map(|column| &column[learned..]).collect();
        let with = |other: &[f64]| -> Vec<f64> {
            let each = columns.iter().map(|column| dot(column, other));
            each.collect()
        };
        let own: Vec<Vec<f64>> = columns.iter().map(|column| with(column)).collect();
        let basis: Vec<Vec<f64>> = screen.basis.iter().map(|q| with(&q[learned..])).collect();
        let draws = self.signs.iter().zip(&self.along).zip(&self.held_out);
        let taken = draws.map(|((signs, along), energy)| {
            let halves = sums.iter().map(|sums| self.halves(sums, signs, learned));
            let (right, mut error): (Vec<f64>, Vec<f64>) = halves.unzip();
            let scales = solve_symmetric(&square, &right)?;
            let moved = along.iter().zip(&basis).map(|(x, with)| (2.0 * x, with));
            let taken = scales.iter().zip(&own).map(|(x, with)| (*x, with));
            error.iter_mut().for_each(|x| *x *= 2.0);
            for (scale, with) in moved.chain(taken) {
                let pairs = error.iter_mut().zip(with);
                pairs.for_each(|(sum, x)| *sum -= scale * x);
            }
            Some(dot(&scales, &error) / energy.max(f64::MIN_POSITIVE))
        });
        taken.collect()
    }
}

/// Bootstrap distribution of the best candidate's gain under noise alone.
#[derive(Clone, Debug, Default)]
pub struct Chance {
    /// Largest explained share of the validation energy in each draw, ascending.
    best: Vec<f64>,
    /// Number of candidates, every grid point counted.
    pub alternatives: usize,
}

impl Chance {
    /// Within each kind, only the candidates with the largest estimation gain are kept, as in the table; of
    /// these the best on the validation samples counts.
    pub(super) fn of(candidates: Vec<(String, Vec<Taken>)>) -> Self {
        let mut kinds: Vec<(&str, Vec<&[Taken]>)> = Vec::new();
        for (kind, taken) in &candidates {
            match kinds.iter_mut().find(|(met, _)| met == kind) {
                Some((_, all)) => all.push(taken),
                None => kinds.push((kind, vec![taken])),
            }
        }
        let best_of = |draw: usize| {
            let of_kind = |all: &Vec<&[Taken]>| {
                let mut all: Vec<Taken> = all.iter().map(|taken| taken[draw]).collect();
                order::descending(&mut all, |one| one.learned);
                let kept = all.iter().take(RULES.kept_points);
                kept.map(|taken| taken.held_out).fold(0.0, f64::max)
            };
            kinds
                .iter()
                .map(|(_, all)| of_kind(all))
                .fold(0.0, f64::max)
        };
        let draws = candidates.first().map_or(0, |(_, taken)| taken.len());
        Self::sorted((0..draws).map(best_of).collect(), candidates.len())
    }

    /// For candidates that are all evaluated on the validation samples: the largest share of each draw.
    pub(crate) fn of_all(shares: &[Vec<f64>]) -> Self {
        let draws = shares.first().map_or(0, Vec::len);
        let best_of = |draw: usize| shares.iter().map(|own| own[draw]).fold(0.0, f64::max);
        Self::sorted((0..draws).map(best_of).collect(), shares.len())
    }

    fn sorted(mut best: Vec<f64>, alternatives: usize) -> Self {
        best.sort_by(f64::total_cmp);
        Self { best, alternatives }
    }

    /// Family-wise p-value of an explained share of the validation energy.
    #[must_use]
    pub fn p_value(&self, share: f64) -> f64 {
        let below = self.best.partition_point(|best| *best < share);
        (self.best.len() - below + 1) as f64 / (self.best.len() + 1) as f64
    }

    /// 95 % quantile of the best share under noise alone; 0 without candidates.
    #[must_use]
    pub fn usual(&self) -> f64 {
        let at = (0.95 * self.best.len() as f64) as usize;
        self.best.get(at).copied().unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::plants::{base, records};
    use crate::terms::Bench;

    fn taken(pairs: &[(f64, f64)]) -> Vec<Taken> {
        let each = pairs.iter().map(|(learned, held_out)| Taken {
            learned: *learned,
            held_out: *held_out,
        });
        each.collect()
    }

    /// Shares that columns explain together equal those of a regression on the draw.
    #[test]
    fn columns_that_are_fitted_as_one_take_what_a_regression_finds() {
        let records = records(&["plenum-droop"], &[], 4);
        let model = base(&records);
        let bench = Bench::of(&model, &records).expect("records to learn from");
        let fitted = bench.judge.refitted(&bench.given).expect("a stable model");
        let screen = Screen::new(&bench.judge, fitted.model()).expect("a stable model");
        let noise = Noise::new(&screen, fitted.model(), 500, 1).expect("a stable model");
        let columns: Vec<Vec<f64>> = [70.0, 310.0]
            .iter()
            .map(|period| {
                let wave = |k: usize| (k as f64 / period).sin();
                let mut column = (0..screen.error.len()).map(wave).collect::<Vec<_>>();
                screen.residualise(&mut column);
                column
            })
            .collect();
        let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let taken = noise
            .taken_together(&screen, &columns)
            .expect("two directions");
        assert_eq!(taken.len(), RULES.draws);
        for (signs, taken) in noise.signs.iter().zip(taken).take(20) {
            let mut drawn = noise.error.clone();
            for (block, sign) in noise.blocks.iter().zip(signs) {
                drawn[block.clone()].iter_mut().for_each(|e| *e *= sign);
            }
            screen.residualise(&mut drawn);
            let rest = screen.rest_of(&drawn, &columns).expect("two directions");
            let held_out = |series: &[f64]| {
                let own = &series[screen.learned..];
                dot(own, own)
            };
            let direct = 1.0 - held_out(&rest) / held_out(&drawn);
            assert!((taken - direct).abs() < 1e-4, "{taken} {direct}");
        }
    }

    /// One draw with three grid points of a kind: only the two with the largest estimation gain count.
    #[test]
    fn only_points_that_a_table_keeps_can_be_the_best() {
        let kind = |points: &[(f64, f64)]| -> Vec<(String, Vec<Taken>)> {
            let each = points
                .iter()
                .map(|point| ("lag".to_owned(), taken(&[*point])));
            each.collect()
        };
        let chance = Chance::of(kind(&[(3.0, 0.01), (2.0, 0.02), (1.0, 0.5)]));
        assert_eq!(chance.best, [0.02]);
        assert_eq!(chance.alternatives, 3);
    }

    #[test]
    fn the_p_value_counts_the_searches_that_do_as_much() {
        let best: Vec<f64> = (0..19).map(|i| 0.001 * f64::from(i)).collect();
        let chance = Chance {
            best,
            alternatives: 7,
        };
        assert!((chance.p_value(0.5) - 0.05).abs() < 1e-12);
        assert!((chance.p_value(0.0) - 1.0).abs() < 1e-12);
        assert!((chance.p_value(0.0175) - 0.1).abs() < 1e-12);
        assert!((chance.usual() - 0.018).abs() < 1e-12);
        assert!(Chance::default().usual() == 0.0 && Chance::default().p_value(0.1) == 1.0);
    }
}
