//! Dates and clock times as loggers print them, and the seconds between them.
//!
//! Supported are ISO 8601 (`2024-09-17T23:55:01.250Z`, with a blank for the `T`, with an offset), dates of day,
//! month and year in either order or with the month's name, clock times with or without seconds, AM and PM, and
//! durations (`0 days 00:00:01.5`). Days are counted in the proleptic Gregorian calendar, without leap seconds.

/// Seconds of a day.
const DAY: f64 = 86_400.0;

/// The date in a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Date {
    /// Days since 1970-01-01.
    Days(i64),
    /// Two numbers that can be day and month in either order, and the year.
    Either(u8, u8, i32),
}

/// A date, a clock time, or both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stamp {
    date: Option<Date>,
    /// Seconds since midnight, or of a duration; in universal time where an offset is stated.
    seconds: Option<f64>,
    /// One unit in the last printed place of the seconds.
    unit: f64,
}

/// The kind of a column's stamps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Days only.
    Date,
    /// Times of a day, or durations.
    Clock,
    /// Both.
    DateTime,
}

/// A column of stamps in seconds.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stamped {
    pub(super) kind: Kind,
    /// The first stamp as printed.
    pub(super) first: String,
    /// Seconds since the first stamp.
    pub(super) seconds: Vec<f64>,
    /// Seconds of the day as printed; 0 for a date without a time.
    pub(super) of_day: Vec<f64>,
    /// One unit in the last printed place of each, s.
    pub(super) unit: Vec<f64>,
    /// Number of midnights between clock times without a date.
    pub(super) midnights: usize,
}

impl Stamp {
    fn kind(&self) -> Kind {
        match (self.date, self.seconds) {
            (Some(_), None) => Kind::Date,
            (None, _) => Kind::Clock,
            (Some(_), Some(_)) => Kind::DateTime,
        }
    }

    /// The stamp in a cell; `None` if it contains something else.
    pub(super) fn of(cell: &str) -> Option<Self> {
        let cell = cell.trim().trim_matches(['[', ']']);
        let is_short = (5..=48).contains(&cell.len());
        if !is_short || !cell.is_ascii() || !cell.bytes().any(|b| b.is_ascii_digit()) {
            return None;
        }
        // Plain numbers, the usual contents, are excluded quickly.
        if !cell.contains([':', '-', '/']) && cell.matches('.').count() < 2 && !cell.contains(' ') {
            return None;
        }
        if let Some((days, rest)) = cell.split_once(" day") {
            let days: u32 = days.parse().ok()?;
            let rest = rest.trim_start_matches(['s', ',', ' ']);
            let (seconds, unit) = clock(rest)?;
            return Some(Self {
                date: None,
                seconds: Some(f64::from(days) * DAY + seconds),
                unit,
            });
        }
        let (date, time) = parted(without_weekday(cell));
        let date = match date {
            Some(text) => Some(date_of(text)?),
            None => None,
        };
        let (seconds, unit) = match time {
            Some(text) => {
                let (seconds, unit) = clock(text)?;
                (Some(seconds), unit)
            }
            None => (None, DAY),
        };
        (date.is_some() || seconds.is_some()).then_some(Self {
            date,
            seconds,
            unit,
        })
    }

    /// Whether a cell contains a date without a time of day, which may be in the next cell.
    pub(super) fn is_date(cell: &str) -> bool {
        Self::of(cell).is_some_and(|stamp| stamp.kind() == Kind::Date)
    }

    /// Whether a cell contains only AM or PM.
    pub(super) fn is_half_of_day(cell: &str) -> bool {
        let words = HALVES.iter().flat_map(|(words, _)| words);
        words
            .into_iter()
            .any(|word| cell.eq_ignore_ascii_case(word))
    }

    /// Whether a cell contains a time of day without a date.
    pub(super) fn is_clock(cell: &str) -> bool {
        Self::of(cell).is_some_and(|stamp| stamp.kind() == Kind::Clock)
    }
}

/// A cell without a leading weekday.
fn without_weekday(cell: &str) -> &str {
    const DAYS: [&str; 7] = ["mon", "tue", "wed", "thu", "fri", "sat", "sun"];
    match cell.split_once([' ', ',']) {
        Some((word, rest))
            if word.bytes().all(|b| b.is_ascii_alphabetic())
                && word
                    .get(..3)
                    .is_some_and(|d| DAYS.iter().any(|day| d.eq_ignore_ascii_case(day))) =>
        {
            rest.trim_start_matches([' ', ','])
        }
        _ => cell,
    }
}

/// A cell split into date and time of day.
fn parted(cell: &str) -> (Option<&str>, Option<&str>) {
    let Some(colon) = cell.find(':') else {
        return (Some(cell), None);
    };
    let before = cell.get(..colon).unwrap_or_default();
    // The hour is the text before the first colon, back to a blank or the T of ISO 8601.
    let hour = before.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    let date = before.get(..hour).unwrap_or_default();
    let date = date.trim_end_matches([' ', 'T', 't', ',', '_']);
    let time = cell.get(hour..).map(str::trim);
    match date.is_empty() {
        true => (None, time),
        false => (Some(date), time),
    }
}

fn date_of(text: &str) -> Option<Date> {
    let parts: Vec<&str> = text
        .split(['-', '/', '.', ' ', ','])
        .filter(|p| !p.is_empty())
        .collect();
    let &[a, b, c] = parts.as_slice() else {
        return None;
    };
    let number = |text: &str, longest: usize| -> Option<u32> {
        let is_one = text.len() <= longest && text.bytes().all(|b| b.is_ascii_digit());
        is_one.then(|| text.parse().ok()).flatten()
    };
    let year = |text: &str| -> Option<i32> {
        let value = number(text, 4)? as i32;
        match text.len() {
            4 => Some(value),
            2 => Some(2000 + value),
            _ => None,
        }
    };
    let days = |y: i32, m: u32, d: u32| days_from_civil(y, m, d).map(Date::Days);
    if let Some(m) = month(b) {
        return days(year(c)?, m, number(a, 2)?);
    }
    if let Some(m) = month(a) {
        return days(year(c)?, m, number(b, 2)?);
    }
    if a.len() == 4 {
        return days(year(a)?, number(b, 2)?, number(c, 2)?);
    }
    let (first, second, year) = (number(a, 2)?, number(b, 2)?, year(c)?);
    // In a date with points the day is first.
    if text.contains('.') {
        return days(year, second, first);
    }
    let is_day = |n: u32| (1..=31).contains(&n);
    (is_day(first) && is_day(second)).then_some(Date::Either(first as u8, second as u8, year))
}

fn month(text: &str) -> Option<u32> {
    const NAMES: [&str; 12] = [
        "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec",
    ];
    let start = text.get(..3)?.to_ascii_lowercase();
    let is_word = text.bytes().all(|b| b.is_ascii_alphabetic());
    let at = NAMES.iter().position(|name| *name == start)?;
    is_word.then_some(at as u32 + 1)
}

/// Days since 1970-01-01; `None` if the calendar has no such day. Method: H. Hinnant, `chrono`-compatible low-level
/// date algorithms (2013), `days_from_civil`.
fn days_from_civil(year: i32, month: u32, day: u32) -> Option<i64> {
    let leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
    let longest = match month {
        4 | 6 | 9 | 11 => 30,
        2 if leap => 29,
        2 => 28,
        1..=12 => 31,
        _ => return None,
    };
    if !(1..=longest).contains(&day) {
        return None;
    }
    let year = i64::from(year) - i64::from(month <= 2);
    let era = year.div_euclid(400);
    let of_era = year.rem_euclid(400);
    let of_year = (153 * ((i64::from(month) + 9) % 12) + 2) / 5 + i64::from(day) - 1;
    Some(era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468)
}

/// Suffixes of the two halves of a day, with their hours.
const HALVES: [([&str; 2], u8); 2] = [(["AM", "a.m."], 0), (["PM", "p.m."], 12)];

/// Seconds since midnight of `23:55:01.250`, `11:55 PM`, `23:55:01+02:00`, and one unit in their last printed place.
fn clock(text: &str) -> Option<(f64, f64)> {
    let (text, offset) = without_offset(text.trim());
    let half = HALVES.iter().find_map(|(words, hours)| {
        let ends = |word: &&&str| {
            let from = text.len().checked_sub(word.len());
            let end = from.and_then(|from| text.get(from..));
            end.is_some_and(|end| end.eq_ignore_ascii_case(word))
        };
        Some((words.iter().find(ends)?.len(), *hours))
    });
    let (text, half) = match half {
        Some((length, hours)) => (text.get(..text.len() - length)?.trim_end(), Some(hours)),
        None => (text, None),
    };
    let mut parts: Vec<&str> = text.split(':').collect();
    // Some programs write milliseconds after a third colon.
    let milliseconds = match parts.as_slice() {
        [_, _, _, ms] if ms.len() == 3 => parts.pop(),
        _ => None,
    };
    let whole = |text: &str| -> Option<f64> {
        let is_one = (1..=5).contains(&text.len()) && text.bytes().all(|b| b.is_ascii_digit());
        is_one.then(|| text.parse().ok()).flatten()
    };
    let fraction = |text: &str| -> Option<(f64, f64)> {
        let (seconds, digits) = match text.split_once(['.', ',']) {
            Some((seconds, digits)) => (seconds, digits),
            None => (text, milliseconds.unwrap_or_default()),
        };
        if !digits.bytes().all(|b| b.is_ascii_digit()) || digits.len() > 12 {
            return None;
        }
        let value: f64 = format!("{}.{digits}0", whole(seconds)?).parse().ok()?;
        (value < 61.0).then_some((value, 10_f64.powi(-(digits.len() as i32))))
    };
    let (mut hours, minutes, (seconds, unit)) = match parts.as_slice() {
        [hours, minutes, seconds] => (whole(hours)?, whole(minutes)?, fraction(seconds)?),
        // A fraction can only belong to the seconds.
        [minutes, seconds] if seconds.contains(['.', ',']) => {
            (0.0, whole(minutes)?, fraction(seconds)?)
        }
        [hours, minutes] => (whole(hours)?, whole(minutes)?, (0.0, 60.0)),
        _ => return None,
    };
    if (minutes >= 60.0 && hours > 0.0) || minutes >= 6000.0 {
        return None;
    }
    if let Some(half) = half {
        if !(1.0..=12.0).contains(&hours) {
            return None;
        }
        hours = hours % 12.0 + f64::from(half);
    }
    Some((hours * 3600.0 + minutes * 60.0 + seconds - offset, unit))
}

/// A time without its offset from universal time, and that offset, s.
fn without_offset(text: &str) -> (&str, f64) {
    for zone in ["Z", "z", " UTC", " GMT"] {
        if let Some(rest) = text.strip_suffix(zone) {
            return (rest, 0.0);
        }
    }
    let Some(at) = text.rfind(['+', '-']) else {
        return (text, 0.0);
    };
    let (time, zone) = text.split_at(at);
    let digits: String = zone.chars().filter(char::is_ascii_digit).collect();
    let value = |from: usize| {
        digits
            .get(from..from + 2)
            .and_then(|d| d.parse::<f64>().ok())
    };
    let seconds = match (digits.len(), value(0), value(2)) {
        (2, Some(hours), _) => hours * 3600.0,
        (4, Some(hours), Some(minutes)) => hours * 3600.0 + minutes * 60.0,
        _ => return (text, 0.0),
    };
    let seconds = if zone.starts_with('-') {
        -seconds
    } else {
        seconds
    };
    (time.trim_end(), seconds)
}

/// A column of stamps in seconds, or the first row whose stamp is of another kind than the first row's.
pub(super) fn resolve(stamps: &[Stamp]) -> Result<Stamped, usize> {
    let kind = stamps.first().map_or(Kind::Clock, Stamp::kind);
    if let Some(row) = stamps.iter().position(|s| s.kind() != kind) {
        return Err(row);
    }
    let of_day: Vec<f64> = stamps.iter().map(|s| s.seconds.unwrap_or(0.0)).collect();
    let unit = stamps.iter().map(|s| s.unit).collect();
    let start = of_day.first().copied().unwrap_or(0.0);
    let mut midnights = 0;
    let seconds: Vec<f64> = match kind {
        Kind::Clock => {
            let mut before = start;
            let unwrapped = of_day.iter().map(|&now| {
                if now < before - DAY / 2.0 {
                    midnights += 1;
                }
                before = now;
                midnights as f64 * DAY + now - start
            });
            unwrapped.collect()
        }
        Kind::Date | Kind::DateTime => {
            let days = days(stamps)?;
            let first = days.first().copied().unwrap_or(0);
            let since = |(day, now): (&i64, &f64)| (day - first) as f64 * DAY + (now - start);
            days.iter().zip(&of_day).map(since).collect()
        }
    };
    Ok(Stamped {
        kind,
        first: String::new(),
        seconds,
        of_day,
        unit,
        midnights,
    })
}

/// Days of the dates. The ambiguous order of day and month is the one that gives the shorter record.
fn days(stamps: &[Stamp]) -> Result<Vec<i64>, usize> {
    let by = |day_first: bool| -> Result<Vec<i64>, usize> {
        let each = stamps.iter().enumerate().map(|(row, stamp)| {
            let day = match stamp.date {
                Some(Date::Days(days)) => Some(days),
                Some(Date::Either(a, b, year)) => {
                    let (day, month) = if day_first { (a, b) } else { (b, a) };
                    days_from_civil(year, month.into(), day.into())
                }
                None => None,
            };
            day.ok_or(row)
        });
        each.collect()
    };
    let span = |days: &[i64]| {
        let steps = days.windows(2).map(|w| (w[1] - w[0]).abs());
        steps.sum::<i64>()
    };
    match (by(false), by(true)) {
        (Ok(month_first), Ok(day_first)) if span(&day_first) < span(&month_first) => Ok(day_first),
        (Ok(month_first), _) => Ok(month_first),
        (Err(_), Ok(day_first)) => Ok(day_first),
        (Err(row), Err(other)) => Err(row.max(other)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn seconds(cells: &[&str]) -> Vec<f64> {
        let stamps: Option<Vec<Stamp>> = cells.iter().map(|c| Stamp::of(c)).collect();
        let stamps = stamps.unwrap_or_else(|| panic!("no stamps: {cells:?}"));
        resolve(&stamps).expect("one kind").seconds
    }

    #[test]
    fn dates_and_clocks_of_many_loggers_are_read() {
        for cells in [
            ["2024-09-17T23:59:59", "2024-09-18T00:00:01"],
            ["2024-09-17 23:59:59.000", "2024-09-18 00:00:01.000"],
            ["2024-09-17T23:59:59Z", "2024-09-18T00:00:01Z"],
            ["2024-09-17T23:59:59+02:00", "2024-09-17T22:00:01Z"],
            ["2024-09-17 23:59:59-0500", "2024-09-18 00:00:01-05"],
            ["2024/09/17 23:59:59", "2024/09/18 00:00:01"],
            ["09/17/2024 11:59:59 PM", "09/18/2024 12:00:01 AM"],
            ["09/17/24 11:59:59PM", "09/18/24 12:00:01AM"],
            ["17.09.2024 23:59:59", "18.09.2024 00:00:01"],
            ["17-Sep-2024 23:59:59", "18-Sep-2024 00:00:01"],
            ["Sep 17, 2024 23:59:59", "Sep 18, 2024 00:00:01"],
            ["Tue, 17 Sep 2024 23:59:59", "Wed, 18 Sep 2024 00:00:01"],
            ["23:59:59", "00:00:01"],
            ["11:59:59 PM", "12:00:01 AM"],
            ["11:59:59 a.m.", "12:00:01 p.m."],
            ["23:59:59,000", "00:00:01,000"],
            ["23:59:59:000", "00:00:01:000"],
            ["0 days 23:59:59", "1 days 00:00:01"],
            ["59:59.0", "60:01.0"],
        ] {
            assert_eq!(seconds(&cells), [0.0, 2.0], "{cells:?}");
        }
        assert_eq!(seconds(&["2024-02-28", "2024-03-01"]), [0.0, 2.0 * DAY]);
        assert_eq!(
            seconds(&["2023-12-31 23:00", "2024-01-01 01:00"]),
            [0.0, 7200.0]
        );
        assert_eq!(seconds(&["23:55:01.25", "23:55:01.5"]), [0.0, 0.25]);
        assert_eq!(days_from_civil(1970, 1, 1), Some(0));
        assert_eq!(days_from_civil(2024, 9, 17), Some(19_983));
    }

    /// Of the two orders of day and month, the one that gives the shorter record applies: 5 and 6 June, not 6
    /// May and 6 June. A number of 13 can only be a day.
    #[test]
    fn the_order_of_day_and_month_is_that_of_the_shorter_record() {
        assert_eq!(
            seconds(&["05/06/2024 23:00", "06/06/2024 00:00"]),
            [0.0, 3600.0]
        );
        assert_eq!(
            seconds(&["06/05/2024 23:00", "06/06/2024 00:00"]),
            [0.0, 3600.0]
        );
        assert_eq!(
            seconds(&["12/06/2024 23:00", "13/06/2024 00:00"]),
            [0.0, 3600.0]
        );
    }

    #[test]
    fn a_month_of_clocks_passes_midnight_often() {
        let cells: Vec<String> = (0..500)
            .map(|k| format!("{:02}:{:02}:00", k * 7 % 24, k % 60))
            .collect();
        let stamps: Vec<Stamp> = cells.iter().filter_map(|c| Stamp::of(c)).collect();
        assert_eq!(resolve(&stamps[..2]).expect("clocks").midnights, 0);
        let nightly = [
            "23:00:00", "05:00:00", "11:00:00", "17:00:00", "23:00:00", "05:00:00",
        ];
        let expected: Vec<f64> = (0..6).map(|k| f64::from(k) * 21_600.0).collect();
        assert_eq!(seconds(&nightly), expected);
    }

    #[test]
    fn numbers_and_words_are_no_stamps() {
        for cell in [
            "1.5",
            "-1.5e-3",
            "21",
            "t",
            "on",
            "2024",
            "1,021.04",
            "192.168.0.1",
            "25:61:00",
            "2024-13-01",
            "2024-02-30",
            "13:00 PM",
            "1-2",
            "u=1",
            "a:b",
            "12:34:56:78:90",
            "::::::",
            "2024-09-17T",
            "99/99/2024",
            "1 day",
            "-- days 1:00:00",
            "é:00:00",
            "1.2.3.4.5",
        ] {
            assert_eq!(Stamp::of(cell), None, "{cell}");
        }
        let mixed = [
            Stamp::of("23:55:01").unwrap(),
            Stamp::of("2024-09-17").unwrap(),
        ];
        assert_eq!(resolve(&mixed).unwrap_err(), 1);
    }
}
