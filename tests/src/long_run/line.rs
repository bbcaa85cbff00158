//! What arrives on the serial line: an operator's words, a host's requests, and garbage.

use super::board::BYTES;
use firmware::controller::Mode;
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;
use wire::request::{Ask, Request, checksum};

/// Mean time between messages, samples.
const BETWEEN: u32 = 400;
/// Samples between the messages with which a host shows that it is there.
const ALIVE: u32 = 100;
/// Samples of a host's visit, at most.
const VISIT: u32 = 60_000;

/// The sender's end of the line.
pub(super) struct Line {
    queue: Vec<u8>,
    at: usize,
    /// Samples until the next message.
    next: u32,
    /// Samples that the present host stays, 0 without a host.
    stays: u32,
    number: u16,
    session: u32,
    /// Samples since the last message that may close the valve or change a setting.
    since_stop: u32,
    since_setting: u32,
    /// Samples since the host's last request, and since the last change of the host.
    silent: u32,
    since_host: u32,
}

impl Line {
    pub(super) fn new() -> Self {
        Self {
            queue: Vec::new(),
            at: 0,
            next: 0,
            stays: 0,
            number: 0,
            session: 1,
            since_stop: u32::MAX,
            since_setting: u32::MAX,
            silent: 0,
            since_host: u32::MAX,
        }
    }

    /// The host notices that the board was restarted.
    pub(super) fn restarted(&mut self) {
        self.stays = 0;
        self.queue.clear();
        self.at = 0;
    }

    /// The bytes of this sample.
    pub(super) fn take(&self) -> &[u8] {
        let end = self.queue.len().min(self.at + BYTES);
        self.queue.get(self.at..end).unwrap_or_default()
    }

    /// The bytes of this sample have been sent.
    pub(super) fn sent(&mut self) {
        self.silent = self.silent.saturating_add(1);
        self.since_host = self.since_host.saturating_add(1);
        self.at += self.take().len();
        if self.at >= self.queue.len() {
            self.queue.clear();
            self.at = 0;
            self.since_stop = self.since_stop.saturating_add(1);
            self.since_setting = self.since_setting.saturating_add(1);
        }
    }

    /// Whether a message that closes the valve or ends a law is on the line or was within the last sample.
    pub(super) fn has_stopped(&self) -> bool {
        self.since_stop <= 2
    }

    /// Whether a change of a setting is on the line or was within the last sample.
    pub(super) fn has_set(&self) -> bool {
        self.since_setting <= 2
    }

    /// Samples since the host's last request.
    pub(super) fn silent(&self) -> u32 {
        self.silent
    }

    /// Samples since another host came.
    pub(super) fn since_host(&self) -> u32 {
        self.since_host
    }

    /// Adds the next message if it is due.
    pub(super) fn fill(&mut self, mode: Mode, random: &mut ChaCha8Rng) {
        if !self.queue.is_empty() {
            return;
        }
        self.stays = self.stays.saturating_sub(1);
        self.next = self.next.saturating_sub(1);
        if self.stays > 0 && self.silent >= ALIVE {
            self.ask(Ask::Alive);
            return;
        }
        if self.next > 0 {
            return;
        }
        self.next = random.random_range(1..2 * BETWEEN);
        match random.random_range(0..100) {
            // Messages that follow each other at once.
            0..4 => {
                self.next = 0;
                self.message(mode, random);
            }
            4..8 => {
                let garbage = random.random_range(1..40);
                for _ in 0..garbage {
                    let byte: u8 = random.random();
                    self.queue.push(byte);
                }
                // A part of it may read as a frame's end or the end of a line.
                self.since_stop = 0;
            }
            8..10 if self.stays == 0 => {
                self.stays = random.random_range(1..VISIT);
                self.session = random.random();
                self.since_host = 0;
                self.ask(Ask::Hello);
            }
            _ => self.message(mode, random),
        }
    }

    /// A message that makes sense in this mode, or any.
    fn message(&mut self, mode: Mode, random: &mut ChaCha8Rng) {
        let sensible = random.random_bool(0.8);
        let what = match mode {
            Mode::Disarmed if sensible => random.random_range(0..2),
            Mode::Paused if sensible => 0,
            Mode::Faulted(_) if sensible => 2,
            Mode::Armed | Mode::Playing if sensible => random.random_range(6..12),
            _ => random.random_range(0..12),
        };
        let host = self.stays > 0;
        match what {
            0 if host => self.ask(Ask::Arm),
            0 => self.text("arm\n"),
            1 if host => self.play(random),
            1 => self.text("arm\r\n"),
            2 if host => self.ask(Ask::Disarm),
            2 => self.text("disarm\n"),
            3 if host => self.ask(Ask::Pause),
            3 => self.text("pause\n"),
            4 => {
                self.text("disarm\narm\n");
                if host {
                    self.ask(Ask::Disarm);
                    self.ask(Ask::Arm);
                }
            }
            5 if host => {
                self.ask(Ask::Pause);
                self.ask(Ask::Arm);
            }
            5 => self.text("pause\narm\n"),
            6 if host => self.ask(Ask::Settings),
            7 if host => {
                let target = random.random_range(0.2..0.8_f32);
                self.ask(Ask::Target(target));
            }
            8 if host => {
                let air = random.random_range(1..=1000);
                self.ask(Ask::Air(air));
            }
            9 if host && random.random_bool(0.1) => {
                let bits: u32 = random.random();
                self.ask(Ask::Target(f32::from_bits(bits)));
            }
            10 if host => self.ask(Ask::Stream),
            11 if host => self.ask(Ask::Hello),
            _ => self.text("status\n"),
        }
    }

    fn text(&mut self, text: &str) {
        self.since_stop = 0;
        self.queue.extend_from_slice(text.as_bytes());
    }

    fn ask(&mut self, ask: Ask<'_>) {
        match ask {
            Ask::Disarm | Ask::Pause | Ask::Arm => self.since_stop = 0,
            Ask::Target(_) | Ask::Air(_) => self.since_setting = 0,
            _ => {}
        }
        self.silent = 0;
        self.number = self.number.wrapping_add(1);
        let request = Request {
            number: self.number,
            session: self.session,
            ask,
        };
        self.queue.extend_from_slice(request.frame().bytes());
    }

    /// A command of random runs, some of which the board must refuse.
    fn play(&mut self, random: &mut ChaCha8Rng) {
        let shortest = random.random_range(1..30);
        let count = random.random_range(1..40);
        let runs: Vec<u32> = (0..count)
            .map(|_| random.random_range(shortest..shortest + 300))
            .collect();
        self.number = self.number.wrapping_add(1);
        let load = Request::load(self.number, self.session, 0, &runs);
        self.queue.extend_from_slice(load.bytes());
        self.ask(Ask::Play {
            repeats: random.random_range(1..4),
            runs: count,
            checksum: checksum(runs),
        });
        // The host stays, or goes away while the command is played.
        if random.random_bool(0.3) {
            self.stays = 1;
        }
    }
}
