//! `host-fit import`: files of other programs to a data set.

use std::path::{Path, PathBuf};

use host_fit::data::import::{Import, Mapping};
use host_fit::steps::{self, ImportedSet};

use super::Console;
use super::average::positive;

/// Convert logger files to a data set: CSV of any dialect, serial-monitor lines, MATLAB's .mat (v5 to v7), NumPy's .npy
/// and .npz.
///
/// Each FILE becomes one record named by the file; a folder stands for the files in it. Recognised are: separators,
/// decimal commas, thousands marks, lines before the header, dates and clock times, Unix times in s, ms or µs,
/// on/off and true/false, percentages, a command that is written on change only, and tables with one signal in each row
/// (time, name, value). The interpretation is printed.
/// A variable is named as in its program: valve, run.valve, data(:,2), data[:,1]. Variables without an option are
/// found by their names (t, time or timestamp; u, input, heater, valve …; y, output, temperature …). y_sd, y_min,
/// y_max and every other variable of the same length are kept. The mapping is stored in dataset.toml, for --like.
///
/// Example: host-fit import log.csv -o set
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Files to read, or folders of them.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Folder for the data set (dataset.toml and one CSV per record).
    #[arg(short, long, value_name = "DIR", value_hint = clap::ValueHint::DirPath)]
    output: PathBuf,
    /// Replace a data set that is in the folder already.
    #[arg(long)]
    force: bool,
    /// Use the mapping of a data set that was imported before; further options override it.
    #[arg(long, value_name = "DATASET")]
    like: Option<PathBuf>,
    /// Variable that is the time.
    #[arg(long, value_name = "NAME")]
    t: Option<String>,
    /// Seconds per unit of the time [default: from the header, otherwise 1].
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    t_scale: Option<f64>,
    /// Sampling period, if the file has no time (or to check it).
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    period: Option<f64>,
    /// Use --period as the spacing of the rows and ignore the file's time.
    #[arg(long, requires = "period")]
    ignore_time: bool,
    /// Fill gaps up to this length, s, from the value before a gap to the value after it: missing values and lost
    /// rows are interpolated, u keeps its value.
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    fill_gaps: Option<f64>,
    /// A number that marks missing readings, such as -9999, or none: every number is a reading; repeatable.
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true, value_parser = mark)]
    missing: Vec<Option<f64>>,
    /// A file has several records: a new one begins where this variable changes (the number of a run), or, if it is
    /// the time, where the time starts again and after a pause.
    #[arg(long, value_name = "NAME")]
    split_by: Option<String>,
    /// Each sample is the mean of this many rows: for a recording that is much faster than the plant.
    #[arg(long, value_name = "ROWS")]
    mean_of: Option<usize>,
    /// Variable that is the command.
    #[arg(long, value_name = "NAME")]
    u: Option<String>,
    /// Scale of u: u is this times the variable, plus --u-offset.
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    u_scale: Option<f64>,
    /// Added to u.
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    u_offset: Option<f64>,
    /// u is on (1) above this value and off (0) elsewhere: makes a voltage an on/off command.
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    u_threshold: Option<f64>,
    /// Command before the first sample of each record [default: its first value].
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    u_before: Option<f64>,
    /// Variable that is the output.
    #[arg(long, value_name = "NAME")]
    y: Option<String>,
    /// y is this times the variable, plus --y-offset; y_sd, y_min and y_max follow.
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    y_scale: Option<f64>,
    /// Added to y.
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    y_offset: Option<f64>,
    /// Keep this variable and no other in addition to t, u and y; repeatable.
    #[arg(long, value_name = "NAME")]
    channel: Vec<String>,
    /// Keep only t, u and y.
    #[arg(long, conflicts_with = "channel")]
    no_channels: bool,
    /// Name of a file (without its ending), or of a record of a file that is split, that becomes a validation record;
    /// repeatable.
    #[arg(long, value_name = "NAME")]
    validate: Vec<String>,
    /// Split each record at this time, s: the samples after it are a validation record, the samples before it
    /// are its lead-in.
    #[arg(long, value_name = "SECONDS")]
    hold_out_from: Option<f64>,
    /// The input has levels between off and on.
    #[arg(long)]
    graded: bool,
    /// Title of the data set.
    #[arg(long)]
    title: Option<String>,
}

/// A number, or nothing for `none`.
fn mark(text: &str) -> Result<Option<f64>, String> {
    if text == "none" {
        return Ok(None);
    }
    let number = text.parse().ok().filter(|number: &f64| number.is_finite());
    let number = number.ok_or("give a number, such as -9999, or none")?;
    Ok(Some(number))
}

impl Args {
    /// The data set made from the files.
    pub(super) fn import(&self) -> anyhow::Result<ImportedSet> {
        let files: Vec<&Path> = self.files.iter().map(PathBuf::as_path).collect();
        let request = Import {
            mapping: self.mapping()?,
            title: self.title.clone(),
            validate: self.validate.clone(),
            hold_out_from_s: self.hold_out_from,
            graded: self.graded,
            u_before: self.u_before,
        };
        Ok(steps::import(&files, &request)?)
    }

    fn mapping(&self) -> anyhow::Result<Mapping> {
        let base = match &self.like {
            Some(path) => Mapping::of(path)?,
            None => Mapping::default(),
        };
        let channels = match (self.no_channels, self.channel.as_slice()) {
            (true, _) => Some(Vec::new()),
            (false, []) => base.channels,
            (false, names) => Some(names.to_vec()),
        };
        let missing = match self.missing.as_slice() {
            [] => base.missing,
            marks => Some(marks.iter().copied().flatten().collect()),
        };
        Ok(Mapping {
            t: self.t.clone().or(base.t),
            t_scale: self.t_scale.or(base.t_scale),
            period_s: self.period.or(base.period_s),
            ignore_time: self.ignore_time || base.ignore_time,
            fill_gaps_s: self.fill_gaps.or(base.fill_gaps_s),
            missing,
            split_by: self.split_by.clone().or(base.split_by),
            mean_of: self.mean_of.or(base.mean_of),
            u: self.u.clone().or(base.u),
            u_scale: self.u_scale.or(base.u_scale),
            u_offset: self.u_offset.or(base.u_offset),
            u_threshold: self.u_threshold.or(base.u_threshold),
            y: self.y.clone().or(base.y),
            y_scale: self.y_scale.or(base.y_scale),
            y_offset: self.y_offset.or(base.y_offset),
            channels,
        })
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let found = args.import()?;
    found.imported.refuse_to_replace(&args.output, args.force)?;
    found.imported.save(&args.output)?;
    console.show(&found, &[("dataset", &args.output)], &[&args.output])
}
