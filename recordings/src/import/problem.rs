//! Problems of a file to import, each with its remedy.

use crate::memory::TooMuch;

/// Kinds of fault of an import; each message ends with the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportProblem {
    /// A MATLAB file in HDF5 format.
    #[error(
        "is a MATLAB 7.3 file (HDF5), which is not supported; open it in MATLAB and save it as version 7: \
             load('{name}'); save('{name}', '-v7')",
        name = .0
    )]
    Matlab73(String),
    /// An HDF5 file.
    #[error(
        "is an HDF5 file, which is not supported; save its arrays with numpy.savez(\"run.npz\", t=t, u=u, y=y) or as CSV"
    )]
    Hdf5,
    /// A workbook or another archive.
    #[error(
        "is an archive without .npy files (for example a spreadsheet's workbook); save the sheet as CSV"
    )]
    NoArrays,
    /// MATLAB 4, or not a MATLAB file.
    #[error(
        "is not a MATLAB file of version 5 to 7; open it in MATLAB or Octave and save it again: \
             save('run.mat', 't', 'u', 'y', '-v7')"
    )]
    NoMatlab,
    /// A damaged or truncated file.
    #[error("is damaged or cut short ({0}); copy or save it again")]
    Damaged(&'static str),
    /// The file needs more memory than allowed.
    #[error(transparent)]
    Memory(#[from] TooMuch),
    /// More columns than a table may have.
    #[error(
        "the rows have {0} cells, but at most 16384 are allowed (the limit of spreadsheets); a table has a row \
         for each sample and a column for each signal: transpose it, or save fewer columns"
    )]
    TooWide(usize),
    /// No table of numbers was found.
    #[error(
        "no rows of numbers were found; a table needs a header line and rows of at least two numbers, separated by commas, semicolons, tabs or blanks"
    )]
    NoTable,
    /// A line that is almost a row of a table.
    #[error(
        "no rows of numbers were found; this line comes closest, but its cell `{0}` is not a number, date, time or on/off word; correct it, or write a header line and rows of at least two numbers, separated by commas, semicolons, tabs or blanks"
    )]
    NearlyRow(String),
    /// An unreadable cell of a required column.
    #[error("{}", unread(.0))]
    Unread(String),
    /// A missing value.
    #[error(
        "the {what}; fill it in, split the record there, or fill short gaps with --fill-gaps SECONDS",
        what = .0
    )]
    Missing(&'static str),
    /// A number that is probably the mark of a missing reading.
    #[error(
        "{mark} occurs in {count} row(s), and all other values lie between {low} and {high}: if it marks missing readings, \
             give --missing {mark} --fill-gaps SECONDS, otherwise --missing none"
    )]
    Marker {
        /// The number.
        mark: f64,
        /// Rows with this number.
        count: usize,
        /// Lowest of the other values.
        low: f64,
        /// Highest of the other values.
        high: f64,
    },
    /// A missing value before the first or after the last value of its variable.
    #[error(
        "the value is missing at the {at} of the record, and --fill-gaps fills only between two values; fill \
             it in, or remove the rows there",
        at = .0
    )]
    MissingAtEnd(&'static str),
    /// A gap that is too long to be filled.
    #[error(
        "the gap lasts {length_s} s, longer than --fill-gaps {most_s}; give --fill-gaps {length_s}, or split \
             the file there with --split-by and the name of the time"
    )]
    LongGap {
        /// Length of the gap, from the last value before it to the first value after it, s.
        length_s: f64,
        /// The longest gap that is filled, s.
        most_s: f64,
    },
    /// More lost rows than can be inserted.
    #[error(
        "according to the times at least {lost} rows are missing, more than {share} % of the {rows} rows in the \
             file; these are too many to fill. Split the file at its gaps with --split-by and the name of the time, or, if only the times are wrong, give \
             --period SECONDS --ignore-time"
    )]
    ManyLost {
        /// Lost rows.
        lost: f64,
        /// The largest share of the rows that is inserted, %.
        share: f64,
        /// Rows in the file.
        rows: usize,
    },
    /// A command written on change without a first value.
    #[error(
        "the first value of u is missing, although u is written only when it changes; write the value into this cell"
    )]
    NoFirstCommand,
    /// A requested variable does not exist.
    #[error("no variable `{wanted}`; the file has {found}", wanted = .wanted, found = .found)]
    NoVariable {
        /// The requested name.
        wanted: String,
        /// The names found.
        found: String,
    },
    /// A requested variable cannot be used.
    #[error("{0}")]
    Unusable(String),
    /// No usual name identifies u or y.
    #[error("it is not clear which variable is {what}; name it with --{option} NAME; the file has {found}", what = .what, option = .option, found = .found)]
    Which {
        /// `the command u`, `the output y`.
        what: &'static str,
        /// The option that names it.
        option: &'static str,
        /// The names found.
        found: String,
    },
    /// No usual name identifies the command, but one variable lies near two levels.
    #[error(
        "it is not clear which variable is the command u; if it is `{name}`, whose values lie near {low} and {high}, give --u \"{name}\" --u-threshold {middle}; otherwise name it with --u NAME; the file has {found}"
    )]
    TwoLevels {
        /// The variable.
        name: String,
        /// Its lower value.
        low: f64,
        /// Its higher value.
        high: f64,
        /// The middle of both.
        middle: f64,
        /// The names found.
        found: String,
    },
    /// Neither a time column nor a sampling period.
    #[error(
        "has no time variable; name it with --t NAME, or give the sampling period with --period SECONDS; the \
             file has {0}"
    )]
    NoTime(String),
    /// Means of fewer than two rows.
    #[error("mean_of must be 2 or more: the number of rows of which each sample is the mean")]
    MeanOfOne,
    /// A record that is too short for means of this many rows.
    #[error("a mean of {rows} rows needs at least twice as many rows; the record has {samples}")]
    TooFewRows {
        /// Rows of which a sample is the mean.
        rows: usize,
        /// Rows of the record.
        samples: usize,
    },
    /// A scale that is 0 or not finite.
    #[error("{0} must be a finite number other than 0")]
    BadScale(&'static str),
    /// A threshold or an offset that is not finite.
    #[error("{0} must be a finite number")]
    BadNumber(&'static str),
    /// A threshold that the command never crosses.
    #[error("u lies between {low} and {high} and never crosses the threshold {threshold}; give one in between", low = .low, high = .high, threshold = .threshold)]
    NeverCrosses {
        /// Lowest value of u.
        low: f64,
        /// Highest value.
        high: f64,
        /// The threshold.
        threshold: f64,
    },
    /// A single wrong value in an on/off command.
    #[error(
        "u = {0} in a command that is otherwise 0 or 1; give --u-threshold to make it on/off, or --graded if the input has levels in between"
    )]
    StrayInput(f64),
    /// A channel with a name that a record cannot have.
    #[error("a channel cannot be named {0} here; leave it out, or rename it in the file")]
    ChannelName(String),
    /// A split time outside the record.
    #[error(
        "--hold-out-from {time} s lies outside the record, which goes from {from} to {to} s; give a time within it"
    )]
    SplitOutside {
        /// The requested time, s.
        time: f64,
        /// Time of the first sample, s.
        from: f64,
        /// Time of the last sample, s.
        to: f64,
    },
    /// A folder that is a data set.
    #[error(
        "is a data set already; pass it to the other commands directly, or name the files to import"
    )]
    IsDataSet,
    /// A folder without files to import.
    #[error(
        "the folder contains no .csv, .tsv, .txt, .dat, .log, .mat, .npy or .npz file; name the files to import"
    )]
    NothingInFolder,
    /// The output folder contains a data set.
    #[error("contains a data set already; name another folder with -o, or replace it with --force")]
    ReplacesSet,
    /// A file of the output exists already.
    #[error("exists already; name another folder with -o, or replace the file with --force")]
    ReplacesFile,
    /// A file of the output is one of the files that are read.
    #[error("is an input and would be replaced by its own import; name another folder with -o")]
    ReplacesSource,
    /// A data set that was not imported.
    #[error(
        "contains no [record.from], so it was not made by `host-fit import`; name a data set that `host-fit import` made"
    )]
    NoMapping,
}

/// Contents of an unreadable cell, with the remedy.
fn unread(text: &str) -> String {
    if text.is_empty() {
        return "the cell is empty; fill it in, or split the record there".to_owned();
    }
    format!(
        "`{text}` is not a number, a date or time, or one of on/off, true/false, yes/no, open/closed; correct the cell, \
         or split the file there"
    )
}
