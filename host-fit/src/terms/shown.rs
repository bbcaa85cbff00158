//! What a change of the model shows beside what needs no name.

use super::screen::Screen;
use super::table::Table;
use crate::linalg::dot;
use crate::model::Model;
use std::ops::Range;

/// What a change of the model shows in the free run, on what is held out.
#[derive(Clone, Debug)]
pub(crate) struct Shown {
    /// Energy of the error.
    pub(crate) error: f64,
    /// What is left of the change beside ever more terms without a name; first, beside none.
    pub(crate) beside: Vec<Left>,
}

/// What is left of a change.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Left {
    /// Its energy.
    pub(crate) energy: f64,
    /// Standard deviation of it times the error.
    pub(crate) deviation: f64,
}

impl Screen<'_> {
    /// What `other` changes that this model's own parameters cannot do in its place, nor up to `most`
    /// columns of `unnamed`, the best first; `block` samples of the error are independent of the next.
    /// `None` if it diverges or changes nothing.
    pub(crate) fn shown(
        &self,
        unnamed: &Table,
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
        let mut rest = change.clone();
        let mut chosen: Vec<&[f64]> = Vec::new();
        while chosen.len() < most {
            let takes = |column: &&Vec<f64>| {
                let (own, rest) = (&column[..self.learned], &rest[..self.learned]);
                dot(own, rest).powi(2) / dot(own, own).max(f64::MIN_POSITIVE)
            };
            let best = unnamed
                .columns
                .iter()
                .max_by(|a, b| takes(a).total_cmp(&takes(b)));
            let Some(best) = best else { break };
            chosen.push(best);
            let Some(less) = self.rest_of(&change, &chosen) else {
                break;
            };
            rest = less;
            shown.beside.push(left(&rest));
        }
        (shown.beside.last()?.energy > 0.0).then_some(shown)
    }
}
