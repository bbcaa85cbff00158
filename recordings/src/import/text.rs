//! Tables of numbers as text, with any separator of columns, any decimal mark, and any lines before the rows.

use std::collections::HashSet;

use super::cell::Marks;
use super::column::Column;
use super::delimited::{Rows, Separator, is_comment};
use super::labelled::{Labels, arrows, leading};
use super::long::widened;
use super::problem::ImportProblem;
use super::source::{Budget, Source, fault};
use super::stamp::Stamp;
use crate::error::{DataError, DataProblem, FilePlace, printable};

/// Largest number of cells of a row: as many columns as a spreadsheet has.
const WIDEST: usize = 16_384;
/// Bytes of memory per line in addition to its text, and per cell: its value, its last place, and its copy in a
/// record.
const LINE: u64 = 32;
const CELL: u64 = 24;

/// Column name of a serial monitor's clock.
const MONITOR: &str = "received";

/// Layout of the rows.
enum Layout {
    Table(Rows),
    Labelled(Labels),
}

/// Result of reading a line as a row.
enum Line {
    Row,
    /// Not a row; may occur between rows.
    Other,
    /// A row with too few or too many cells.
    Length(usize),
}

impl Layout {
    fn of(lines: &[&str]) -> Result<Self, DataError> {
        if let Some(labels) = Labels::of(lines) {
            return Ok(Self::Labelled(labels));
        }
        if let Some(rows) = Rows::find(lines) {
            return Ok(Self::Table(rows));
        }
        Err(match Rows::nearest(lines) {
            Some((at, text)) => FilePlace::default()
                .at_line(at as u64 + 1)
                .error(ImportProblem::NearlyRow(printable(&text)).into()),
            None => fault(ImportProblem::NoTable),
        })
    }

    /// Index of the first line that may be a row.
    fn first(&self) -> usize {
        match self {
            Self::Table(rows) => rows.first,
            Self::Labelled(_) => 0,
        }
    }

    /// Cells of a row.
    fn width(&self) -> usize {
        match self {
            Self::Table(rows) => rows.width,
            Self::Labelled(labels) => labels.0.len(),
        }
    }

    fn split<'a>(&self, line: &'a str, cells: &mut Vec<&'a str>) -> Line {
        match self {
            Self::Labelled(labels) => match labels.split(line, cells) {
                true => Line::Row,
                false => Line::Other,
            },
            Self::Table(_) if is_comment(line) => Line::Other,
            Self::Table(rows) => {
                rows.separator.split(line, cells);
                // Trailing separators do not make empty columns.
                while cells.len() > rows.width && cells.last().is_some_and(|c| c.is_empty()) {
                    cells.pop();
                }
                match cells.len() == rows.width {
                    true => Line::Row,
                    false => Line::Length(cells.len()),
                }
            }
        }
    }

    fn is_parted_by_commas(&self) -> bool {
        matches!(self, Self::Table(rows) if rows.separator == Separator::Comma)
    }

    fn words(&self) -> String {
        match self {
            Self::Table(rows) => format!("table separated by {}", rows.separator.words()),
            Self::Labelled(_) => "lines of labelled values".to_owned(),
        }
    }
}

/// The columns of a table.
pub(super) fn variables(bytes: &[u8], budget: &mut Budget) -> Result<Source, DataError> {
    // Reserves memory for the text and for its line index.
    let lines = bytes.iter().filter(|b| **b == b'\n').count() as u64 + 1;
    budget.take(2 * bytes.len() as u64 + lines * LINE, || {
        "its text".to_owned()
    })?;
    let text = decode(bytes)?;
    let lines: Vec<&str> = text.lines().collect();
    let is_cut = !text.ends_with('\n');
    if let Some(rows) = Rows::find(&lines)
        && let Some(wide) = widened(&rows, &lines, budget)?
    {
        let size = wide.lines.iter().map(String::len).sum::<usize>() as u64;
        budget.take(size + wide.lines.len() as u64 * LINE, || {
            "its signals as columns".to_owned()
        })?;
        let lines: Vec<&str> = wide.lines.iter().map(String::as_str).collect();
        let table = Layout::Table(Rows {
            separator: Separator::Tab,
            first: 1,
            width: lines[0].split('\t').count(),
        });
        let mut source = table_of(lines, Some((table, &wide.numbers)), false, budget)?;
        source.dialect = source.dialect.replace(
            Separator::Tab.words(),
            &format!("{}, one signal a row", rows.separator.words()),
        );
        source.remarks.splice(0..0, wide.remarks);
        return Ok(source);
    }
    table_of(lines, None, is_cut, budget)
}

/// The columns of a table with these lines; `known` are its layout and the lines' numbers in the file, if these are not
/// those of `lines`.
fn table_of(
    mut lines: Vec<&str>,
    known: Option<(Layout, &[u64])>,
    is_cut: bool,
    budget: &mut Budget,
) -> Result<Source, DataError> {
    let labelled = || Labels::of(&lines).and_then(|_| leading(&lines));
    let parted = match known {
        Some(_) => None,
        None => arrows(&lines).or_else(labelled),
    };
    let stamps = parted.map(|parted| {
        lines = parted.iter().map(|(_, rest)| *rest).collect();
        let stamps = parted.iter().map(|(stamp, _)| *stamp);
        stamps.collect::<Vec<&str>>()
    });
    let (layout, numbers) = match known {
        Some((layout, numbers)) => (layout, Some(numbers)),
        None => (Layout::of(&lines)?, None),
    };
    let number = |at: usize| match numbers {
        Some(numbers) => numbers.get(at).copied().unwrap_or(0),
        None => at as u64 + 1,
    };
    let width = layout.width();
    if width > WIDEST {
        let here = FilePlace::default().at_line(number(layout.first()));
        return Err(here.error(ImportProblem::TooWide(width).into()));
    }
    let cells = (lines.len() - layout.first()) as u64 * width as u64;
    budget.take(cells * CELL, || format!("its table of {width} columns"))?;
    let (names, units) = match &layout {
        Layout::Table(rows) => rows.header(&lines),
        Layout::Labelled(labels) => (labels.0.clone(), vec![None; labels.0.len()]),
    };
    let mut before = HashSet::new();
    for name in &names {
        if !before.insert(name) {
            let header = FilePlace::default().at_line(number(layout.first().saturating_sub(1)));
            let header = header.in_column(name);
            return Err(header.error(DataProblem::DoubledColumn));
        }
    }
    let mut source = Source::new(String::new());
    let rows = rows(&layout, &lines, is_cut, &mut source)?;
    let mut marks = Marks::default();
    let mut cells = Vec::new();
    for &at in &rows {
        layout.split(lines.get(at).copied().unwrap_or_default(), &mut cells);
        cells.iter().for_each(|cell| marks.see(cell));
    }
    let decimals = marks.decimals(layout.is_parted_by_commas());
    let halves = halves(&layout, &lines, &rows);
    let joined = |cells: &[&str], index: usize| -> Option<String> {
        let half = halves.filter(|half| index + 1 == *half)?;
        Some(format!("{} {}", cells.get(index)?, cells.get(half)?))
    };
    let mut columns = vec![Column::default(); names.len()];
    let mut monitor = Column::default();
    for &at in &rows {
        let line = number(at);
        layout.split(lines.get(at).copied().unwrap_or_default(), &mut cells);
        for (index, (cell, column)) in cells.iter().zip(&mut columns).enumerate() {
            match joined(&cells, index) {
                Some(clock) => column.push(&clock, line, decimals),
                None => column.push(cell, line, decimals),
            }
        }
        if let Some(stamp) = stamps.as_ref().and_then(|stamps| stamps.get(at)) {
            monitor.push(stamp, line, decimals);
        }
        source.lines.push(line);
    }
    if marks.is_unclear() {
        let as_what = match layout.is_parted_by_commas() {
            true => "commas are read as thousands marks",
            false => "commas are read as decimal commas",
        };
        source
            .remarks
            .push(format!("{as_what}; the file itself is ambiguous"));
    }
    let mut described: Vec<_> = names.into_iter().zip(units).zip(columns).collect();
    if stamps.is_some() && described.iter().all(|((name, _), _)| name != MONITOR) {
        described.push(((MONITOR.to_owned(), None), monitor));
    }
    for (index, ((name, unit), column)) in described.into_iter().enumerate() {
        if halves == Some(index) {
            continue;
        }
        if column.is_empty() {
            if !name.starts_with("column ") {
                source
                    .skipped
                    .push((name, "its cells are empty".to_owned()));
            }
            continue;
        }
        let text = |row: usize| {
            let at = rows.get(row).copied().unwrap_or(0);
            let mut cells = Vec::new();
            layout.split(lines.get(at).copied().unwrap_or_default(), &mut cells);
            let stamp = || stamps.as_ref().and_then(|stamps| stamps.get(at));
            let cell = cells.get(index).or_else(stamp);
            joined(&cells, index).unwrap_or_else(|| cell.copied().unwrap_or_default().to_owned())
        };
        match column.variable(name, unit, &source.lines, text) {
            Ok(variable) => source.variables.push(variable),
            Err(unread) => source.unread.push(unread),
        }
    }
    source.dialect = format!("{}, decimal {}", layout.words(), decimals.words(marks));
    Ok(source)
}

/// The column with AM or PM for the clock time in the column before it.
fn halves(layout: &Layout, lines: &[&str], rows: &[usize]) -> Option<usize> {
    let mut cells = Vec::new();
    let mut is_half = |at: usize, column: usize| {
        layout.split(lines.get(at).copied().unwrap_or_default(), &mut cells);
        let clock = |text: &&str| text.contains(':');
        cells
            .get(column)
            .copied()
            .is_some_and(Stamp::is_half_of_day)
            && cells.get(column - 1).is_some_and(clock)
    };
    let first = *rows.first()?;
    let column = (1..layout.width()).find(|column| is_half(first, *column))?;
    let all = rows.iter().all(|at| is_half(*at, column));
    all.then_some(column)
}

/// Indices of the lines that are rows; skipped lines are mentioned in a remark.
fn rows(
    layout: &Layout,
    lines: &[&str],
    is_cut: bool,
    source: &mut Source,
) -> Result<Vec<usize>, DataError> {
    let mut rows = Vec::with_capacity(lines.len());
    let mut others: Vec<usize> = Vec::new();
    let mut cells = Vec::new();
    for (at, line) in lines.iter().enumerate().skip(layout.first()) {
        if line.trim().is_empty() {
            continue;
        }
        let found = layout.split(line, &mut cells);
        let is_last = at + 1 == lines.len() && is_cut;
        match found {
            // A stopped program leaves an incomplete line.
            Line::Length(_) if is_last => others.push(at),
            Line::Row
                if is_last && matches!(layout, Layout::Labelled(_)) && cells.contains(&"") =>
            {
                others.push(at);
            }
            Line::Row => rows.push(at),
            Line::Other if rows.is_empty() => {}
            Line::Other => others.push(at),
            Line::Length(found) => {
                let expected = layout.width();
                let here = FilePlace::default().at_line(at as u64 + 1);
                return Err(here.error(DataProblem::RowLength { expected, found }));
            }
        }
    }
    if let Some(&first) = others.first() {
        let text = printable(lines.get(first).copied().unwrap_or_default().trim());
        let more = match others.len() - 1 {
            0 => String::new(),
            more => format!(" ({more} more)"),
        };
        source.remarks.push(format!(
            "line {} is not a row and is left out: `{text}`{more}",
            first + 1
        ));
    }
    Ok(rows)
}

/// UTF-8, UTF-16 with its mark, otherwise Latin-1, in which old instruments write `°C` and `µs`.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Source {
        variables(text.as_bytes(), &mut Budget::with(0)).expect("a table")
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
        let exported =
            read("***End_of_Header***\nX_Value\tValve\tFilm\tComment\n0\t0\t1\n1\t5\t2\n");
        expect(&exported, &["X_Value", "Valve", "Film"], &[1.0, 5.0, 2.0]);
        let scope = read("x-axis,1,2\nsecond,Volt,Volt\n+0.0E+00,0,1\n+1.0E-03,5,2\n");
        expect(&scope, &["x-axis", "1", "2"], &[1e-3, 5.0, 2.0]);
        assert_eq!(scope.variables[2].unit.as_deref(), Some("Volt"));
        let bare = read("0 1\n1 2\n");
        expect(&bare, &["column 1", "column 2"], &[1.0, 2.0]);
    }

    #[test]
    fn quotes_indices_and_empty_ends_are_understood() {
        let quoted = read("t,u,y\n0,0,\"1,021.04\"\n1,1,\"998.5\"\n");
        expect(&quoted, &["t", "u", "y"], &[1.0, 1.0, 998.5]);
        let indexed = read(",t,u\n0,0.0,1\n1,0.5,1\n");
        expect(&indexed, &["column 1", "t", "u"], &[1.0, 0.5, 1.0]);
        let unnamed = read("\"t\" \"u\"\n\"1\" 0.0 1\n\"2\" 0.5 1\n");
        expect(&unnamed, &["column 1", "t", "u"], &[2.0, 0.5, 1.0]);
        let ended = read("t;u;\n0;1;\n1;0;\n");
        expect(&ended, &["t", "u"], &[1.0, 0.0]);
        let sparse = read("t;u\n0;1\n1;\n2;\n3;0\n");
        expect(&sparse, &["t", "u"], &[3.0, 0.0]);
        assert_eq!(sparse.variables[1].blanks, [1, 2]);
        let plain = read("0,5 100,2\n1,5 100,3\n");
        expect(&plain, &["column 1", "column 2"], &[1.5, 100.3]);
    }

    #[test]
    fn the_half_of_the_day_may_stand_in_a_column_of_its_own() {
        let noon = read("time,,u\n12:59:59,PM,0\n01:00:01,pm,1\n");
        expect(&noon, &["time", "u"], &[2.0, 1.0]);
        assert!(noon.unread.is_empty() && noon.skipped.is_empty());
        let other = read("time,state,u\n12:59:59,PM,0\n13:00:01,idle,1\n");
        expect(&other, &["time", "u"], &[2.0, 1.0]);
        assert_eq!(other.unread[0].name, "state");
    }

    #[test]
    fn a_line_that_was_cut_off_and_comments_are_remarked() {
        let cut = read("t,u\n0,1\n# a break\n1,0\n2");
        assert_eq!(cut.lines, [2, 4]);
        assert_eq!(
            cut.remarks,
            ["line 3 is not a row and is left out: `# a break` (1 more)"]
        );
        let unclear = read("t;u\n0;1,021\n1;1,022\n");
        assert_eq!(unclear.variables[1].values, [1.021, 1.022]);
        assert!(unclear.remarks[0].contains("decimal commas"));
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
            let source = variables(bytes, &mut Budget::with(0)).expect("a table");
            expect(&source, &["t", "T"], &[1.0, 21.0]);
            assert_eq!(source.variables[0].unit.as_deref(), Some("µs"));
        }
    }

    #[test]
    fn faults_name_line_and_column() {
        let message = |text: &str| {
            let fault = variables(text.as_bytes(), &mut Budget::with(0)).expect_err("a fault");
            fault.to_string()
        };
        for (text, parts) in [
            ("t;u\n0;1\n1;1\n2\n", ["line 4", "2 names"]),
            ("0;1\n1;HEAT\n", ["line 2", "`HEAT` is not a number, date"]),
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
