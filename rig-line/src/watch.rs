//! The closed loop in operation: displayed, logged and checked.
//!
//! The log is a data set of one record, so `compare` and `diagnose` read it. It begins at rest, before the law is
//! armed, and ends at the first missing sample, because a free run needs the whole history. The check of the model
//! continues.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use recordings::output::{OutputError, Staging};
use serde::Serialize;
use wire::reply::{Phase, Scale};
use wire::samples::Sample;

use crate::alarm::{Alarm, Test, Verdict};
use crate::error::LineError;
use crate::host::{Change, Event, Host, Streamed, word};
use crate::log::{Columns, value};
use crate::record::MOST_SAMPLES;

/// Options of a watch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Arms the law after `rest_s`, and closes the valve at the end.
    pub arm: bool,
    /// Logged rest before the law is armed, s.
    pub rest_s: f64,
    /// Duration, s; infinite for no limit.
    pub duration_s: f64,
    /// Longest log, s.
    pub log_s: f64,
    /// Test of the model.
    pub test: Test,
}

/// State of the closed loop at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Now {
    /// Time, s.
    pub t: f64,
    /// Phase of the board.
    pub phase: Phase,
    /// The reading, y.
    pub y: f64,
    /// y*, where the law has one.
    pub reference: Option<f64>,
    /// Output of the model, y.
    pub model: Option<f64>,
    /// The valve.
    pub open: bool,
    /// Missing samples so far.
    pub lost: u64,
    /// Verdict on the model so far.
    pub verdict: Verdict,
    /// Residual averaged over about 64 samples, y.
    pub residual: Option<f64>,
    /// Distance of that average from the limit at which the board closes the valve, as a share of the limit.
    pub margin: Option<f64>,
}

/// The next action after a sample of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Turn {
    /// Watch on.
    GoOn,
    /// Change the running law, and watch on.
    Change(Change),
    /// End.
    End,
}

/// A requested change of the law. Serialises to the keys under `changes` of `watch --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Changed {
    /// Time, s.
    pub t: f64,
    /// The change.
    pub change: String,
    /// Reason if the change was refused; `None` if it was made.
    pub refused: Option<String>,
}

/// Result of watching. Serialises to the keys of `watch --json`.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Watched {
    /// How long, s.
    pub seconds: f64,
    /// Samples that came.
    pub samples: u64,
    /// Samples that were lost.
    pub lost_samples: u64,
    /// While the law controls the valve: root mean square of y* − y, if the law has a reference.
    pub rms_error: Option<f64>,
    /// Root mean square of reading minus model.
    pub rms_residual: Option<f64>,
    /// Mean y.
    pub mean: Option<f64>,
    /// Share of the time with an open valve.
    pub air: Option<f64>,
    /// Switches of the valve per second.
    pub switches_per_s: Option<f64>,
    /// The smallest distance of the averaged residual from the board's limit, as a share of the limit.
    pub least_margin: Option<f64>,
    /// The changes of the law.
    pub changes: Vec<Changed>,
    /// Verdict on the model so far.
    #[serde(flatten)]
    pub verdict: Option<Verdict>,
    /// The data set, if one was requested.
    #[serde(serialize_with = "some_text")]
    pub log: Option<PathBuf>,
    /// Samples in it.
    pub logged: u64,
    /// The reason for an early end.
    pub ended: Option<String>,
}

fn some_text<S: serde::Serializer>(path: &Option<PathBuf>, to: S) -> Result<S::Ok, S::Error> {
    path.as_ref()
        .map(|path| path.to_string_lossy())
        .serialize(to)
}

/// Longest time without a message.
const SILENCE: Duration = Duration::from_secs(2);
/// Longest time in which the board may answer without a new sample.
const NOTHING_NEW: Duration = Duration::from_secs(10);
/// Errors and air are computed from this time after arming on, s; before it the flow is far from y*.
const SETTLING_S: f64 = 1.0;
/// Errors and air are computed only after at least this many samples, because flows are slow at a
/// long sample period.
const SETTLING: u64 = 1000;

/// Weight of a residual in the average that the board compares with its limit.
const SHARE: f64 = 1.0 / 64.0;

/// Watches the loop behind `host` and makes the changes that `turn` returns, until `turn` returns the end. Writes the
/// log's folder, if requested.
///
/// The board answers a change before the next one is requested. A refused change is recorded, and the loop
/// continues unchanged.
///
/// # Errors
/// [`LineError`] if the board cannot be watched.
pub fn watch(
    host: &mut Host,
    plan: &Plan,
    columns: &Columns,
    log: Option<&Path>,
    turn: &mut dyn FnMut(&Now) -> Turn,
) -> Result<Watched, LineError> {
    let board = host.hello()?;
    if plan.arm && board.phase != Phase::Disarmed {
        return Err(LineError::Refused {
            asked: "arm",
            reason: format!("it is {}; disarm it first (`--disarm`)", word(board.phase)),
        });
    }
    let period_s = f64::from(board.period_us) * 1e-6;
    let most_rows = plan.log_s / period_s;
    if log.is_some() && most_rows > MOST_SAMPLES as f64 {
        return Err(LineError::TooLong {
            what: "log",
            longest_s: MOST_SAMPLES as f64 * period_s,
        });
    }
    let mut watcher = Watcher {
        period_s,
        sensor: columns.sensor.unwrap_or(board.sensor),
        board: board.sensor,
        envelope: f64::from(board.envelope),
        strayed: 0.0,
        reference: None,
        alarm: Alarm::new(plan.test, period_s),
        next: 0,
        phase: Phase::Disarmed,
        rows: Vec::new(),
        // Only a log that begins at rest is a valid record.
        logs: log.is_some() && board.phase == Phase::Disarmed,
        most_rows: most_rows as usize,
        armed: Sums::default(),
        watched: Watched::default(),
        armed_since: 0,
        last: None,
    };
    host.stream()?;
    let mut armed = false;
    let mut came = Instant::now();
    let ended = loop {
        if came.elapsed() > NOTHING_NEW {
            break Some("the board answers, but sends no new samples".to_owned());
        }
        let streamed = match host.next(SILENCE)? {
            Event::Samples(streamed) => streamed,
            Event::Silence => {
                let info = host.hello()?;
                if info.session == host.session() {
                    continue;
                }
                break Some(format!(
                    "the board has lost its host and is {}",
                    word(info.phase)
                ));
            }
        };
        let Some(now) = watcher.take(&streamed) else {
            continue;
        };
        came = Instant::now();
        if let Phase::Faulted(_) = streamed.phase {
            break Some(format!(
                "the board closed the valve: {}",
                word(streamed.phase)
            ));
        }
        if plan.arm && !armed && now.t >= plan.rest_s {
            armed = true;
            host.arm()?;
        }
        match turn(&now) {
            Turn::End => break None,
            Turn::Change(change) => {
                let result = host.change(change);
                if let Err(error @ LineError::Gone(_)) = result {
                    return Err(error);
                }
                watcher.watched.changes.push(Changed {
                    t: now.t,
                    change: change.to_string(),
                    refused: result.err().map(|error| error.to_string()),
                });
            }
            Turn::GoOn => {}
        }
        if now.t >= plan.duration_s {
            break None;
        }
    };
    if plan.arm {
        host.disarm()?;
    }
    let mut watched = watcher.figures();
    watched.ended = ended;
    if let Some(folder) = log {
        watched.logged = watcher.rows.len() as u64;
        if watched.logged > 1 {
            write(folder, &watcher, columns)?;
            watched.log = Some(folder.to_path_buf());
        }
    }
    Ok(watched)
}

/// Sums over the samples at which the law controls the valve.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    samples: u64,
    y: f64,
    error: f64,
    referred: u64,
    residual: f64,
    open: u64,
    switches: u64,
}

struct Watcher {
    period_s: f64,
    sensor: Scale,
    /// The board's scale: the law's numbers arrive in its counts.
    board: Scale,
    /// The board's limit of the averaged residual, y.
    envelope: f64,
    /// The averaged residual, y.
    strayed: f64,
    /// y* of the samples before.
    reference: Option<f32>,
    alarm: Alarm,
    next: u32,
    phase: Phase,
    rows: Vec<Row>,
    logs: bool,
    most_rows: usize,
    armed: Sums,
    watched: Watched,
    /// Number of samples for which the law has controlled the valve.
    armed_since: u64,
    last: Option<bool>,
}

struct Row {
    sample: Sample,
    reference: Option<f32>,
}

impl Watcher {
    /// Receives samples; the newest is displayed.
    fn take(&mut self, streamed: &Streamed) -> Option<Now> {
        let first = streamed.samples.first()?.0;
        if first < self.next {
            return None;
        }
        let missing = first - self.next;
        if missing > 0 {
            self.watched.lost_samples += u64::from(missing);
            self.alarm.gap(missing);
            self.logs = false;
            self.last = None;
        }
        self.phase = streamed.phase;
        let runs = streamed.phase == Phase::Armed;
        // With another target the operating point changes: there is a transient, and the model
        // error is different.
        if runs && streamed.reference != self.reference {
            if self.reference.is_some() {
                self.alarm.learn_again();
            }
            self.reference = streamed.reference;
            self.armed_since = 0;
        } else if !runs {
            self.armed_since = 0;
        }
        let mut newest = None;
        for (number, sample) in &streamed.samples {
            self.next = number.wrapping_add(1);
            self.watched.samples += 1;
            if self.logs && self.rows.len() < self.most_rows {
                self.rows.push(Row {
                    sample: *sample,
                    reference: streamed.reference,
                });
            }
            let y = f64::from(value(self.sensor, sample.counts));
            let reference = streamed.reference.map(f64::from);
            let model = sample
                .law
                .map(|law| f64::from((law.model - self.board.zero) * self.board.per_count));
            if let Some(law) = sample.law {
                self.armed_since += u64::from(runs);
                let residual = f64::from(law.residual * self.board.per_count);
                self.strayed += SHARE * (residual - self.strayed);
                let margin = self.margin();
                let least = self.watched.least_margin.unwrap_or(margin);
                self.watched.least_margin = Some(least.min(margin));
                let settled = runs
                    && self.armed_since > SETTLING
                    && self.armed_since as f64 * self.period_s > SETTLING_S;
                if settled {
                    self.alarm.push(residual);
                    let sums = &mut self.armed;
                    sums.samples += 1;
                    sums.y += y;
                    sums.residual += residual * residual;
                    sums.open += u64::from(sample.open);
                    sums.switches += u64::from(self.last.is_some_and(|last| last != sample.open));
                    if let Some(reference) = reference {
                        sums.referred += 1;
                        sums.error += (reference - y).powi(2);
                    }
                } else if runs {
                    // A sample of a transient counts for the time, but not for the baseline.
                    self.alarm.gap(1);
                }
            }
            self.last = Some(sample.open);
            newest = Some(Now {
                t: f64::from(*number) * self.period_s,
                phase: streamed.phase,
                y,
                reference,
                model,
                open: sample.open,
                lost: self.watched.lost_samples,
                verdict: self.alarm.verdict(),
                residual: sample.law.map(|_| self.strayed),
                margin: sample.law.map(|_| self.margin()),
            });
        }
        newest
    }

    fn margin(&self) -> f64 {
        1.0 - self.strayed.abs() / self.envelope
    }

    fn figures(&self) -> Watched {
        let sums = &self.armed;
        let n = sums.samples as f64;
        let of = |value: f64| (sums.samples > 0).then_some(value);
        Watched {
            seconds: f64::from(self.next) * self.period_s,
            rms_error: (sums.referred > 0).then(|| (sums.error / sums.referred as f64).sqrt()),
            rms_residual: of((sums.residual / n).sqrt()),
            mean: of(sums.y / n),
            air: of(sums.open as f64 / n),
            switches_per_s: of(sums.switches as f64 / (n * self.period_s)),
            verdict: Some(self.alarm.verdict()),
            ..self.watched.clone()
        }
    }
}

/// The data set, with the law's own signals in a file next to the record.
fn write(folder: &Path, watcher: &Watcher, columns: &Columns) -> Result<(), OutputError> {
    let mut files = Staging::new(folder)?;
    let time = |k: usize| (k as f64 * watcher.period_s * 1e9).round() / 1e9;
    files.write("service.csv", |out| {
        match &columns.channel {
            Some((name, _)) => writeln!(out, "t,u,y,{name}")?,
            None => writeln!(out, "t,u,y")?,
        }
        for (k, row) in watcher.rows.iter().enumerate() {
            let y = value(watcher.sensor, row.sample.counts);
            write!(out, "{},{},{y}", time(k), u8::from(row.sample.open))?;
            if let Some((_, scale)) = &columns.channel {
                write!(out, ",{}", value(*scale, row.sample.channel))?;
            }
            writeln!(out)?;
        }
        Ok(())
    })?;
    files.write("law.csv", |out| {
        writeln!(out, "t,reference,model,residual")?;
        for (k, row) in watcher.rows.iter().enumerate() {
            if let Some(law) = row.sample.law {
                let model = (law.model - watcher.board.zero) * watcher.board.per_count;
                let residual = law.residual * watcher.board.per_count;
                let reference = row.reference.map_or_else(String::new, |y| y.to_string());
                writeln!(out, "{},{reference},{model},{residual}", time(k))?;
            }
        }
        Ok(())
    })?;
    // `dataset.toml`, which makes the folder a data set, is written last.
    files.write("dataset.toml", |out| {
        writeln!(
            out,
            "title = \"The closed loop in operation\"\nsample_period_s = {}\n\n[[record]]\nname = \
             \"service\"\nfile = \"service.csv\"\nuse = \"validate\"",
            watcher.period_s
        )
    })?;
    files.commit()
}
