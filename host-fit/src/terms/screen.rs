//! Hundreds of candidates for the price of a few free runs each.
//!
//! At a fitted model with the free-run error e and the sensitivities J of its
//! parameters, a candidate changes the free run by s: the difference of two runs for
//! effects (which holds for thresholds too), a derivative for lags. What is left of s
//! after everything else has been refitted to first order is
//!
//! s⊥ = s − J(JᵀJ)⁻¹Jᵀs,
//!
//! and the candidate takes (s⊥ᵀe)²/(s⊥ᵀs⊥) of the error. Sets of candidates are
//! judged together by regression on their s⊥. Coefficients come from the records that
//! are learned from, what they leave is counted on those that are held out.

use super::RULES;
use super::grid::{grid, longest_lag};
use super::judge::Judge;
use super::term::Term;
use crate::data::Record;
use crate::fit::{Known, sensitivities};
use crate::linalg::{dot, solve_symmetric};
use crate::model::{Delay, Model, Start};
use model_core::effect::{Place, Sign, Spec};
use model_core::effects::{LEVEL_RATE, SLOW_WAKE, ZERO_OFFSET};
use model_core::recursion::Grading;
use rayon::prelude::*;

/// Most numbers per series: longer ones are averaged over neighbours.
const LONGEST: usize = 24_000;
/// Grid points of a jet effect that are tried with every response to part jets.
const REGRADED: usize = 3;
/// The responses to jets of part strength.
pub(super) const GRADINGS: [Grading; 3] = Grading::ALL;
/// Grid points of an effect that are kept for sets.
const KEPT_POINTS: usize = 2;
/// Lags of a kind that are kept for sets, and how far apart they are.
const KEPT_LAGS: usize = 5;
const APART: i32 = 20;
/// Single candidates from which pairs are made.
const PAIRED: usize = 24;
/// Lags that are screened below the regular steps.
const SHORT_LAGS: [u16; 6] = [3, 5, 8, 12, 16, 20];
/// Second lags of the flow that are screened, samples.
pub(super) const SERIES: [f64; 5] = [1.5, 4.0, 10.0, 20.0, 40.0];
/// Slow wakes that are screened, inner seconds.
const WAKES_S: [f64; 5] = [0.1, 0.2, 0.4, 0.8, 1.6];
/// Change of the rate with the level, and pull of a wake, by which their effect is seen.
const SLOPE: f64 = 0.1;
/// Lags whose derivatives are carried by one run, two each.
const LAGS_AT_ONCE: usize = 4;
/// Samples by which a lag is moved to see where it should be.
const PROBE: u16 = 2;
/// Longest move of a lag at a time.
const LONGEST_MOVE: f64 = 12.0;
/// What is not proportional must be wanted at least this many times.
const SOME: f64 = 0.1;
/// Ridge of the points of a curve, share of their mean square: points that are hardly
/// ever met stay where they are.
const RIDGE: f64 = 1e-4;
/// Share of the error that moving a lag must take.
const WORTH_MOVING: f64 = 2e-4;

/// A term that could be added, and what it takes alone.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The term, an effect's amplitude as it fits best.
    pub term: Term,
    /// Share of the error energy that it takes where it was learned.
    pub learned: f64,
    /// The same on what was held out.
    pub held_out: f64,
    /// Its columns in the table of changes.
    columns: Vec<usize>,
}

/// Terms to add together, and what they are expected to leave.
#[derive(Clone, Debug)]
pub struct Proposal {
    /// The terms.
    pub terms: Vec<Term>,
    /// First values of the coefficients of each.
    pub coefficients: Vec<Vec<f64>>,
    /// Expected held-out mean square over the present one.
    pub left: f64,
    /// ½ ln of that, and the price of the terms: below 0 is worth it.
    pub score: f64,
}

/// What the parameters of one effect do together.
pub(crate) struct Tangent {
    /// By how much each should change, to first order.
    pub(crate) coefficients: Vec<f64>,
    /// Share of the error energy that they take where it is learned.
    pub(crate) learned: f64,
    /// The same on what is held out.
    pub(crate) held_out: f64,
    /// What they change in the free run, as far as the model itself cannot.
    pub(crate) direction: Vec<f64>,
}

/// Everything that could be added, and its changes to the free run.
pub struct Table {
    /// The candidates, the best held-out share first.
    pub candidates: Vec<Candidate>,
    columns: Vec<Vec<f64>>,
}

/// A fitted model, ready to be asked what a change would do.
pub struct Screen<'a> {
    judge: &'a Judge,
    model: &'a Model,
    /// Records that are learned from, then those that are judged.
    records: Vec<&'a Record>,
    /// The first sample of each that counts.
    from: Vec<usize>,
    /// Neighbours that are averaged.
    stride: usize,
    /// Joined numbers that are learned from.
    learned: usize,
    runs: Vec<Vec<f64>>,
    error: Vec<f64>,
    /// Directions that the model's own parameters can follow, orthonormal on what is
    /// learned from.
    basis: Vec<Vec<f64>>,
}

impl<'a> Screen<'a> {
    /// Makes `model`, fitted to the first fold, ready. `None` if it diverges.
    #[must_use]
    pub fn new(judge: &'a Judge, model: &'a Model) -> Option<Self> {
        let fold = &judge.folds[0];
        let records: Vec<&Record> = fold
            .learning
            .iter()
            .chain(fold.judging.iter().map(|judging| &judging.record))
            .collect();
        let warm_up = model.warm_up();
        let judged_from = fold.judging.iter().map(|judging| judging.from.max(warm_up));
        let from: Vec<usize> = vec![warm_up; fold.learning.len()]
            .into_iter()
            .chain(judged_from)
            .collect();
        let samples: usize = records.iter().map(|r| r.len()).sum();
        let stride = samples.div_ceil(LONGEST).max(1);
        let constant = judge.options_for(model).constant;
        let coordinates = model.coordinates();
        let moves = |(index, coordinate): (usize, &crate::model::Coordinate)| {
            let fixed = coordinate.parameter().is_some_and(|p| p.low >= p.high);
            (!fixed && (index > 0 || constant)).then_some(index)
        };
        let indices: Vec<usize> = coordinates.iter().enumerate().filter_map(moves).collect();
        let each: Option<Vec<_>> = records
            .par_iter()
            .map(|record| sensitivities(model, record, &indices))
            .collect();
        let (runs, slopes): (Vec<Vec<f64>>, Vec<Vec<Vec<f64>>>) = each?.into_iter().unzip();
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
        };
        let mut jacobian: Vec<Vec<f64>> = (0..indices.len())
            .map(|i| screen.joined(slopes.iter().map(|record| record[i].as_slice())))
            .collect();
        jacobian.extend(screen.fixed_delays());
        for column in jacobian {
            screen.follow(column);
        }
        let errors: Vec<Vec<f64>> = screen
            .records
            .iter()
            .zip(&screen.runs)
            .map(|(record, run)| record.y.iter().zip(run).map(|(y, sim)| y - sim).collect())
            .collect();
        let mut error = screen.joined(errors.iter().map(Vec::as_slice));
        screen.residualise(&mut error);
        screen.error = error;
        Some(screen)
    }

    /// Judged samples of all records, joined and averaged over neighbours.
    fn joined<'s>(&self, series: impl Iterator<Item = &'s [f64]>) -> Vec<f64> {
        let mut all = Vec::new();
        for (series, from) in series.zip(&self.from) {
            let judged = series.get(*from..).unwrap_or(&[]).chunks_exact(self.stride);
            all.extend(judged.map(|chunk| chunk.iter().sum::<f64>() / self.stride as f64));
        }
        all
    }

    /// What moving each fixed delay by a sample does: they have no derivative.
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

    /// Adds a direction to those that the model can follow.
    fn follow(&mut self, mut column: Vec<f64>) {
        let size = self.learned_square(&column).sqrt();
        // Twice is enough (Kahan, in Parlett 1980).
        self.residualise(&mut column);
        self.residualise(&mut column);
        let left = self.learned_square(&column).sqrt();
        if left > 1e-8 * size && left.is_finite() {
            column.iter_mut().for_each(|x| *x /= left);
            self.basis.push(column);
        }
    }

    fn learned_square(&self, column: &[f64]) -> f64 {
        dot(&column[..self.learned], &column[..self.learned])
    }

    /// Takes away what the model's own parameters can do, to first order.
    fn residualise(&self, column: &mut [f64]) {
        for direction in &self.basis {
            let along = dot(&direction[..self.learned], &column[..self.learned]);
            let pairs = column.iter_mut().zip(direction);
            pairs.for_each(|(x, d)| *x -= along * d);
        }
    }

    /// What another model changes in the free run; `None` if it diverges.
    fn change(&self, other: &Model) -> Option<Vec<f64>> {
        let changes: Option<Vec<Vec<f64>>> = self
            .records
            .iter()
            .zip(&self.runs)
            .map(|(record, run)| {
                let own = other.free_run(record).ok()?;
                Some(own.iter().zip(run).map(|(a, b)| a - b).collect())
            })
            .collect();
        let joined = self.joined(changes?.iter().map(Vec::as_slice));
        joined.iter().all(|x| x.is_finite()).then_some(joined)
    }

    /// Coefficients of columns fitted to the error, and the shares of the error's
    /// energy that are left where it was learned and held out.
    fn regress(&self, columns: &[&[f64]]) -> Option<(Vec<f64>, f64, f64)> {
        self.regress_with(columns, 0.0)
    }

    /// The same with a ridge, as a share of the mean square of the columns.
    fn regress_with(&self, columns: &[&[f64]], ridge: f64) -> Option<(Vec<f64>, f64, f64)> {
        let n = columns.len();
        let learned = |series: &'_ [f64]| series[..self.learned].to_vec();
        let own: Vec<Vec<f64>> = columns.iter().map(|c| learned(c)).collect();
        let mut products = vec![0.0; n * n];
        let mut right = vec![0.0; n];
        for i in 0..n {
            for j in 0..n {
                products[i * n + j] = dot(&own[i], &own[j]);
            }
            right[i] = dot(&own[i], &self.error[..self.learned]);
        }
        let mean = (0..n).map(|i| products[i * n + i]).sum::<f64>() / n.max(1) as f64;
        for i in 0..n {
            products[i * n + i] *= 1.0 + 1e-9;
            products[i * n + i] += ridge * mean;
        }
        let scale = solve_symmetric(&products, &right)?;
        let mut rest = self.error.clone();
        for (column, scale) in columns.iter().zip(&scale) {
            let pairs = rest.iter_mut().zip(*column);
            pairs.for_each(|(rest, x)| *rest -= scale * x);
        }
        let share = |rest: &[f64], whole: &[f64]| {
            dot(rest, rest) / dot(whole, whole).max(f64::MIN_POSITIVE)
        };
        let (before, after) = rest.split_at(self.learned);
        let (own, other) = self.error.split_at(self.learned);
        Some((scale, share(before, own), share(after, other)))
    }

    /// By how many samples the lag of each term should move, to first order; 0 where
    /// it is right, or the term has none.
    #[must_use]
    pub fn moves_of(&self, terms: &[Term]) -> Vec<i32> {
        let probed = terms.par_iter().enumerate().filter_map(|(index, term)| {
            let mut column = self.change(&term.moved_in(self.model, term.lag()? + PROBE)?)?;
            self.residualise(&mut column);
            Some((index, column))
        });
        let (indices, columns): (Vec<usize>, Vec<Vec<f64>>) = probed.collect();
        let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let mut moves = vec![0; terms.len()];
        if let Some((scales, left, _)) = self.regress(&columns)
            && 1.0 - left > WORTH_MOVING
        {
            for (index, scale) in indices.into_iter().zip(scales) {
                let step = (scale * f64::from(PROBE)).clamp(-LONGEST_MOVE, LONGEST_MOVE);
                moves[index] = step.round() as i32;
            }
        }
        moves
    }

    /// What the parameters of an effect do together, from where `other` has them: the
    /// model with that effect, which runs as this one does. `None` if they do nothing.
    pub(crate) fn tangent(&self, other: &Model, effect: &str) -> Option<Tangent> {
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
        let columns: Vec<Vec<f64>> = (0..indices.len())
            .map(|i| {
                let mut column = self.joined(slopes.iter().map(|record| record[i].as_slice()));
                self.residualise(&mut column);
                column
            })
            .collect();
        let all: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let (coefficients, learned, held_out) = self.regress_with(&all, RIDGE)?;
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

    /// Correlation of what a candidate changes with a direction, where it is learned.
    pub(crate) fn likeness(&self, table: &Table, candidate: &Candidate, direction: &[f64]) -> f64 {
        let own = candidate.columns.iter().map(|i| &table.columns[*i]);
        let along = own.map(|column| {
            let (column, direction) = (&column[..self.learned], &direction[..self.learned]);
            let size = (dot(column, column) * dot(direction, direction)).sqrt();
            dot(column, direction).abs() / size.max(f64::MIN_POSITIVE)
        });
        along.fold(0.0, f64::max)
    }

    fn lags(&self) -> Vec<u16> {
        let shortest = self.records.iter().map(|r| r.len()).min().unwrap_or(0);
        let longest = longest_lag(self.model.sample_period_s, shortest);
        let regular = (26..=longest).step_by(RULES.lag_step);
        let all = SHORT_LAGS.into_iter().chain(regular);
        all.filter(|lag| *lag <= longest && !self.model.state_lags.contains(lag))
            .collect()
    }

    /// Changes by lags: the derivatives by a coefficient that is 0, of y and of y
    /// times the jet.
    fn lag_columns(&self) -> Vec<(u16, [Vec<f64>; 2])> {
        let (n1, n2) = (self.model.a.len(), self.model.product_lags.len());
        let lags = self.lags();
        let lags: Vec<u16> = lags
            .into_iter()
            .filter(|lag| !self.model.product_lags.contains(lag))
            .collect();
        let each = lags.par_chunks(LAGS_AT_ONCE).map(|lags| {
            let terms = lags.iter().map(|lag| Term::Memory(*lag));
            let model = terms.fold(self.model.clone(), |m, term| term.added_to(&m, &[]));
            // The vector is d, a, b, c by columns: the first input's c at the end of its own.
            let first = 1 + n1;
            let product = 1 + n1 + lags.len() + model.b.len() + n2;
            let indices: Vec<usize> = (0..lags.len())
                .flat_map(|i| [first + i, product + i])
                .collect();
            let slopes: Option<Vec<Vec<Vec<f64>>>> = self
                .records
                .iter()
                .map(|record| Some(sensitivities(&model, record, &indices)?.1))
                .collect();
            let Some(slopes) = slopes else {
                return Vec::new();
            };
            let column = |index: usize| {
                let mut column = self.joined(slopes.iter().map(|record| record[index].as_slice()));
                self.residualise(&mut column);
                column
            };
            let of = |(i, lag): (usize, &u16)| (*lag, [column(2 * i), column(2 * i + 1)]);
            lags.iter().enumerate().map(of).collect()
        });
        each.flatten().collect()
    }

    /// Changes by a second lag of the flow.
    fn series(&self) -> Vec<(Term, Vec<f64>)> {
        let order = |lags: &[u16]| lags.contains(&1) && !lags.contains(&2);
        if !order(&self.model.state_lags) {
            return Vec::new();
        }
        let changes = SERIES.into_par_iter().filter_map(|samples| {
            let term = Term::Inertia(samples);
            let mut column = self.change(&term.added_to(self.model, &[]))?;
            self.residualise(&mut column);
            Some((term, column))
        });
        changes.collect()
    }

    /// Changes by a slow wake, per pull.
    fn wakes(&self) -> Vec<(Term, Vec<f64>)> {
        // Nobody knows the wake of a flow that was blown before.
        let present = self.model.effects.iter().any(|e| e.name == SLOW_WAKE.name);
        if present || self.model.start == Start::Measured {
            return Vec::new();
        }
        let changes = WAKES_S.into_par_iter().filter_map(|time_constant| {
            let term = Term::Wake(time_constant);
            let mut column = self.change(&term.added_to(self.model, &[SLOPE]))?;
            column.iter_mut().for_each(|x| *x /= SLOPE);
            self.residualise(&mut column);
            Some((term, column))
        });
        changes.collect()
    }

    /// Changes by a rate that depends on the level, without jets and under them.
    fn level_rate(&self) -> Option<[Vec<f64>; 2]> {
        if self.model.effects.iter().any(|e| e.name == LEVEL_RATE.name) {
            return None;
        }
        let of = |slopes: [f64; 2]| {
            let mut column = self.change(&Term::LevelRate.added_to(self.model, &slopes))?;
            column.iter_mut().for_each(|x| *x /= SLOPE);
            self.residualise(&mut column);
            Some(column)
        };
        Some([of([SLOPE, 0.0])?, of([0.0, SLOPE])?])
    }

    /// The model's lags and the sensor's zero, with what each takes alone.
    fn base_candidates(&self, columns: &mut Vec<Vec<f64>>) -> Vec<Candidate> {
        let mut all: Vec<(Term, Vec<usize>)> = Vec::new();
        for (lag, [state, product]) in self.lag_columns() {
            let at = columns.len();
            columns.push(state);
            columns.push(product);
            all.push((Term::Memory(lag), vec![at, at + 1]));
            all.push((Term::State(lag), vec![at]));
            all.push((Term::Product(lag), vec![at + 1]));
        }
        for (term, column) in self.series() {
            all.push((term, vec![columns.len()]));
            columns.push(column);
        }
        for (term, column) in self.wakes() {
            all.push((term, vec![columns.len()]));
            columns.push(column);
        }
        if let Some([separating, attaching]) = self.level_rate() {
            all.push((Term::LevelRate, vec![columns.len(), columns.len() + 1]));
            columns.push(separating);
            columns.push(attaching);
        }
        let has_zero = self
            .model
            .effects
            .iter()
            .any(|e| e.name == ZERO_OFFSET.name);
        if !has_zero && !self.judge.options.constant {
            let mut column = self.joined(self.runs.iter().map(Vec::as_slice));
            column.iter_mut().for_each(|x| *x = 1.0);
            self.residualise(&mut column);
            all.push((Term::Offset, vec![columns.len()]));
            columns.push(column);
        }
        let mut rated: Vec<Candidate> = all
            .into_iter()
            .filter_map(|(term, own)| {
                let chosen: Vec<&[f64]> = own.iter().map(|i| columns[*i].as_slice()).collect();
                let (scale, learned, held_out) = self.regress(&chosen)?;
                Self::is_feasible(&term, scale[0]).then_some(Candidate {
                    term,
                    learned: 1.0 - learned,
                    held_out: 1.0 - held_out,
                    columns: own,
                })
            })
            .collect();
        rated.sort_by(|a, b| b.learned.total_cmp(&a.learned));
        // Neighbours say the same: the best of each neighbourhood.
        let mut kept: Vec<Candidate> = Vec::new();
        for candidate in rated {
            let same_kind = |k: &&Candidate| {
                std::mem::discriminant(&k.term) == std::mem::discriminant(&candidate.term)
            };
            let near = |k: &Candidate| match (k.term.lag(), candidate.term.lag()) {
                (Some(a), Some(b)) => (i32::from(a) - i32::from(b)).abs() <= APART,
                _ => true,
            };
            // Time constants say different things: which one shows beside an effect.
            let alike: Vec<&Candidate> = kept.iter().filter(same_kind).collect();
            let has_time = matches!(candidate.term, Term::Inertia(_) | Term::Wake(_));
            if has_time || (alike.len() < KEPT_LAGS && !alike.iter().any(|k| near(k))) {
                kept.push(candidate);
            }
        }
        kept
    }

    /// Whether an effect cannot be tried here, and why.
    pub(crate) fn pointless(&self, spec: &Spec) -> Option<String> {
        if self
            .model
            .effect_names()
            .iter()
            .any(|name| name == spec.name)
        {
            return Some("it is in the model already".to_owned());
        }
        if let Some(channel) = spec.channel
            && let Some(record) = self
                .records
                .iter()
                .find(|r| !r.channels.contains_key(channel))
        {
            let error = crate::fit::CandidateError::MissingChannel {
                effect: spec.name.to_owned(),
                channel: channel.to_owned(),
                record: record.name.clone(),
            };
            return Some(error.to_string());
        }
        spec.needs.unmet(self.judge.on_off).map(str::to_owned)
    }

    /// The mean of the effect's channel over the records.
    fn reference(&self, spec: &Spec) -> Option<f64> {
        let channel = spec.channel?;
        let values = || {
            let channels = self.records.iter().filter_map(|r| r.channels.get(channel));
            channels.flatten().copied()
        };
        Some(values().sum::<f64>() / values().count().max(1) as f64)
    }

    /// Whether so many times its change makes sense for a term.
    fn is_feasible(term: &Term, scale: f64) -> bool {
        let (spec, parameters) = match term {
            Term::Effect {
                spec, parameters, ..
            } => (spec, parameters),
            Term::Inertia(_) => return scale > SOME,
            _ => return true,
        };
        let linear = spec.amplitude.filter(|amplitude| amplitude.linear);
        match linear.and_then(|amplitude| spec.parameter(amplitude.parameter)) {
            Some(index) => {
                let physical = spec.parameters[index].sign == Sign::Either;
                physical || parameters[index] * scale >= 0.0
            }
            // What is not proportional keeps its direction, and some of its size.
            None => spec.parameters.is_empty() || scale > SOME,
        }
    }

    /// An effect with its amplitude so many times as large.
    fn scaled(term: &Term, scale: f64) -> Term {
        let mut term = term.clone();
        if let Term::Effect {
            spec, parameters, ..
        } = &mut term
        {
            let linear = spec.amplitude.filter(|amplitude| amplitude.linear);
            if let Some(index) = linear.and_then(|a| spec.parameter(a.parameter)) {
                let range = &spec.parameters[index];
                parameters[index] = (parameters[index] * scale).clamp(range.low, range.high);
            }
        }
        term
    }

    /// Effects with what they change, best first; those that make no sense left out.
    fn rated(&self, terms: Vec<Term>) -> Vec<(Candidate, Vec<f64>)> {
        let rated = terms.into_par_iter().filter_map(|term| {
            let mut column = self.change(&term.added_to(self.model, &[]))?;
            let before = self.learned_square(&column);
            self.residualise(&mut column);
            let after = self.learned_square(&column);
            let shows = after > 1e-10 * before && after > 0.0;
            let (scale, learned, held_out) = self.regress(&[&column]).filter(|_| shows)?;
            let candidate = Candidate {
                learned: 1.0 - learned,
                held_out: 1.0 - held_out,
                columns: Vec::new(),
                term,
            };
            Self::is_feasible(&candidate.term, scale[0]).then_some((candidate, column))
        });
        let mut rated: Vec<_> = rated.collect();
        rated.sort_by(|a, b| b.0.learned.total_cmp(&a.0.learned));
        rated
    }

    fn effect_candidates(&self, known: &Known, columns: &mut Vec<Vec<f64>>) -> Vec<Candidate> {
        let specs = self.model.candidates();
        let specs = specs.filter(|spec| self.pointless(spec).is_none());
        let with_grading = |spec: &'static Spec, parameters: Vec<f64>, grading: Grading| {
            let reference = self.reference(spec);
            Term::Effect {
                spec,
                parameters,
                grading,
                reference,
            }
        };
        let terms: Vec<Term> = specs
            .flat_map(|spec| {
                let grid = grid(spec, self.model, known).into_iter();
                grid.map(move |parameters| (spec, parameters))
            })
            .map(|(spec, parameters)| with_grading(spec, parameters, self.model.grading))
            .collect();
        let mut rated = self.rated(terms);
        // How the flow takes jets of part strength shows only once there are some.
        if self.judge.on_off && !has_jet_effect(self.model) {
            let mut met: Vec<&str> = Vec::new();
            let mut others = Vec::new();
            for (candidate, _) in &rated {
                let Term::Effect {
                    spec, parameters, ..
                } = &candidate.term
                else {
                    continue;
                };
                let before = met.iter().filter(|name| **name == spec.name).count();
                if spec.place != Place::Jet || before >= REGRADED {
                    continue;
                }
                met.push(spec.name);
                let gradings = GRADINGS.into_iter().filter(|g| *g != self.model.grading);
                others.extend(gradings.map(|g| with_grading(spec, parameters.clone(), g)));
            }
            rated.extend(self.rated(others));
            rated.sort_by(|a, b| b.0.learned.total_cmp(&a.0.learned));
        }
        let mut met = Vec::new();
        let mut kept = Vec::new();
        for (mut candidate, column) in rated {
            let key = candidate.term.key();
            if met.iter().filter(|m| **m == key).count() < KEPT_POINTS {
                met.push(key);
                candidate.columns = vec![columns.len()];
                columns.push(column);
                kept.push(candidate);
            }
        }
        kept
    }

    /// Everything that could be added: lags and the zero, and effects if wanted.
    #[must_use]
    pub fn table(&self, known: &Known, effects: bool) -> Table {
        let mut columns = Vec::new();
        let mut candidates = self.base_candidates(&mut columns);
        if effects {
            candidates.extend(self.effect_candidates(known, &mut columns));
        }
        candidates.sort_by(|a, b| b.held_out.total_cmp(&a.held_out));
        Table {
            candidates,
            columns,
        }
    }

    /// Single terms and pairs that are worth their price, the best first.
    #[must_use]
    pub fn proposals(&self, table: &Table) -> Vec<Proposal> {
        let candidates = &table.candidates;
        let sets = Sets::new(self, table);
        let price = |set: &[usize]| {
            let cost: usize = set.iter().map(|c| candidates[*c].term.cost()).sum();
            RULES.price * cost as f64
        };
        let scored = |set: &[usize]| {
            let (left, scale) = sets.left(set)?;
            Some((0.5 * left.ln() + price(set), left, scale))
        };
        let mut all: Vec<(f64, f64, Vec<f64>, Vec<usize>)> = Vec::new();
        for c in 0..candidates.len() {
            if let Some((score, left, scale)) = scored(&[c]) {
                all.push((score, left, scale, vec![c]));
            }
        }
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let singles: Vec<(f64, usize)> = all.iter().take(PAIRED).map(|s| (s.0, s.3[0])).collect();
        let mut seen: Vec<[usize; 2]> = Vec::new();
        for (single, first) in &singles {
            for second in 0..candidates.len() {
                let pair = [*first.min(&second), *first.max(&second)];
                let (a, b) = (&candidates[pair[0]], &candidates[pair[1]]);
                if *first == second || clash(a, b) || seen.contains(&pair) {
                    continue;
                }
                seen.push(pair);
                if let Some((score, left, scale)) = scored(&pair)
                    && score < single - 2.0 * RULES.price
                {
                    all.push((score, left, scale, pair.to_vec()));
                }
            }
        }
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let worth = all.into_iter().take_while(|(score, ..)| *score < 0.0);
        let proposals = worth.map(|(score, left, scale, set)| {
            let mut rest = scale.as_slice();
            let (mut terms, mut coefficients) = (Vec::new(), Vec::new());
            for c in &set {
                let (own, others) = rest.split_at(candidates[*c].columns.len());
                rest = others;
                terms.push(Self::scaled(&candidates[*c].term, own[0]));
                coefficients.push(own.to_vec());
            }
            Proposal {
                terms,
                coefficients,
                left,
                score,
            }
        });
        proposals.collect()
    }

    /// What a candidate alone is expected to leave, as a proposal; `None` if it makes
    /// no sense.
    #[must_use]
    pub fn alone(&self, table: &Table, candidate: &Candidate) -> Option<Proposal> {
        let own: Vec<&[f64]> = candidate
            .columns
            .iter()
            .map(|i| table.columns[*i].as_slice())
            .collect();
        let (scale, _, left) = self.regress(&own)?;
        Some(Proposal {
            terms: vec![Self::scaled(&candidate.term, scale[0])],
            score: 0.5 * left.ln() + RULES.price * candidate.term.cost() as f64,
            coefficients: vec![scale],
            left,
        })
    }
}

/// Whether the model has an effect on the jet: it has a response to part jets then.
pub(super) fn has_jet_effect(model: &Model) -> bool {
    let places = model.effects.iter().filter_map(|e| model.spec(&e.name));
    places.into_iter().any(|spec| spec.place == Place::Jet)
}

/// Whether two candidates exclude each other.
fn clash(a: &Candidate, b: &Candidate) -> bool {
    match (&a.term, &b.term) {
        (
            Term::Effect {
                spec: x,
                grading: g,
                ..
            },
            Term::Effect {
                spec: y,
                grading: h,
                ..
            },
        ) => {
            let both = |place: Place| x.place == place && y.place == place;
            x.name == y.name || both(Place::Delay) || (both(Place::Jet) && g != h)
        }
        (Term::Inertia(_), Term::Inertia(_)) | (Term::Wake(_), Term::Wake(_)) => true,
        _ => a.columns.iter().any(|column| b.columns.contains(column)),
    }
}

/// Products of all columns, so that sets of them cost nothing.
struct Sets<'t> {
    candidates: &'t [Candidate],
    count: usize,
    /// Learned and held-out products of the columns, row-major.
    products: Vec<(f64, f64)>,
    with_error: Vec<(f64, f64)>,
    error: f64,
}

impl<'t> Sets<'t> {
    fn new(screen: &Screen<'_>, table: &'t Table) -> Self {
        let learned = screen.learned;
        let both = |a: &[f64], b: &[f64]| {
            let ((a, c), (b, d)) = (a.split_at(learned), b.split_at(learned));
            (dot(a, b), dot(c, d))
        };
        let columns = &table.columns;
        let count = columns.len();
        // Columns that no candidate kept are left out.
        let used: Vec<bool> = {
            let mut used = vec![false; count];
            let kept = table.candidates.iter().flat_map(|c| &c.columns);
            kept.for_each(|i| used[*i] = true);
            used
        };
        let rows: Vec<Vec<(f64, f64)>> = (0..count)
            .into_par_iter()
            .map(|i| {
                let wanted = |j: usize| used[i] && used[j] && j <= i;
                let cell = |j: usize| {
                    if wanted(j) {
                        both(&columns[i], &columns[j])
                    } else {
                        (0.0, 0.0)
                    }
                };
                (0..count).map(cell).collect()
            })
            .collect();
        let products = (0..count * count)
            .map(|cell| {
                let (i, j) = (cell / count, cell % count);
                rows[i.max(j)][i.min(j)]
            })
            .collect();
        let held_out = &screen.error[learned..];
        Self {
            candidates: &table.candidates,
            count,
            products,
            with_error: columns.iter().map(|c| both(c, &screen.error)).collect(),
            error: dot(held_out, held_out),
        }
    }

    /// The held-out share that a set leaves, and the coefficients of its columns;
    /// `None` if they make no sense.
    fn left(&self, set: &[usize]) -> Option<(f64, Vec<f64>)> {
        let own = set.iter().flat_map(|c| &self.candidates[*c].columns);
        let index: Vec<usize> = own.copied().collect();
        let n = index.len();
        let cell = |i: usize, j: usize| self.products[index[i] * self.count + index[j]];
        let mut products: Vec<f64> = (0..n * n).map(|c| cell(c / n, c % n).0).collect();
        (0..n).for_each(|i| products[i * n + i] *= 1.0 + 1e-6);
        let right: Vec<f64> = index.iter().map(|i| self.with_error[*i].0).collect();
        let scale = solve_symmetric(&products, &right)?;
        let mut at = 0;
        for c in set {
            let candidate = &self.candidates[*c];
            if !Screen::is_feasible(&candidate.term, scale[at]) {
                return None;
            }
            at += candidate.columns.len();
        }
        let mut left = self.error;
        for i in 0..n {
            left -= 2.0 * scale[i] * self.with_error[index[i]].1;
            for j in 0..n {
                left += scale[i] * scale[j] * cell(i, j).1;
            }
        }
        // First order: less than nothing is never left.
        Some(((left / self.error).max(1e-6), scale))
    }
}
