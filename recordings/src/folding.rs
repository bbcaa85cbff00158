//! Accumulation of repeats: the samples of the running period, and the sums over complete periods.

use std::collections::BTreeMap;

use crate::averaging::{Align, AverageError, AverageSummary, Averaging, Defect, Dropped};
use crate::error::FilePlace;
use crate::raw::RawReader;
use crate::record::{Record, Use};
use crate::thresholds::RULES;

/// A sample of the running period.
#[derive(Debug, Clone, Copy)]
struct Waiting {
    line: u64,
    on: bool,
    defect: Option<Defect>,
}

/// The state of an average: the samples of the running period and the sums of the complete ones.
#[derive(Debug)]
pub(super) struct Folding {
    /// Exact number of samples per period; the buffer works with the rounded number.
    exact_length: f64,
    length: usize,
    width: usize,
    jitter: usize,
    /// Search range of an anchor to either side.
    slack: usize,
    align: Align,
    /// Sample of the anchor edge within the period, once known.
    anchor: Option<usize>,
    /// Command of the sample before the buffer.
    pub(super) before: Option<bool>,
    /// Samples at the front of the buffer that belong to the preceding period, for an early anchor.
    lead_in: usize,
    waiting: Vec<Waiting>,
    values: Vec<f64>,
    /// Grid alignment: index and first sample of the running period since the last restart.
    period: u64,
    started_at: u64,
    sequences: Vec<Sequence>,
    dropped: BTreeMap<Defect, (u64, u64)>,
    pub(super) rows: u64,
    edges: Vec<(usize, bool)>,
}

/// Sums over the periods with the same command sequence.
#[derive(Debug)]
struct Sequence {
    edges: Vec<(usize, bool)>,
    first_line: u64,
    periods: u64,
    on_count: Vec<u32>,
    mean: Vec<f64>,
    m2: Vec<f64>,
    low: Vec<f64>,
    high: Vec<f64>,
}

impl Sequence {
    fn new(edges: Vec<(usize, bool)>, first_line: u64, length: usize, width: usize) -> Self {
        Self {
            edges,
            first_line,
            periods: 0,
            on_count: vec![0; length],
            mean: vec![0.0; length * width],
            m2: vec![0.0; length],
            low: vec![f64::INFINITY; length],
            high: vec![f64::NEG_INFINITY; length],
        }
    }

    fn matches(&self, edges: &[(usize, bool)], jitter: usize) -> bool {
        self.edges.len() == edges.len()
            && self
                .edges
                .iter()
                .zip(edges)
                .all(|(a, b)| a.1 == b.1 && a.0.abs_diff(b.0) <= jitter)
    }

    /// Adds one period (Welford's recursion); spread and envelope are those of `y`, the first value of each
    /// sample.
    fn add(&mut self, samples: &[Waiting], values: &[f64], width: usize) {
        self.periods += 1;
        let weight = 1.0 / self.periods as f64;
        for (count, sample) in self.on_count.iter_mut().zip(samples) {
            *count += u32::from(sample.on);
        }
        let rows = values
            .chunks_exact(width)
            .zip(self.mean.chunks_exact_mut(width));
        let spread = self.m2.iter_mut().zip(&mut self.low).zip(&mut self.high);
        for ((row, mean), ((m2, low), high)) in rows.zip(spread) {
            if let (Some(&y), Some(&mean_y)) = (row.first(), mean.first()) {
                let away = y - mean_y;
                *m2 += away * away * (1.0 - weight);
                *low = low.min(y);
                *high = high.max(y);
            }
            for (mean, value) in mean.iter_mut().zip(row) {
                *mean += (value - *mean) * weight;
            }
        }
    }
}

impl Folding {
    pub(super) fn new(exact_length: f64, width: usize, averaging: &Averaging) -> Self {
        let length = exact_length.round() as usize;
        Self {
            exact_length,
            length,
            width,
            jitter: averaging.edge_jitter,
            slack: (length / 50).clamp(2, 200).min(length / 4),
            align: averaging.align,
            anchor: None,
            before: None,
            lead_in: 0,
            waiting: Vec::new(),
            values: Vec::new(),
            period: 0,
            started_at: 0,
            sequences: Vec::new(),
            dropped: BTreeMap::new(),
            rows: 0,
            edges: Vec::new(),
        }
    }

    fn drop_period(&mut self, defect: Defect, line: u64, periods: u64) {
        let entry = self.dropped.entry(defect).or_insert((0, line));
        entry.0 += periods;
        entry.1 = entry.1.min(line);
    }

    /// `count` samples are missing before the row at `line`.
    pub(super) fn gap(&mut self, count: u64, line: u64) {
        let placeholder = Waiting {
            line,
            on: self.last_on(),
            defect: Some(Defect::MissingSamples),
        };
        // Whole periods inside a long gap are counted without iterating over them.
        let period = match self.align {
            Align::Edges => self.length as f64,
            Align::Grid => self.exact_length,
        };
        let far = (count.saturating_sub(2 * self.length as u64) as f64 / period) as u64;
        let mut near = count;
        if far > 0 {
            self.drop_period(Defect::MissingSamples, line, far);
            let skipped = match self.align {
                Align::Edges => far * self.length as u64,
                Align::Grid => {
                    let before = self.started_at;
                    self.period = self.period.saturating_add(far);
                    self.started_at = (self.period as f64 * self.exact_length).round() as u64;
                    self.started_at - before
                }
            };
            near = count.saturating_sub(skipped);
        }
        for _ in 0..near {
            self.waiting.push(placeholder);
            self.values.extend(std::iter::repeat_n(0.0, self.width));
            self.settle();
        }
    }

    /// The recording starts again at the row at `line`.
    pub(super) fn restart(&mut self, line: u64) {
        if self.waiting.len() > self.lead_in {
            self.drop_period(Defect::Restart, line, 1);
        }
        self.waiting.clear();
        self.values.clear();
        self.lead_in = 0;
        self.before = None;
        self.period = 0;
        self.started_at = 0;
    }

    fn last_on(&self) -> bool {
        self.waiting
            .last()
            .map_or(self.before.unwrap_or(false), |w| w.on)
    }

    pub(super) fn push(
        &mut self,
        line: u64,
        on: Option<bool>,
        defect: Option<Defect>,
        values: &[f64],
    ) {
        let on = on.unwrap_or_else(|| self.last_on());
        self.waiting.push(Waiting { line, on, defect });
        self.values.extend_from_slice(values);
        self.settle();
    }

    /// Completes the current period when all its samples and the margin for a late anchor are in the buffer.
    fn settle(&mut self) {
        let margin = match self.align {
            Align::Edges => self.slack,
            Align::Grid => 0,
        };
        if self.waiting.len() < self.lead_in + self.length + margin {
            return;
        }
        let shift = match self.align {
            Align::Grid => Some(0),
            Align::Edges => self.anchor_shift(),
        };
        let start = self.lead_in.saturating_add_signed(shift.unwrap_or(0));
        self.close_period(start, shift.is_some());
        let next = match self.align {
            Align::Edges => start + self.length,
            Align::Grid => {
                self.period += 1;
                let next_start = (self.period as f64 * self.exact_length).round() as u64;
                let advance = next_start.saturating_sub(self.started_at) as usize;
                self.started_at = next_start;
                (start + advance).min(self.waiting.len())
            }
        };
        let keep_from = next.saturating_sub(margin);
        self.before = match keep_from.checked_sub(1) {
            Some(last) => self.waiting.get(last).map(|w| w.on),
            None => self.before,
        };
        self.lead_in = next - keep_from;
        self.waiting.drain(..keep_from);
        self.values.drain(..keep_from * self.width);
    }

    /// Delay of the current period's anchor relative to its expected time, samples; `None` if there is no anchor.
    fn anchor_shift(&mut self) -> Option<isize> {
        let rises = |i: usize| -> bool {
            let now = self.waiting.get(i).is_some_and(|w| w.on);
            let before = match i.checked_sub(1) {
                Some(j) => self.waiting.get(j).map(|w| w.on),
                None => self.before,
            };
            now && before == Some(false)
        };
        let Some(anchor) = self.anchor else {
            // The first rising edge seen becomes the anchor.
            let first = (self.lead_in..self.lead_in + self.length).find(|&i| rises(i))?;
            self.anchor = Some(first - self.lead_in);
            return Some(0);
        };
        let expected = self.lead_in + anchor;
        (0..=self.slack)
            .flat_map(|d| [expected.checked_sub(d), Some(expected + d)])
            .flatten()
            .find(|&i| rises(i))
            .map(|found| found as isize - expected as isize)
            .filter(|&shift| self.lead_in as isize + shift >= 0)
    }

    fn close_period(&mut self, start: usize, anchored: bool) {
        let end = start + self.length;
        let (Some(samples), Some(values)) = (
            self.waiting.get(start..end),
            self.values.get(start * self.width..end * self.width),
        ) else {
            return;
        };
        let first_line = samples.first().map_or(0, |s| s.line);
        if let Some(bad) = samples.iter().find(|s| s.defect.is_some()) {
            let (defect, line) = (bad.defect, bad.line);
            self.drop_period(defect.unwrap_or(Defect::UnreadableValue), line, 1);
            return;
        }
        // Edges within the jitter of the period's ends may belong to the neighbouring period. Only edges between
        // them count, starting from the level at the start of the period.
        self.edges.clear();
        let inner = self.jitter..self.length.saturating_sub(self.jitter);
        let mut level = None;
        for (i, sample) in samples.iter().enumerate() {
            if inner.contains(&i) && level != Some(sample.on) {
                self.edges.push((i, sample.on));
                level = Some(sample.on);
            }
        }
        // Without edges there is no anchor, and no misalignment.
        if !anchored && self.anchor.is_some() {
            self.drop_period(Defect::NoAnchorEdge, first_line, 1);
            return;
        }
        let known = self
            .sequences
            .iter()
            .position(|s| s.matches(&self.edges, self.jitter));
        let index = match known {
            Some(index) => index,
            None => {
                let fresh = Sequence::new(self.edges.clone(), first_line, self.length, self.width);
                if self.sequences.len() < RULES.sequences {
                    self.sequences.push(fresh);
                    self.sequences.len() - 1
                } else {
                    // The rarest sequence is dropped to make room.
                    let rarest = (0..self.sequences.len())
                        .min_by_key(|&i| self.sequences.get(i).map_or(0, |s| s.periods))
                        .unwrap_or(0);
                    let Some(place) = self.sequences.get_mut(rarest) else {
                        return;
                    };
                    let old = std::mem::replace(place, fresh);
                    let entry = self
                        .dropped
                        .entry(Defect::OtherCommand)
                        .or_insert((0, old.first_line));
                    entry.0 += old.periods;
                    entry.1 = entry.1.min(old.first_line);
                    rarest
                }
            }
        };
        if let Some(sequence) = self.sequences.get_mut(index) {
            sequence.add(samples, values, self.width);
        }
    }

    pub(super) fn finish<R: std::io::BufRead>(
        mut self,
        raw: &RawReader<R>,
        name: &str,
        role: Use,
        place: FilePlace,
    ) -> Result<(Record, AverageSummary), AverageError> {
        // The last period may be complete and waiting only for the margin of a late anchor.
        let mut left_over = self.waiting.len().saturating_sub(self.lead_in);
        if self.align == Align::Edges && left_over >= self.length {
            let shift = self.anchor_shift();
            let start = self.lead_in.saturating_add_signed(shift.unwrap_or(0));
            if start + self.length <= self.waiting.len() {
                self.close_period(start, shift.is_some());
                left_over = self.waiting.len() - start - self.length;
            }
        }
        // Of equally frequent sequences the first is used, so that the result is unique.
        let most = self.sequences.iter().map(|s| s.periods).max().unwrap_or(0);
        let rule = self.sequences.iter().position(|s| s.periods == most);
        let Some(rule) = rule else {
            let mut found: Vec<String> = self
                .dropped
                .iter()
                .map(|(d, (n, line))| format!("{n} dropped: {}, first at line {line}", d.words()))
                .collect();
            found.push(format!(
                "{left_over} samples left over; a period has {}",
                self.length
            ));
            return Err(AverageError::NothingLeft {
                place: Box::new(place),
                found: found.join("; "),
            });
        };
        let rule = self.sequences.swap_remove(rule);
        for other in std::mem::take(&mut self.sequences) {
            self.drop_period(Defect::OtherCommand, other.first_line, other.periods);
        }
        let n = rule.periods as f64;
        let column = |i: usize| -> Vec<f64> {
            rule.mean
                .iter()
                .skip(i)
                .step_by(self.width)
                .copied()
                .collect()
        };
        let mut record = Record::new(
            name,
            role,
            raw.sample_period_s(),
            rule.on_count
                .iter()
                .map(|&c| {
                    if 2 * u64::from(c) >= rule.periods && c > 0 {
                        1.0
                    } else {
                        0.0
                    }
                })
                .collect(),
            column(0),
        );
        if rule.periods > 1 {
            record.y_sd = Some(
                rule.m2
                    .iter()
                    .map(|m2| (m2.max(0.0) / (n - 1.0) / n).sqrt())
                    .collect(),
            );
        }
        record.y_min = Some(rule.low);
        record.y_max = Some(rule.high);
        for (i, channel) in raw.names().iter().enumerate().skip(1) {
            record.channels.insert(channel.clone(), column(i));
        }
        let summary = AverageSummary {
            name: name.to_owned(),
            rows: self.rows,
            bytes: raw.bytes(),
            sample_period_s: raw.sample_period_s(),
            period_samples: self.length,
            periods_used: rule.periods,
            dropped: self
                .dropped
                .into_iter()
                .map(|(defect, (periods, first_line))| Dropped {
                    defect,
                    periods,
                    first_line,
                })
                .collect(),
            left_over_samples: left_over,
            aligned_on_edges: self.anchor.is_some(),
            mean_standard_error: record
                .y_sd
                .as_ref()
                .map(|sd| (sd.iter().map(|s| s * s).sum::<f64>() / sd.len().max(1) as f64).sqrt()),
        };
        Ok((record, summary))
    }
}
