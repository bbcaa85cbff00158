use crate::cases::{RELAY, SETTINGS};
use crate::controller::{Controller, Mode, Reading};
use crate::fault::Fault;
use crate::law::{Driven, driven};
use crate::link::desk::Desk;
use crate::relay::Relay;
use identified::full;
use model_core::average::MovingAverage;
use std::vec::Vec;
use wire::Outbox;
use wire::frame::Receiver;
use wire::reply::{Answer, Phase, Reply, Status};
use wire::request::{Ask, Request, checksum};
use wire::samples::{Sample, Samples};

const US: u32 = 11;

/// A board under test, with its inputs and outputs.
struct Bench {
    controller: Controller<driven!(Relay, full)>,
    desk: Desk,
    outbox: Outbox,
    /// Bytes that the line transmits per sample.
    line: usize,
    receiver: Receiver,
    number: u16,
    k: u16,
    valve: Vec<bool>,
    replies: Vec<Reply>,
    samples: Vec<(u32, Sample, Phase)>,
    left_out: u32,
    last: bool,
    text: Vec<u8>,
}

impl Bench {
    fn new() -> Self {
        Self::every(1000)
    }

    /// A board with a sample every `period_us`.
    fn every(period_us: u32) -> Self {
        let model = full::model();
        let law = Driven::new(RELAY, model, full::state(&model), MovingAverage::new());
        Self {
            controller: Controller::new(SETTINGS, law),
            desk: Desk::new(super::Board {
                period_us,
                model: full::CHECKSUM,
            }),
            outbox: Outbox::new(),
            line: 11,
            receiver: Receiver::new(),
            number: 0,
            k: 0,
            valve: Vec::new(),
            replies: Vec::new(),
            samples: Vec::new(),
            left_out: 0,
            last: false,
            text: Vec::new(),
        }
    }

    fn say(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.desk
                .receive(*byte, &mut self.controller, &mut self.outbox);
        }
    }

    fn ask(&mut self, session: u32, ask: Ask<'_>) {
        self.number += 1;
        let request = Request {
            number: self.number,
            session,
            ask,
        };
        self.say(request.frame().bytes());
    }

    fn load(&mut self, runs: &[u32]) {
        for (i, part) in runs.chunks(wire::request::RUNS).enumerate() {
            self.number += 1;
            let at = (i * wire::request::RUNS) as u16;
            self.say(Request::load(self.number, US, at, part).bytes());
        }
    }

    fn play(&mut self, runs: &[u32], repeats: u32) {
        self.load(runs);
        self.ask(
            US,
            Ask::Play {
                repeats,
                runs: runs.len() as u16,
                checksum: checksum(runs.iter().copied()),
            },
        );
    }

    /// Runs samples with a healthy sensor; if `there`, the host sends keep-alive messages.
    fn run(&mut self, samples: usize, there: bool) {
        for _ in 0..samples {
            if there && self.k.is_multiple_of(100) {
                self.ask(US, Ask::Alive);
            }
            self.sample(800.0 + f32::from(self.k % 7));
        }
    }

    fn sample(&mut self, counts: f32) {
        self.k += 1;
        self.desk.before(&mut self.controller, &mut self.outbox);
        let tick = self.controller.tick(Reading {
            counts,
            channel: 2048.0,
            periods: 1,
        });
        self.desk
            .after(&tick, &mut self.controller, &mut self.outbox);
        self.valve.push(tick.open);
        for _ in 0..self.line {
            let Some(byte) = self.outbox.pop() else {
                break;
            };
            self.text.push(byte);
            let Some(content) = self.receiver.receive(byte) else {
                continue;
            };
            self.text.clear();
            // Text between frames is ignored.
            let Ok(content) = content else { continue };
            if let Some(samples) = Samples::read(content) {
                self.left_out = samples.left_out;
                self.last |= samples.last;
                let phase = samples.phase;
                self.samples
                    .extend(samples.iter().map(|(n, s)| (n, s, phase)));
            } else {
                self.replies.extend(Reply::read(content));
            }
        }
    }

    fn status(&mut self) -> Option<(Status, u32)> {
        match self.replies.last()?.answer {
            Answer::Done { status, detail, .. } => Some((status, detail)),
            Answer::Info(_) | Answer::Settings(_) => None,
        }
    }
}

fn levels(runs: &[u32], repeats: usize) -> Vec<bool> {
    let once = runs.iter().enumerate();
    once.flat_map(|(i, run)| (0..*run).map(move |_| i % 2 == 1))
        .collect::<Vec<_>>()
        .repeat(repeats)
}

const COMMAND: [u32; 5] = [30, 40, 25, 60, 100];

#[test]
fn a_command_is_played_and_every_sample_of_it_arrives() {
    let mut bench = Bench::new();
    bench.play(&COMMAND, 3);
    bench.run(900, true);
    assert_eq!(bench.status(), Some((Status::Done, 0)));
    let played: Vec<bool> = bench.samples.iter().map(|(_, s, _)| s.open).collect();
    assert_eq!(played, levels(&COMMAND, 3));
    assert_eq!(bench.valve[..played.len()], played);
    assert!(bench.valve[played.len()..].iter().all(|open| !open));
    for (n, (number, sample, phase)) in bench.samples.iter().enumerate() {
        assert_eq!((*number as usize, *phase), (n, Phase::Playing));
        // An `ALIVE` every hundred samples does not disturb the readings.
        assert_eq!(usize::from(sample.counts), 800 + n % 7, "{n}");
        assert_eq!(sample.channel, 2048);
    }
    assert!(bench.last && bench.left_out == 0);
    assert_eq!(bench.controller.mode(), Mode::Disarmed);
}

#[test]
fn what_is_played_ends_on_every_fault_on_disarm_and_with_the_link() {
    type End = (&'static str, fn(&mut Bench), Mode);
    let ends: [End; 5] = [
        (
            "a fault",
            |bench| bench.sample(4095.0),
            Mode::Faulted(Fault::AtRail),
        ),
        ("disarm", |bench| bench.ask(US, Ask::Disarm), Mode::Disarmed),
        (
            "another's disarm",
            |bench| bench.ask(99, Ask::Disarm),
            Mode::Disarmed,
        ),
        (
            "the operator's disarm among frames",
            |bench| bench.say(b"\ndisarm\n"),
            Mode::Disarmed,
        ),
        (
            "a host that has died",
            |bench| bench.run(501, false),
            Mode::Faulted(Fault::Link),
        ),
    ];
    for (name, end, mode) in ends {
        let mut bench = Bench::new();
        bench.play(&[10, 5000, 10], 1);
        bench.run(200, true);
        assert!(bench.controller.is_open(), "{name}");
        end(&mut bench);
        bench.run(2, false);
        assert_eq!(bench.controller.mode(), mode, "{name}");
        assert!(!bench.controller.is_open(), "{name}");
        bench.run(100, false);
        // A lost host receives nothing more.
        assert_eq!(bench.last, mode != Mode::Faulted(Fault::Link), "{name}");
        // A latched fault must be acknowledged before anything is played.
        if let Mode::Faulted(_) = mode {
            bench.play(&COMMAND, 1);
            bench.run(50, true);
            assert_eq!(bench.status().map(|s| s.0), Some(Status::NotDisarmed));
            bench.ask(US, Ask::Disarm);
        }
        bench.play(&COMMAND, 1);
        bench.run(50, true);
        assert_eq!(bench.status(), Some((Status::Done, 0)), "{name}");
    }
}

/// With a line that is too slow the loop continues, and every dropped sample is detectable by number and
/// counted.
#[test]
fn what_finds_no_room_is_counted_and_known() {
    let mut bench = Bench::new();
    bench.line = 2;
    bench.play(&[0, 20_000], 1);
    bench.run(20_100, true);
    bench.line = 1000;
    bench.run(50, true);
    let (arrived, left_out) = (bench.samples.len(), bench.left_out as usize);
    assert!(left_out > 5_000 && arrived > 5_000, "{left_out} {arrived}");
    assert_eq!(arrived + left_out, 20_000);
    let last = bench.samples.windows(2).all(|w| w[0].0 < w[1].0);
    assert!(last, "numbers only grow");
    assert_eq!(bench.valve.iter().filter(|open| **open).count(), 20_000);
}

#[test]
fn a_request_is_carried_out_once_and_another_host_is_told_to_wait() {
    let mut bench = Bench::new();
    bench.play(&COMMAND, 1);
    let number = bench.number;
    bench.run(20, true);
    let first = bench.replies.last().copied().expect("an answer");
    // The answer was lost: the request is repeated.
    bench.number = number - 1;
    bench.ask(
        US,
        Ask::Play {
            repeats: 1,
            runs: 5,
            checksum: checksum(COMMAND),
        },
    );
    bench.run(20, true);
    assert_eq!(bench.replies.last(), Some(&first));
    bench.ask(99, Ask::Arm);
    bench.run(20, true);
    assert_eq!(bench.status(), Some((Status::Busy, 0)));
    bench.ask(99, Ask::Hello);
    bench.run(20, true);
    let answer = bench.replies.last().map(|reply| reply.answer);
    let Some(Answer::Info(info)) = answer else {
        panic!("{answer:?}");
    };
    assert_eq!((info.phase, info.period_us), (Phase::Playing, 1000));
    // The first host is gone; the second can connect after the timeout.
    bench.run(600, false);
    bench.ask(99, Ask::Arm);
    bench.run(20, false);
    assert_eq!(bench.status(), Some((Status::Done, 0)));
}

#[test]
fn the_law_is_shown_with_reference_model_and_residual() {
    let mut bench = Bench::new();
    bench.ask(US, Ask::Stream);
    bench.ask(US, Ask::Arm);
    bench.run(1000, true);
    assert_eq!(bench.status(), Some((Status::Done, 0)));
    let laws: Vec<_> = bench.samples.iter().filter_map(|(_, s, _)| s.law).collect();
    assert!(laws.len() > 950);
    // The readings are 800 to 806 counts, independent of the model.
    for ((_, sample, _), law) in bench.samples.iter().rev().zip(laws.iter().rev()) {
        let y = f32::from(sample.counts);
        assert!((y - law.model - law.residual).abs() <= 2.0 / wire::samples::STEPS);
    }
    assert!(laws.iter().any(|law| law.model > 900.0));
    // The host disconnects; the law does not need it.
    bench.run(1000, false);
    assert_eq!(bench.controller.mode(), Mode::Armed);
}

/// The line returns to the operator after the host is gone.
#[test]
fn the_line_is_the_operators_again_after_frames() {
    let mut bench = Bench::new();
    bench.say(b"status\n");
    bench.run(20, false);
    assert!(bench.text.starts_with(b"disarmed"));
    bench.play(&COMMAND, 1);
    bench.run(300, true);
    bench.run(700, false);
    assert!(
        bench.text.windows(2).any(|w| w == b"t "),
        "{:?}",
        bench.text
    );
    bench.say(b"status\n");
    bench.text.clear();
    bench.run(20, false);
    assert!(bench.text.starts_with(b"disarmed"), "{:?}", bench.text);
}

/// A silent host is lost after half a second, or after ten samples if that is longer, at any period.
#[test]
fn a_dead_host_is_lost_after_a_time_and_not_after_samples() {
    for (period_us, samples) in [(200, 2500), (1000, 500), (10_000, 50), (100_000, 10)] {
        let mut bench = Bench::every(period_us);
        bench.line = 1 << 10;
        bench.play(&[0, 100_000, 10], 1);
        bench.run(samples - 1, false);
        assert!(bench.controller.is_open(), "{period_us}");
        bench.run(1, false);
        let mode = bench.controller.mode();
        assert_eq!(mode, Mode::Faulted(Fault::Link), "{period_us}");
    }
}

/// Every streamed sample is sent within a tenth of a second.
#[test]
fn no_sample_of_the_stream_waits_longer_than_a_tenth_of_a_second() {
    for (period_us, waiting) in [
        (200, 24),
        (1000, 24),
        (10_000, 10),
        (50_000, 2),
        (100_000, 1),
    ] {
        let mut bench = Bench::every(period_us);
        bench.line = 1 << 10;
        bench.play(&[0, 100, 10], 1);
        let mut most = 0;
        for k in 1..100 {
            if k % 5 == 0 {
                bench.ask(US, Ask::Alive);
            }
            bench.run(1, false);
            most = most.max(k - bench.samples.len());
        }
        // The frame is sent with its last sample.
        assert_eq!(most, waiting - 1, "{period_us}");
    }
}

/// For any input on the line the valve opens only if the law is armed or a command is played, and the loop
/// continues.
#[test]
fn garbage_opens_no_valve() {
    let mut bench = Bench::new();
    let mut seed = 3_u32;
    for k in 0..60_000_u32 {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        // Every second interval has no zero bytes, like the input that an operator types.
        let byte = (seed >> 24) as u8;
        if (k / 1000) % 3 > 0 {
            bench.say(&[if (k / 1000) % 3 == 1 { byte | 1 } else { byte }]);
        }
        bench.sample(800.0 + (k % 5) as f32);
        assert!(!bench.controller.is_open());
    }
    assert_eq!(bench.controller.mode(), Mode::Disarmed);
    bench.run(600, false);
    bench.play(&COMMAND, 1);
    bench.run(300, true);
    assert_eq!(bench.samples.len(), 255);
}
