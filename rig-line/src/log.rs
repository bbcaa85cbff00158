//! Files of a recording: rows for `host-fit average`, and a header with board, command and time.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use recordings::output::{OutputError, write_atomic};
use serde::Serialize;
use wire::reply::Scale;
use wire::samples::Sample;

use crate::command::Command;
use crate::error::LineError;
use crate::host::Host;
use crate::record::{Connect, Gap, Part, Progress, Recording, record};
use crate::rig_file::RigFile;

/// A recording and its files. Serialises to the keys of `record --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Written {
    /// The rows: t, u, y and the channel.
    #[serde(serialize_with = "as_text")]
    pub file: PathBuf,
    /// The header.
    #[serde(serialize_with = "as_text")]
    pub header: PathBuf,
    /// Repeats in the file.
    pub repeats: u32,
    /// Length of a repeat, s.
    pub period_s: f64,
    /// Lost samples; their repeats were played again.
    pub lost_samples: u64,
    /// Lost samples that were dropped for lack of memory on the board.
    pub left_out_samples: u64,
    /// Damaged frames.
    pub damaged_frames: u64,
    /// Number of attempts: more than 1 if the link broke or samples were lost.
    pub parts: usize,
    /// The reason for fewer repeats than requested, if there are fewer.
    pub cut_short: Option<String>,
}

/// JSON strings must be UTF-8: other bytes are replaced.
fn as_text<S: serde::Serializer>(path: &Path, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(&path.to_string_lossy())
}

/// Columns of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    /// Scale from counts to y; the board's own if not given.
    pub sensor: Option<Scale>,
    /// Name and scale of the measured channel, if it is recorded.
    pub channel: Option<(String, Scale)>,
}

impl Columns {
    /// The columns for a rig.
    #[must_use]
    pub fn of(rig: &RigFile) -> Self {
        let scale = |zero: f64, per_count: f64| Scale {
            zero: zero as f32,
            per_count: per_count as f32,
        };
        Self {
            sensor: Some(scale(rig.sensor.zero_counts, rig.sensor.per_count)),
            channel: (rig.channel.as_ref())
                .map(|c| (c.name.clone(), scale(c.zero_counts, c.per_count))),
        }
    }
}

/// Plays `command` and writes `NAME.csv` and `NAME.toml` into `folder`.
///
/// # Errors
/// [`LineError`]; nothing is left behind then.
pub fn to_files(
    host: &mut Host,
    connect: &mut Connect<'_>,
    command: &Command,
    repeats: u32,
    columns: &Columns,
    folder: &Path,
    watch: &mut dyn FnMut(&Progress),
) -> Result<Written, LineError> {
    std::fs::create_dir_all(folder).map_err(|cause| OutputError::Io {
        path: folder.to_path_buf(),
        cause,
    })?;
    let file = folder.join(format!("{}.csv", command.name));
    let header = folder.join(format!("{}.toml", command.name));
    let board = host.hello()?;
    let rows = Rows {
        period_s: command.sample_period_s,
        samples: command.samples(),
        sensor: columns.sensor.unwrap_or(board.sensor),
        channel: columns.channel.clone(),
    };
    let mut outcome = Err(LineError::Silent("who are you"));
    let written = write_atomic(&file, |out| {
        rows.head(out)?;
        let mut keep = |repeat, samples: &[Sample]| rows.repeat(out, repeat, samples);
        outcome = record(host, connect, command, repeats, &mut keep, watch);
        match &outcome {
            // Without a complete repeat no file is written.
            Ok(recording) if recording.whole > 0 => Ok(()),
            Ok(recording) => Err(io::Error::other(
                recording.cut_short.clone().unwrap_or_default(),
            )),
            Err(error) => Err(io::Error::other(error.to_string())),
        }
    });
    let recording = outcome?;
    if let (0, Some(reason)) = (recording.whole, &recording.cut_short) {
        return Err(LineError::Nothing(reason.clone()));
    }
    written?;
    let text = Header::of(&recording, command, &rows).text();
    write_atomic(&header, |out| out.write_all(text.as_bytes()))?;
    Ok(Written {
        file,
        header,
        repeats: recording.whole,
        period_s: command.samples() as f64 * command.sample_period_s,
        lost_samples: recording.lost(),
        left_out_samples: recording.gaps.iter().map(|g| u64::from(g.left_out)).sum(),
        damaged_frames: recording.damaged_frames,
        parts: recording.parts.len(),
        cut_short: recording.cut_short,
    })
}

/// Writes consecutive repeats on one clock.
struct Rows {
    period_s: f64,
    samples: u64,
    sensor: Scale,
    channel: Option<(String, Scale)>,
}

impl Rows {
    fn head(&self, out: &mut dyn Write) -> io::Result<()> {
        match &self.channel {
            Some((name, _)) => writeln!(out, "t,u,y,{name}"),
            None => writeln!(out, "t,u,y"),
        }
    }

    fn repeat(&self, out: &mut dyn Write, repeat: u32, samples: &[Sample]) -> io::Result<()> {
        let first = u64::from(repeat) * self.samples;
        for (sample, k) in samples.iter().zip(first..) {
            // Rounded to 1 ns: multiples of the period would print 0.30000000000000004.
            let t = (k as f64 * self.period_s * 1e9).round() / 1e9;
            let y = value(self.sensor, sample.counts);
            write!(out, "{t},{},{y}", u8::from(sample.open))?;
            if let Some((_, scale)) = &self.channel {
                write!(out, ",{}", value(*scale, sample.channel))?;
            }
            writeln!(out)?;
        }
        Ok(())
    }
}

/// Value of counts, computed as on the board.
#[must_use]
pub fn value(scale: Scale, counts: u16) -> f32 {
    (f32::from(counts) - scale.zero) * scale.per_count
}

/// Header of a recording.
#[derive(Serialize)]
struct Header<'a> {
    /// The command and how it was played.
    command: &'a str,
    sample_period_s: f64,
    samples_per_repeat: u64,
    repeats: u32,
    samples_received: u64,
    damaged_frames: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    cut_short: Option<&'a str>,
    board: Board,
    sensor: Line,
    #[serde(skip_serializing_if = "Option::is_none")]
    channel: Option<Line>,
    part: &'a [Part],
    #[serde(skip_serializing_if = "<[Gap]>::is_empty")]
    lost: &'a [Gap],
}

#[derive(Serialize)]
struct Board {
    firmware: String,
    protocol: u8,
    /// Checksums of the board's constants.
    model: String,
    rig: String,
    rails_counts: [f32; 2],
    stuck_after_samples: u32,
    residual_envelope: f32,
    hold_on_samples: u32,
    hold_off_samples: u32,
}

#[derive(Serialize)]
struct Line {
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    zero_counts: f32,
    per_count: f32,
}

impl<'a> Header<'a> {
    fn of(recording: &'a Recording, command: &'a Command, rows: &Rows) -> Self {
        let board = &recording.board;
        let [major, minor, patch] = board.version;
        let line = |scale: Scale, name: Option<&str>| Line {
            name: name.map(str::to_owned),
            zero_counts: scale.zero,
            per_count: scale.per_count,
        };
        Self {
            command: &command.name,
            sample_period_s: command.sample_period_s,
            samples_per_repeat: command.samples(),
            repeats: recording.whole,
            samples_received: recording.samples,
            damaged_frames: recording.damaged_frames,
            cut_short: recording.cut_short.as_deref(),
            board: Board {
                firmware: format!("{major}.{minor}.{patch}"),
                protocol: board.protocol,
                model: format!("{:08x}", board.model),
                rig: format!("{:08x}", board.rig),
                rails_counts: board.rails,
                stuck_after_samples: board.stuck_after,
                residual_envelope: board.envelope,
                hold_on_samples: board.hold[0],
                hold_off_samples: board.hold[1],
            },
            sensor: line(rows.sensor, None),
            channel: (rows.channel.as_ref()).map(|(name, scale)| line(*scale, Some(name))),
            part: &recording.parts,
            lost: &recording.gaps,
        }
    }

    fn text(&self) -> String {
        let body = toml::to_string(self).unwrap_or_default();
        format!(
            "# A recording by the board. Repeats follow one another on one clock; each is complete and starts \
             from rest.\n# `average` reads the file of the same name: --period {}\n{body}",
            self.samples_per_repeat as f64 * self.sample_period_s
        )
    }
}
