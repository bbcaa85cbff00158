//! Contents of a table cell: a number in any notation, on or off, a date or time, or nothing.

use super::stamp::Stamp;
use crate::printed::printed_unit;

/// The contents of one cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Cell<'a> {
    Empty,
    /// A mark for a missing value: `NaN`, `null`, `n/a`.
    Missing,
    Number(Number<'a>),
    /// On (true) or off.
    Switch(bool),
    Stamp(Stamp),
    /// None of these.
    Text,
}

/// A number as printed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Number<'a> {
    pub(super) value: f64,
    /// Resolution of the number: one unit in its last printed place.
    pub(super) unit_in_last_place: f64,
    /// The unit after the number.
    pub(super) unit: Option<&'a str>,
    /// Whether the number has thousands separators.
    pub(super) is_grouped: bool,
}

/// The decimal separator; the other mark separates thousands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Decimals {
    Point,
    Comma,
    /// Undecided, or not the same in all cells: a mark that occurs only once in a number is its
    /// decimal separator.
    Each,
}

/// Evidence for the decimal separator of a file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Marks {
    points: usize,
    commas: usize,
    /// Ambiguous `1,021`: thousands or decimals.
    unclear_commas: usize,
    unclear_points: usize,
}

impl Decimals {
    /// The decimal separator in words, for a file with these cells.
    pub(super) fn words(self, marks: Marks) -> &'static str {
        match self {
            Self::Comma => "commas",
            Self::Each if marks.commas + marks.unclear_commas > 0 => "commas",
            Self::Point | Self::Each => "points",
        }
    }
}

impl Marks {
    /// Takes a cell into account.
    pub(super) fn see(&mut self, cell: &str) {
        if !cell.contains([',', '.']) || Stamp::of(cell).is_some() {
            return;
        }
        let Some((mantissa, rest)) = mantissa(cell) else {
            return;
        };
        if !(rest.is_empty() || is_unit(rest.trim()) || rest.starts_with(['e', 'E'])) {
            return;
        }
        let (points, commas) = (mantissa.matches('.').count(), mantissa.matches(',').count());
        match (points, commas) {
            (0, 0) => {}
            (1, 0) if is_grouped(mantissa, '.') => self.unclear_points += 1,
            (0, 1) if is_grouped(mantissa, ',') => self.unclear_commas += 1,
            (1, 0) => self.points += 1,
            (0, 1) => self.commas += 1,
            (0, _) => self.points += 1,
            (_, 0) => self.commas += 1,
            _ if mantissa.rfind('.') > mantissa.rfind(',') => self.points += 1,
            _ => self.commas += 1,
        }
    }

    /// The decimal separator of the file. Ambiguous numbers like `1,021` are decided by the column separator:
    /// comma-separated columns have decimal points.
    pub(super) fn decimals(self, parted_by_commas: bool) -> Decimals {
        match (self.points > 0, self.commas > 0) {
            (true, false) => Decimals::Point,
            (false, true) => Decimals::Comma,
            (true, true) => Decimals::Each,
            (false, false) if parted_by_commas => Decimals::Point,
            (false, false) => Decimals::Each,
        }
    }

    /// Whether every number with a comma is ambiguous.
    pub(super) fn is_unclear(self) -> bool {
        self.unclear_commas > 0 && self.points == 0 && self.commas == 0
    }
}

impl<'a> Cell<'a> {
    /// The kind of `text`, which is trimmed and without quotes.
    pub(super) fn of(text: &'a str, decimals: Decimals) -> Self {
        if text.is_empty() {
            return Self::Empty;
        }
        if let Some(number) = plain(text, decimals) {
            return Self::Number(number);
        }
        if let Some(stamp) = Stamp::of(text) {
            return Self::Stamp(stamp);
        }
        if let Some(number) = number(text, decimals) {
            return Self::Number(number);
        }
        if let Some(on) = switch(text) {
            return Self::Switch(on);
        }
        const MISSING: [&str; 8] = ["nan", "na", "n/a", "#n/a", "null", "none", "-", "--"];
        match MISSING.iter().any(|m| text.eq_ignore_ascii_case(m)) {
            true => Self::Missing,
            false => Self::Text,
        }
    }

    /// Whether the cell is a valid value of a table.
    pub(super) fn is_value(&self) -> bool {
        !matches!(self, Self::Empty | Self::Text)
    }
}

/// A number as most programs print it.
fn plain<'a>(text: &str, decimals: Decimals) -> Option<Number<'a>> {
    // `parse` would accept `inf` and `nan`, which may be header names.
    let is_plain = |b: u8| b.is_ascii_digit() || matches!(b, b'.' | b'-' | b'+' | b'e' | b'E');
    let starts = text.bytes().any(|b| b.is_ascii_digit());
    if !starts || !text.bytes().all(is_plain) {
        return None;
    }
    if decimals == Decimals::Comma && text.contains('.') {
        return None;
    }
    Some(Number {
        value: text.parse().ok()?,
        unit_in_last_place: printed_unit(text.as_bytes()),
        unit: None,
        is_grouped: false,
    })
}

/// A number with a decimal comma, thousands marks or a unit.
fn number(text: &str, decimals: Decimals) -> Option<Number<'_>> {
    let (mantissa, rest) = mantissa(text)?;
    let (digits, is_grouped) = ungrouped(mantissa, decimals)?;
    let (exponent, rest) = exponent(rest);
    let unit = rest.trim();
    if !(unit.is_empty() || is_unit(unit)) {
        return None;
    }
    let sign = if text.starts_with(['-', '−']) {
        "-"
    } else {
        ""
    };
    let printed = format!("{sign}{digits}{exponent}");
    Some(Number {
        value: printed.parse().ok()?,
        unit_in_last_place: printed_unit(printed.as_bytes()),
        unit: (!unit.is_empty()).then_some(unit),
        is_grouped,
    })
}

/// Thousands marks other than points and commas.
const GROUPS: [char; 5] = ['\'', '’', ' ', '\u{a0}', '\u{202f}'];

/// Splits a cell without its sign into its leading digits, with their marks, and the remaining
/// text.
fn mantissa(text: &str) -> Option<(&str, &str)> {
    let text = text.strip_prefix(['-', '+', '−']).unwrap_or(text);
    let mut end = 0;
    let mut characters = text.char_indices().peekable();
    while let Some((at, c)) = characters.next() {
        let before_digit = characters
            .peek()
            .is_some_and(|(_, next)| next.is_ascii_digit());
        let belongs = c.is_ascii_digit()
            || (matches!(c, '.' | ',') && (before_digit || end > 0))
            || (GROUPS.contains(&c) && before_digit && end > 0);
        if !belongs {
            break;
        }
        end = at + c.len_utf8();
    }
    let (mantissa, rest) = text.split_at_checked(end)?;
    mantissa
        .bytes()
        .any(|b| b.is_ascii_digit())
        .then_some((mantissa, rest))
}

/// Whether `mark` separates groups of three digits, after a first group of one to three digits that
/// does not begin with 0.
fn is_grouped(digits: &str, mark: char) -> bool {
    let mut groups = digits.split(mark);
    let first = groups.next().unwrap_or_default();
    let is_number = |g: &str| g.bytes().all(|b| b.is_ascii_digit());
    let fits = (1..=3).contains(&first.len()) && is_number(first) && !first.starts_with('0');
    fits && groups.all(|g| g.len() == 3 && is_number(g))
}

/// The digits with a decimal point and no other mark, and whether there was one.
fn ungrouped(mantissa: &str, decimals: Decimals) -> Option<(String, bool)> {
    let (points, commas) = (mantissa.matches('.').count(), mantissa.matches(',').count());
    let decimal = match decimals {
        Decimals::Point => '.',
        Decimals::Comma => ',',
        Decimals::Each => match (points, commas) {
            (1, 0) => '.',
            (0, 1) => ',',
            // Repeated marks separate thousands.
            (_, 0) => ',',
            (0, _) => '.',
            _ if mantissa.rfind('.') > mantissa.rfind(',') => '.',
            _ => ',',
        },
    };
    let (whole, fraction) = mantissa.split_once(decimal).unwrap_or((mantissa, ""));
    let marks: Vec<char> = whole.chars().filter(|c| !c.is_ascii_digit()).collect();
    if fraction.contains(|c: char| !c.is_ascii_digit()) {
        return None;
    }
    let Some(&mark) = marks.first() else {
        let digits = match mantissa.contains(decimal) {
            true => format!("{whole}.{fraction}"),
            false => whole.to_owned(),
        };
        return Some((digits, false));
    };
    if !is_grouped(whole, mark) {
        return None;
    }
    let whole: String = whole.chars().filter(char::is_ascii_digit).collect();
    let digits = match mantissa.contains(decimal) {
        true => format!("{whole}.{fraction}"),
        false => whole,
    };
    Some((digits, true))
}

/// Splits the text after a mantissa into the exponent (`e-3`) and the remaining text.
fn exponent(rest: &str) -> (&str, &str) {
    let is_one = |text: &str| -> Option<usize> {
        let digits = text.strip_prefix(['e', 'E'])?;
        let unsigned = digits.strip_prefix(['+', '-']).unwrap_or(digits);
        let count = unsigned.bytes().take_while(u8::is_ascii_digit).count();
        (count > 0).then_some(text.len() - unsigned.len() + count)
    };
    match is_one(rest).and_then(|end| rest.split_at_checked(end)) {
        Some(parts) => parts,
        None => ("", rest),
    }
}

/// Units that may follow a number.
pub(super) fn is_unit(text: &str) -> bool {
    const KNOWN: [&str; 43] = [
        "%", "s", "ms", "us", "µs", "μs", "ns", "min", "h", "V", "mV", "A", "mA", "W", "kW", "Pa",
        "kPa", "hPa", "bar", "mbar", "psi", "m/s", "K", "°C", "C", "ºC", "°F", "F", "N", "mN",
        "Nm", "m", "mm", "cm", "Hz", "rpm", "RPM", "l/min", "L/min", "lx", "lux", "ppm", "degC",
    ];
    KNOWN.contains(&text)
}

/// Words for on and off.
pub(super) fn switch(text: &str) -> Option<bool> {
    const WORDS: [(&str, bool); 20] = [
        ("on", true),
        ("off", false),
        ("true", true),
        ("false", false),
        ("yes", true),
        ("no", false),
        ("open", true),
        ("opened", true),
        ("closed", false),
        ("close", false),
        ("high", true),
        ("low", false),
        ("enabled", true),
        ("disabled", false),
        ("ein", true),
        ("aus", false),
        ("auf", true),
        ("zu", false),
        ("ja", true),
        ("nein", false),
    ];
    let known = WORDS
        .iter()
        .find(|(word, _)| text.eq_ignore_ascii_case(word));
    known.map(|&(_, on)| on)
}

/// Splits `u_inf [m/s]`, `u_inf (m/s)`, `u_inf in m/s` and `u_inf / m/s` into name and unit.
pub(super) fn name_and_unit(text: &str) -> (&str, Option<String>) {
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

    #[track_caller]
    fn value(text: &str, decimals: Decimals) -> (f64, f64) {
        match Cell::of(text, decimals) {
            Cell::Number(n) => (n.value, n.unit_in_last_place),
            other => panic!("`{text}`: {other:?}"),
        }
    }

    #[test]
    fn numbers_of_every_country_are_read() {
        use Decimals::{Comma, Each, Point};
        for (text, decimals, expected) in [
            ("21.04", Point, 21.04),
            ("+21.04", Point, 21.04),
            ("-.5e-3", Point, -0.5e-3),
            ("1,021.04", Point, 1021.04),
            ("1,021", Point, 1021.0),
            ("1,234,567.5", Each, 1_234_567.5),
            ("1,234,567", Each, 1_234_567.0),
            ("1'021.04", Point, 1021.04),
            ("21,04", Comma, 21.04),
            ("21,04", Each, 21.04),
            ("1,021", Each, 1.021),
            ("1.021", Comma, 1021.0),
            ("1.021,04", Comma, 1021.04),
            ("-1.021,04", Each, -1021.04),
            ("1 021,04", Comma, 1021.04),
            ("1\u{a0}021,5e1", Comma, 10_215.0),
            ("−3,5", Each, -3.5),
            ("2,5e-3", Comma, 2.5e-3),
            ("5.", Point, 5.0),
        ] {
            let (found, _) = value(text, decimals);
            assert!((found / expected - 1.0).abs() < 1e-15, "{text}: {found}");
        }
        assert_eq!(value("1,021.040", Decimals::Point).1, 1e-3);
        assert_eq!(value("1.021", Decimals::Comma).1, 1.0);
    }

    #[test]
    fn units_words_and_gaps_are_told_apart() {
        let unit = |text| match Cell::of(text, Decimals::Point) {
            Cell::Number(n) => n.unit.map(str::to_owned),
            other => panic!("`{text}`: {other:?}"),
        };
        assert_eq!(unit("45 %").as_deref(), Some("%"));
        assert_eq!(unit("45%").as_deref(), Some("%"));
        assert_eq!(unit("21.3 °C").as_deref(), Some("°C"));
        assert_eq!(unit("21.3"), None);
        for (text, expected) in [
            ("", Cell::Empty),
            ("NaN", Cell::Missing),
            ("--", Cell::Missing),
            ("ON", Cell::Switch(true)),
            ("off", Cell::Switch(false)),
            ("True", Cell::Switch(true)),
            ("closed", Cell::Switch(false)),
        ] {
            assert_eq!(Cell::of(text, Decimals::Point), expected, "{text}");
        }
        for text in [
            "t", "inf", "HEAT", "12abc", "1,02,3.4", "1,2.3,4", "3 4", "5 x", "e5", "↗", "1.5.2",
            ",", "-", "- 5", "1,0211.5",
        ] {
            let found = Cell::of(text, Decimals::Point);
            assert!(
                matches!(found, Cell::Text | Cell::Missing),
                "{text}: {found:?}"
            );
        }
        assert!(matches!(
            Cell::of("23:55:01", Decimals::Point),
            Cell::Stamp(_)
        ));
    }

    #[test]
    fn the_decimal_mark_is_that_of_the_file() {
        let decimals = |cells: &[&str], commas: bool| {
            let mut marks = Marks::default();
            cells.iter().for_each(|cell| marks.see(cell));
            (marks.decimals(commas), marks.is_unclear())
        };
        assert_eq!(decimals(&["1,021", "0.5"], true), (Decimals::Point, false));
        assert_eq!(
            decimals(&["1,021", "998,5"], false),
            (Decimals::Comma, false)
        );
        assert_eq!(decimals(&["1,021", "998"], true), (Decimals::Point, true));
        assert_eq!(decimals(&["1,021", "998"], false), (Decimals::Each, true));
        assert_eq!(decimals(&["0.001", "1,5"], false), (Decimals::Each, false));
        assert_eq!(
            decimals(&["17.09.2024", "1,5"], false),
            (Decimals::Comma, false)
        );
        assert_eq!(decimals(&["1.021,5"], false), (Decimals::Comma, false));
        assert_eq!(decimals(&["45,5 %"], false), (Decimals::Comma, false));
        assert_eq!(decimals(&[], false), (Decimals::Each, false));
    }
}
