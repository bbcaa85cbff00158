//! A column of a text table while its rows are read.

use super::cell::{Cell, Decimals};
use super::source::{Exactness, Unread, Variable};
use super::stamp::{Stamp, resolve};
use crate::error::printable;

/// The kind of a column's cells; the first non-empty cell decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Numbers,
    Stamps,
}

/// The cells of a column so far.
#[derive(Debug, Clone, Default)]
pub(super) struct Column {
    kind: Option<Kind>,
    values: Vec<f64>,
    exact: Vec<f64>,
    stamps: Vec<Stamp>,
    /// Rows in which the cell is empty.
    blanks: Vec<usize>,
    /// The unit after the numbers.
    unit: Option<String>,
    /// The words for on and for off, as written.
    words: [Option<String>; 2],
    /// A number with thousands marks, as written, and its value.
    grouped: Option<(String, f64)>,
    /// The first row without a value.
    gap: Option<usize>,
    unread: Option<(u64, String)>,
}

impl Column {
    /// Adds the cell of the next row, which stands in `line`.
    pub(super) fn push(&mut self, text: &str, line: u64, decimals: Decimals) {
        let cell = Cell::of(text, decimals);
        let mut value = f64::NAN;
        let mut exact = 1.0;
        match (cell, self.kind) {
            (Cell::Empty, _) => {
                self.blanks.push(self.values.len());
                self.gap.get_or_insert(self.values.len());
            }
            (Cell::Missing, _) => {
                self.gap.get_or_insert(self.values.len());
            }
            (Cell::Number(number), None | Some(Kind::Numbers)) => {
                self.kind = Some(Kind::Numbers);
                (value, exact) = (number.value, number.unit_in_last_place);
                if let Some(unit) = number.unit {
                    match &self.unit {
                        None => self.unit = Some(unit.to_owned()),
                        Some(known) if known == unit => {}
                        Some(_) => self.stop(line, text),
                    }
                }
                if number.is_grouped && self.grouped.is_none() {
                    self.grouped = Some((text.to_owned(), value));
                }
            }
            (Cell::Switch(on), None | Some(Kind::Numbers)) => {
                self.kind = Some(Kind::Numbers);
                value = f64::from(u8::from(on));
                let [on_word, off_word] = &mut self.words;
                let word = if on { on_word } else { off_word };
                word.get_or_insert_with(|| text.to_owned());
            }
            (Cell::Stamp(stamp), None | Some(Kind::Stamps)) => {
                self.kind = Some(Kind::Stamps);
                self.stamps.push(stamp);
            }
            _ => self.stop(line, text),
        }
        self.values.push(value);
        self.exact.push(exact);
    }

    fn stop(&mut self, line: u64, text: &str) {
        self.unread.get_or_insert((line, printable(text)));
    }

    /// Whether all cells are empty.
    pub(super) fn is_empty(&self) -> bool {
        self.blanks.len() == self.values.len()
    }

    /// The column as a variable, or its first unreadable cell; `lines` are the lines of the rows.
    pub(super) fn variable(
        mut self,
        name: String,
        unit: Option<String>,
        lines: &[u64],
        text: impl Fn(usize) -> String,
    ) -> Result<Variable, Unread> {
        let unread = |(line, text): (u64, String)| Unread {
            name: name.clone(),
            line,
            text,
        };
        if let Some(at) = self.unread.take() {
            return Err(unread(at));
        }
        let mut variable = Variable {
            name: name.clone(),
            unit: unit.or(self.unit),
            values: self.values,
            exactness: Exactness::Printed(self.exact),
            blanks: self.blanks,
            stamped: None,
            notes: Vec::new(),
        };
        if self.kind == Some(Kind::Stamps) {
            // For a missing stamp the message quotes the row.
            let at = |row: usize| (lines.get(row).copied().unwrap_or(0), printable(&text(row)));
            if let Some(row) = self.gap {
                return Err(unread(at(row)));
            }
            let mut stamped = resolve(&self.stamps).map_err(|row| unread(at(row)))?;
            stamped.first = printable(&text(0));
            variable.values.clone_from(&stamped.seconds);
            variable.exactness = Exactness::Printed(stamped.unit.clone());
            variable.unit = Some("s".to_owned());
            variable.stamped = Some(stamped);
            return Ok(variable);
        }
        if let [Some(on), Some(off)] = &self.words {
            let note = format!("`{name}`: {on} is 1, {off} is 0");
            variable.notes.push(note);
        } else if let [on, off] = &self.words
            && let Some((word, value)) = on.as_ref().zip(Some(1)).or(off.as_ref().zip(Some(0)))
        {
            variable.notes.push(format!("`{name}`: {word} is {value}"));
        }
        if let Some((text, value)) = &self.grouped {
            let note = format!("`{name}`: {} is read as {value}", printable(text));
            variable.notes.push(note);
        }
        Ok(variable)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(cells: &[&str]) -> Result<Variable, Unread> {
        let mut column = Column::default();
        let lines: Vec<u64> = (2..).take(cells.len()).collect();
        for (cell, line) in cells.iter().zip(&lines) {
            column.push(cell, *line, Decimals::Point);
        }
        column.variable("x".to_owned(), None, &lines, |row| cells[row].to_owned())
    }

    #[test]
    fn each_kind_of_column_becomes_numbers() {
        let switch = read(&["OFF", "ON", "ON"]).unwrap();
        assert_eq!(switch.values, [0.0, 1.0, 1.0]);
        assert_eq!(switch.notes, ["`x`: ON is 1, OFF is 0"]);
        let percent = read(&["0 %", "45 %", "45 %"]).unwrap();
        assert_eq!(
            (percent.unit.as_deref(), percent.values[1]),
            (Some("%"), 45.0)
        );
        let held = read(&["0", "", "1"]).unwrap();
        assert_eq!(held.blanks, [1]);
        assert!(held.values[1].is_nan());
        let thousands = read(&["998", "1,021.04", "1,030"]).unwrap();
        assert_eq!(thousands.values, [998.0, 1021.04, 1030.0]);
        assert_eq!(thousands.notes, ["`x`: 1,021.04 is read as 1021.04"]);
        let clock = read(&["23:59:59", "00:00:00", "00:00:01"]).unwrap();
        assert_eq!(clock.values, [0.0, 1.0, 2.0]);
        assert_eq!(clock.stamped.unwrap().midnights, 1);
    }

    #[test]
    fn the_first_cell_that_is_not_read_is_named() {
        for (cells, line, text) in [
            (&["0", "HEAT", "1"][..], 3, "HEAT"),
            (&["HEAT", "0", "1"], 2, "HEAT"),
            (&["23:59:59", "12", "00:00:01"], 3, "12"),
            (&["23:59:59", "", "00:00:01"], 3, ""),
            (&["23:59:59", "2024-09-17"], 3, "2024-09-17"),
            (&["21 °C", "70 °F"], 3, "70 °F"),
        ] {
            let unread = read(cells).unwrap_err();
            assert_eq!(
                (unread.line, unread.text.as_str()),
                (line, text),
                "{cells:?}"
            );
        }
    }
}
