//! Errors in measured data: problem, place and remedy.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::import::problem::ImportProblem;

/// Place of an error in the user's data; all known parts are printed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct FilePlace {
    /// The file (or folder) as the caller named it.
    pub file: Option<PathBuf>,
    /// The name of the record, if the data were not read from a separate file.
    pub record: Option<String>,
    /// Line in the file; the header is line 1.
    pub line: Option<u64>,
    /// Sample index in the record (0 is the first), for data that have no lines.
    pub sample: Option<usize>,
    /// Name of the CSV column or channel.
    pub column: Option<String>,
    /// Name of the variable of a binary file.
    pub variable: Option<String>,
    /// Key in `dataset.toml`.
    pub key: Option<String>,
}

impl FilePlace {
    /// A place that names a file only.
    #[must_use]
    pub fn file(path: &Path) -> Self {
        Self {
            file: Some(path.to_path_buf()),
            ..Self::default()
        }
    }

    /// Adds the line number to the place.
    #[must_use]
    pub fn at_line(mut self, line: u64) -> Self {
        self.line = Some(line);
        self
    }

    /// Adds the column name to the place.
    #[must_use]
    pub fn in_column(mut self, column: &str) -> Self {
        self.column = Some(column.to_owned());
        self
    }

    /// Removes line and sample from the place.
    #[must_use]
    pub(crate) fn whole(mut self) -> Self {
        (self.line, self.sample) = (None, None);
        self
    }

    /// Adds the TOML key to the place.
    #[must_use]
    pub fn at_key(mut self, key: &str) -> Self {
        self.key = Some(key.to_owned());
        self
    }

    /// The error at this place.
    #[must_use]
    pub fn error(self, problem: DataProblem) -> DataError {
        DataError {
            place: Box::new(self),
            problem: Box::new(problem),
        }
    }
}

impl fmt::Display for FilePlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        if let Some(file) = &self.file {
            write!(f, "{}", file.display())?;
            separator = ", ";
        }
        if let Some(record) = &self.record {
            write!(f, "{separator}record `{}`", printable(record))?;
            separator = ", ";
        }
        if let Some(variable) = &self.variable {
            write!(f, "{separator}variable `{}`", printable(variable))?;
            separator = ", ";
        }
        if let Some(line) = self.line {
            write!(f, "{separator}line {line}")?;
            separator = ", ";
        }
        if let Some(sample) = self.sample {
            write!(f, "{separator}sample {sample}")?;
            separator = ", ";
        }
        if let Some(column) = &self.column {
            write!(f, "{separator}column `{}`", printable(column))?;
            separator = ", ";
        }
        if let Some(key) = &self.key {
            write!(f, "{separator}key `{}`", printable(key))?;
            separator = ", ";
        }
        if separator.is_empty() {
            write!(f, "the data")?;
        }
        Ok(())
    }
}

/// The user's text on one line, cut to a length that a terminal can show.
pub(crate) fn printable(text: &str) -> String {
    let mut out: String = text
        .chars()
        .take(60)
        .flat_map(char::escape_debug)
        .collect::<String>()
        .replace("\\'", "'")
        .replace("\\\"", "\"");
    if text.chars().count() > 60 {
        out.push('…');
    }
    out
}

/// A fault in measured data: one paragraph that names the place, the fault and the remedy.
#[derive(Debug, thiserror::Error)]
#[error("{place}: {problem}")]
pub struct DataError {
    /// The place.
    pub place: Box<FilePlace>,
    /// The problem with its remedy.
    pub problem: Box<DataProblem>,
}

impl DataError {
    /// A file could not be opened or read.
    #[must_use]
    pub fn unreadable(path: &Path, cause: std::io::Error) -> Self {
        FilePlace::file(path).error(DataProblem::Unreadable(cause))
    }
}

/// The kinds of problem; each message ends with the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DataProblem {
    /// A problem of a file to import.
    #[error(transparent)]
    Import(#[from] ImportProblem),
    /// The operating system refused to open or read the file.
    #[error("cannot be read ({0}); check the path and its permissions")]
    Unreadable(std::io::Error),
    /// A folder without `dataset.toml`.
    #[error(
        "the folder contains no dataset.toml; make a data set of its files with `host-fit import {folder} -o \
             DIR` and give the folder DIR here",
        folder = .0
    )]
    NoManifest(String),
    /// An empty file.
    #[error("the file is empty; it needs a header line `t,u,y` and one row per sample")]
    Empty,
    /// A header and no rows (or a single one).
    #[error("has {0} row(s) of numbers; a record needs at least 2")]
    TooFewRows(usize),
    /// Not text.
    #[error("is not UTF-8 text; export the data as a plain CSV file in UTF-8")]
    NotText,
    /// A line above the length limit.
    #[error(
        "the line is longer than 1 MiB, too long for a row of measurements; check that this is a CSV file"
    )]
    LineTooLong,
    /// The header line cannot be split into names.
    #[error(
        "the header cannot be read ({0}); write the column names once, separated by commas: t,u,y"
    )]
    BadHeader(String),
    /// Semicolons or tabs instead of commas.
    #[error(
        "the header has no comma but {0}; separate columns with commas and write decimals with a point, or let `host-fit import` read the file"
    )]
    WrongSeparator(&'static str),
    /// A required column is missing.
    #[error(
        "no column `{name}` in the header ({found}); name the columns t (s), u and y, or say which is which with `host-fit import FILE -o DIR`",
        name = .name, found = .found
    )]
    MissingColumn {
        /// The required name.
        name: &'static str,
        /// The names found.
        found: String,
    },
    /// A column name occurs twice.
    #[error("this column name occurs twice in the header; rename or remove one of the two")]
    DoubledColumn,
    /// An empty name in the header.
    #[error("column {0} has no name in the header; name it or remove it")]
    UnnamedColumn(usize),
    /// A row that is shorter or longer than the header.
    #[error(
        "the row has {found} values where the header has {expected} names; complete the row or cut the record before it"
    )]
    RowLength {
        /// Number of names in the header.
        expected: usize,
        /// Number of values in this row.
        found: usize,
    },
    /// An empty cell.
    #[error(
        "the value is missing; fill it in, or split the record there (`host-fit import` repeats a u that is \
             written only when it changes, and interpolates short gaps with --fill-gaps SECONDS)"
    )]
    MissingValue,
    /// Text where a number belongs.
    #[error(
        "`{0}` is not a number; write decimals with a point, without units or thousands marks, or let `host-fit import` read the file"
    )]
    NotANumber(String),
    /// A value that is NaN or infinite.
    #[error("the value is {0}, not a finite number; repair it, or split the record there")]
    NotFinite(f64),
    /// A value so large that its square would overflow.
    #[error("the value {0:e} is beyond ±1e100; check the column's units")]
    TooLarge(f64),
    /// Time does not increase.
    #[error(
        "time does not increase: {time} s follows {before} s; if a new run begins there, split the file with \
             `host-fit import --split-by NAME`, the name of the time or of a column that numbers the runs; \
             otherwise sort the rows, remove repeated ones, and print t with enough digits"
    )]
    TimeBackward {
        /// The previous row's time.
        before: f64,
        /// Time of this row.
        time: f64,
    },
    /// Samples are missing.
    #[error(
        "time jumps by {step} s where the sampling period is {period} s: about {missing} sample(s) missing; \
             `host-fit import` it with --split-by NAME, the name of the time, which splits the record there, or \
             with --fill-gaps SECONDS (if only the times are wrong: with --period SECONDS --ignore-time)"
    )]
    TimeGap {
        /// The step found.
        step: f64,
        /// The sampling period.
        period: f64,
        /// Number of missing samples.
        missing: u64,
    },
    /// Non-uniform time steps.
    #[error(
        "the time step is {step} s where the sampling period is {period} s (10 % and the rounding of the \
             printed times are allowed); resample the record to a uniform period, or, if only the times are \
             wrong, `host-fit import` it with --period SECONDS --ignore-time"
    )]
    TimeUneven {
        /// The step found.
        step: f64,
        /// The sampling period.
        period: f64,
    },
    /// The sampling period of the time column differs from the stated one.
    #[error(
        "the times of the rows are {found} s apart, but {by} {stated} s; correct the value that is wrong"
    )]
    PeriodMismatch {
        /// Sampling period from the time column, s.
        found: f64,
        /// Stated sampling period, s.
        stated: f64,
        /// Source of the stated period: subject and verb of a sentence.
        by: &'static str,
    },
    /// Records of different sampling periods.
    #[error(
        "the sampling period of this record is {found} s, that of record `{first}` is {other} s, but a data \
             set has one period: import the records into separate data sets, or resample one of them"
    )]
    PeriodsDiffer {
        /// Sampling period of this record, s.
        found: f64,
        /// Sampling period of the first record, s.
        other: f64,
        /// Name of the first record.
        first: String,
    },
    /// A time that cannot be in seconds, for example a Unix time in ms.
    #[error(
        "t = {0} is not a time in seconds; if it is a Unix time in ms, µs or ns, make a data set of the file with `host-fit import FILE -o DIR`"
    )]
    NotSeconds(f64),
    /// A file of another program instead of a data set.
    #[error(
        "is a {kind}, not a data set; make a data set of it with `host-fit import {name} -o DIR` and give the folder DIR here"
    )]
    ToImport {
        /// Kind of the file.
        kind: &'static str,
        /// The file's name.
        name: String,
    },
    /// An invalid sampling period.
    #[error(
        "the sampling period is {0:?}; it must be a number of seconds above 0, from 1e-9 to 1e9; check the unit of the times"
    )]
    BadPeriod(f64),
    /// Times so large that double precision does not resolve the samples.
    #[error(
        "at t = {time} s double precision cannot resolve samples {period} s apart; count time from the \
        beginning of the record"
    )]
    LateTimes {
        /// The latest time, s.
        time: f64,
        /// The sampling period, s.
        period: f64,
    },
    /// More columns than a file of a data set can have.
    #[error(
        "has {found} measured channels, but at most {most} are allowed; keep those that are needed (`host-fit \
             import` with --channel NAME, or --no-channels)"
    )]
    TooManyChannels {
        /// Number of channels.
        found: usize,
        /// Largest number of channels.
        most: usize,
    },
    /// A column name longer than the limit.
    #[error("the name is longer than {0} bytes; shorten it")]
    LongName(usize),
    /// A non-finite command before the record.
    #[error("the command before the record is {0}; give a finite number in the unit of u")]
    BadCommandBefore(f64),
    /// A lead that leaves no scored sample.
    #[error(
        "lead_samples is {lead}, but the record has {samples} samples, so none would be scored; choose a \
             smaller lead_samples"
    )]
    OnlyLead {
        /// Samples of the lead.
        lead: usize,
        /// Samples of the record.
        samples: usize,
    },
    /// A negative standard error.
    #[error("the standard error is {0}; it must be 0 or above")]
    NegativeDeviation(f64),
    /// Lower envelope above the upper one.
    #[error(
        "y_min = {low} lies above y_max = {high}; exchange the two columns or repair the value"
    )]
    EnvelopeCrossed {
        /// The value of `y_min`.
        low: f64,
        /// The value of `y_max`.
        high: f64,
    },
    /// Columns of a record differ in length.
    #[error(
        "has {found} values where u has {expected}; all columns of a record need the same length"
    )]
    UnequalLengths {
        /// Length of `u`.
        expected: usize,
        /// Length of this column.
        found: usize,
    },
    /// The command is not on/off where it must be.
    #[error(
        "u = {0} is neither 0 nor 1, but an on/off command is needed here; scale the command so that off is 0 and on is 1"
    )]
    NotOnOff(f64),
    /// A single wrong value in an on/off command.
    #[error(
        "u = {0} in a command that is otherwise 0 or 1; correct the value, or, if the input has levels in between, say so with `input = \"graded\"` in the dataset.toml of a folder"
    )]
    StrayInput(f64),
    /// A channel with a reserved column name.
    #[error("this name is reserved (t, u, y, y_sd, y_min, y_max); rename the channel")]
    ReservedChannel,
    /// A name that cannot be printed or is empty.
    #[error("a name must not be empty or contain control characters; rename it")]
    BadName,
    /// Two records with one name.
    #[error("the record name `{0}` is used twice; give every record its own name")]
    DoubledRecord(String),
    /// No records at all.
    #[error("there is no record; add at least one [[record]] with name, file and use")]
    NoRecords,
    /// `dataset.toml` does not parse, lacks a key or has one that does not exist.
    #[error(
        "{0}; a dataset.toml contains sample_period_s and, optionally, title and input; each [[record]] contains name, file, use (\"identify\" or \"validate\") and, optionally, u_before and lead_samples"
    )]
    Manifest(String),
    /// A record's file outside the data set's folder.
    #[error(
        "the path `{0}` leaves the data set's folder; give a path relative to dataset.toml, without `..`, to a file inside the folder"
    )]
    OutsideFolder(String),
    /// Not a regular file.
    #[error("`{0}` is not a file; name a CSV file")]
    NotAFile(String),
}
