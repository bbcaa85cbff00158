//! The desk: the operator's lines and the host's frames on one serial line.
//!
//! A byte 0 begins a frame. While frames arrive, operator's lines are ignored except `disarm`, which is always
//! executed. After the link's timeout without frames, operator's lines are accepted again.
//!
//! The loop never waits for the line: output goes into an [`Outbox`], completely or not at all, and a sample that
//! does not fit is counted.

use crate::console::{Command, Console, Operator};
use crate::controller::{Controller, Tick};
use crate::law::Law;
use crate::link::service::{Board, Service};
use wire::Outbox;
use wire::frame::Receiver;
use wire::request::Request;

/// The loop's interface to operator and host.
#[derive(Clone, Debug)]
pub struct Desk {
    operator: Operator,
    /// Detects the operator's `disarm` among frames.
    emergency: Console,
    receiver: Receiver,
    /// Samples since the last byte of a frame; after the link's timeout the line is the operator's.
    since_frames: u32,
    service: Service,
}

impl Desk {
    /// Initial state without a host.
    #[must_use]
    pub fn new(board: Board) -> Self {
        let service = Service::new(board);
        Self {
            operator: Operator::new(board.period_us),
            emergency: Console::new(),
            receiver: Receiver::new(),
            since_frames: service.lost_after(),
            service,
        }
    }

    /// Before a sample: sets the valve position of the command being played.
    #[inline]
    pub fn before<L: Law>(&mut self, controller: &mut Controller<L>, outbox: &mut Outbox) {
        self.service.before(controller, outbox);
    }

    /// After a sample: streams it, and checks whether the host is still connected.
    pub fn after<L: Law>(
        &mut self,
        tick: &Tick,
        controller: &mut Controller<L>,
        outbox: &mut Outbox,
    ) {
        self.service.after(tick, controller, outbox);
        if self.frames_come() {
            self.since_frames += 1;
        } else if let Some(line) = self.operator.report(controller) {
            // Without room the line is dropped: it would be outdated later.
            let _ = outbox.offer(line.bytes());
        }
    }

    /// Whether the line currently carries frames.
    #[must_use]
    pub fn frames_come(&self) -> bool {
        self.since_frames < self.service.lost_after()
    }

    /// Takes a byte from the line.
    #[inline(never)]
    pub fn receive<L: Law>(
        &mut self,
        byte: u8,
        controller: &mut Controller<L>,
        outbox: &mut Outbox,
    ) {
        if byte != 0 && !self.frames_come() {
            if let Some(line) = self.operator.receive(byte, controller) {
                let _ = outbox.offer(line.bytes());
            }
            return;
        }
        self.since_frames = 0;
        if self.emergency.receive(byte) == Some(Command::Disarm) {
            self.service.disarm(controller, outbox);
        }
        match self.receiver.receive(byte) {
            Some(Ok(content)) => {
                let request = Request::read(content);
                let reply = request.and_then(|r| self.service.serve(&r, controller, outbox));
                if let Some(reply) = reply {
                    // If there is no room, the host asks again.
                    let _ = outbox.offer(reply.frame().bytes());
                }
            }
            Some(Err(_)) => self.service.damaged(),
            None => {}
        }
    }
}
