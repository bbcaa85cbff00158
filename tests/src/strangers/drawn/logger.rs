//! Formats of loggers: names, separators, clock, words for the command.

use super::chance;
use super::kind::{Drawn, Record};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::fmt::Write as _;

/// The time column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Clock {
    /// Seconds from the start.
    Seconds,
    /// Milliseconds from the start; the header states the unit.
    Milliseconds,
    /// Milliseconds since 1970.
    Epoch,
    /// Date and time of day.
    Iso,
}

/// Off and on of a switched command.
type Words = Option<[&'static str; 2]>;

/// A logger's habits.
#[derive(Clone, Debug)]
pub(super) struct Logger {
    clock: Clock,
    words: Words,
    separator: char,
    decimal_comma: bool,
    /// Names of time, command and output.
    names: [&'static str; 3],
}

/// 4 March 2026, 10:00 UTC, in milliseconds since 1970.
const START_MS: u64 = 1_772_618_400_000;

impl Logger {
    #[cfg(test)]
    pub(super) const PLAIN: Self = Self {
        clock: Clock::Seconds,
        words: None,
        separator: ',',
        decimal_comma: false,
        names: ["t", "u", "y"],
    };

    /// Formats that suit the records: whole milliseconds require a period of at least a millisecond.
    pub(super) fn draw(rng: &mut ChaCha8Rng, drawn: &Drawn) -> Self {
        let clocks = [
            Clock::Seconds,
            Clock::Milliseconds,
            Clock::Epoch,
            Clock::Iso,
        ];
        let clock = match chance(rng, 0.5) {
            true => Clock::Seconds,
            false => clocks[rng.random_range(0..clocks.len())],
        };
        let words: [Words; 3] = [None, Some(["OFF", "ON"]), Some(["false", "true"])];
        let graded = drawn.records.iter().any(|record| !record.is_switched());
        let words = match graded || chance(rng, 0.5) {
            true => None,
            false => words[rng.random_range(0..words.len())],
        };
        let (separator, decimal_comma) =
            [(',', false), (',', false), ('\t', false), (';', true)][rng.random_range(0..4)];
        let names = match (clock, chance(rng, 0.5)) {
            (Clock::Milliseconds, true) => ["t_ms", "u", "y"],
            (Clock::Milliseconds, false) => ["Time (ms)", "Heater", "Temperature"],
            (_, true) => ["t", "u", "y"],
            (_, false) => ["Time", "Valve", "Sensor 1"],
        };
        Self {
            clock,
            words,
            separator,
            decimal_comma,
            names,
        }
    }

    /// The options of `import` that name the columns.
    pub(super) fn options(&self) -> Vec<String> {
        let options = ["--t", "--u", "--y"].into_iter().zip(self.names);
        options
            .flat_map(|(option, name)| [option.to_owned(), name.to_owned()])
            .collect()
    }

    /// The file of a record with this sampling period (s).
    pub(super) fn csv(&self, record: &Record, period_s: f64) -> String {
        let mut header: Vec<&str> = self.names.to_vec();
        header.extend(record.channel.as_ref().map(|(name, _)| *name));
        let mut text = header.join(&self.separator.to_string()) + "\n";
        for (sample, (u, y)) in record.u.iter().zip(&record.y).enumerate() {
            let mut cells = vec![
                self.time(sample, period_s),
                self.command(*u),
                self.number(*y),
            ];
            let channel = record.channel.as_ref();
            cells.extend(channel.map(|(_, values)| self.number(values[sample])));
            text += &cells.join(&self.separator.to_string());
            text.push('\n');
        }
        text
    }

    fn number(&self, value: f64) -> String {
        // Nine digits, as from an accurate logger.
        let text = format!("{value:.8e}");
        let plain: f64 = text.parse().unwrap_or(value);
        match self.decimal_comma {
            true => plain.to_string().replace('.', ","),
            false => plain.to_string(),
        }
    }

    fn command(&self, u: f64) -> String {
        match self.words {
            Some([off, on]) => (if u > 0.5 { on } else { off }).to_owned(),
            None => self.number(u),
        }
    }

    fn time(&self, sample: usize, period_s: f64) -> String {
        let ms = (sample as f64 * period_s * 1e3).round() as u64;
        match self.clock {
            Clock::Seconds => self.number(sample as f64 * period_s),
            Clock::Milliseconds => ms.to_string(),
            Clock::Epoch => (START_MS + ms).to_string(),
            Clock::Iso => iso(ms),
        }
    }
}

/// Date and time of day this many milliseconds after the start; a record ends within the month.
fn iso(ms: u64) -> String {
    let (seconds, ms) = (ms / 1000, ms % 1000);
    let (minutes, s) = (seconds / 60, seconds % 60);
    let (hours, minute) = (10 + minutes / 60, minutes % 60);
    let (day, hour) = (4 + hours / 24, hours % 24);
    let mut text = format!("2026-03-{day:02}T{hour:02}:{minute:02}:{s:02}");
    // Infallible for a string.
    let _ = write!(text, ".{ms:03}");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_say_the_same_time() {
        let at = |clock| {
            let logger = Logger {
                clock,
                ..Logger::PLAIN
            };
            logger.time(90_061, 1.0)
        };
        assert_eq!(at(Clock::Seconds), "90061");
        assert_eq!(at(Clock::Milliseconds), "90061000");
        assert_eq!(at(Clock::Epoch), "1772708461000");
        assert_eq!(at(Clock::Iso), "2026-03-05T11:01:01.000");
    }

    #[test]
    fn a_decimal_comma_goes_with_another_separator() {
        let logger = Logger {
            separator: ';',
            decimal_comma: true,
            words: Some(["OFF", "ON"]),
            ..Logger::PLAIN
        };
        let record = Record {
            u: vec![0.0, 1.0],
            y: vec![21.25, -0.5],
            channel: Some(("fan", vec![1.0, 0.25])),
        };
        assert_eq!(
            logger.csv(&record, 0.5),
            "t;u;y;fan\n0;OFF;21,25;1\n0,5;ON;-0,5;0,25\n"
        );
    }
}
