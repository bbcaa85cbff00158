//! Properties of the records that are determined before any model: where they rest, the command before them, the
//! scored samples, and zero and size of command and response.
//!
//! All of these come from the data alone. Every hypothesis of a command is therefore simulated from the same
//! beginnings and scored on the same samples.

mod beginning;
mod command;
mod levels;
mod reference;
mod rest;
mod row;
mod rules;
mod smoothing;

pub use reference::FirstOrder;
pub use rest::MovingZero;
pub use rules::{RULES, Rules};

use crate::baseline::Baselines;
use crate::data::import::near_two_levels;
use crate::data::{Record, Use};
use crate::model::CommandRange;
use beginning::Beginning;
use smoothing::{Slow, slow_part, smoothed};
use std::fmt::Write as _;

/// Prepared records, with the properties found.
#[derive(Clone, Debug)]
pub struct Preparation {
    /// The records, with the signals before their first sample and the range of scored samples. If the sensor's
    /// offset varies, each record's own offset is subtracted.
    pub records: Vec<Record>,
    /// The commands of no jet and of a full jet, in the unit of u.
    pub command: CommandRange,
    /// Whether the full jet of `command` is that of the rig; if not, it is only the largest command of the records.
    pub full_is_known: bool,
    /// The reading without friction gain, y: the level of rest without jet, or an estimate of it.
    pub zero: f64,
    /// Whether every record begins at rest without jet.
    pub at_rest: bool,
    /// The offset of the sensor, if it differs between records.
    pub moving_zero: Option<MovingZero>,
    /// Whether y responds to the command of its own row; u of `records` is then moved up by one row.
    pub own_row: bool,
    /// The first-order response on which these decisions are based; `None` if u and y are unrelated.
    pub reference: Option<FirstOrder>,
}

impl Preparation {
    /// Prepares `records`; what their files state about the beginning is not changed.
    #[must_use]
    pub fn of(records: &[Record]) -> Self {
        if let Some(moved) = row::in_own_row(records) {
            return Self {
                own_row: true,
                ..Self::of_rows(&moved)
            };
        }
        Self::of_rows(records)
    }

    /// Prepares `records` in which u_k acts from y_{k+1} on.
    fn of_rows(records: &[Record]) -> Self {
        let prepared = Self::as_read(records);
        if prepared.moving_zero.is_some() {
            return prepared;
        }
        // Where the levels of records differ by more than a response moves y, no record seems to rest.
        let moved = |moving: MovingZero, tared: &[Record]| Self {
            moving_zero: Some(moving),
            ..Self::as_read(tared)
        };
        let begins_at_rest =
            |prepared: &Self| prepared.records.iter().all(|r| r.followed.is_empty());
        if !begins_at_rest(&prepared)
            && let Some((moving, tared)) = MovingZero::by_own_levels(records)
        {
            let with_own = moved(moving, &tared);
            if begins_at_rest(&with_own) {
                return with_own;
            }
        }
        // If rests are too short to distinguish an offset from a relaxation, offsets are estimated by the response
        // through whole records.
        match MovingZero::by_response(records) {
            Some((moving, tared)) => moved(moving, &tared),
            None => prepared,
        }
    }

    /// Prepares `records`; of the offsets only those of rests are corrected.
    fn as_read(records: &[Record]) -> Self {
        let reference = FirstOrder::fitted(records);
        let mut beginnings: Vec<Beginning> = records
            .iter()
            .map(|record| Beginning::of(record, records, reference.as_ref()))
            .collect();
        if let Some(reference) = &reference {
            Beginning::reconcile(&mut beginnings, records, reference);
            Beginning::recognise(&mut beginnings, records, reference);
            Beginning::distrust(&mut beginnings, records, reference);
        }
        let command = command::range_of(records, &beginnings, reference.as_ref());
        let mut prepared: Vec<Record> = records
            .iter()
            .zip(&beginnings)
            .map(|(record, beginning)| beginning.filled_in(record))
            .collect();
        let left = || {
            let first = reference.as_ref().map_or(f64::INFINITY, |r| r.varying_rms);
            first.min(rest::left_by_second_order(&prepared).unwrap_or(f64::INFINITY))
        };
        let moving_zero = MovingZero::of(&prepared, &beginnings, command.off, left);
        if let Some(moving) = &moving_zero {
            rest::tare(&mut prepared, &beginnings, command.off, moving);
        }
        follow(&mut prepared, &beginnings);
        let zero = rest::level_of_rest(&prepared, &beginnings, command.off)
            .unwrap_or_else(|| rest::estimated_zero(&prepared, command, reference.as_ref()));
        Self {
            full_is_known: command.is_unit() || levels::two_levels(records).is_some(),
            at_rest: beginnings.iter().all(|own| own.rests_at(command.off)),
            records: prepared,
            command,
            zero,
            moving_zero,
            own_row: false,
            reference,
        }
    }

    /// Remarks for the user, one sentence each.
    #[must_use]
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        let begun: Vec<&Record> = self
            .records
            .iter()
            .filter(|r| !r.followed.is_empty())
            .collect();
        if let Some(first) = begun.first() {
            let mut text = format!(
                "{} of {} records begin in mid-run: free runs follow the measurement for their first ",
                begun.len(),
                self.records.len()
            );
            let _ = write!(
                text,
                "{} samples ({} s), which are not scored.",
                first.lead,
                crate::picture::significant(first.lead as f64 * first.sample_period_s, 3)
            );
            remarks.push(text);
        }
        if self.own_row {
            remarks.push(
                "y responds to the command of its own row. The command is therefore read one row earlier, because \
                    models and boards read y before they set the command."
                    .to_owned(),
            );
        }
        if self.command.off != 0.0 {
            remarks.push(format!(
                "The command is {} without a jet and {} with a full jet.",
                self.command.off, self.command.full
            ));
        }
        if levels::two_levels(&self.records).is_none() {
            let all = self.records.iter().flat_map(|r| r.u.iter().copied());
            let near = near_two_levels(&all.collect::<Vec<f64>>());
            let words = |v: f64| crate::picture::significant(v, 2);
            remarks.extend(near.map(|(low, high)| {
                format!(
                    "u has values near {} and {} and hardly any between: if this is a measured on/off command, \
                     `import` the files with --u-threshold {}.",
                    words(low),
                    words(high),
                    words(0.5 * (low + high))
                )
            }));
        }
        remarks.extend(self.moving_zero.iter().map(ToString::to_string));
        remarks
    }
}

/// Sets the output from which free runs start in records that begin in mid-run. It is the response of a
/// second-order plant with dead time whose initial state is fitted to the start of the record, plus the slow part
/// of the residual of y against that response, if there is one (theory 1.5). Single samples are too noisy to give
/// the slope of y, and smoothing y itself would be biased after edges.
fn follow(records: &mut [Record], beginnings: &[Beginning]) {
    if beginnings.iter().all(|own| own.follow == 0) {
        return;
    }
    let learning: Vec<&Record> = records.iter().filter(|r| r.role == Use::Identify).collect();
    let second = Baselines::second_order(&learning);
    for (record, own) in records.iter_mut().zip(beginnings) {
        if own.follow == 0 {
            continue;
        }
        let follow = own.follow.min(record.len());
        record.followed = record.y[..follow].to_vec();
        let run = second.and_then(|second| second.simulate(record));
        let run = run.unwrap_or_else(|| vec![0.0; record.len()]);
        let left: Vec<f64> = record.y.iter().zip(&run).map(|(y, run)| y - run).collect();
        // During the first dead time y responds to commands that were not recorded, so the fitted response is not
        // valid there.
        let answered = second.map_or(0.0, |second| second.dead_time_s / record.sample_period_s);
        let from = (answered.ceil() as usize + 1).min(follow / 2);
        let slow = slow_part(&left[from..], 0..follow - from);
        let half = match slow {
            Slow::Nothing => 0,
            Slow::Parabola(half) => half.min((follow - from) / 2),
        };
        // The smoothed value of the last followed sample uses `half` samples after it; those are not scored either.
        let follow = follow - half;
        let answered = (from..follow).map(|k| match slow {
            Slow::Nothing => run[k],
            Slow::Parabola(_) => run[k] + smoothed(&left[from..], k - from, half),
        });
        record.followed.truncate(from);
        record.followed.extend(answered);
        record.lead = record.lead.max(follow + half);
    }
}

/// Samples of `records` that are scored, and samples in all.
#[must_use]
pub fn scored_samples(records: &[Record]) -> (usize, usize) {
    let scored = records.iter().map(|r| r.len().saturating_sub(r.lead)).sum();
    (scored, records.iter().map(Record::len).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_measured_valve_voltage_is_pointed_out() {
        let remarks = |read: &dyn Fn(f64, usize) -> f64| {
            let on = |k: usize| f64::from(u8::from(k / 60 % 3 == 1));
            let u = (0..1200).map(|k| read(on(k), k)).collect();
            let y = (0..1200).map(|k| (0.1 * k as f64).sin()).collect();
            let record = Record::new("r", Use::Identify, 0.001, u, y);
            Preparation::of(&[record]).remarks().join(" ")
        };
        let volts = |on: f64, k: usize| 24.0 * on + 0.1 * (k as f64).cos();
        let told = remarks(&volts);
        assert!(told.contains("--u-threshold 12"), "{told}");
        // Two exact levels are an on/off command already; three levels are none.
        let others: [&dyn Fn(f64, usize) -> f64; 3] =
            [&|on, _| on, &|on, _| 255.0 * on, &|on, k| {
                if k % 7 == 0 { 0.5 } else { on }
            }];
        for read in others {
            let told = remarks(read);
            assert!(!told.contains("--u-threshold"), "{told}");
        }
    }
}
