//! Edges of the command.

use super::plant::{Change, Switching};
use super::rules::RULES;

/// One switching of the command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Edge {
    /// The first sample with the new command.
    pub sample: usize,
    /// Off → on, or to a higher level.
    pub rising: bool,
}

/// The changes of the command that count as edges, with their indices in `switching.changes`. Every
/// change of an on/off command counts; a change of a graded command counts if it is at least the rule's
/// share of the `range`.
pub(crate) fn edges(switching: &Switching, range: f64) -> Vec<(usize, Edge)> {
    let least = RULES.smallest_edge * range;
    let mut last = 0.0;
    let sizes = switching.changes.iter().map(|change: &Change| {
        let size = change.level - last;
        last = change.level;
        size
    });
    let counted = sizes.zip(&switching.changes).enumerate();
    counted
        .filter(|(_, (size, _))| size.abs() >= least)
        .map(|(place, (_, change))| {
            let edge = Edge {
                // Times of changes are samples of the record.
                sample: change.time as usize,
                rising: change.rising,
            };
            (place, edge)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(u: &[f64], before: f64) -> Vec<(usize, bool)> {
        edges(&Switching::of(u, before, 0.5), 1.0)
            .iter()
            .map(|(_, e)| (e.sample, e.rising))
            .collect()
    }

    #[test]
    fn the_first_sample_is_an_edge_only_where_u_was_something_else_before() {
        let u = [1.0, 1.0, 0.0, 0.0, 1.0];
        assert_eq!(found(&u, 0.0), [(0, true), (2, false), (4, true)]);
        assert_eq!(found(&u, 1.0), [(2, false), (4, true)]);
    }

    #[test]
    fn every_level_change_that_matters_is_an_edge() {
        let u = [0.2, 0.2, 0.8, 0.79, 0.3, 0.3];
        assert_eq!(found(&u, 0.2), [(2, true), (4, false)]);
    }
}
