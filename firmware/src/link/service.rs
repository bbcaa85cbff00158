//! The board's services for a host: it plays commands and streams samples.
//!
//! One host at a time controls the board. If no frame arrives for the link's timeout, a command being played ends: the
//! valve closes and [`Fault::Link`] is latched. An armed law continues without the host.

use crate::controller::{Controller, Mode, Tick};
use crate::fault::Fault;
use crate::law::{Change, Law, Unchanged};
use crate::player::{Player, RUNS, Refusal};
use crate::sensor::Calibration;
use model_core::self_test::Crc32;
use wire::Outbox;
use wire::reply::{Answer, Info, PROTOCOL, Phase, Reply, Scale, Status, lost_after_samples};
use wire::request::{Ask, Request};
use wire::samples::{self, Batch, FULL, Sample};

/// Longest waiting time of a sample before its frame is sent, ms.
const STREAMED_MS: u32 = 100;

/// Properties of the board, for [`Info`].
#[derive(Clone, Copy, Debug)]
pub struct Board {
    /// Sample period, µs.
    pub period_us: u32,
    /// Checksum of the model's constants.
    pub model: u32,
}

/// The connected host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Session {
    name: u32,
    /// Samples since the host's last message.
    silent: u32,
    /// The last executed request, with its result.
    answered: Option<(u16, Done)>,
    streams: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Done {
    status: Status,
    detail: u32,
    samples: u64,
}

/// The board's side of the protocol.
#[derive(Clone, Debug)]
pub struct Service {
    board: Board,
    /// Samples after which a silent host counts as lost.
    lost_after: u32,
    /// Samples per frame of the stream: the largest number, limited to a tenth of a second.
    streamed: usize,
    session: Option<Session>,
    player: Player,
    batch: Batch,
    /// Samples for which the valve has been closed, saturating.
    shut: u32,
    damaged: u32,
}

impl Service {
    /// Initial state without a host.
    #[must_use]
    pub fn new(board: Board) -> Self {
        Self {
            board,
            lost_after: lost_after_samples(board.period_us),
            streamed: (STREAMED_MS * 1000 / board.period_us.max(1)).max(1) as usize,
            session: None,
            player: Player::new(),
            batch: Batch::new(),
            shut: u32::MAX,
            damaged: 0,
        }
    }

    /// Samples after which a silent host counts as lost.
    #[must_use]
    pub fn lost_after(&self) -> u32 {
        self.lost_after
    }

    /// Counts a damaged frame.
    pub fn damaged(&mut self) {
        self.damaged = self.damaged.wrapping_add(1);
    }

    /// Before a sample: sets the valve position of the command being played.
    #[inline]
    pub fn before<L: Law>(&mut self, controller: &mut Controller<L>, outbox: &mut Outbox) {
        if controller.mode() == Mode::Playing {
            match self.player.level() {
                Some(open) => controller.demand(open),
                None => self.disarm(controller, outbox),
            }
        }
    }

    /// After a sample: streams it, and checks whether the host is still connected.
    #[inline]
    pub fn after<L: Law>(
        &mut self,
        tick: &Tick,
        controller: &mut Controller<L>,
        outbox: &mut Outbox,
    ) {
        self.shut = if tick.open {
            0
        } else {
            self.shut.saturating_add(1)
        };
        let Some(session) = &mut self.session else {
            return;
        };
        session.silent += 1;
        if session.silent >= self.lost_after {
            self.session = None;
            if tick.mode == Mode::Playing {
                controller.latch(Fault::Link);
            }
        } else if session.streams {
            self.stream(tick, controller, outbox);
        }
    }

    #[inline(never)]
    fn stream<L: Law>(&mut self, tick: &Tick, controller: &Controller<L>, outbox: &mut Outbox) {
        // During the rest before a command no sample counts.
        if tick.mode == Mode::Playing && self.player.waits() {
            return;
        }
        let calibration = &controller.settings().calibration;
        let law = matches!(tick.mode, Mode::Armed | Mode::Paused).then(|| samples::Law {
            model: calibration.counts(tick.predicted),
            residual: tick.residual / calibration.per_count,
        });
        let sample = Sample {
            counts: twelve_bits(tick.reading.counts),
            channel: twelve_bits(tick.reading.channel),
            open: tick.open,
            law,
        };
        let phase = phase(tick.mode);
        if !self.batch.takes(&sample, phase) {
            self.batch.end(false, |bytes| outbox.offer(bytes));
        }
        self.batch.push(&sample, phase, controller.reference());
        if let Mode::Faulted(_) = tick.mode {
            // A closed valve is reported immediately.
            self.end_stream(phase, outbox);
        } else if self.batch.is_full() || self.batch.count() >= self.streamed {
            self.batch.end(false, |bytes| outbox.offer(bytes));
        }
    }

    /// Sends the remaining samples, marked as the last.
    #[inline(never)]
    fn end_stream(&mut self, phase: Phase, outbox: &mut Outbox) {
        if let Some(session) = &mut self.session
            && core::mem::take(&mut session.streams)
        {
            self.batch.end(false, |bytes| outbox.offer(bytes));
            self.batch.note(phase);
            self.batch.end(true, |bytes| outbox.offer(bytes));
        }
    }

    /// Closes the valve; ends a command being played and its stream.
    #[inline(never)]
    pub fn disarm<L: Law>(&mut self, controller: &mut Controller<L>, outbox: &mut Outbox) {
        let played = controller.mode() == Mode::Playing;
        controller.disarm();
        if played {
            self.end_stream(phase(controller.mode()), outbox);
        }
    }

    /// Executes a request; returns the answer, if any.
    #[inline(never)]
    pub fn serve<L: Law>(
        &mut self,
        request: &Request<'_>,
        controller: &mut Controller<L>,
        outbox: &mut Outbox,
    ) -> Option<Reply> {
        let ours = self.session.as_mut().filter(|s| s.name == request.session);
        let known = ours.is_some();
        let before = ours.and_then(|session| {
            session.silent = 0;
            session.answered
        });
        let done = match request.ask {
            Ask::Hello => {
                return Some(Reply {
                    number: request.number,
                    session: request.session,
                    answer: Answer::Info(self.info(controller)),
                });
            }
            Ask::Settings => {
                return Some(Reply {
                    number: request.number,
                    session: request.session,
                    answer: Answer::Settings(controller.law_settings()),
                });
            }
            Ask::Alive => return None,
            // Any host may disarm.
            Ask::Load { .. }
            | Ask::Play { .. }
            | Ask::Stream
            | Ask::Arm
            | Ask::Target(_)
            | Ask::Air(_)
            | Ask::Pause
                if self.session.is_some() && !known =>
            {
                Done {
                    status: Status::Busy,
                    detail: 0,
                    samples: controller.samples(),
                }
            }
            _ => match before {
                Some((number, done)) if number == request.number => done,
                _ => self.carry_out(request, controller, outbox),
            },
        };
        Some(Reply {
            number: request.number,
            session: request.session,
            answer: Answer::Done {
                status: done.status,
                detail: done.detail,
                samples: done.samples,
            },
        })
    }

    #[inline(never)]
    fn carry_out<L: Law>(
        &mut self,
        request: &Request<'_>,
        controller: &mut Controller<L>,
        outbox: &mut Outbox,
    ) -> Done {
        let result = match request.ask {
            Ask::Hello | Ask::Alive | Ask::Settings => Ok(()),
            // A command must not change while it is played.
            Ask::Load { .. } if controller.mode() == Mode::Playing => not_disarmed(controller),
            Ask::Load { at, runs } => self.player.load(at, runs.iter()),
            Ask::Play {
                repeats,
                runs,
                checksum,
            } => self.play((repeats, runs, checksum), controller),
            Ask::Stream | Ask::Arm if controller.mode() == Mode::Playing => {
                not_disarmed(controller)
            }
            Ask::Stream => Ok(()),
            // The valve has been shut by the pause; it has to stay shut for its shortest time.
            Ask::Arm
                if controller.mode() == Mode::Paused
                    && self.shut < controller.settings().hold.of(false) =>
            {
                Err((Status::Pending, 0))
            }
            Ask::Target(target) => changed(controller.change(Change::Target(target))),
            Ask::Air(per_mille) => changed(controller.change(Change::Air(per_mille))),
            Ask::Pause if controller.pause() => Ok(()),
            Ask::Pause => changed(Err(Unchanged::NotRunning)),
            Ask::Arm => {
                controller.arm();
                if controller.mode() == Mode::Armed {
                    Ok(())
                } else {
                    not_disarmed(controller)
                }
            }
            Ask::Disarm => {
                self.disarm(controller, outbox);
                Ok(())
            }
        };
        let (status, detail) = result.err().unwrap_or((Status::Done, 0));
        let done = Done {
            status,
            detail,
            samples: controller.samples(),
        };
        let session = match &mut self.session {
            // The request is a disarm by another host.
            Some(session) if session.name != request.session => return done,
            Some(session) => session,
            none => none.insert(Session {
                name: request.session,
                silent: 0,
                answered: None,
                streams: false,
            }),
        };
        session.answered = Some((request.number, done));
        if status == Status::Done && matches!(request.ask, Ask::Play { .. } | Ask::Stream) {
            session.streams = true;
            self.batch.start(request.session);
        }
        done
    }

    fn play<L: Law>(
        &mut self,
        (repeats, runs, checksum): (u32, u16, u32),
        controller: &mut Controller<L>,
    ) -> Result<(), Refusal> {
        if controller.mode() != Mode::Disarmed {
            return not_disarmed(controller);
        }
        let hold = controller.settings().hold;
        self.player
            .start(repeats, runs, checksum, &hold, self.shut)?;
        controller.play();
        Ok(())
    }

    #[inline(never)]
    fn info<L: Law>(&self, controller: &Controller<L>) -> Info {
        let settings = controller.settings();
        let scale = |calibration: &Calibration| Scale {
            zero: calibration.zero,
            per_count: calibration.per_count,
        };
        let channel = settings.channel.as_ref();
        let mut info = Info {
            protocol: PROTOCOL,
            version: VERSION,
            period_us: self.board.period_us,
            model: self.board.model,
            rig: 0,
            sensor: scale(&settings.calibration),
            rails: [settings.range.lower_rail, settings.range.upper_rail],
            stuck_after: settings.range.stuck_after,
            envelope: settings.residual_envelope,
            hold: [settings.hold.of(true), settings.hold.of(false)],
            channel: channel.map_or(Scale::default(), |c| scale(&c.calibration)),
            phase: phase(controller.mode()),
            samples: controller.samples(),
            most_runs: RUNS as u16,
            damaged: self.damaged,
            session: self.session.map_or(0, |session| session.name),
        };
        info.rig = rig_checksum(&info);
        info
    }
}

fn changed(result: Result<(), Unchanged>) -> Result<(), Refusal> {
    result.map_err(|why| {
        let status = match why {
            Unchanged::Outside => Status::Outside,
            Unchanged::Pending => Status::Pending,
            Unchanged::NoSetting => Status::NoSetting,
            Unchanged::NotRunning => Status::NotRunning,
        };
        (status, 0)
    })
}

fn not_disarmed<L: Law>(controller: &Controller<L>) -> Result<(), Refusal> {
    Err((
        Status::NotDisarmed,
        phase(controller.mode()).to_byte().into(),
    ))
}

/// Checksum of the rig's constants.
fn rig_checksum(info: &Info) -> u32 {
    [
        info.sensor.zero.to_bits(),
        info.sensor.per_count.to_bits(),
        info.rails[0].to_bits(),
        info.rails[1].to_bits(),
        info.stuck_after,
        info.envelope.to_bits(),
        info.hold[0],
        info.hold[1],
        info.channel.zero.to_bits(),
        info.channel.per_count.to_bits(),
    ]
    .into_iter()
    .fold(Crc32::new(), Crc32::word)
    .value()
}

/// The package's version.
const VERSION: [u8; 3] = [
    number(env!("CARGO_PKG_VERSION_MAJOR")),
    number(env!("CARGO_PKG_VERSION_MINOR")),
    number(env!("CARGO_PKG_VERSION_PATCH")),
];

const fn number(text: &str) -> u8 {
    let mut bytes = text.as_bytes();
    let mut value = 0_u8;
    while let [digit, rest @ ..] = bytes {
        value = value.wrapping_mul(10).wrapping_add(*digit - b'0');
        bytes = rest;
    }
    value
}

/// The mode in wire format.
fn phase(mode: Mode) -> Phase {
    match mode {
        Mode::Disarmed => Phase::Disarmed,
        Mode::Armed => Phase::Armed,
        Mode::Playing => Phase::Playing,
        Mode::Paused => Phase::Paused,
        Mode::Faulted(fault) => {
            let number = Fault::ALL.iter().position(|f| *f == fault);
            Phase::Faulted(number.map_or(0x7F, |n| n as u8))
        }
    }
}

/// A reading in converter counts; a non-finite one becomes full scale.
fn twelve_bits(counts: f32) -> u16 {
    if counts.is_finite() {
        // Negative values saturate at 0.
        (counts as u16).min(FULL)
    } else {
        FULL
    }
}

#[cfg(test)]
mod tests;
