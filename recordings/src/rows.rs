//! Rows of a CSV file, one line at a time, with exact line numbers.
//!
//! The header line goes through the `csv` crate, because names may be quoted. The rows contain only numbers and are
//! split here, for two reasons: the line numbers of the `csv` crate are wrong after blank lines and with CRLF line
//! ends, and raw recordings of several GB are read by the same code.

use std::collections::HashSet;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use crate::error::{DataError, DataProblem, FilePlace, printable};
use crate::import::ImportProblem;

/// Longest line accepted as a row of measurements, bytes.
const LONGEST_LINE: u64 = 1 << 20;

/// Opens a file of rows; a file of another program is reported with the command that reads it.
pub(crate) fn open_text(path: &Path, buffer: usize) -> Result<BufReader<File>, DataError> {
    let unreadable = |e| DataError::unreadable(path, e);
    let mut reader = BufReader::with_capacity(buffer, File::open(path).map_err(unreadable)?);
    let start = reader.fill_buf().map_err(unreadable)?;
    let ends_in = |ending: &str| {
        path.extension()
            .is_some_and(|e| e.eq_ignore_ascii_case(ending))
    };
    let kind = if start.starts_with(b"MATLAB") || (ends_in("mat") && start.contains(&0)) {
        "MATLAB file"
    } else if start.starts_with(b"\x93NUMPY") || (ends_in("npz") && start.starts_with(b"PK")) {
        "NumPy file"
    } else if start.starts_with(b"PK\x03\x04") {
        return Err(FilePlace::file(path).error(ImportProblem::NoArrays.into()));
    } else if start.starts_with(b"\x89HDF") {
        return Err(FilePlace::file(path).error(ImportProblem::Hdf5.into()));
    } else {
        return Ok(reader);
    };
    let name = path.display().to_string();
    Err(FilePlace::file(path).error(DataProblem::ToImport { kind, name }))
}

/// Reads the rows of one CSV file in order, with one line in memory.
pub(crate) struct RowReader<R> {
    source: R,
    path: PathBuf,
    names: Vec<String>,
    buffer: Vec<u8>,
    line: u64,
    bytes: u64,
}

impl<R: BufRead> RowReader<R> {
    /// Reads the header line. `path` is only used in messages.
    pub(crate) fn new(source: R, path: &Path) -> Result<Self, DataError> {
        let mut reader = Self {
            source,
            path: path.to_path_buf(),
            names: Vec::new(),
            buffer: Vec::with_capacity(256),
            line: 0,
            bytes: 0,
        };
        if !reader.fill_line()? {
            return Err(reader.place().error(DataProblem::Empty));
        }
        let place = reader.here();
        let header = reader
            .buffer
            .strip_prefix(b"\xef\xbb\xbf")
            .unwrap_or(&reader.buffer);
        let text =
            std::str::from_utf8(header).map_err(|_| place.clone().error(DataProblem::NotText))?;
        reader.names = split_header(text, &place)?;
        Ok(reader)
    }

    /// The column names, trimmed, unique and non-empty.
    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }

    /// Index of a column.
    pub(crate) fn column(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|n| n == name)
    }

    /// Index of a required column.
    pub(crate) fn required(&self, name: &'static str) -> Result<usize, DataError> {
        self.column(name).ok_or_else(|| {
            self.place().at_line(1).error(DataProblem::MissingColumn {
                name,
                found: printable(&self.names.join(",")),
            })
        })
    }

    /// The file, for messages.
    pub(crate) fn place(&self) -> FilePlace {
        FilePlace::file(&self.path)
    }

    /// The file and the current line, for messages.
    pub(crate) fn here(&self) -> FilePlace {
        self.place().at_line(self.line)
    }

    /// Number of the line that was read last; the header is line 1.
    pub(crate) fn line(&self) -> u64 {
        self.line
    }

    /// Bytes read so far.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Reads the next line that is not blank; `false` at the end of the file.
    pub(crate) fn advance(&mut self) -> Result<bool, DataError> {
        loop {
            if !self.fill_line()? {
                return Ok(false);
            }
            if !self.buffer.iter().all(u8::is_ascii_whitespace) {
                return Ok(true);
            }
        }
    }

    /// The cells of the current row, trimmed, without surrounding quotes.
    pub(crate) fn cells(&self) -> impl Iterator<Item = &[u8]> {
        self.buffer.split(|&b| b == b',').map(bare)
    }

    /// Reads one line without its line end into the buffer.
    fn fill_line(&mut self) -> Result<bool, DataError> {
        self.buffer.clear();
        let count = (&mut self.source)
            .take(LONGEST_LINE + 1)
            .read_until(b'\n', &mut self.buffer)
            .map_err(|e| DataError::unreadable(&self.path, e))?;
        if count == 0 {
            return Ok(false);
        }
        self.line += 1;
        self.bytes += count as u64;
        if self.buffer.last() == Some(&b'\n') {
            self.buffer.pop();
            if self.buffer.last() == Some(&b'\r') {
                self.buffer.pop();
            }
        } else if count as u64 > LONGEST_LINE {
            return Err(self.here().error(DataProblem::LineTooLong));
        }
        Ok(true)
    }
}

fn bare(cell: &[u8]) -> &[u8] {
    let cell = cell.trim_ascii();
    match cell {
        [b'"', inner @ .., b'"'] => inner.trim_ascii(),
        _ => cell,
    }
}

fn split_header(text: &str, place: &FilePlace) -> Result<Vec<String>, DataError> {
    if text.trim().is_empty() {
        return Err(place
            .clone()
            .error(DataProblem::BadHeader("it is blank".into())));
    }
    if !text.contains(',') {
        for (separator, word) in [(';', "semicolons"), ('\t', "tabs")] {
            if text.contains(separator) {
                return Err(place.clone().error(DataProblem::WrongSeparator(word)));
            }
        }
    }
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut record = csv::StringRecord::new();
    reader
        .read_record(&mut record)
        .map_err(|e| place.clone().error(DataProblem::BadHeader(e.to_string())))?;
    let names: Vec<String> = record.iter().map(str::to_owned).collect();
    let mut before = HashSet::new();
    for (i, name) in names.iter().enumerate() {
        if name.is_empty() {
            return Err(place.clone().error(DataProblem::UnnamedColumn(i + 1)));
        }
        if name.chars().any(char::is_control) {
            return Err(place.clone().in_column(name).error(DataProblem::BadName));
        }
        if !before.insert(name) {
            return Err(place
                .clone()
                .in_column(name)
                .error(DataProblem::DoubledColumn));
        }
    }
    Ok(names)
}

/// The number in a cell; the caller checks that it is finite.
pub(crate) fn number(cell: &[u8]) -> Result<f64, DataProblem> {
    if cell.is_empty() {
        return Err(DataProblem::MissingValue);
    }
    std::str::from_utf8(cell)
        .ok()
        .and_then(|text| text.parse().ok())
        .ok_or_else(|| DataProblem::NotANumber(printable(&String::from_utf8_lossy(cell))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reader(text: &str) -> Result<RowReader<&[u8]>, DataError> {
        RowReader::new(text.as_bytes(), Path::new("x.csv"))
    }

    #[test]
    fn lines_are_counted_as_an_editor_counts_them() {
        for end in ["\n", "\r\n"] {
            let text = ["\u{feff}t, u ,\"y\"", "0,1,2", "", "1,\"1\", 3", "", ""].join(end);
            let mut rows = reader(&text).unwrap();
            assert_eq!(rows.names(), ["t", "u", "y"]);
            assert!(rows.advance().unwrap());
            assert_eq!(rows.line(), 2);
            assert!(rows.advance().unwrap());
            assert_eq!(rows.line(), 4);
            let cells: Vec<f64> = rows.cells().map(|c| number(c).unwrap()).collect();
            assert_eq!(cells, [1.0, 1.0, 3.0]);
            assert!(!rows.advance().unwrap());
        }
    }

    #[test]
    fn header_faults_say_what_to_do() {
        let message = |text: &str| reader(text).err().unwrap().to_string();
        assert!(message("").contains("empty"));
        assert!(message("t;u;y\n").contains("commas"));
        assert!(message("t,u,u\n").contains("column `u`"));
        assert!(message("t,,u\n").contains("column 2"));
        assert!(message("\n1,2").contains("blank"));
        let rows = reader("t,u\n").unwrap();
        let text = rows.required("y").unwrap_err().to_string();
        assert!(
            text.contains("x.csv, line 1") && text.contains("(t,u)"),
            "{text}"
        );
    }

    #[test]
    fn endless_line_is_refused_in_bounded_memory() {
        let text = format!("t,u,y\n{}", "1".repeat(3 << 20));
        let mut rows = reader(&text).unwrap();
        assert!(rows.advance().unwrap_err().to_string().contains("line 2"));
        assert!(rows.buffer.len() <= 2 << 20);
    }
}
