//! Commands and status lines of the operator on the serial line.

use crate::controller::{Controller, Mode};
use crate::law::Law;
use heapless::Vec;

/// Interval of telemetry, µs.
const TELEMETRY_US: u32 = 100_000;

/// The operator's interface: commands in, answers and telemetry out.
#[derive(Clone, Debug)]
pub struct Operator {
    console: Console,
    /// Samples per telemetry line.
    every: u32,
    /// Samples since the last telemetry.
    since: u32,
    told: Mode,
}

impl Operator {
    /// Initial state, with a sample every `period_us`.
    #[must_use]
    pub const fn new(period_us: u32) -> Self {
        let period_us = if period_us == 0 { 1 } else { period_us };
        Self {
            console: Console::new(),
            every: TELEMETRY_US / period_us,
            since: 0,
            told: Mode::Disarmed,
        }
    }

    /// Takes a typed byte and executes the command that it completes; the answer is the status, preceded by
    /// `?` for an unknown command.
    pub fn receive<L: Law>(&mut self, byte: u8, controller: &mut Controller<L>) -> Option<Line> {
        let command = self.console.receive(byte)?;
        match command {
            Command::Arm => controller.arm(),
            Command::Disarm => controller.disarm(),
            Command::Pause => {
                controller.pause();
            }
            Command::Status | Command::Unknown => {}
        }
        let prefix = if command == Command::Unknown {
            "? "
        } else {
            ""
        };
        Some(Line::status(prefix, controller))
    }

    /// Telemetry after a sample: a status line starting with `t`, ten times a second and immediately after a
    /// change of mode.
    pub fn report<L: Law>(&mut self, controller: &Controller<L>) -> Option<Line> {
        self.since += 1;
        let mode = controller.mode();
        if self.since < self.every && mode == self.told {
            return None;
        }
        self.since = 0;
        self.told = mode;
        Some(Line::status("t ", controller))
    }
}

/// A command of the operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// Arm the law.
    Arm,
    /// Close the valves; also acknowledges a latched fault.
    Disarm,
    /// Close the valves and keep the law's settings until `arm`.
    Pause,
    /// Report the status.
    Status,
    /// Not understood.
    Unknown,
}

/// Collects a line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Console {
    /// One byte longer than the longest command; longer input is not a command.
    line: Vec<u8, 7>,
}

impl Console {
    /// An empty line.
    #[must_use]
    pub const fn new() -> Self {
        Self { line: Vec::new() }
    }

    /// Takes a byte. Returns a command at the end of a line, unless the line is empty.
    pub fn receive(&mut self, byte: u8) -> Option<Command> {
        if byte != b'\n' && byte != b'\r' {
            let _ = self.line.push(byte);
            return None;
        }
        let command = match self.line.as_slice() {
            b"" => None,
            b"arm" => Some(Command::Arm),
            b"disarm" => Some(Command::Disarm),
            b"pause" => Some(Command::Pause),
            b"status" => Some(Command::Status),
            _ => Some(Command::Unknown),
        };
        self.line.clear();
        command
    }
}

/// A line of text; text beyond its capacity is cut off.
#[derive(Clone, Debug)]
pub struct Line {
    bytes: Vec<u8, 96>,
}

impl Line {
    /// The status: `armed y=0.512 valve=1 samples=61234`, after `prefix`.
    #[must_use]
    pub fn status<L: Law>(prefix: &str, controller: &Controller<L>) -> Self {
        Self::new(
            prefix,
            controller.mode(),
            controller.friction(),
            controller.is_open(),
            controller.samples(),
        )
    }

    fn new(prefix: &str, mode: Mode, friction: f32, open: bool, samples: u64) -> Self {
        let mut line = Self { bytes: Vec::new() };
        line.text(prefix);
        match mode {
            Mode::Disarmed => line.text("disarmed"),
            Mode::Armed => line.text("armed"),
            Mode::Playing => line.text("playing"),
            Mode::Paused => line.text("paused"),
            Mode::Faulted(fault) => {
                line.text("fault=");
                line.text(fault.name());
            }
        }
        line.text(" y=");
        line.thousandths(friction);
        line.text(if open { " valve=1" } else { " valve=0" });
        line.text(" samples=");
        line.integer(samples);
        line.text("\r\n");
        line
    }

    /// The bytes to send.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    fn byte(&mut self, byte: u8) {
        let _ = self.bytes.push(byte);
    }

    fn text(&mut self, text: &str) {
        for byte in text.bytes() {
            self.byte(byte);
        }
    }

    fn integer(&mut self, mut value: u64) {
        // The least significant digit is written first.
        let mut digits = [b'0'; 20];
        let mut used = 0;
        for digit in &mut digits {
            *digit = b'0' + (value % 10) as u8;
            value /= 10;
            used += 1;
            if value == 0 {
                break;
            }
        }
        for digit in digits.iter().take(used).rev() {
            self.byte(*digit);
        }
    }

    fn thousandths(&mut self, value: f32) {
        if !value.is_finite() {
            self.text("nan");
            return;
        }
        let scaled = value.clamp(-1e6, 1e6) * 1000.0;
        let rounded = if scaled < 0.0 {
            scaled - 0.5
        } else {
            scaled + 0.5
        } as i64;
        if rounded < 0 {
            self.byte(b'-');
        }
        let magnitude = rounded.unsigned_abs();
        self.integer(magnitude / 1000);
        self.byte(b'.');
        self.byte(b'0' + (magnitude / 100 % 10) as u8);
        self.byte(b'0' + (magnitude / 10 % 10) as u8);
        self.byte(b'0' + (magnitude % 10) as u8);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::Fault;

    #[test]
    fn lines_become_commands() {
        let mut console = Console::new();
        let mut typed = std::vec::Vec::new();
        for byte in b"arm\r\nstatus\npause\ndisarm\n\nlaunch the rocket\narms\n".iter() {
            typed.extend(console.receive(*byte));
        }
        let expected = [
            Command::Arm,
            Command::Status,
            Command::Pause,
            Command::Disarm,
            Command::Unknown,
            Command::Unknown,
        ];
        assert_eq!(typed, expected);
    }

    #[test]
    fn the_status_is_one_line() {
        let line = Line::new("", Mode::Armed, 0.5124, true, u64::MAX);
        assert_eq!(
            line.bytes(),
            b"armed y=0.512 valve=1 samples=18446744073709551615\r\n"
        );
        let line = Line::new("t ", Mode::Faulted(Fault::Stuck), -0.0306, false, 0);
        assert_eq!(
            line.bytes(),
            b"t fault=stuck y=-0.031 valve=0 samples=0\r\n"
        );
        let line = Line::new("", Mode::Disarmed, f32::NAN, false, 7);
        assert_eq!(line.bytes(), b"disarmed y=nan valve=0 samples=7\r\n");
    }

    #[test]
    fn the_operator_is_answered_and_told_of_changes() {
        use crate::cases::{RELAY, SETTINGS};
        use crate::controller::Reading;
        use crate::law::{Driven, driven};
        use crate::relay::Relay;
        use identified::full;
        use model_core::average::MovingAverage;

        let model = full::model();
        let relay: driven!(Relay, full) =
            Driven::new(RELAY, model, full::state(&model), MovingAverage::new());
        let mut controller = Controller::new(SETTINGS, relay);
        let mut operator = Operator::new(1000);
        let mut typed = |text: &str, controller: &mut Controller<_>| {
            let answers = text.bytes().filter_map(|b| operator.receive(b, controller));
            let texts =
                answers.map(|line| std::string::String::from_utf8_lossy(line.bytes()).into_owned());
            texts.collect::<std::string::String>()
        };
        assert!(typed("launch\n", &mut controller).starts_with("? disarmed y=0.000 valve=0"));
        assert!(typed("arm\r\n", &mut controller).starts_with("armed"));
        let mut lines = |period_us: u32| {
            let (mut lines, mut operator) = (0, Operator::new(period_us));
            for k in 0..250_u16 {
                let counts = f32::from(800 + k % 2);
                controller.tick(Reading {
                    counts,
                    channel: 0.0,
                    periods: 1,
                });
                lines += u32::from(operator.report(&controller).is_some());
            }
            lines
        };
        // One line reports the change of mode; the others are periodic, ten per second at any sample period.
        assert_eq!(
            [200, 1000, 10_000, 100_000].map(&mut lines),
            [1, 3, 25, 250]
        );
        let mut operator = Operator::new(1000);
        controller.latch(Fault::Stuck);
        let line = operator
            .report(&controller)
            .expect("a fault is told at once");
        assert!(line.bytes().starts_with(b"t fault=stuck"));
    }
}
