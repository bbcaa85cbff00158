//! First-order screening: hundreds of candidates at the cost of a few free runs each.
//!
//! At a fitted model with the free-run error e and the sensitivities J of its parameters, a candidate changes
//! the free run by s: the difference of two runs for effects (valid for thresholds too), a derivative for
//! lags. After a first-order refit of all other parameters, what remains of s is
//!
//! s⊥ = s − J(JᵀJ)⁻¹Jᵀs,
//!
//! and the candidate explains (s⊥ᵀe)²/(s⊥ᵀs⊥) of the error energy. Sets of candidates are judged together by
//! regression on their s⊥. Coefficients are estimated on the estimation samples, gains on the validation
//! samples.

use super::RULES;
use super::judge::Judge;
use super::term::Term;
use crate::data::Record;
use crate::fit::{channel_reference, sensitivities};
use crate::model::{Delay, Model};
use crate::parallel;
use model_core::effect::Spec;
use numerics::linalg::{dot, gram, solve_symmetric};
use std::ops::Range;

/// First-order prediction for all parameters of one effect together.
pub(crate) struct Tangent {
    /// Predicted change of each parameter.
    pub(crate) coefficients: Vec<f64>,
    /// Share of the error energy explained on the estimation samples.
    pub(crate) learned: f64,
    /// Share of the error energy explained on the validation samples.
    pub(crate) held_out: f64,
    /// Change of the free run by the parameters, orthogonal to the model's own sensitivities.
    pub(crate) direction: Vec<f64>,
}

/// A fitted model with its sensitivities, ready to predict the gain of changes.
pub struct Screen<'a> {
    pub(super) judge: &'a Judge,
    pub(super) model: &'a Model,
    /// Estimation records, then validation records.
    pub(super) records: Vec<&'a Record>,
    /// First scored sample of each record.
    from: Vec<usize>,
    /// Number of neighbouring samples that are averaged.
    pub(super) stride: usize,
    /// Number of joined values that belong to the estimation samples.
    pub(super) learned: usize,
    pub(super) runs: Vec<Vec<f64>>,
    pub(super) error: Vec<f64>,
    /// Directions that the model's own parameters can follow, orthonormal on the estimation samples.
    pub(super) basis: Vec<Vec<f64>>,
    /// For each leading direction of the basis: the coordinate it came from, and the components of that
    /// coordinate's sensitivity. The remaining directions are fixed delays.
    pub(super) made_by: Vec<(usize, Vec<f64>)>,
    /// Component of the error along each direction.
    own: Vec<f64>,
}

/// Predicted moves of the lags, and the accompanying change of the model's parameters.
pub(super) struct Moves {
    /// Move of each term's lag in samples; 0 for terms without a lag.
    pub(super) steps: Vec<i32>,
    /// For each term, the components of a move by one sample along the basis.
    along: Vec<Vec<f64>>,
}

impl<'a> Screen<'a> {
    /// Prepares `model`, fitted to the first fold. `None` if its free run diverges.
    #[must_use]
    pub fn new(judge: &'a Judge, model: &'a Model) -> Option<Self> {
        let fold = &judge.folds[0];
        let records = judge.first_fold();
        let judged_from = fold.judging.iter().map(|judging| judging.scored_from());
        let learning = fold.learning.iter().map(|record| record.lead);
        let from: Vec<usize> = learning.chain(judged_from).collect();
        let samples: usize = records.iter().map(|r| r.len()).sum();
        let stride = samples.div_ceil(RULES.longest_series).max(1);
        let indices = judge.free(model);
        let each = parallel::all(&records, |record| sensitivities(model, record, &indices))?;
        let (runs, slopes): (Vec<Vec<f64>>, Vec<Vec<Vec<f64>>>) = each.into_iter().unzip();
        let learned = (0..fold.learning.len())
            .map(|i| records[i].len().saturating_sub(from[i]) / stride)
            .sum();
        let mut screen = Self {
            judge,
            model,
            records,
            from,
            stride,
            learned,
            runs,
            error: Vec::new(),
            basis: Vec::new(),
            made_by: Vec::new(),
            own: Vec::new(),
        };
        for (i, index) in indices.into_iter().enumerate() {
            let column = screen.joined(slopes.iter().map(|record| record[i].as_slice()));
            if let Some(made) = screen.follow(column) {
                screen.made_by.push((index, made));
            }
        }
        for column in screen.fixed_delays() {
            screen.follow(column);
        }
        let mut error = screen.error_with(&screen.runs);
        screen.own = screen.residualise(&mut error);
        screen.error = error;
        Some(screen)
    }

    /// y − y_sim of all records, joined.
    fn error_with(&self, runs: &[Vec<f64>]) -> Vec<f64> {
        let pairs = self.records.iter().zip(runs);
        let each =
            pairs.map(|(record, run)| record.y.iter().zip(run).map(|(y, sim)| y - sim).collect());
        let errors: Vec<Vec<f64>> = each.collect();
        self.joined(errors.iter().map(Vec::as_slice))
    }

    /// Independent blocks of the joined series: whole records, because record-to-record scatter is constant within
    /// one. If there are few records, pieces of them with at least this many samples.
    pub(super) fn blocks(&self, samples: usize) -> Vec<Range<usize>> {
        let most = self.records.iter().map(|r| r.len()).max().unwrap_or(0);
        let pieces = RULES.fewest_pieces.div_ceil(self.records.len().max(1));
        let length = (samples.max(most.div_ceil(pieces)) / self.stride).max(1);
        let mut blocks = Vec::new();
        let mut start = 0;
        for (record, from) in self.records.iter().zip(&self.from) {
            let end = start + record.len().saturating_sub(*from) / self.stride;
            let each = (start..end).step_by(length);
            blocks.extend(each.map(|first| first..(first + length).min(end)));
            start = end;
        }
        blocks
    }

    /// Number of estimation records.
    pub(super) fn learning(&self) -> usize {
        self.judge.folds[0].learning.len()
    }

    /// Estimation records, then validation records.
    pub(crate) fn records(&self) -> &[&'a Record] {
        &self.records
    }

    /// The screened model.
    pub(crate) fn model(&self) -> &'a Model {
        self.model
    }

    /// Scored samples of all records, joined and averaged over neighbours.
    pub(super) fn joined<'s>(&self, series: impl Iterator<Item = &'s [f64]>) -> Vec<f64> {
        self.joined_from(0, series)
    }

    /// Scored samples of the records from `first` on, joined and averaged over neighbours.
    fn joined_from<'s>(&self, first: usize, series: impl Iterator<Item = &'s [f64]>) -> Vec<f64> {
        let mut all = Vec::new();
        for (index, series) in (first..).zip(series) {
            let begin = all.len();
            self.join(index, series, &mut all);
            if let Some(scatter) = &self.judge.options.level_scatter {
                let mut y = Vec::new();
                self.join(index, &self.records[index].y, &mut y);
                scatter.shrink(&mut all[begin..], &y, self.stride);
            }
        }
        all
    }

    /// Appends the scored samples of one record, averaged over neighbours.
    fn join(&self, record: usize, series: &[f64], all: &mut Vec<f64>) {
        let judged = series.get(self.from[record]..).unwrap_or(&[]);
        let means = judged.chunks_exact(self.stride);
        all.extend(means.map(|chunk| chunk.iter().sum::<f64>() / self.stride as f64));
    }

    /// Change of the free run by moving each fixed delay by one sample; delays have no derivative.
    fn fixed_delays(&self) -> Vec<Vec<f64>> {
        let Delay::Fixed { delays } = &self.model.delay else {
            return Vec::new();
        };
        let later = |l: usize| {
            let mut delays = delays.clone();
            delays[l] = delays[l].saturating_add(1);
            self.change(&Model {
                delay: Delay::Fixed { delays },
                ..self.model.clone()
            })
        };
        (0..delays.len()).filter_map(later).collect()
    }

    /// Adds a column to the basis and returns its components along it; `None` if the column is linearly
    /// dependent.
    fn follow(&mut self, mut column: Vec<f64>) -> Option<Vec<f64>> {
        let size = self.learned_square(&column).sqrt();
        // Orthogonalising twice is enough (Kahan, in Parlett 1980).
        let mut made = self.residualise(&mut column);
        let again = self.residualise(&mut column);
        made.iter_mut().zip(again).for_each(|(sum, x)| *sum += x);
        let left = self.learned_square(&column).sqrt();
        if left > 1e-8 * size && left.is_finite() {
            column.iter_mut().for_each(|x| *x /= left);
            self.basis.push(column);
            made.push(left);
            return Some(made);
        }
        None
    }

    pub(super) fn learned_square(&self, column: &[f64]) -> f64 {
        self.product(column, column)
    }

    /// Subtracts from a column what the model's own parameters can follow to first order, and returns the
    /// components. A column that covers only the estimation samples is extended accordingly.
    pub(super) fn residualise(&self, column: &mut [f64]) -> Vec<f64> {
        let taken = self.basis.iter().map(|direction| {
            let along = dot(&direction[..self.learned], &column[..self.learned]);
            let pairs = column.iter_mut().zip(direction);
            pairs.for_each(|(x, d)| *x -= along * d);
            along
        });
        taken.collect()
    }

    /// The change of the free run with another model; `None` if it diverges.
    pub(super) fn change(&self, other: &Model) -> Option<Vec<f64>> {
        self.change_on(0..self.records.len(), other)
    }

    /// The change of the free run over some of the records with another model; `None` if it diverges.
    pub(super) fn change_on(&self, which: Range<usize>, other: &Model) -> Option<Vec<f64>> {
        let pairs = self.records[which.clone()]
            .iter()
            .zip(&self.runs[which.clone()]);
        let changes: Option<Vec<Vec<f64>>> = pairs
            .map(|(record, run)| {
                let own = other.free_run(record).ok()?;
                Some(own.iter().zip(run).map(|(a, b)| a - b).collect())
            })
            .collect();
        let changes = changes?;
        let joined = self.joined_from(which.start, changes.iter().map(Vec::as_slice));
        joined.iter().all(|x| x.is_finite()).then_some(joined)
    }

    /// Least-squares coefficients of columns on the error, and the remaining shares of the error energy on
    /// estimation and validation samples.
    pub(super) fn regress(&self, columns: &[&[f64]]) -> Option<(Vec<f64>, f64, f64)> {
        self.regress_with(columns, 0.0)
    }

    /// [`regress`](Self::regress) with ridge regularisation, as a share of the mean square of the columns.
    fn regress_with(&self, columns: &[&[f64]], ridge: f64) -> Option<(Vec<f64>, f64, f64)> {
        let scale = self.coefficients(&self.error, columns, ridge)?;
        let rest = less(&self.error, columns, &scale);
        let share = |rest: &[f64], whole: &[f64]| {
            dot(rest, rest) / dot(whole, whole).max(f64::MIN_POSITIVE)
        };
        let (before, after) = rest.split_at(self.learned);
        let (own, other) = self.error.split_at(self.learned);
        Some((scale, share(before, own), share(after, other)))
    }

    /// Least-squares coefficients of columns on a series over the estimation samples.
    fn coefficients(&self, series: &[f64], columns: &[&[f64]], ridge: f64) -> Option<Vec<f64>> {
        let products = self.square(columns, ridge);
        let right: Vec<f64> = columns.iter().map(|c| self.product(c, series)).collect();
        solve_symmetric(&products, &right)
    }

    fn product(&self, a: &[f64], b: &[f64]) -> f64 {
        dot(&a[..self.learned], &b[..self.learned])
    }

    /// Gram matrix of columns over the estimation samples, with a ridge as a share of their mean square.
    pub(super) fn square(&self, columns: &[&[f64]], ridge: f64) -> Vec<f64> {
        let n = columns.len();
        let learned: Vec<&[f64]> = columns.iter().map(|c| &c[..self.learned]).collect();
        let mut products = gram(&learned);
        let mean = (0..n).map(|i| products[i * n + i]).sum::<f64>() / n.max(1) as f64;
        for i in 0..n {
            products[i * n + i] *= 1.0 + 1e-9;
            products[i * n + i] += ridge * mean;
        }
        products
    }

    /// The residual of a series after regression on columns.
    pub(super) fn rest_of(&self, series: &[f64], columns: &[&[f64]]) -> Option<Vec<f64>> {
        let scale = self.coefficients(series, columns, 0.0)?;
        Some(less(series, columns, &scale))
    }

    /// First-order prediction of the best moves of the terms' lags.
    #[must_use]
    pub(super) fn moves_of(&self, terms: &[Term]) -> Moves {
        let probed = parallel::some(0..terms.len(), |index| {
            let term = &terms[index];
            let mut column =
                self.change(&term.moved_in(self.model, term.lag()? + RULES.lag_probe)?)?;
            let along = self.residualise(&mut column);
            Some((index, column, along))
        });
        let columns: Vec<&[f64]> = probed.iter().map(|(_, column, _)| &column[..]).collect();
        let mut moves = Moves {
            steps: vec![0; terms.len()],
            along: vec![Vec::new(); terms.len()],
        };
        let probe = f64::from(RULES.lag_probe);
        if let Some((scales, left, _)) = self.regress(&columns)
            && 1.0 - left > RULES.worth_moving
        {
            for ((index, _, along), scale) in probed.iter().zip(scales) {
                let step = (scale * probe).clamp(-RULES.longest_move, RULES.longest_move);
                moves.steps[*index] = step.round() as i32;
                moves.along[*index] = along.iter().map(|x| x / probe).collect();
            }
        }
        moves
    }

    /// The parameters after moving the lags by this many samples, to first order.
    pub(super) fn values_with(&self, moves: &Moves, steps: &[i32]) -> Vec<f64> {
        let wanted = |direction: usize| {
            let of_term = |(along, step): (&Vec<f64>, &i32)| {
                f64::from(*step) * along.get(direction).copied().unwrap_or(0.0)
            };
            self.own[direction] - moves.along.iter().zip(steps).map(of_term).sum::<f64>()
        };
        let mut rest: Vec<f64> = (0..self.made_by.len()).map(wanted).collect();
        let mut values = self.model.values();
        let coordinates = self.model.coordinates();
        for (direction, (index, made)) in self.made_by.iter().enumerate().rev() {
            let step = rest[direction] / made[direction];
            rest.iter_mut()
                .zip(made)
                .for_each(|(rest, made)| *rest -= step * made);
            let moved = values[*index] + step;
            values[*index] = coordinates[*index]
                .parameter()
                .map_or(moved, |card| moved.clamp(card.low, card.high));
        }
        values
    }

    /// Derivative of the free run with respect to each parameter of an effect, at its values in `other`. `other` is
    /// this model with the effect at an amplitude that leaves the run unchanged. `None` if the run diverges.
    fn columns(&self, other: &Model, effect: &str) -> Option<Vec<Vec<f64>>> {
        let coordinates = other.coordinates();
        let own = |name: &str| name.split('.').next() == Some(effect);
        let indices: Vec<usize> = (0..coordinates.len())
            .filter(|i| own(&coordinates[*i].name))
            .collect();
        let slopes: Option<Vec<Vec<Vec<f64>>>> = self
            .records
            .iter()
            .map(|record| Some(sensitivities(other, record, &indices)?.1))
            .collect();
        let slopes = slopes?;
        let columns = (0..indices.len()).map(|i| {
            let mut column = self.joined(slopes.iter().map(|record| record[i].as_slice()));
            self.residualise(&mut column);
            column
        });
        Some(columns.collect())
    }

    /// First-order prediction for all parameters of an effect together; `None` if they change nothing.
    pub(crate) fn tangent(&self, other: &Model, effect: &str) -> Option<Tangent> {
        let columns = self.columns(other, effect)?;
        let all: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let (coefficients, learned, held_out) = self.regress_with(&all, RULES.ridge)?;
        let mut direction = vec![0.0; self.error.len()];
        for (column, scale) in columns.iter().zip(&coefficients) {
            let pairs = direction.iter_mut().zip(column);
            pairs.for_each(|(sum, x)| *sum += scale * x);
        }
        let finite = coefficients.iter().all(|c| c.is_finite()) && held_out.is_finite();
        finite.then_some(Tangent {
            coefficients,
            learned: 1.0 - learned,
            held_out: 1.0 - held_out,
            direction,
        })
    }

    /// Why an effect cannot be tried on these records; none if it can.
    pub(crate) fn pointless(&self, spec: &Spec) -> Option<String> {
        if self
            .model
            .effect_names()
            .iter()
            .any(|name| name == spec.name)
        {
            return Some("it is in the model already".to_owned());
        }
        if let Err(error) = channel_reference(spec, &self.records) {
            return Some(error.to_string());
        }
        let dead_time = self.model.delay.present(0.0, self.model.sample_period_s);
        let unmet = spec.needs.unmet(self.judge.on_off, dead_time);
        unmet.map(str::to_owned)
    }
}

/// A series minus a linear combination of columns.
fn less(series: &[f64], columns: &[&[f64]], scales: &[f64]) -> Vec<f64> {
    let mut rest = series.to_vec();
    for (column, scale) in columns.iter().zip(scales) {
        let pairs = rest.iter_mut().zip(*column);
        pairs.for_each(|(rest, x)| *rest -= scale * x);
    }
    rest
}
