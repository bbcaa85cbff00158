//! The desk: the operator's lines and the host's frames on one serial line.
//!
//! A byte 0 begins frames; while they come, of the operator's lines only
//! `disarm` counts, and it always does. When they have stopped for the link's
//! time the line is the operator's again.
//!
//! The loop never waits for any of it: what is to be sent goes into an
//! [`Outbox`], whole or not at all, and a sample that found no room is counted.

use crate::console::{Command, Console, Operator};
use crate::controller::{Controller, Tick};
use crate::law::Law;
use crate::link::service::{Board, Service};
use wire::Outbox;
use wire::frame::Receiver;
use wire::request::Request;

/// Operator's and host's end of the loop.
#[derive(Clone, Debug)]
pub struct Desk {
    operator: Operator,
    /// Sees the operator's `disarm` among frames.
    emergency: Console,
    receiver: Receiver,
    /// Samples since the last byte of frames; at the link's time there are none.
    since_frames: u32,
    service: Service,
}

impl Desk {
    /// Nobody there.
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

    /// Before a sample: where the command that is played wants the valve.
    #[inline]
    pub fn before<L: Law>(&mut self, controller: &mut Controller<L>, outbox: &mut Outbox) {
        self.service.before(controller, outbox);
    }

    /// After a sample, before what has been received meanwhile: streams it, and looks whether the host is still there.
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
            // What finds no room is of the past by the time there is some.
            let _ = outbox.offer(line.bytes());
        }
    }

    /// Whether the line speaks frames now.
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
                    // An answer that finds no room is asked for again.
                    let _ = outbox.offer(reply.frame().bytes());
                }
            }
            Some(Err(_)) => self.service.damaged(),
            None => {}
        }
    }
}
