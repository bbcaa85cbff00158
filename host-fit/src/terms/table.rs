//! All candidate terms of a model, with the share of the error that each explains alone.

use super::RULES;
use super::grid::{grid, longest_lag};
use super::screen::Screen;
use super::term::Term;
use crate::fit::{Known, channel_reference, sensitivities};
use crate::model::Model;
use crate::order;
use crate::parallel;
use model_core::effect::{Place, Sign, Spec};
use model_core::effects::{LEVEL_RATE, PATH_TERMS, SLOW_WAKE, ZERO_OFFSET};
use model_core::recursion::Grading;
use numerics::linalg::dot;

/// Number of lags whose derivatives one run computes, two each.
const LAGS_AT_ONCE: usize = 4;

/// A candidate term with the share of the error that it explains alone.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The term; an effect with its least-squares amplitude.
    pub term: Term,
    /// Share of the error energy explained on the estimation samples.
    pub learned: f64,
    /// Share of the error energy explained on the validation samples.
    pub held_out: f64,
    /// Columns of the effect in the table of changes.
    pub(super) columns: Vec<usize>,
}

/// A screened effect.
struct Rated {
    term: Term,
    /// The model with the effect.
    with: Model,
    /// Change of the free run by the effect on the estimation samples, orthogonal to the model's own sensitivities.
    column: Vec<f64>,
    /// The components of the change along the directions of the basis, which were subtracted from it.
    along: Vec<f64>,
    /// Factor on the effect's amplitude that fits the error best.
    scale: f64,
    /// Share of the error energy explained on the estimation samples.
    learned: f64,
}

/// All candidates, and their changes of the free run.
pub struct Table {
    /// The candidates by descending share of the validation error energy.
    pub candidates: Vec<Candidate>,
    pub(super) columns: Vec<Vec<f64>>,
}

impl Table {
    /// All candidates for the screen's model: lags and the offset, and effects if `effects` is set.
    #[must_use]
    pub fn of(screen: &Screen, known: &Known, effects: bool) -> Self {
        let mut columns = Vec::new();
        let mut candidates = screen.base_candidates(&mut columns);
        if effects {
            candidates.extend(screen.effect_candidates(known, &mut columns));
        }
        order::descending(&mut candidates, |one| one.held_out);
        Self {
            candidates,
            columns,
        }
    }

    /// Correlation of a candidate's change with a direction over the estimation samples.
    pub(crate) fn likeness(
        &self,
        screen: &Screen,
        candidate: &Candidate,
        direction: &[f64],
    ) -> f64 {
        let learned = screen.learned;
        let own = candidate.columns.iter().map(|i| &self.columns[*i]);
        let along = own.map(|column| {
            let (column, direction) = (&column[..learned], &direction[..learned]);
            let size = (dot(column, column) * dot(direction, direction)).sqrt();
            dot(column, direction).abs() / size.max(f64::MIN_POSITIVE)
        });
        along.fold(0.0, f64::max)
    }
}

impl Screen<'_> {
    fn lags(&self) -> Vec<u16> {
        let shortest = self.records.iter().map(|r| r.len()).min().unwrap_or(0);
        let longest = longest_lag(self.model.sample_period_s, shortest);
        let regular = (RULES.regular_lags..=longest).step_by(RULES.lag_step);
        let all = RULES
            .short_lags
            .iter()
            .map(|lag| *lag as u16)
            .chain(regular);
        all.filter(|lag| *lag <= longest && !self.model.state_lags.contains(lag))
            .collect()
    }

    /// Changes by lags: derivatives with respect to a zero coefficient of y and of y times the jet.
    fn lag_columns(&self) -> Vec<(u16, [Vec<f64>; 2])> {
        let (n1, n2) = (self.model.a.len(), self.model.product_lags.len());
        let lags = self.lags();
        let lags: Vec<u16> = lags
            .into_iter()
            .filter(|lag| !self.model.product_lags.contains(lag))
            .collect();
        let chunks: Vec<&[u16]> = lags.chunks(LAGS_AT_ONCE).collect();
        let each = parallel::each(chunks, |lags| {
            let terms = lags.iter().map(|lag| Term::Memory(*lag));
            let model = terms.fold(self.model.clone(), |m, term| term.added_to(&m, &[]));
            // The coordinate vector is d, a, b, c by columns; the first input's c is at its end.
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
        each.into_iter().flatten().collect()
    }

    /// Changes by a second lag of the flow.
    fn series(&self) -> Vec<(Term, Vec<f64>)> {
        let order = |lags: &[u16]| lags.contains(&1) && !lags.contains(&2);
        if !order(&self.model.state_lags) {
            return Vec::new();
        }
        parallel::some(&RULES.second_lags[..], |samples| {
            let term = Term::Inertia(*samples);
            let mut column = self.change(&term.added_to(self.model, &[]))?;
            self.residualise(&mut column);
            Some((term, column))
        })
    }

    /// Changes by terms in the jet path and the reading, from all starting values of their cards.
    fn paths(&self) -> Vec<(Term, Vec<f64>)> {
        let absent = |spec: &&'static Spec| !self.model.has_effect(spec.name);
        let terms = PATH_TERMS.into_iter().filter(absent).flat_map(path_terms);
        let terms: Vec<Term> = terms.collect();
        parallel::some(terms, |term| {
            let mut column = self.change(&term.added_to(self.model, &[]))?;
            self.residualise(&mut column);
            let (scale, ..) = self.regress(&[&column])?;
            Self::is_feasible(&term, scale[0]).then_some((term, column))
        })
    }

    /// Changes by a slow wake, per unit of its strength.
    fn wakes(&self) -> Vec<(Term, Vec<f64>)> {
        if self.model.has_effect(SLOW_WAKE.name) {
            return Vec::new();
        }
        parallel::some(&RULES.wakes_s[..], |time_constant| {
            let term = Term::Wake(*time_constant);
            let mut column = self.change(&term.added_to(self.model, &[RULES.slope]))?;
            column.iter_mut().for_each(|x| *x /= RULES.slope);
            self.residualise(&mut column);
            Some((term, column))
        })
    }

    /// Changes by a rate that depends on the level, without jets and under them.
    fn level_rate(&self) -> Option<[Vec<f64>; 2]> {
        if self.model.has_effect(LEVEL_RATE.name) || !self.judge.full_is_one {
            return None;
        }
        let of = |slopes: [f64; 2]| {
            let mut column = self.change(&Term::LevelRate.added_to(self.model, &slopes))?;
            column.iter_mut().for_each(|x| *x /= RULES.slope);
            self.residualise(&mut column);
            Some(column)
        };
        Some([of([RULES.slope, 0.0])?, of([0.0, RULES.slope])?])
    }

    /// Lags and the sensor's offset, with the share of the error that each explains alone.
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
        for (term, column) in self.paths().into_iter().chain(self.wakes()) {
            all.push((term, vec![columns.len()]));
            columns.push(column);
        }
        if let Some([separating, attaching]) = self.level_rate() {
            all.push((Term::LevelRate, vec![columns.len(), columns.len() + 1]));
            columns.push(separating);
            columns.push(attaching);
        }
        let has_zero = self.model.has_effect(ZERO_OFFSET.name);
        if !has_zero && !self.judge.options.constant {
            let ones: Vec<Vec<f64>> = self.runs.iter().map(|run| vec![1.0; run.len()]).collect();
            let mut column = self.joined(ones.iter().map(Vec::as_slice));
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
        order::descending(&mut rated, |one| one.learned);
        // Neighbouring lags are equivalent: only the best of each neighbourhood is kept.
        let mut kept: Vec<Candidate> = Vec::new();
        for candidate in rated {
            let same_kind = |k: &&Candidate| {
                std::mem::discriminant(&k.term) == std::mem::discriminant(&candidate.term)
            };
            let near = |k: &Candidate| match (k.term.lag(), candidate.term.lag()) {
                (Some(a), Some(b)) => {
                    (i32::from(a) - i32::from(b)).abs() <= RULES.lags_apart as i32
                }
                _ => true,
            };
            // All time constants are kept, because it is not known yet which one matters together with an effect.
            let alike: Vec<&Candidate> = kept.iter().filter(same_kind).collect();
            let has_time = matches!(
                candidate.term,
                Term::Inertia(_) | Term::Wake(_) | Term::Path { .. }
            );
            if has_time || (alike.len() < RULES.kept_lags && !alike.iter().any(|k| near(k))) {
                kept.push(candidate);
            }
        }
        kept
    }

    /// Whether a factor on a term's amplitude is physically possible.
    pub(super) fn is_feasible(term: &Term, scale: f64) -> bool {
        let (spec, parameters) = match term {
            Term::Effect {
                spec, parameters, ..
            } => (spec, parameters),
            Term::Inertia(_) | Term::Path { .. } => return scale > RULES.some,
            _ => return true,
        };
        let linear = spec.amplitude.filter(|amplitude| amplitude.linear);
        match linear.and_then(|amplitude| spec.parameter(amplitude.parameter)) {
            Some(index) => {
                let physical = spec.parameters[index].sign == Sign::Either;
                physical || parameters[index] * scale >= 0.0
            }
            // If the change is not proportional to the amplitude, the factor must be positive and not too
            // small.
            None => spec.parameters.is_empty() || scale > RULES.some,
        }
    }

    /// An effect with its amplitude multiplied by `scale`.
    pub(super) fn scaled(term: &Term, scale: f64) -> Term {
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

    /// Screened effects with their changes on the estimation samples, best first; infeasible ones are left out.
    fn rated(&self, terms: Vec<Term>) -> Vec<Rated> {
        let mut rated = parallel::some(terms, |term| {
            let with = term.added_to(self.model, &[]);
            let mut column = self.change_on(0..self.learning(), &with)?;
            let before = self.learned_square(&column);
            let along = self.residualise(&mut column);
            let after = self.learned_square(&column);
            let shows = after > 1e-10 * before && after > 0.0;
            let (scale, learned, _) = self.regress(&[&column]).filter(|_| shows)?;
            Self::is_feasible(&term, scale[0]).then_some(Rated {
                learned: 1.0 - learned,
                scale: scale[0],
                column,
                along,
                with,
                term,
            })
        });
        order::descending(&mut rated, |one| one.learned);
        rated
    }

    /// A screened effect with its change on the validation samples; `None` if it diverges there.
    fn held_out(&self, rated: Rated) -> Option<(Candidate, Vec<f64>)> {
        let mut changed = rated.column;
        let mut others = self.change_on(self.learning()..self.records.len(), &rated.with)?;
        for (direction, along) in self.basis.iter().zip(&rated.along) {
            let pairs = others.iter_mut().zip(&direction[self.learned..]);
            pairs.for_each(|(x, d)| *x -= along * d);
        }
        changed.append(&mut others);
        let (error, own) = (&self.error[self.learned..], &changed[self.learned..]);
        let gain = rated.scale * (2.0 * dot(own, error) - rated.scale * dot(own, own));
        let candidate = Candidate {
            learned: rated.learned,
            held_out: gain / dot(error, error).max(f64::MIN_POSITIVE),
            columns: Vec::new(),
            term: rated.term,
        };
        Some((candidate, changed))
    }

    fn effect_candidates(&self, known: &Known, columns: &mut Vec<Vec<f64>>) -> Vec<Candidate> {
        let specs = self.model.candidates();
        let specs = specs.filter(|spec| self.pointless(spec).is_none());
        let with_grading = |spec: &'static Spec, parameters: Vec<f64>, grading: Grading| {
            let reference = channel_reference(spec, &self.records).ok().flatten();
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
        // The response to jets of part strength can only be identified if there are such jets.
        if self.judge.on_off && !has_jet_effect(self.model) {
            let mut met: Vec<&str> = Vec::new();
            let mut others = Vec::new();
            for one in &rated {
                let Term::Effect {
                    spec, parameters, ..
                } = &one.term
                else {
                    continue;
                };
                let before = met.iter().filter(|name| **name == spec.name).count();
                if spec.place != Place::Jet || before >= RULES.regraded {
                    continue;
                }
                met.push(spec.name);
                let gradings = self.judge.other_gradings(self.model.grading);
                others.extend(
                    gradings
                        .into_iter()
                        .map(|g| with_grading(spec, parameters.clone(), g)),
                );
            }
            rated.extend(self.rated(others));
            order::descending(&mut rated, |one| one.learned);
        }
        let mut met = Vec::new();
        rated.retain(|one| {
            let key = one.term.key();
            let first = met.iter().filter(|m| **m == key).count() < RULES.kept_points;
            met.push(key);
            first
        });
        let judged = parallel::some(rated, |one| self.held_out(one));
        let mut kept = Vec::new();
        for (mut candidate, column) in judged {
            candidate.columns = vec![columns.len()];
            columns.push(column);
            kept.push(candidate);
        }
        kept
    }
}

/// A term in the jet path or the reading at all starting values of its card.
pub(super) fn path_terms(spec: &'static Spec) -> Vec<Term> {
    let each = spec.parameters.iter().map(|parameter| parameter.starts);
    let points = each.fold(vec![Vec::new()], |points: Vec<Vec<f64>>, starts| {
        let with = |point: &Vec<f64>| {
            let longer = |start: &f64| [point.as_slice(), &[*start]].concat();
            starts.iter().map(longer).collect::<Vec<_>>()
        };
        points.iter().flat_map(with).collect()
    });
    let term = |parameters| Term::Path { spec, parameters };
    points.into_iter().map(term).collect()
}

/// Whether the model has an effect on the jet, and therefore a response to jets of part strength.
pub(super) fn has_jet_effect(model: &Model) -> bool {
    let places = model.effects.iter().filter_map(|e| model.spec(&e.name));
    places.into_iter().any(|spec| spec.place == Place::Jet)
}
