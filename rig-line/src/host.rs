//! The protocol of the host: requests with retries, the stream of samples, and keep-alive messages.

use std::collections::VecDeque;
use std::ops::RangeInclusive;
use std::time::{Duration, Instant};

use wire::frame::Receiver;
use wire::reply::{Answer, Info, NO_LIMIT, PROTOCOL, Phase, Reply, Scale, Settings, Status};
use wire::request::{Ask, Request};
use wire::samples::{Sample, Samples};

use crate::emulator::{Pace, Presence};
use crate::error::LineError;
use crate::port::Port;

/// Number of attempts per request before the board counts as silent.
const ATTEMPTS: u32 = 8;
/// Timeout of an answer.
const ANSWER: Duration = Duration::from_millis(250);
/// Timeout of an emulated board without progress, long because its machine may be busy.
const EMULATED: Duration = Duration::from_secs(600);
/// Keep-alive interval in time and in samples.
const ALIVE: Duration = Duration::from_millis(100);
const ALIVE_SAMPLES: usize = 48;
/// Waiting time for another host to be released; a silent one is dropped after half a second.
const BUSY: Duration = Duration::from_millis(2000);

/// Names of the faults, in the order of the firmware's `Fault::ALL`.
const FAULTS: [&str; 10] = [
    "overrun",
    "not-finite",
    "at-rail",
    "stuck",
    "channel",
    "residual",
    "link",
    "watchdog",
    "self-test",
    "setting",
];

/// Name of a phase of the board.
#[must_use]
pub fn word(phase: Phase) -> &'static str {
    match phase {
        Phase::Disarmed => "disarmed",
        Phase::Armed => "armed",
        Phase::Playing => "playing",
        Phase::Paused => "paused",
        Phase::Faulted(number) => FAULTS
            .get(usize::from(number))
            .copied()
            .unwrap_or("an unknown fault"),
    }
}

/// A change of the running law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// Another target, y of the flow.
    Target(f64),
    /// Another air budget, as a share of the time; 1 for no limit.
    Air(f64),
    /// The valve shut, the law kept ready.
    Pause,
    /// The end of a pause.
    Resume,
}

impl std::fmt::Display for Change {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Target(target) => write!(f, "target {target}"),
            Self::Air(share) => write!(f, "air {share}"),
            Self::Pause => f.write_str("pause"),
            Self::Resume => f.write_str("resume"),
        }
    }
}

/// A batch of samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Streamed {
    /// Sample numbers with the samples.
    pub samples: Vec<(u32, Sample)>,
    /// Number of the sample after this batch.
    pub next: u32,
    /// Phase of the board.
    pub phase: Phase,
    /// y* at the first sample.
    pub reference: Option<f32>,
    /// Whether the stream ends here.
    pub last: bool,
    /// Samples of the stream that were dropped for lack of memory on the board.
    pub left_out: u32,
}

/// An event on the line.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// Samples of this host's stream.
    Samples(Streamed),
    /// Nothing within the timeout.
    Silence,
}

/// Connection to a board.
pub struct Host {
    port: Port,
    receiver: Receiver,
    session: u32,
    number: u16,
    alive_at: Instant,
    unheard: usize,
    waiting: VecDeque<Streamed>,
    /// The board's sample period, µs; until it is known, that of the bundled model.
    period_us: u32,
    /// Whether a complete frame has been received: before that a board sends text for its operator.
    is_framed: bool,
    /// Number of damaged frames.
    pub damaged: u64,
    /// Registration with an emulated board, whose time waits for its host.
    presence: Option<Presence>,
}

impl Host {
    /// Opens a connection. `session` must be unique among hosts.
    #[must_use]
    pub fn new(port: Port, session: u32, pace: Option<Pace>) -> Self {
        Self {
            port,
            receiver: Receiver::new(),
            session,
            number: 0,
            alive_at: Instant::now(),
            unheard: 0,
            waiting: VecDeque::new(),
            period_us: 1000,
            is_framed: false,
            damaged: 0,
            presence: pace.map(|pace| pace.enter()),
        }
    }

    /// Closes the connection and returns the line.
    #[must_use]
    pub fn into_port(self) -> Port {
        self.port
    }

    /// The line itself, for tests.
    pub fn port(&mut self) -> &mut Port {
        &mut self.port
    }

    /// Session number of this host.
    #[must_use]
    pub fn session(&self) -> u32 {
        self.session
    }

    /// Identifies the board.
    ///
    /// # Errors
    /// [`LineError`] without an answer, or for another protocol version.
    pub fn hello(&mut self) -> Result<Info, LineError> {
        match self.ask("who are you", |_, _| Ask::Hello)? {
            Answer::Info(info) if info.protocol == PROTOCOL => {
                check(&info)?;
                self.period_us = info.period_us;
                Ok(info)
            }
            Answer::Info(info) => Err(LineError::Version {
                board: info.protocol,
                host: PROTOCOL,
            }),
            Answer::Done { .. } | Answer::Settings(_) => Err(LineError::Silent("who are you")),
        }
    }

    /// Loads a command's runs.
    ///
    /// # Errors
    /// [`LineError`].
    pub fn load(&mut self, runs: &[u32]) -> Result<(), LineError> {
        for (i, part) in runs.chunks(wire::request::RUNS).enumerate() {
            let at = (i * wire::request::RUNS) as u16;
            self.number = self.number.wrapping_add(1);
            let frame = Request::load(self.number, self.session, at, part);
            self.done("take a command", frame.bytes())?;
        }
        Ok(())
    }

    /// Plays the loaded runs; starts the stream.
    ///
    /// # Errors
    /// [`LineError`].
    pub fn play(&mut self, runs: &[u32], repeats: u32) -> Result<u64, LineError> {
        self.waiting.clear();
        let checksum = wire::request::checksum(runs.iter().copied());
        self.carry_out(
            "play a command",
            Ask::Play {
                repeats,
                runs: runs.len() as u16,
                checksum,
            },
        )
    }

    /// Starts a stream of all samples.
    ///
    /// # Errors
    /// [`LineError`].
    pub fn stream(&mut self) -> Result<u64, LineError> {
        self.waiting.clear();
        self.carry_out("stream its samples", Ask::Stream)
    }

    /// Arms the law.
    ///
    /// # Errors
    /// [`LineError`].
    pub fn arm(&mut self) -> Result<u64, LineError> {
        self.carry_out("arm", Ask::Arm)
    }

    /// Disarms and closes the valve.
    ///
    /// # Errors
    /// [`LineError`].
    pub fn disarm(&mut self) -> Result<u64, LineError> {
        self.carry_out("disarm", Ask::Disarm)
    }

    /// The settings of the board's law, with their bounds.
    ///
    /// # Errors
    /// [`LineError`].
    pub fn settings(&mut self) -> Result<Settings, LineError> {
        const ASKED: &str = "the settings of the law";
        match self.ask(ASKED, |_, _| Ask::Settings)? {
            Answer::Settings(settings) => Ok(settings),
            Answer::Info(_) | Answer::Done { .. } => Err(LineError::Silent(ASKED)),
        }
    }

    /// Changes the running law. A value outside the board's bounds is not sent, because the board would close the
    /// valve.
    ///
    /// # Errors
    /// [`LineError`], with the bounds where the value is outside them.
    pub fn change(&mut self, change: Change) -> Result<u64, LineError> {
        match change {
            Change::Target(target) => {
                const ASKED: &str = "change its target";
                let settings = self.settings()?;
                let target = target as f32;
                if settings.has_target() && !settings.takes_target(target) {
                    let [low, high] = settings.reachable;
                    return Err(LineError::Refused {
                        asked: ASKED,
                        reason: format!(
                            "{target} is outside the open interval ({low:.4}, {high:.4}) that on/off blowing can hold"
                        ),
                    });
                }
                self.carry_out(ASKED, Ask::Target(target))
            }
            Change::Air(share) => {
                const ASKED: &str = "change its air budget";
                // NaN becomes 0, which is outside the permitted range.
                let per_mille = (share * f64::from(NO_LIMIT)).round() as u16;
                if !Settings::takes_air(per_mille) {
                    return Err(LineError::Refused {
                        asked: ASKED,
                        reason: format!(
                            "{share} is outside 0.001 to 1, the share of time with the valve open"
                        ),
                    });
                }
                self.carry_out(ASKED, Ask::Air(per_mille))
            }
            Change::Pause => self.carry_out("pause", Ask::Pause),
            Change::Resume => self.carry_out("resume", Ask::Arm),
        }
    }

    /// Executes a request; returns the board's sample count at its execution.
    fn carry_out(&mut self, asked: &'static str, ask: Ask<'_>) -> Result<u64, LineError> {
        self.number = self.number.wrapping_add(1);
        let request = Request {
            number: self.number,
            session: self.session,
            ask,
        };
        self.done(asked, request.frame().bytes())
    }

    fn done(&mut self, asked: &'static str, frame: &[u8]) -> Result<u64, LineError> {
        let until = Instant::now() + BUSY;
        loop {
            let Answer::Done {
                status,
                detail,
                samples,
            } = self.answer(asked, frame)?
            else {
                return Err(LineError::Silent(asked));
            };
            match status {
                Status::Done => return Ok(samples),
                // The other host may have gone, and the board may still wait for it.
                Status::Busy if Instant::now() < until => {
                    let _ = self.port.receive(ALIVE)?;
                    self.touch();
                }
                _ => {
                    return Err(LineError::Refused {
                        asked,
                        reason: reason(status, detail),
                    });
                }
            }
        }
    }

    fn ask(
        &mut self,
        asked: &'static str,
        ask: impl Fn(u16, u32) -> Ask<'static>,
    ) -> Result<Answer, LineError> {
        self.number = self.number.wrapping_add(1);
        let request = Request {
            number: self.number,
            session: self.session,
            ask: ask(self.number, self.session),
        };
        self.answer(asked, request.frame().bytes())
    }

    /// Repeats a request until it is answered; samples received meanwhile are queued.
    fn answer(&mut self, asked: &'static str, frame: &[u8]) -> Result<Answer, LineError> {
        let patience = self.patience(ATTEMPTS * ANSWER);
        while !patience.is_over(self.presence.as_ref()) {
            self.port.send(frame)?;
            self.touch();
            let until = Instant::now() + ANSWER;
            while Instant::now() < until {
                for reply in self.read(until.saturating_duration_since(Instant::now()))? {
                    if reply.number == self.number && reply.session == self.session {
                        return Ok(reply.answer);
                    }
                }
            }
        }
        Err(LineError::Silent(asked))
    }

    /// The next event within `patience`.
    ///
    /// # Errors
    /// [`LineError::Gone`].
    pub fn next(&mut self, patience: Duration) -> Result<Event, LineError> {
        let patience = self.patience(patience);
        loop {
            if let Some(streamed) = self.waiting.pop_front() {
                return Ok(Event::Samples(streamed));
            }
            if patience.is_over(self.presence.as_ref()) {
                return Ok(Event::Silence);
            }
            let left = patience.until.saturating_duration_since(Instant::now());
            self.read(left.clamp(Duration::from_millis(1), ALIVE))?;
            if self.unheard >= ALIVE_SAMPLES || self.alive_at.elapsed() >= ALIVE {
                self.alive()?;
            }
        }
    }

    /// Sends a keep-alive message; [`Self::next`] does so itself.
    ///
    /// # Errors
    /// [`LineError::Gone`].
    pub fn alive(&mut self) -> Result<(), LineError> {
        let request = Request {
            number: 0,
            session: self.session,
            ask: Ask::Alive,
        };
        self.port.send(request.frame().bytes())?;
        self.touch();
        Ok(())
    }

    fn patience(&self, time: Duration) -> Patience {
        let samples = time.as_micros() / u128::from(self.period_us);
        let samples = u64::try_from(samples).unwrap_or(u64::MAX);
        Patience {
            until: Instant::now() + time,
            sample: self.presence.as_ref().map(|p| p.samples() + samples),
            at_last: Instant::now() + EMULATED.max(time),
        }
    }

    fn touch(&mut self) {
        self.unheard = 0;
        self.alive_at = Instant::now();
        if let Some(presence) = &self.presence {
            presence.touch(self.period_us);
        }
    }

    /// Reads from the line: samples are queued, answers are returned.
    fn read(&mut self, patience: Duration) -> Result<Vec<Reply>, LineError> {
        let bytes = self.port.receive(patience)?;
        let mut replies = Vec::new();
        for byte in bytes {
            let content = match self.receiver.receive(byte) {
                None => continue,
                Some(Err(_)) => {
                    self.damaged += u64::from(self.is_framed);
                    continue;
                }
                Some(Ok(content)) => content,
            };
            self.is_framed = true;
            if let Some(samples) = Samples::read(content) {
                if samples.session == self.session {
                    let all: Vec<_> = samples.iter().collect();
                    self.unheard += all.len();
                    self.waiting.push_back(Streamed {
                        next: samples.first.wrapping_add(all.len() as u32),
                        samples: all,
                        phase: samples.phase,
                        reference: samples.reference,
                        last: samples.last,
                        left_out: samples.left_out,
                    });
                }
            } else {
                replies.extend(Reply::read(content));
            }
        }
        Ok(replies)
    }
}

/// A timeout. The time of an emulated board is counted in its samples.
struct Patience {
    until: Instant,
    sample: Option<u64>,
    at_last: Instant,
}

impl Patience {
    fn is_over(&self, presence: Option<&Presence>) -> bool {
        let now = Instant::now();
        let sampled = match (presence, self.sample) {
            (Some(presence), Some(sample)) => presence.samples() >= sample,
            _ => true,
        };
        now >= self.until && (sampled || now >= self.at_last)
    }
}

/// Valid sample periods of a board's loop, µs, from `model_core::control::period`.
const PERIODS_US: RangeInclusive<u32> = 200..=100_000;

/// Rejects a board with invalid constants, whose recordings would be wrong.
fn check(info: &Info) -> Result<(), LineError> {
    let wrong = |what: String| Err(LineError::Constants(what));
    let Scale { zero, per_count } = info.sensor;
    if !PERIODS_US.contains(&info.period_us) {
        return wrong(format!("a sampling period of {} µs", info.period_us));
    }
    if !(zero.is_finite() && per_count.is_normal()) {
        return wrong(format!("y = (counts - {zero}) * {per_count}"));
    }
    if !(info.rails.iter().all(|rail| rail.is_finite()) && info.rails[0] < info.rails[1]) {
        return wrong(format!("rails of {:?} counts", info.rails));
    }
    if !info.envelope.is_finite() {
        return wrong(format!("a residual limit of {}", info.envelope));
    }
    Ok(())
}

/// Why the board refuses, with the remedy.
fn reason(status: Status, detail: u32) -> String {
    match status {
        Status::Busy => "another host uses the board; end that host first".into(),
        Status::TooLong => {
            format!("it stores at most {detail} intervals of constant command; play the command in shorter pieces")
        }
        Status::Missing => format!("it received only the first {detail} intervals of constant command; start again"),
        Status::TooShort => format!(
            "interval {detail} of constant command (counted from 0; in interval 0 the valve is closed) is shorter \
                than the valve's hold time in the \
             board's rig constants; lengthen it"
        ),
        Status::OtherCommand => {
            "the command on the board differs from the one to play; start again".into()
        }
        Status::Nothing => {
            "there is nothing to play, or the number of samples exceeds 32 bits".into()
        }
        Status::Outside => {
            "the value is outside its bounds; the board closed the valve and latched `setting`".into()
        }
        Status::Pending => {
            "the preceding change is not complete (a ramp, or the valve's shortest closed time); wait and repeat".into()
        }
        Status::NoSetting => "its law has no such setting".into(),
        Status::NotRunning => "no law is running; arm it first (`--arm`)".into(),
        Status::NotDisarmed => match Phase::from_byte(detail as u8) {
            Some(Phase::Faulted(number)) => format!(
                "it has latched `{}`; remove the cause, then disarm (`--disarm`)",
                word(Phase::Faulted(number))
            ),
            Some(phase) => format!("it is {}; disarm it first (`--disarm`)", word(phase)),
            None => "it is not disarmed; disarm it first (`--disarm`)".into(),
        },
        _ => format!("it says {status:?} {detail}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_that_cannot_be_is_refused() {
        use model_core::control::period::{LONGEST_US, SHORTEST_US};
        assert_eq!(PERIODS_US, SHORTEST_US..=LONGEST_US);
        let good = Info {
            protocol: PROTOCOL,
            version: [0, 1, 0],
            period_us: 1000,
            model: 1,
            rig: 2,
            sensor: Scale {
                zero: 800.0,
                per_count: 0.0005,
            },
            rails: [8.0, 4087.0],
            stuck_after: 500,
            envelope: 0.5,
            hold: [4, 4],
            channel: Scale {
                zero: 0.0,
                per_count: 0.0,
            },
            phase: Phase::Disarmed,
            samples: 0,
            most_runs: 1024,
            damaged: 0,
            session: 0,
        };
        assert!(check(&good).is_ok());
        let scale = |zero, per_count| Scale { zero, per_count };
        for (bad, word) in [
            (
                Info {
                    period_us: 0,
                    ..good
                },
                "0 µs",
            ),
            (
                Info {
                    period_us: u32::MAX,
                    ..good
                },
                "4294967295 µs",
            ),
            (
                Info {
                    sensor: scale(f32::NAN, 0.1),
                    ..good
                },
                "NaN",
            ),
            (
                Info {
                    sensor: scale(0.0, f32::NAN),
                    ..good
                },
                "NaN",
            ),
            (
                Info {
                    sensor: scale(0.0, f32::INFINITY),
                    ..good
                },
                "inf",
            ),
            (
                Info {
                    sensor: scale(0.0, 0.0),
                    ..good
                },
                "* 0",
            ),
            (
                Info {
                    rails: [f32::NAN; 2],
                    ..good
                },
                "rails",
            ),
            (
                Info {
                    rails: [4087.0, 8.0],
                    ..good
                },
                "rails",
            ),
            (
                Info {
                    envelope: f32::INFINITY,
                    ..good
                },
                "residual limit",
            ),
        ] {
            let error = check(&bad).expect_err(word).to_string();
            assert!(
                error.contains(word) && error.contains("firmware"),
                "{error}"
            );
        }
    }
}
