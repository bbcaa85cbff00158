//! Long tables: a row holds the time, the name of a signal and its value, as home automation, historians and time-series
//! databases write them.

use super::cell::{Cell, Decimals, Marks};
use super::column::Column;
use super::delimited::{Rows, Separator};
use super::names::{TIMES, is_known};
use super::source::Budget;
use crate::error::DataError;

/// Usual names of the column with the signals' names, of that with their values, and of the time beside [`TIMES`].
const SIGNALS: &str = "entity_id _field field tag tagname tag_name signal signal_name variable parameter metric series \
    sensor channel key item point point_name topic name";
const VALUES: &str = "value _value state val reading wert measurement payload data";
const LOGGED: &str = "last_changed last_updated _time ts";

/// Bytes of memory per row and per cell while the signals are sorted.
const ROW: u64 = 96;
const CELL: u64 = 16;

/// Most signals of a file. A column with more different texts does not name signals.
const MOST: usize = 64;

/// A long table as a wide one: a row for each value of one signal, with the values of the others at that time.
#[derive(Debug)]
pub(super) struct Widened {
    /// Header and rows, separated by tabs.
    pub(super) lines: Vec<String>,
    /// The line of the file that each belongs to, from 1.
    pub(super) numbers: Vec<u64>,
    /// What was done.
    pub(super) remarks: Vec<String>,
}

/// A value of a signal.
struct Reading<'a> {
    time: f64,
    stamp: &'a str,
    text: &'a str,
    line: u64,
}

/// A signal with its values in the order of time.
struct Signal<'a> {
    name: &'a str,
    readings: Vec<Reading<'a>>,
    /// Whether it is on/off, or has two values only.
    switches: bool,
}

impl Signal<'_> {
    /// Whether its last value is kept at the times of the `reference`.
    fn is_held(&self, reference: &Self) -> bool {
        self.switches || 2 * self.readings.len() < reference.readings.len()
    }

    /// Its cell at a time not before its first value: the last value until then, or between the values around it.
    fn at(&self, time: f64, is_held: bool, decimals: Decimals) -> String {
        let after = self.readings.partition_point(|r| r.time <= time);
        let Some(before) = after.checked_sub(1).and_then(|at| self.readings.get(at)) else {
            return String::new();
        };
        let number = |reading: &Reading<'_>| match Cell::of(reading.text, decimals) {
            Cell::Number(number) => Some(number.value),
            _ => None,
        };
        let next = self
            .readings
            .get(after)
            .filter(|_| !is_held && before.time < time);
        let between = next.and_then(|next| {
            let share = (time - before.time) / (next.time - before.time);
            let (from, to) = (number(before)?, number(next)?);
            Some((from + share * (to - from)).to_string())
        });
        match between {
            Some(number) if decimals == Decimals::Comma => number.replace('.', ","),
            Some(number) => number,
            None => before.text.to_owned(),
        }
    }
}

/// `lines` as a wide table; `None` if they are no long table, which the names of its columns and its texts show.
pub(super) fn widened(
    rows: &Rows,
    lines: &[&str],
    budget: &mut Budget,
) -> Result<Option<Widened>, DataError> {
    let (names, units) = rows.header(lines);
    let named = |known: &'static str| {
        let columns = 0..rows.width;
        columns.filter(|at| is_known(known, &names[*at]))
    };
    let values = named(VALUES).next();
    let time = named(TIMES).chain(named(LOGGED)).next();
    let (Some(values), Some(time)) = (values, time) else {
        return Ok(None);
    };
    if named(SIGNALS).next().is_none() {
        return Ok(None);
    }
    let count = lines.len().saturating_sub(rows.first) as u64;
    let taken = count * (ROW + CELL * rows.width as u64);
    budget.take(taken, || "its signals".to_owned())?;
    let table = cells(rows, lines);
    let signals =
        named(SIGNALS).find(|at| *at != values && *at != time && names_signals(&table, *at));
    let wide = signals.and_then(|signals| {
        let columns = Columns {
            time,
            signals,
            values,
        };
        let clock = match units.get(time) {
            Some(Some(unit)) => format!("{} [{unit}]", names[time]),
            _ => names[time].clone(),
        };
        columns.widen(rows, &table, clock)
    });
    budget.give(taken);
    Ok(wide)
}

/// Whether the texts of a column are names of signals, which recur.
fn names_signals(table: &[(u64, Vec<&str>)], at: usize) -> bool {
    let texts = || table.iter().map(|(_, cells)| cells[at]);
    let all_texts = texts().all(|text| Cell::of(text, Decimals::Each) == Cell::Text);
    let names = different(texts(), MOST).map_or(0, |names| names.len());
    all_texts && names >= 2 && 2 * names <= table.len()
}

/// The different texts; `None` if there are more than `most`.
fn different<'a>(texts: impl Iterator<Item = &'a str>, most: usize) -> Option<Vec<&'a str>> {
    let mut all = Vec::new();
    for text in texts {
        if !all.contains(&text) {
            if all.len() == most {
                return None;
            }
            all.push(text);
        }
    }
    Some(all)
}

/// The columns of a long table.
struct Columns {
    time: usize,
    signals: usize,
    values: usize,
}

impl Columns {
    /// The signals in the order of the file, and the number of rows without a value; `None` if a time is unreadable.
    fn signals<'a>(
        &self,
        table: &[(u64, Vec<&'a str>)],
        decimals: Decimals,
    ) -> Option<(Vec<Signal<'a>>, usize)> {
        let mut clock = Column::default();
        for (line, cells) in table {
            clock.push(cells[self.time], *line, decimals);
        }
        let lines: Vec<u64> = table.iter().map(|(line, _)| *line).collect();
        let text = |row: usize| table[row].1[self.time].to_owned();
        let clock = clock.variable(String::new(), None, &lines, text).ok()?;
        let mut signals: Vec<Signal<'_>> = Vec::new();
        let mut without = 0;
        for ((line, cells), time) in table.iter().zip(clock.values) {
            if !time.is_finite() {
                return None;
            }
            let (name, text) = (cells[self.signals], cells[self.values]);
            if let Cell::Empty | Cell::Missing | Cell::Text = Cell::of(text, decimals) {
                without += 1;
                continue;
            }
            let reading = Reading {
                time,
                stamp: cells[self.time],
                text,
                line: *line,
            };
            match signals.iter_mut().find(|signal| signal.name == name) {
                Some(signal) => signal.readings.push(reading),
                None => signals.push(Signal {
                    name,
                    readings: vec![reading],
                    switches: true,
                }),
            }
        }
        for signal in &mut signals {
            signal.readings.sort_by(|a, b| a.time.total_cmp(&b.time));
            let texts = signal.readings.iter().map(|reading| reading.text);
            signal.switches = different(texts, 2).is_some();
        }
        Some((signals, without))
    }

    fn widen(&self, rows: &Rows, table: &[(u64, Vec<&str>)], clock: String) -> Option<Widened> {
        let mut marks = Marks::default();
        table
            .iter()
            .for_each(|(_, cells)| marks.see(cells[self.values]));
        let decimals = marks.decimals(rows.separator == Separator::Comma);
        let (signals, without) = self.signals(table, decimals)?;
        // Of two signals with as many values the first is the reference.
        let measured = signals.iter().rev().filter(|signal| !signal.switches);
        let reference = measured.max_by_key(|signal| signal.readings.len())?;
        let others = signals
            .iter()
            .filter(|signal| signal.name != reference.name);
        let others: Vec<(&Signal<'_>, bool)> = others
            .map(|signal| (signal, signal.is_held(reference)))
            .collect();
        let firsts = signals
            .iter()
            .filter_map(|signal| Some(signal.readings.first()?.time));
        let begin = firsts.fold(f64::NEG_INFINITY, f64::max);
        let early = reference.readings.partition_point(|r| r.time < begin);
        let names = others.iter().map(|(signal, _)| signal.name);
        let names = names.chain([reference.name]);
        let names = names.map(|name| name.replace('\t', " "));
        let header: Vec<String> = std::iter::once(clock).chain(names).collect();
        let mut wide = Widened {
            lines: vec![header.join("\t")],
            numbers: vec![rows.first as u64],
            remarks: vec![described(reference, &others)],
        };
        for reading in &reference.readings[early..] {
            let others = others.iter();
            let others =
                others.map(|(signal, is_held)| signal.at(reading.time, *is_held, decimals));
            let mut cells = vec![reading.stamp.to_owned()];
            cells.extend(others.chain([reading.text.to_owned()]));
            wide.lines.push(cells.join("\t"));
            wide.numbers.push(reading.line);
        }
        if early > 0 {
            wide.remarks.push(format!(
                "the first {early} row(s) are left out: not every signal has a value there"
            ));
        }
        if without > 0 {
            wide.remarks
                .push(format!("{without} row(s) without a value are left out"));
        }
        Some(wide)
    }
}

/// What a wide table is made of.
fn described(reference: &Signal<'_>, others: &[(&Signal<'_>, bool)]) -> String {
    let mut words = format!(
        "every row holds one signal: a sample for each value of `{}`",
        reference.name
    );
    for (held, what) in [
        (true, "last value is kept"),
        (false, "values are interpolated"),
    ] {
        let names = others.iter().filter(|(_, is_held)| *is_held == held);
        let names: Vec<String> = names
            .map(|(signal, _)| format!("`{}`", signal.name))
            .collect();
        if !names.is_empty() {
            words.push_str(&format!("; {}: {what}", names.join(", ")));
        }
    }
    words
}

/// The rows with their lines, from 1, and cells.
fn cells<'a>(rows: &Rows, lines: &[&'a str]) -> Vec<(u64, Vec<&'a str>)> {
    let rest = lines.iter().enumerate().skip(rows.first);
    let split = |(at, line): (usize, &&'a str)| {
        let mut cells = Vec::new();
        rows.separator.split(line, &mut cells);
        (cells.len() == rows.width).then(|| (at as u64 + 1, cells))
    };
    rest.filter_map(split).collect()
}

#[cfg(test)]
mod tests {
    use super::super::source::{Budget, Source};
    use super::super::text::variables;

    fn read(text: &str) -> Source {
        variables(text.as_bytes(), &mut Budget::with(0)).expect("a table")
    }

    /// The states of home automation: the heater when it changes, the temperature every 10 s, one of them lost.
    #[test]
    fn signals_become_columns() {
        let log = read(
            "entity_id,state,last_changed\n\
             sensor.tank,20.5,2026-03-29T00:00:00Z\n\
             switch.heater,off,2026-03-29T00:00:05Z\n\
             sensor.tank,21.0,2026-03-29T00:00:10Z\n\
             switch.heater,on,2026-03-29T00:00:12Z\n\
             sensor.tank,unavailable,2026-03-29T00:00:20Z\n\
             sensor.tank,22.0,2026-03-29T00:00:30Z\n\
             switch.heater,off,2026-03-29T00:00:30Z\n\
             sensor.tank,23.0,2026-03-29T00:00:40Z\n",
        );
        let names: Vec<&str> = log.variables.iter().map(|v| v.name.as_str()).collect();
        assert_eq!(names, ["last_changed", "switch.heater", "sensor.tank"]);
        assert_eq!(log.variables[0].values, [0.0, 20.0, 30.0]);
        assert_eq!(log.variables[1].values, [0.0, 0.0, 0.0]);
        assert_eq!(log.variables[2].values, [21.0, 22.0, 23.0]);
        assert_eq!(log.lines, [4, 7, 9]);
        let remarks = log.remarks.join("\n");
        for part in [
            "a sample for each value of `sensor.tank`; `switch.heater`: last value is kept",
            "the first 1 row(s)",
            "1 row(s) without a value",
        ] {
            assert!(remarks.contains(part), "{remarks}");
        }
    }

    /// Signals one after the other, decimal commas, and a second measurement between the times of the first.
    #[test]
    fn measurements_are_interpolated_and_sorted_by_time() {
        let export = read(
            "time;tag;value\n0;pump;0\n2;pump;1\n0;level;1,0\n1;level;1,5\n2;level;2,5\n3;level;3,5\n\
             0;flow;10,0\n1,5;flow;13,0\n3;flow;16,5\n",
        );
        let values = |at: usize| export.variables[at].values.clone();
        assert_eq!(values(1), [0.0, 0.0, 1.0, 1.0]);
        assert_eq!(values(3), [1.0, 1.5, 2.5, 3.5]);
        let flow = values(2);
        assert!(
            (flow[1] - 12.0).abs() < 1e-9 && (flow[3] - 16.5).abs() < 1e-9,
            "{flow:?}"
        );
    }

    #[test]
    fn a_wide_table_with_words_stays_what_it_is() {
        let wide = read("time,state,temp\n0,HEAT,20\n1,HEAT,21\n2,IDLE,22\n");
        assert_eq!(wide.variables.len(), 2);
        let notes = read("time,name,u,y\n0,a,0,20\n1,b,1,21\n2,a,1,22\n");
        assert_eq!(notes.variables.len(), 3);
    }
}
