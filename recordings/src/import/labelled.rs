//! Lines of a serial monitor: `t=0.1 u=1 y=21.3`, `sec: 0.29  out: 64  pv: 25.3`, `{"t": 0.1, "u": 1}`, and the clock that
//! the monitor writes before each line, `23:55:01.250 -> …`.

use super::cell::{Cell, Decimals};
use super::stamp::Stamp;

/// Number of lines from which the labels are taken.
const HEAD: usize = 400;

/// The labels of a row's values, in order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Labels(pub(super) Vec<String>);

impl Labels {
    /// The labels of a text; `None` unless most of its lines contain at least two labelled values.
    pub(super) fn of(lines: &[&str]) -> Option<Self> {
        let mut most: Vec<(&str, &str)> = Vec::new();
        let (mut labelled, mut all) = (0, 0);
        let filled = lines.iter().filter(|line| !line.trim().is_empty());
        for line in filled.take(HEAD) {
            all += 1;
            let pairs = pairs(line);
            let values = pairs
                .iter()
                .filter(|(_, text)| is_value(value(text)))
                .count();
            let is_row = values >= 2 && 2 * values > pairs.len() && are_distinct(&pairs);
            labelled += usize::from(is_row);
            if is_row && pairs.len() > most.len() {
                most = pairs;
            }
        }
        let names = || most.iter().map(|(name, _)| (*name).to_owned()).collect();
        (labelled >= 2 && 2 * labelled > all).then(|| Self(names()))
    }

    /// Writes the values of a line into `cells`, one per label, empty if missing. Returns false if the line
    /// is not a row.
    pub(super) fn split<'a>(&self, line: &'a str, cells: &mut Vec<&'a str>) -> bool {
        cells.clear();
        cells.resize(self.0.len(), "");
        let pairs = pairs(line);
        if pairs.len() < 2 || !are_distinct(&pairs) {
            return false;
        }
        for (name, text) in pairs {
            let at = self.0.iter().position(|known| known == name);
            let Some(cell) = at.and_then(|at| cells.get_mut(at)) else {
                return false;
            };
            *cell = value(text);
        }
        true
    }
}

fn are_distinct(pairs: &[(&str, &str)]) -> bool {
    let is_new = |(i, (name, _)): (usize, &(&str, &str))| {
        pairs.iter().take(i).all(|(before, _)| before != name)
    };
    pairs.iter().enumerate().all(is_new)
}

/// A value without the text after it.
fn value(text: &str) -> &str {
    let first = text.split_whitespace().next().unwrap_or_default();
    match !is_value(text) && is_value(first) {
        true => first,
        false => text,
    }
}

fn is_value(text: &str) -> bool {
    Cell::of(text, Decimals::Each).is_value()
}

/// Labels of a line with the text up to the next one.
fn pairs(line: &str) -> Vec<(&str, &str)> {
    let mut starts: Vec<(usize, usize, usize)> = Vec::new();
    for (at, mark) in line.char_indices() {
        if !matches!(mark, '=' | ':') {
            continue;
        }
        let before = line.get(..at).unwrap_or_default().trim_end();
        let before = before.strip_suffix('"').unwrap_or(before);
        let is_name = |c: char| c.is_alphanumeric() || "_.[]()/%°".contains(c);
        let from = before
            .char_indices()
            .rev()
            .take_while(|&(_, c)| is_name(c))
            .last()
            .map(|(from, _)| from);
        let Some(from) = from else { continue };
        let name = before.get(from..).unwrap_or_default();
        let parted = before
            .get(..from)
            .and_then(|b| b.chars().next_back())
            .is_none_or(|c| c.is_whitespace() || ",;|{\"".contains(c));
        let is_label = name.starts_with(|c: char| c.is_alphabetic() || c == '_');
        if parted && is_label && starts.last().is_none_or(|&(_, _, end)| end <= from) {
            starts.push((from, before.len(), at + mark.len_utf8()));
        }
    }
    let ends = starts.iter().skip(1).map(|&(from, ..)| from);
    let ends: Vec<usize> = ends.chain([line.len()]).collect();
    let each = starts
        .iter()
        .zip(ends)
        .filter_map(|(&(from, to, value), end)| {
            let marks = |c: char| c.is_whitespace() || ",;|{}\"".contains(c);
            Some((
                line.get(from..to)?,
                line.get(value..end)?.trim_matches(marks),
            ))
        });
    each.collect()
}

/// The clock times before the arrows of a serial monitor, and the text after them; `None` if most lines have no
/// arrow.
pub(super) fn arrows<'a>(lines: &[&'a str]) -> Option<Vec<(&'a str, &'a str)>> {
    let split = |line: &&'a str| -> Option<(&'a str, &'a str)> {
        let (stamp, rest) = line.split_once("->")?;
        Stamp::of(stamp.trim())?;
        Some((stamp.trim(), rest))
    };
    before_lines(lines, split)
}

/// The dates or clock times at the beginnings of the lines of a log, and the text after them; `None` if most lines
/// begin otherwise.
pub(super) fn leading<'a>(lines: &[&'a str]) -> Option<Vec<(&'a str, &'a str)>> {
    let split = |line: &&'a str| -> Option<(&'a str, &'a str)> {
        let line = line.trim_start();
        let (first, rest) = line.split_once(char::is_whitespace)?;
        if !Stamp::is_date(first) {
            return Stamp::of(first).map(|_| (first, rest));
        }
        let clock = rest.trim_start().split(char::is_whitespace).next()?;
        let end = line.len() - rest.trim_start().len() + clock.len();
        let (both, rest) = line.split_at_checked(end)?;
        Stamp::of(both).map(|_| (both, rest))
    };
    before_lines(lines, split)
}

/// Splits each line in two; `None` unless this is possible for most lines.
fn before_lines<'a>(
    lines: &[&'a str],
    split: impl Fn(&&'a str) -> Option<(&'a str, &'a str)>,
) -> Option<Vec<(&'a str, &'a str)>> {
    let filled = || {
        lines
            .iter()
            .filter(|line| !line.trim().is_empty())
            .take(HEAD)
    };
    let stamped = filled().filter(|line| split(line).is_some()).count();
    if stamped < 2 || 2 * stamped <= filled().count() {
        return None;
    }
    let each = lines.iter().map(|line| split(line).unwrap_or(("", line)));
    Some(each.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn expect(lines: &[&str], names: &[&str], last: &[&str]) {
        let labels = Labels::of(lines).expect("labels");
        assert_eq!(labels.0, names);
        let mut cells = Vec::new();
        assert!(labels.split(lines.last().expect("a line"), &mut cells));
        assert_eq!(cells, last);
    }

    #[test]
    fn labelled_lines_are_split_at_their_labels() {
        expect(
            &["t=0.1 u=1 y=21.3", "t=0.2 u=1 y=21.4"],
            &["t", "u", "y"],
            &["0.2", "1", "21.4"],
        );
        expect(
            &[
                "tuner configured - starting",
                " sec: 0.0000  out: 0.00  pv: 25.317  tan: 0.010 ↗",
                " sec: 0.2899  out: 64.00  pv: 25.341  tan: 0.010 ↗",
            ],
            &["sec", "out", "pv", "tan"],
            &["0.2899", "64.00", "25.341", "0.010"],
        );
        expect(
            &[
                "Time: 23:55:01, Heater: ON, Temp = 21.3 °C",
                "Time: 23:55:02, Heater: OFF, Temp = 21.4 °C",
            ],
            &["Time", "Heater", "Temp"],
            &["23:55:02", "OFF", "21.4 °C"],
        );
        expect(
            &[
                "{\"t\": 0.1, \"u\": true, \"y\": 2}",
                "{\"t\": 0.2, \"u\": false, \"y\": 3}",
            ],
            &["t", "u", "y"],
            &["0.2", "false", "3"],
        );
        // Values written only on change are empty elsewhere.
        expect(
            &["t:0.1,u:1,y:21.3", "t:0.2,y:21.4", "t:0.3,y:21.4"],
            &["t", "u", "y"],
            &["0.3", "", "21.4"],
        );
        expect(
            &["at=2024-09-17T23:55:01 u=1", "at=2024-09-17T23:55:02 u=0"],
            &["at", "u"],
            &["2024-09-17T23:55:02", "0"],
        );
    }

    #[test]
    fn tables_and_prose_have_no_labels() {
        for lines in [
            &["t,u,y", "23:55:01,0,21.04", "23:55:02,0,21.04"][..],
            &["2024-09-17T23:55:01 0 21", "2024-09-17T23:55:02 0 21"],
            &["# rate: 10 Hz, gain: 5", "0,1", "1,2", "2,3"],
            &["note: see above", "note: nothing"],
            &[],
        ] {
            assert_eq!(Labels::of(lines), None, "{lines:?}");
        }
        let labels = Labels(vec!["t".into(), "u".into()]);
        for line in ["", "WARN: heater=1", "t=1", "t=1 t=2", "1,2"] {
            assert!(!labels.split(line, &mut Vec::new()), "{line}");
        }
    }

    #[test]
    fn arrows_part_the_monitors_clock_from_the_line() {
        let lines = [
            "23:55:01.250 -> t,u",
            "23:55:01.350 -> 0,1",
            "",
            "23:55:01.450 -> 1,1",
        ];
        let parted = arrows(&lines).expect("arrows");
        assert_eq!(parted[1], ("23:55:01.350", " 0,1"));
        assert_eq!(parted[2], ("", ""));
        assert_eq!(arrows(&["a -> b", "c -> d"]), None);
        let log = [
            "2024-09-17 23:58:31,120 INFO u=1",
            "2024-09-17 23:58:32,120 INFO u=0",
        ];
        assert_eq!(
            leading(&log).expect("stamps")[1],
            ("2024-09-17 23:58:32,120", " INFO u=0")
        );
        let log = ["[23:58:31] u=1 y=2", "[23:58:32] u=0 y=2"];
        assert_eq!(leading(&log).expect("stamps")[1], ("[23:58:32]", "u=0 y=2"));
        assert_eq!(leading(&["t=1 u=1", "t=2 u=1"]), None);
    }
}
