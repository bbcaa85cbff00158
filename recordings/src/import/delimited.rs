//! Splitting of text lines into cells: separator, first row, and column names.

use std::borrow::Cow;

use super::cell::{Cell, Decimals, is_unit, name_and_unit};
use super::stamp::Stamp;

/// Number of lines in which the first row is searched.
const HEAD: usize = 400;

/// Separator of the cells of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Separator {
    Tab,
    Semicolon,
    Comma,
    Blanks,
}

impl Separator {
    const ALL: [Self; 4] = [Self::Tab, Self::Semicolon, Self::Comma, Self::Blanks];

    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Tab => "tabs",
            Self::Semicolon => "semicolons",
            Self::Comma => "commas",
            Self::Blanks => "blanks",
        }
    }

    /// The cells of a line, trimmed and without quotes. Separators within quotes are ignored.
    pub(super) fn split<'a>(self, line: &'a str, cells: &mut Vec<&'a str>) {
        cells.clear();
        let mut is_quoted = false;
        let quotes = line.contains('"');
        let mut parts = |is_separator: &dyn Fn(char) -> bool| {
            if quotes {
                cells.extend(line.split(|c: char| {
                    is_quoted ^= c == '"';
                    !is_quoted && is_separator(c)
                }));
            } else {
                cells.extend(line.split(is_separator));
            }
        };
        match self {
            Self::Tab => parts(&|c| c == '\t'),
            Self::Semicolon => parts(&|c| c == ';'),
            Self::Comma => parts(&|c| c == ','),
            Self::Blanks => {
                parts(&char::is_whitespace);
                cells.retain(|cell| !cell.is_empty());
                merge(line, cells);
            }
        }
        for cell in cells {
            *cell = bare(cell);
        }
    }

    /// The cells of a header, in which a quote may stand within quotes.
    fn split_header(self, line: &str) -> Vec<String> {
        let delimiter = match self {
            Self::Comma => b',',
            Self::Semicolon => b';',
            Self::Tab => b'\t',
            Self::Blanks => {
                return line
                    .split_whitespace()
                    .map(|cell| bare(cell).to_owned())
                    .collect();
            }
        };
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .delimiter(delimiter)
            .flexible(true)
            .from_reader(line.as_bytes());
        let mut record = csv::StringRecord::new();
        match reader.read_record(&mut record) {
            Ok(true) => record.iter().map(|c| bare(c).to_owned()).collect(),
            _ => Vec::new(),
        }
    }
}

fn bare(cell: &str) -> &str {
    let cell = cell.trim();
    let inner = cell.strip_prefix('"').and_then(|c| c.strip_suffix('"'));
    inner.map_or(cell, str::trim)
}

/// Joins cells that blanks have split: a date and its clock time, a clock time and AM or PM, a number and its unit.
fn merge<'a>(line: &'a str, cells: &mut Vec<&'a str>) {
    // Cells up to `kept` are finished.
    let mut kept = 0;
    for at in 1..cells.len() {
        let (before, cell) = (cells[kept], cells[at]);
        let belongs = match before.contains([':', '-', '/', '.']) {
            true if cell.contains(':') => Stamp::is_date(before) && Stamp::is_clock(cell),
            true if Stamp::is_half_of_day(cell) => Stamp::of(before).is_some(),
            _ => false,
        };
        let is_number =
            |text| matches!(Cell::of(text, Decimals::Each), Cell::Number(n) if n.unit.is_none());
        let start = before.as_ptr() as usize - line.as_ptr() as usize;
        let end = cell.as_ptr() as usize - line.as_ptr() as usize + cell.len();
        match line.get(start..end) {
            Some(whole) if belongs || (is_unit(cell) && is_number(before)) => cells[kept] = whole,
            _ => {
                kept += 1;
                cells[kept] = cell;
            }
        }
    }
    cells.truncate(kept + 1);
}

/// Layout of the rows of a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rows {
    pub(super) separator: Separator,
    /// Index of the first row's line.
    pub(super) first: usize,
    /// Cells of a row.
    pub(super) width: usize,
}

/// How much a line resembles a table row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Likeness {
    None,
    /// Some cells hold text.
    Partial,
    /// Every cell holds a value or nothing.
    Whole,
}

impl Rows {
    /// The first row is the first line that is followed by a similar one. Lines of values only are preferred
    /// to lines with text.
    pub(super) fn find(lines: &[&str]) -> Option<Self> {
        let found = Self::first_of(lines, Likeness::Whole);
        let mut rows = found.or_else(|| Self::first_of(lines, Likeness::Partial))?;
        // Rows with text may be above the first row without text.
        let mut cells = Vec::new();
        for at in (0..rows.first).rev() {
            let line = lines.get(at).copied().unwrap_or_default();
            if line.trim().is_empty() {
                continue;
            }
            rows.separator.split(line, &mut cells);
            if cells.len() != rows.width || likeness(rows.separator, &cells) == Likeness::None {
                break;
            }
            rows.first = at;
        }
        Some(rows)
    }

    fn first_of(lines: &[&str], least: Likeness) -> Option<Self> {
        let mut found: Option<Self> = None;
        let mut cells = Vec::new();
        for separator in Separator::ALL {
            let mut before: Option<(usize, usize)> = None;
            for (at, line) in lines.iter().enumerate().take(HEAD) {
                // The earliest table is used; of two separators that fit equally, the first in the list, so that
                // `1,5;2,5` is two numbers.
                if found.is_some_and(|rows| at > rows.first) && before.is_none() {
                    break;
                }
                if line.trim().is_empty() || is_comment(line) {
                    continue;
                }
                separator.split(line, &mut cells);
                let fits = likeness(separator, &cells) >= least;
                match before {
                    Some((first, width)) if fits && width == cells.len() => {
                        if found.is_none_or(|rows| first < rows.first) {
                            found = Some(Self {
                                separator,
                                first,
                                width,
                            });
                        }
                        break;
                    }
                    _ => before = fits.then_some((at, cells.len())),
                }
            }
        }
        found
    }

    /// The line that resembles a row most, although no row follows: its index and its first cell that is not a
    /// value.
    pub(super) fn nearest<'a>(lines: &[&'a str]) -> Option<(usize, Cow<'a, str>)> {
        let mut best: Option<(usize, usize, &str)> = None;
        let mut cells = Vec::new();
        for separator in Separator::ALL {
            for (at, line) in lines.iter().enumerate().take(HEAD) {
                separator.split(line, &mut cells);
                let is_value = |cell: &&&str| Cell::of(cell, Decimals::Each).is_value();
                let values = cells.iter().filter(is_value).count();
                let text = cells
                    .iter()
                    .find(|cell| !is_value(cell) && !cell.is_empty());
                if values > best.map_or(0, |(most, ..)| most)
                    && cells.len() >= 2
                    && let Some(text) = text
                {
                    best = Some((values, at, text));
                }
            }
        }
        best.map(|(_, at, text)| (at, Cow::Borrowed(text)))
    }

    /// Names and units from the lines above the rows.
    pub(super) fn header(self, lines: &[&str]) -> (Vec<String>, Vec<Option<String>>) {
        let width = self.width;
        let marks = |c: char| matches!(c, '#' | '%') || c.is_whitespace();
        let joined = self.joined_stamp(lines);
        let cells = |line: &&str| -> Option<Vec<String>> {
            let line = match self.separator {
                Separator::Tab => line.trim_start_matches(['#', '%']),
                _ => line.trim_start_matches(marks),
            };
            let mut cells = self.separator.split_header(line);
            // LabVIEW names a column of comments that no row has.
            let no_column = |name: &String| name.is_empty() || name == "Comment";
            while cells.len() > width && cells.last().is_some_and(no_column) {
                cells.pop();
            }
            if let Some(at) = joined
                && cells.len() == width + 1
            {
                let second = cells.remove(at + 1);
                if let Some(first) = cells.get_mut(at) {
                    *first = format!("{first} {second}");
                }
            }
            // Some programs write row numbers without a column name.
            if cells.len() + 1 == width && cells.iter().all(|c| is_name(c)) {
                cells.insert(0, String::new());
            }
            (cells.len() == width).then_some(cells)
        };
        let mut candidates = lines
            .iter()
            .take(self.first)
            .rev()
            .filter(|l| !l.trim().is_empty())
            .take(2)
            .map(cells);
        let (last, before) = (candidates.next().flatten(), candidates.next().flatten());
        let numbered = || (1..=width).map(|i| format!("column {i}")).collect();
        // A line of units stands between the names and the rows.
        if let (Some(units), Some(names)) = (&last, &before)
            && units.iter().all(|u| u.is_empty() || is_header_unit(u))
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

    /// The column whose date and clock time are separated by a blank.
    fn joined_stamp(self, lines: &[&str]) -> Option<usize> {
        let mut cells = Vec::new();
        self.separator.split(lines.get(self.first)?, &mut cells);
        let is_joined = |cell: &&str| cell.contains(' ') && Stamp::of(cell).is_some();
        match self.separator {
            Separator::Blanks => cells.iter().position(is_joined),
            _ => None,
        }
    }
}

/// Whether a line is a comment.
pub(super) fn is_comment(line: &str) -> bool {
    line.trim_start().starts_with(['#', '%'])
}

/// Whether a cell of a header can be a name.
fn is_name(cell: &str) -> bool {
    cell.contains(|c: char| c.is_alphabetic())
        && !matches!(
            Cell::of(cell, Decimals::Each),
            Cell::Number(_) | Cell::Stamp(_)
        )
}

fn likeness(separator: Separator, cells: &[&str]) -> Likeness {
    let (mut values, mut measured, mut texts) = (0, 0, 0);
    for text in cells {
        match Cell::of(text, Decimals::Each) {
            // `0,5 100,2` are two numbers separated by a blank.
            Cell::Number(n)
                if n.is_grouped && separator == Separator::Comma && text.contains(' ') =>
            {
                texts += 1;
            }
            Cell::Number(_) | Cell::Stamp(_) => {
                values += 1;
                measured += 1;
            }
            Cell::Switch(_) | Cell::Missing => values += 1,
            Cell::Empty => {}
            Cell::Text => texts += 1,
        }
    }
    // A row of two columns may have one value, if the other is written on change only.
    let fewest = if cells.len() == 2 && texts == 0 { 1 } else { 2 };
    if cells.len() < 2 || values < fewest || measured == 0 || texts > values {
        Likeness::None
    } else if texts > 0 {
        Likeness::Partial
    } else {
        Likeness::Whole
    }
}

fn is_header_unit(text: &str) -> bool {
    let bracketed = |open, close| text.starts_with(open) && text.ends_with(close);
    // Oscilloscopes write out the units.
    const WORDS: [&str; 13] = [
        "second", "seconds", "sec", "volt", "volts", "ampere", "amperes", "amps", "pascal",
        "celsius", "kelvin", "hertz", "percent",
    ];
    let is_word = WORDS.iter().any(|word| text.eq_ignore_ascii_case(word));
    bracketed('[', ']') || bracketed('(', ')') || text == "-" || is_word || is_unit(text)
}
