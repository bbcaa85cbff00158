//! Tables of numbers as text: whatever separates their columns, marks their decimals and precedes their rows.

use super::problem::ImportProblem;
use super::source::{Exactness, Source, Variable, fault};
use crate::error::{DataError, DataProblem, FilePlace, printable};
use crate::rows::printed_unit;

/// Lines among which the first row of numbers has to be.
const HEAD: usize = 400;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Separator {
    Tab,
    Semicolon,
    Comma,
    Blanks,
}

impl Separator {
    const ALL: [Self; 4] = [Self::Tab, Self::Semicolon, Self::Comma, Self::Blanks];

    fn words(self) -> &'static str {
        match self {
            Self::Tab => "tabs",
            Self::Semicolon => "semicolons",
            Self::Comma => "commas",
            Self::Blanks => "blanks",
        }
    }

    /// The cells of a line, trimmed and without quotes. Programs that end each row with a separator make no empty column of it.
    fn split(self, line: &str) -> Vec<&str> {
        let mut cells: Vec<&str> = match self {
            Self::Blanks => line.split_whitespace().collect(),
            Self::Tab => line.split('\t').collect(),
            Self::Semicolon => line.split(';').collect(),
            Self::Comma => line.split(',').collect(),
        };
        if cells.len() > 2 && cells.last().is_some_and(|c| c.trim().is_empty()) {
            cells.pop();
        }
        for cell in &mut cells {
            *cell = bare(cell);
        }
        cells
    }

    /// Cells of a header, whose names may hold the separator within quotes.
    fn split_header(self, line: &str) -> Vec<String> {
        let delimiter = match self {
            Self::Comma => b',',
            Self::Semicolon => b';',
            _ => return self.split(line).into_iter().map(str::to_owned).collect(),
        };
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .delimiter(delimiter)
            .flexible(true)
            .from_reader(line.as_bytes());
        let mut record = csv::StringRecord::new();
        let read = reader.read_record(&mut record);
        let mut cells: Vec<String> = match read {
            Ok(true) => record.iter().map(|c| bare(c).to_owned()).collect(),
            _ => return self.split(line).into_iter().map(str::to_owned).collect(),
        };
        if cells.len() > 2 && cells.last().is_some_and(String::is_empty) {
            cells.pop();
        }
        cells
    }
}

fn bare(cell: &str) -> &str {
    let cell = cell.trim();
    let inner = cell.strip_prefix('"').and_then(|c| c.strip_suffix('"'));
    inner.map_or(cell, str::trim)
}

/// The number in a cell, with a decimal point or a decimal comma.
fn number(cell: &str) -> Option<f64> {
    // `parse` would take these for numbers, and a header may well read `inf`.
    if !cell.bytes().any(|b| b.is_ascii_digit()) {
        return match cell {
            "NaN" | "nan" | "NAN" => Some(f64::NAN),
            _ => None,
        };
    }
    match cell.split_once(',') {
        None => cell.parse().ok(),
        Some((whole, rest)) if !whole.contains('.') && !rest.contains(['.', ',']) => {
            format!("{whole}.{rest}").parse().ok()
        }
        Some(_) => None,
    }
}

/// The columns of a table.
pub(super) fn variables(bytes: &[u8]) -> Result<Source, DataError> {
    let text = decode(bytes)?;
    let lines: Vec<&str> = text.lines().collect();
    let (separator, first) = first_row(&lines).ok_or_else(|| fault(ImportProblem::NoTable))?;
    let width = separator.split(lines[first]).len();
    let (names, units) = header(&lines[..first], separator, width);
    let place = |line: usize, column: Option<&str>| {
        let place = FilePlace::default().at_line(line as u64 + 1);
        match column {
            Some(name) => place.in_column(name),
            None => place,
        }
    };
    for (i, name) in names.iter().enumerate() {
        if names.iter().take(i).any(|n| n == name) {
            let header = place(first.saturating_sub(1), Some(name));
            return Err(header.error(DataProblem::DoubledColumn));
        }
    }
    let mut source = Source::new(String::new());
    let mut columns = vec![(Vec::new(), Vec::new()); width];
    let mut decimal_comma = false;
    for (at, line) in lines.iter().enumerate().skip(first) {
        if line.trim().is_empty() {
            continue;
        }
        let cells = separator.split(line);
        if cells.len() != width {
            return Err(place(at, None).error(DataProblem::RowLength {
                expected: width,
                found: cells.len(),
            }));
        }
        for ((cell, name), (values, exact)) in cells.iter().zip(&names).zip(&mut columns) {
            let value = number(cell).ok_or_else(|| {
                place(at, Some(name)).error(match cell.is_empty() {
                    true => DataProblem::MissingValue,
                    false => DataProblem::NotANumber(printable(cell)),
                })
            })?;
            values.push(value);
            if cell.contains(',') {
                decimal_comma = true;
                exact.push(printed_unit(cell.replace(',', ".").as_bytes()));
            } else {
                exact.push(printed_unit(cell.as_bytes()));
            }
        }
        source.lines.push(at as u64 + 1);
    }
    let decimals = if decimal_comma { "commas" } else { "points" };
    source.dialect = format!(
        "table separated by {}, decimal {decimals}",
        separator.words()
    );
    let described = names.into_iter().zip(units).zip(columns);
    source.variables = described
        .map(|((name, unit), (values, exact))| Variable {
            name,
            unit,
            values,
            exactness: Exactness::Printed(exact),
        })
        .collect();
    Ok(source)
}

/// UTF-8, UTF-16 with its mark, or else Latin-1, in which old instruments write `°C` and `µs`.
fn decode(bytes: &[u8]) -> Result<String, DataError> {
    let wide = |from: fn([u8; 2]) -> u16| {
        let units = bytes.chunks_exact(2).skip(1).map(|b| from([b[0], b[1]]));
        char::decode_utf16(units)
            .map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER))
            .collect()
    };
    if bytes.starts_with(b"\xff\xfe") {
        return Ok(wide(u16::from_le_bytes));
    }
    if bytes.starts_with(b"\xfe\xff") {
        return Ok(wide(u16::from_be_bytes));
    }
    if bytes.contains(&0) {
        return Err(FilePlace::default().error(DataProblem::NotText));
    }
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|&b| char::from(b)).collect(),
    };
    Ok(match text.strip_prefix('\u{feff}') {
        Some(rest) => rest.to_owned(),
        None => text,
    })
}

/// How columns are separated, and the first row of numbers: the first one that is followed by another like it.
fn first_row(lines: &[&str]) -> Option<(Separator, usize)> {
    let numbers = |separator: Separator, line: &str| -> Option<usize> {
        let cells = separator.split(line);
        let all = cells.len() >= 2 && cells.iter().all(|c| number(c).is_some());
        all.then_some(cells.len())
    };
    let mut found: Option<(Separator, usize)> = None;
    for separator in Separator::ALL {
        let mut rows = lines.iter().take(HEAD).enumerate();
        let mut before: Option<(usize, usize)> = None;
        let row = rows.find_map(|(at, line)| {
            if line.trim().is_empty() {
                return None;
            }
            let width = numbers(separator, line);
            match (before, width) {
                (Some((start, w)), Some(width)) if w == width => return Some(start),
                _ => before = width.map(|w| (at, w)),
            }
            None
        });
        // The earliest table wins; of two separators that fit equally, the first in the list, so that `1,5;2,5` is two numbers.
        if let Some(row) = row
            && found.is_none_or(|(_, at)| row < at)
        {
            found = Some((separator, row));
        }
    }
    found
}

/// Names and units from the lines above the rows.
fn header(
    above: &[&str],
    separator: Separator,
    width: usize,
) -> (Vec<String>, Vec<Option<String>>) {
    let marks = |c: char| matches!(c, '#' | '%') || c.is_whitespace();
    let cells = |line: &&&str| -> Option<Vec<String>> {
        let cells = separator.split_header(line.trim_start_matches(marks));
        (cells.len() == width).then_some(cells)
    };
    let mut candidates = above
        .iter()
        .rev()
        .filter(|l| !l.trim().is_empty())
        .take(2)
        .map(|line| cells(&line));
    let (last, before) = (candidates.next().flatten(), candidates.next().flatten());
    let numbered = || (1..=width).map(|i| format!("column {i}")).collect();
    // A line of units stands between the names and the rows.
    if let (Some(units), Some(names)) = (&last, &before)
        && units.iter().all(|u| u.is_empty() || is_unit(u))
        && names.iter().all(|n| !n.is_empty())
    {
        let units = units.iter().map(|u| {
            let u = u.trim_matches(['[', ']', '(', ')']);
            (!u.is_empty()).then(|| u.to_owned())
        });
        return (names.clone(), units.collect());
    }
    let names: Vec<String> = last.unwrap_or_else(numbered);
    let split = names.iter().enumerate().map(|(i, text)| {
        let (name, unit) = name_and_unit(text);
        match name.is_empty() {
            true => (format!("column {}", i + 1), unit),
            false => (name.to_owned(), unit),
        }
    });
    split.unzip()
}

fn is_unit(text: &str) -> bool {
    let bracketed = |open, close| text.starts_with(open) && text.ends_with(close);
    const KNOWN: [&str; 18] = [
        "s", "ms", "us", "µs", "min", "h", "V", "mV", "A", "mA", "Pa", "bar", "mbar", "m/s", "K",
        "°C", "N", "-",
    ];
    bracketed('[', ']') || bracketed('(', ')') || KNOWN.contains(&text)
}

/// `u_inf [m/s]`, `u_inf (m/s)`, `u_inf in m/s` and `u_inf / m/s` in two.
fn name_and_unit(text: &str) -> (&str, Option<String>) {
    let bracketed = |open: char, close: char| {
        let (name, rest) = text.split_once(open)?;
        Some((name.trim(), rest.trim_end().strip_suffix(close)?.trim()))
    };
    let parted = |by: &str| {
        let (name, unit) = text.split_once(by)?;
        Some((name.trim(), unit.trim()))
    };
    let found = bracketed('[', ']')
        .or_else(|| bracketed('(', ')'))
        .or_else(|| parted(" / "))
        .or_else(|| parted(" in "));
    match found {
        Some((name, unit)) if !name.is_empty() && !unit.is_empty() => (name, Some(unit.to_owned())),
        _ => (text.trim(), None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Source {
        variables(text.as_bytes()).expect("a table")
    }

    #[track_caller]
    fn expect(source: &Source, names: &[&str], last: &[f64]) {
        let found: Vec<&str> = source.variables.iter().map(|v| v.name.as_str()).collect();
        assert_eq!(found, names);
        let values: Vec<f64> = source
            .variables
            .iter()
            .filter_map(|v| v.values.last().copied())
            .collect();
        assert_eq!(values, last);
    }

    #[test]
    fn dialects_are_told_apart() {
        let german = read("Zeit [ms];Ventil;tau / Pa\r\n0,0;0;1,25\r\n1,0;5;-1,5e-3\r\n");
        expect(&german, &["Zeit", "Ventil", "tau"], &[1.0, 5.0, -1.5e-3]);
        assert_eq!(german.variables[0].unit.as_deref(), Some("ms"));
        assert_eq!(german.variables[2].unit.as_deref(), Some("Pa"));
        assert!(
            german.dialect.contains("semicolons") && german.dialect.contains("decimal commas"),
            "{}",
            german.dialect
        );
        let tabs = read("\u{feff}t\tu (V)\ty\n0,000\t0\t0,5\n0,001\t1\t0,6\n");
        expect(&tabs, &["t", "u", "y"], &[0.001, 1.0, 0.6]);
        let plain = read("t,u,y\n0,0,1\n0.5,1,2\n");
        expect(&plain, &["t", "u", "y"], &[0.5, 1.0, 2.0]);
        let blanks = read("% t u y\n 0.0  0 1\n 0.1  1 2\n");
        expect(&blanks, &["t", "u", "y"], &[0.1, 1.0, 2.0]);
        let quoted = read("\"t\",\"a, b\"\n0,1\n1,2\n");
        expect(&quoted, &["t", "a, b"], &[1.0, 2.0]);
    }

    #[test]
    fn what_precedes_the_rows_is_passed_over() {
        let lab = read(
            "LabVIEW Measurement\nChannels\t3\n\nTime\tValve\tShear\ns\tV\tPa\n0\t0\t1\n1\t5\t2\n2\t5\t3\n",
        );
        expect(&lab, &["Time", "Valve", "Shear"], &[2.0, 5.0, 3.0]);
        assert_eq!(lab.variables[1].unit.as_deref(), Some("V"));
        assert_eq!(lab.lines, [6, 7, 8]);
        let bare = read("0 1\n1 2\n");
        expect(&bare, &["column 1", "column 2"], &[1.0, 2.0]);
    }

    #[test]
    fn wide_and_old_encodings_are_read() {
        let text = "t [µs];T [°C]\n0;20\n1;21\n";
        let latin: Vec<u8> = text.chars().map(|c| c as u32 as u8).collect();
        let wide: Vec<u8> = std::iter::once(0xfeff)
            .chain(text.encode_utf16())
            .flat_map(u16::to_le_bytes)
            .collect();
        for bytes in [text.as_bytes(), &latin, &wide] {
            let source = variables(bytes).expect("a table");
            expect(&source, &["t", "T"], &[1.0, 21.0]);
            assert_eq!(source.variables[0].unit.as_deref(), Some("µs"));
        }
    }

    #[test]
    fn faults_name_line_and_column() {
        let message = |text: &str| {
            let fault = variables(text.as_bytes()).expect_err("a fault");
            fault.to_string()
        };
        for (text, parts) in [
            ("t;u\n0;1\n1;1\n2\n", ["line 4", "2 names"]),
            (
                "t;u;y\n0;1;1\n1;1;1\n2;;1\n",
                ["line 4, column `u`", "missing"],
            ),
            ("t;u\n0;1\n1;1\n2;on\n", ["line 4, column `u`", "`on`"]),
            (
                "t;u\n0;1\n1;1\n2;1.000,5\n",
                ["line 4, column `u`", "thousands"],
            ),
            ("t;t\n0;1\n1;1\n", ["line 1, column `t`", "twice"]),
            ("nothing here", ["header", "no rows of numbers"]),
            ("t;u\n0;1\n1;1;3\n", ["header", "no rows"]),
        ] {
            let found = message(text);
            for part in parts {
                assert!(found.contains(part), "{text:?}: {found}");
            }
        }
    }
}
