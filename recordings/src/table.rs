//! One CSV file in memory: columns by name, the line of each row, the sampling period.

use std::collections::BTreeMap;
use std::io::BufRead;
use std::path::Path;

use crate::error::{DataError, DataProblem, FilePlace};
use crate::import::ImportProblem;
use crate::memory;
use crate::printed::printed_unit;
use crate::record::{Origin, Record, Use, check_values};
use crate::rows::{RowReader, number, open_text};
use crate::sampling::{PrintedTimes, Stated};
use crate::thresholds::RULES;

/// The columns of one file; all have the same length, at least 2, and only finite values.
#[derive(Debug)]
pub(crate) struct Table {
    columns: BTreeMap<String, Vec<f64>>,
    t0: f64,
    sample_period_s: f64,
    origin: Origin,
}

/// Interval of the memory check, rows.
const CHECKED: usize = 4096;
const REMEDY: &str = "phase-average it with `host-fit average`, or use a part of it";

impl Table {
    /// Reads a file; `stated` is its required sampling period, otherwise it is estimated.
    pub(crate) fn load(path: &Path, stated: Option<Stated>) -> Result<Self, DataError> {
        Self::load_beside(path, stated, 0)
    }

    /// Loads a file while `taken` bytes of memory are already in use.
    pub(crate) fn load_beside(
        path: &Path,
        stated: Option<Stated>,
        taken: u64,
    ) -> Result<Self, DataError> {
        Self::read(open_text(path, 1 << 16)?, path, stated, taken)
    }

    /// Reads from anything that yields bytes; `path` is used in messages only.
    pub(crate) fn read(
        source: impl BufRead,
        path: &Path,
        stated: Option<Stated>,
        taken: u64,
    ) -> Result<Self, DataError> {
        let mut rows = RowReader::new(source, path)?;
        let time_column = rows.required("t")?;
        let names = rows.names().to_vec();
        let mut columns = vec![Vec::new(); names.len()];
        let mut times = PrintedTimes::default();
        let mut lines = Vec::new();
        // Memory of a row: its values, its line number, and one unit in the last printed place of its time; 8 bytes
        // each.
        let row = 8 * (names.len() as u64 + 2);
        while rows.advance()? {
            if lines.len() % CHECKED == 0 {
                let needed = taken + (lines.len() + CHECKED) as u64 * row;
                memory::allow(needed, "its rows", REMEDY)
                    .map_err(|e| rows.here().error(ImportProblem::from(e).into()))?;
            }
            let found = rows.cells().count();
            if found != names.len() {
                return Err(rows.here().error(DataProblem::RowLength {
                    expected: names.len(),
                    found,
                }));
            }
            let cells = rows.cells().zip(&mut columns).zip(&names).enumerate();
            for (i, ((cell, column), name)) in cells {
                let value = number(cell).map_err(|p| rows.here().in_column(name).error(p))?;
                column.push(value);
                if i == time_column {
                    times.unit.push(printed_unit(cell));
                }
            }
            lines.push(rows.line());
        }
        let origin = Origin {
            file: Some(path.to_path_buf()),
            lines,
        };
        let place = |row: Option<usize>| origin.place("", row);
        for (name, values) in names.iter().zip(&columns) {
            check_values(name, values, &place)?;
        }
        let mut columns: BTreeMap<String, Vec<f64>> = names.into_iter().zip(columns).collect();
        times.time = columns.remove("t").unwrap_or_default();
        if let Some(row) = times.time.iter().position(|t| t.abs() >= RULES.latest_s) {
            let time = times.time.get(row).copied().unwrap_or(f64::NAN);
            let here = place(Some(row)).in_column("t");
            return Err(here.error(DataProblem::NotSeconds(time)));
        }
        let clock = times.clock(stated).map_err(|fault| {
            let at = match fault.problem {
                DataProblem::TooFewRows(_) => place(None),
                _ => place(Some(fault.row)).in_column("t"),
            };
            at.error(fault.problem)
        })?;
        Ok(Self {
            t0: times.time.first().copied().unwrap_or(0.0),
            columns,
            sample_period_s: clock.period_s,
            origin,
        })
    }

    fn take(&mut self, name: &'static str) -> Result<Vec<f64>, DataError> {
        if let Some(values) = self.columns.remove(name) {
            return Ok(values);
        }
        let found: Vec<&str> = std::iter::once("t")
            .chain(self.columns.keys().map(String::as_str))
            .collect();
        Err(self.header_place().error(DataProblem::MissingColumn {
            name,
            found: found.join(","),
        }))
    }

    fn header_place(&self) -> FilePlace {
        self.origin.place("", None).at_line(1)
    }

    /// The table as a record; the rules of [`Record`] are checked by the caller.
    pub(crate) fn into_record(
        mut self,
        name: &str,
        role: Use,
    ) -> Result<(Record, Origin), DataError> {
        let u = self.take("u")?;
        let y = self.take("y")?;
        let record = Record {
            name: name.to_owned(),
            role,
            sample_period_s: self.sample_period_s,
            t0: self.t0,
            u_before: None,
            lead: 0,
            y_before: None,
            followed: Vec::new(),
            u,
            y,
            y_sd: self.columns.remove("y_sd"),
            y_min: self.columns.remove("y_min"),
            y_max: self.columns.remove("y_max"),
            channels: self.columns,
        };
        Ok((record, self.origin))
    }
}

/// A command sequence with measured channels: columns `t`, `u` and any others. `y` is optional.
#[derive(Debug, Clone)]
pub struct InputFile {
    /// Sampling period, s.
    pub sample_period_s: f64,
    /// Time of sample 0, s.
    pub t0: f64,
    /// Command per sample, any finite value.
    pub u: Vec<f64>,
    /// Measured output, if the file has it; as long as `u`.
    pub y: Option<Vec<f64>>,
    /// Further channels by name (`y_sd` and the like count as channels here), each as long as `u`.
    pub channels: BTreeMap<String, Vec<f64>>,
    origin: Origin,
}

impl InputFile {
    /// Loads the file; its sampling period is `stated` if given, otherwise that of its column `t`.
    ///
    /// # Errors
    /// [`DataError`] naming file, line and column of the first fault.
    pub fn load(path: &Path, stated: Option<f64>) -> Result<Self, DataError> {
        let by = "the sampling period is stated as";
        let stated = stated.map(|period_s| Stated { period_s, by });
        let mut table = Table::load(path, stated)?;
        Ok(Self {
            sample_period_s: table.sample_period_s,
            t0: table.t0,
            u: table.take("u")?,
            y: table.columns.remove("y"),
            channels: table.columns,
            origin: table.origin,
        })
    }

    /// Position of sample `k` in the user's file, for messages.
    #[must_use]
    pub fn place(&self, k: Option<usize>) -> FilePlace {
        self.origin.place("", k)
    }

    /// Refuses a command that is not on/off.
    ///
    /// # Errors
    /// [`DataError`] naming file and line of the first value that is neither 0 nor 1.
    pub fn require_on_off(&self) -> Result<(), DataError> {
        match self.u.iter().position(|&u| u != 0.0 && u != 1.0) {
            Some(k) => Err(self
                .place(Some(k))
                .in_column("u")
                .error(DataProblem::NotOnOff(self.u[k]))),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Table, DataError> {
        Table::read(text.as_bytes(), Path::new("run.csv"), None, 0)
    }

    fn message(text: &str) -> String {
        read(text).unwrap_err().to_string()
    }

    #[test]
    fn columns_arrive_whatever_their_order() {
        let table = read("u_inf,y,t,u\r\n9.5,0.25,0.5,1\r\n9.6,0.5,0.501,0\r\n").unwrap();
        let (record, _) = table.into_record("r", Use::Validate).unwrap();
        assert_eq!((record.t0, record.sample_period_s), (0.5, 0.001));
        assert_eq!((record.u, record.y), (vec![1.0, 0.0], vec![0.25, 0.5]));
        assert_eq!(record.channels["u_inf"], [9.5, 9.6]);
    }

    #[test]
    fn each_fault_names_its_line_and_column() {
        for (text, parts) in [
            (
                "t,u,y\n0,0,0\n1,0\n",
                ["line 3", "2 values where the header has 3"],
            ),
            ("t,u,y\n0,0,0\n1,0,\n", ["line 3, column `y`", "missing"]),
            (
                "t,u,y\n0,0,0\n1,on,0\n",
                ["line 3, column `u`", "`on` is not a number"],
            ),
            ("t,u,y\n0,0,NaN\n1,0,0\n", ["line 2, column `y`", "NaN"]),
            ("t,u,y\n0,0,0\n1,0,inf\n", ["line 3, column `y`", "inf"]),
            ("t,u,y\n0,0,0\n1,0,1e300\n", ["line 3, column `y`", "units"]),
            (
                "t,u,y\n0,0,0\n1,0,0\n\n1,0,0\n",
                ["line 5, column `t`", "does not increase"],
            ),
            (
                "t,u,y\n0,0,0\n1,0,0\n2,0,0\n5,0,0\n",
                ["line 5, column `t`", "2 sample(s) missing"],
            ),
            ("t,u,y\n0,0,0\n", ["run.csv", "at least 2"]),
            ("t,u,y\n", ["run.csv", "at least 2"]),
            ("", ["run.csv", "empty"]),
            ("time,u,y\n0,0,0\n", ["line 1", "no column `t`"]),
        ] {
            let found = message(text);
            assert!(found.starts_with("run.csv"), "{found}");
            for part in parts {
                assert!(found.contains(part), "{text:?}: {found}");
            }
            assert!(!found.contains('\n'), "one paragraph: {found}");
        }
        let text = read("t,u,z\n0,0,0\n1,0,0\n")
            .unwrap()
            .into_record("r", Use::Identify);
        let text = text.unwrap_err().to_string();
        assert!(
            text.contains("line 1") && text.contains("no column `y`"),
            "{text}"
        );
    }

    #[test]
    fn an_input_file_needs_no_output() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("in.csv");
        std::fs::write(&path, "t,u,u_inf\n0,0,9\n0.001,1,9\n0.002,0.5,9\n").unwrap();
        let input = InputFile::load(&path, None).unwrap();
        assert_eq!(input.u, [0.0, 1.0, 0.5]);
        assert!(input.y.is_none() && input.channels.contains_key("u_inf"));
        let text = input.require_on_off().unwrap_err().to_string();
        assert!(text.contains("in.csv, line 4, column `u`"), "{text}");
        assert!(InputFile::load(&path, Some(0.01)).is_err());
    }
}
