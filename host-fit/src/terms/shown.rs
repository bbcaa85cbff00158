//! The part of a candidate's change of the free run that unnamed terms cannot imitate.

use super::screen::Screen;
use super::table::Table;
use super::term::Term;
use crate::fit::Known;
use crate::model::Model;
use crate::parallel;
use numerics::linalg::{dot, dots};
use std::ops::Range;

/// Two columns are linearly dependent if the residual share of their energy is below this.
const SAME: f64 = 1e-6;

/// The change of the free run by a candidate, on the validation samples.
#[derive(Clone, Debug)]
pub(crate) struct Shown {
    /// Energy of the model's error.
    pub(crate) error: f64,
    /// Residual of the change after regression on 0, 1, 2 … unnamed terms.
    pub(crate) beside: Vec<Left>,
}

/// The part of a change that other terms cannot imitate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Left {
    /// Energy of that part.
    pub(crate) energy: f64,
    /// Standard deviation of the inner product of that part with the error.
    pub(crate) deviation: f64,
}

/// Candidate terms without a name, with their Gram matrix.
pub(crate) struct Unnamed {
    columns: Vec<Vec<f64>>,
    /// Gram matrix of the columns over the estimation samples.
    products: Vec<Vec<f64>>,
}

impl Unnamed {
    /// All unnamed terms that are linear in an amplitude on the screen's model. Terms in the jet path are excluded,
    /// because they are not linear in an amplitude.
    pub(crate) fn of(screen: &Screen, known: &Known) -> Self {
        let Table {
            candidates,
            mut columns,
            ..
        } = Table::of(screen, known, false);
        let paths = candidates
            .iter()
            .filter(|c| matches!(c.term, Term::Path { .. }));
        let mut paths: Vec<usize> = paths.flat_map(|c| c.columns.iter().copied()).collect();
        paths.sort_unstable();
        while let Some(path) = paths.pop() {
            columns.remove(path);
        }
        let learned = |i: usize| &columns[i][..screen.learned];
        let mut products =
            parallel::each(0..columns.len(), |i| dots(learned(i), (0..=i).map(learned)));
        for i in 0..products.len() {
            let upper: Vec<f64> = products[i + 1..].iter().map(|row| row[i]).collect();
            products[i].extend(upper);
        }
        Self { products, columns }
    }
}

impl Screen<'_> {
    /// The part of the change by `other` that neither this model's parameters nor up to `most` columns of `unnamed`
    /// (greedily selected) can imitate. Blocks of `block` samples of the error count as independent. `None` if `other`
    /// diverges or changes nothing.
    pub(crate) fn shown(
        &self,
        unnamed: &Unnamed,
        other: &Model,
        block: usize,
        most: usize,
    ) -> Option<Shown> {
        let mut change = self.change(other)?;
        self.residualise(&mut change);
        let blocks: Vec<Range<usize>> = self.blocks(block);
        let left = |series: &[f64]| {
            let held_out = &series[self.learned..];
            let judged = blocks.iter().filter(|block| block.start >= self.learned);
            let each = judged.map(|b| dot(&series[b.clone()], &self.error[b.clone()]).powi(2));
            Left {
                energy: dot(held_out, held_out),
                deviation: each.sum::<f64>().sqrt(),
            }
        };
        let held_out = &self.error[self.learned..];
        let mut shown = Shown {
            error: dot(held_out, held_out),
            beside: vec![left(&change)],
        };
        for chosen in self.ever_more(unnamed, &change, most) {
            let chosen: Vec<&[f64]> = chosen
                .iter()
                .map(|i| unnamed.columns[*i].as_slice())
                .collect();
            let Some(rest) = self.rest_of(&change, &chosen) else {
                break;
            };
            shown.beside.push(left(&rest));
        }
        (shown.beside.last()?.energy > 0.0).then_some(shown)
    }

    /// Greedy selection of columns that imitate a change on the estimation samples; the first two are
    /// selected as a pair. Two neighbouring lags may explain little alone and much together, because their
    /// difference is a derivative.
    fn ever_more(&self, unnamed: &Unnamed, change: &[f64], most: usize) -> Vec<Vec<usize>> {
        let columns: Vec<&[f64]> = (unnamed.columns.iter())
            .map(|column| &column[..self.learned])
            .collect();
        let along: Vec<f64> = columns
            .iter()
            .map(|c| dot(c, &change[..self.learned]))
            .collect();
        let square = |i: usize| unnamed.products[i][i].max(f64::MIN_POSITIVE);
        let alone = |i: &usize| along[*i].powi(2) / square(*i);
        let pair = |(i, j): &(usize, usize)| {
            let (a, b, both) = (square(*i), square(*j), unnamed.products[*i][*j]);
            let apart = a * b - both * both;
            if apart <= SAME * a * b {
                return 0.0;
            }
            let (x, y) = (along[*i], along[*j]);
            (x * x * b - 2.0 * x * y * both + y * y * a) / apart
        };
        let all = 0..columns.len();
        let Some(first) = all.clone().max_by(|a, b| alone(a).total_cmp(&alone(b))) else {
            return Vec::new();
        };
        let mut chosen = vec![vec![first]];
        let pairs = all.flat_map(|j| (0..j).map(move |i| (i, j)));
        let best = pairs.max_by(|a, b| pair(a).total_cmp(&pair(b)));
        chosen.extend(best.map(|(i, j)| vec![i, j]));
        while let Some(last) = chosen.last().filter(|last| last.len() < most) {
            let of: Vec<&[f64]> = last
                .iter()
                .map(|i| unnamed.columns[*i].as_slice())
                .collect();
            let Some(rest) = self.rest_of(change, &of) else {
                break;
            };
            let takes = |i: &usize| dot(columns[*i], &rest[..self.learned]).powi(2) / square(*i);
            let others = (0..columns.len()).filter(|i| !last.contains(i));
            let Some(next) = others.max_by(|a, b| takes(a).total_cmp(&takes(b))) else {
                break;
            };
            let longer = [last.as_slice(), &[next]].concat();
            chosen.push(longer);
        }
        chosen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Record, Use};
    use crate::model::Delay;
    use crate::terms::Bench;
    use model_core::effects::spec;

    /// On/off commands on a flow with equal attachment and separation times: it is linear, so an echo equals
    /// two lags.
    fn linear() -> (Model, Vec<Record>) {
        let model = Model {
            a: vec![0.97],
            b: vec![0.03],
            c: vec![0.0],
            delay: Delay::Fixed { delays: vec![30] },
            ..Model::default()
        };
        let mut random = 5_u32;
        let mut next = move || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            random >> 16
        };
        let mut record = |index: usize| {
            let mut u: Vec<f64> = vec![0.0; 600];
            while u.len() < 5000 {
                let (blow, rest) = (30 + next() % 200, 30 + next() % 200);
                u.extend((0..blow).map(|_| 1.0));
                u.extend((0..rest).map(|_| 0.0));
            }
            u.truncate(5000);
            let mut y = vec![0.0];
            for k in 0..u.len() - 1 {
                let jet = if k >= 30 { u[k - 30] } else { 0.0 };
                y.push(0.97 * y[k] + 0.03 * jet);
            }
            y.iter_mut()
                .for_each(|y| *y += 1e-3 * (f64::from(next() % 1000) / 1e3 - 0.5));
            let role = [Use::Identify, Use::Validate][index % 2];
            Record::new(&format!("r{index}"), role, 0.001, u, y)
        };
        let records = (0..4).map(&mut record).collect();
        (model, records)
    }

    /// The delay of a pickup would imitate the first samples of the response.
    #[test]
    fn a_pickup_is_no_candidate_where_the_flow_answers_at_once() {
        let (model, records) = linear();
        let bench = Bench::of(&model, &records).expect("records to learn from");
        let pickup = spec("electrical-pickup").expect("in the catalogue");
        let reason = |delay: u16| {
            let delays = vec![delay];
            let model = Model {
                delay: Delay::Fixed { delays },
                ..bench.given.clone()
            };
            let screen = Screen::new(&bench.judge, &model).expect("a stable model");
            screen.pointless(pickup)
        };
        assert_eq!(reason(30), None);
        assert!(reason(1).is_some());
    }

    #[test]
    fn an_echo_hides_behind_two_lags_and_not_behind_one() {
        let (model, records) = linear();
        let bench = Bench::of(&model, &records).expect("records to learn from");
        let fitted = bench.judge.refitted(&bench.given).expect("a stable model");
        let screen = Screen::new(&bench.judge, fitted.model()).expect("a stable model");
        let unnamed = Unnamed::of(&screen, &Known::of(&bench.judge.learning(0)));
        let left = |name: &str, parameters: &[f64]| -> Vec<f64> {
            let mut other = fitted.model().clone();
            other.add(spec(name).expect("in the catalogue"), parameters, None);
            let shown = screen.shown(&unnamed, &other, 50, 4).expect("it shows");
            let energy = |left: &Left| left.energy / shown.beside[0].energy;
            shown.beside.iter().map(energy).collect()
        };
        let echo = left("echo-path", &[0.1, 0.142]);
        assert!(echo[1] > 0.02 && echo[2] < 1e-3, "{echo:?}");
        // No lag of y has an effect before y moves.
        let pickup = left("electrical-pickup", &[0.1, 0.0]);
        assert!(pickup.len() == 5 && pickup[4] > 0.2, "{pickup:?}");
    }
}
