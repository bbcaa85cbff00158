//! Edges of the command.

use crate::data::Record;

/// One switching of the command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Edge {
    /// The first sample with the new command.
    pub sample: usize,
    /// Off → on.
    pub rising: bool,
}

/// The edges of a record in order of time. Before the record the command is 0, so a record that starts blowing starts
/// with a rising edge. Values of the command other than 0 count as on.
#[must_use]
pub fn edges(record: &Record) -> Vec<Edge> {
    let mut on = false;
    let mut edges = Vec::new();
    for (sample, &u) in record.u.iter().enumerate() {
        if (u != 0.0) != on {
            on = u != 0.0;
            edges.push(Edge { sample, rising: on });
        }
    }
    edges
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;

    #[test]
    fn edges_with_history_zero() {
        let u = vec![1.0, 1.0, 0.0, 0.0, 1.0];
        let record = Record::new("r", Use::Identify, 0.001, u, vec![0.0; 5]);
        let found: Vec<(usize, bool)> = edges(&record)
            .iter()
            .map(|e| (e.sample, e.rising))
            .collect();
        assert_eq!(found, [(0, true), (2, false), (4, true)]);
    }
}
