//! Sets of candidates whose joint gain exceeds the penalty of their parameters.

use super::RULES;
use super::screen::Screen;
use super::table::{Candidate, Table};
use super::term::Term;
use crate::model::Model;
use crate::order;
use crate::parallel;
use model_core::effect::{Place, Spec};
use numerics::linalg::{dot, solve_symmetric};

/// Terms to add together, with their predicted gain.
#[derive(Clone, Debug)]
pub struct Proposal {
    /// The terms.
    pub terms: Vec<Term>,
    /// Initial values of the coefficients of each term.
    pub coefficients: Vec<Vec<f64>>,
    /// Predicted validation mean square error over the present one.
    pub left: f64,
    /// ½ ln of `left` plus the penalty of the terms; negative if the gain exceeds the penalty.
    pub score: f64,
}

impl Proposal {
    /// An effect without a prediction, for `model`.
    pub(super) fn unrated(spec: &'static Spec, model: &Model) -> Self {
        Self {
            terms: vec![Term::unfitted(spec, model)],
            coefficients: vec![Vec::new()],
            left: 1.0,
            score: 0.0,
        }
    }
}

impl Screen<'_> {
    /// Single terms and pairs whose gain exceeds their penalty, best first.
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
        order::ascending(&mut all, |one| one.0);
        let singles: Vec<(f64, usize)> = all
            .iter()
            .take(RULES.paired)
            .map(|s| (s.0, s.3[0]))
            .collect();
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
        order::ascending(&mut all, |one| one.0);
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

    /// A single candidate as a proposal; `None` if its coefficient is not feasible.
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
        (Term::Path { spec: x, .. }, Term::Path { spec: y, .. }) => x.name == y.name,
        _ => a.columns.iter().any(|column| b.columns.contains(column)),
    }
}

/// Inner products of all columns, computed once for all sets.
struct Sets<'t> {
    candidates: &'t [Candidate],
    count: usize,
    /// Inner products of the columns over estimation and validation samples, row-major.
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
        // Columns that belong to no kept candidate are left out.
        let used: Vec<bool> = {
            let mut used = vec![false; count];
            let kept = table.candidates.iter().flat_map(|c| &c.columns);
            kept.for_each(|i| used[*i] = true);
            used
        };
        let rows: Vec<Vec<(f64, f64)>> = parallel::each(0..count, |i| {
            let wanted = |j: usize| used[i] && used[j] && j <= i;
            let cell = |j: usize| {
                if wanted(j) {
                    both(&columns[i], &columns[j])
                } else {
                    (0.0, 0.0)
                }
            };
            (0..count).map(cell).collect()
        });
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

    /// The validation error share that remains with a set, and the coefficients of its columns; `None` if
    /// they are not feasible.
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
        // A first-order prediction may be negative; the remaining error is not.
        Some(((left / self.error).max(1e-6), scale))
    }
}
