//! SEGGER's real-time transfer: a ring in RAM that the probe reads while the
//! program runs.

use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};

const SIZE: u32 = 1024;
/// RTT mode: drop what does not fit, and never wait.
const DROP_WHAT_DOES_NOT_FIT: u32 = 0;

/// The control block that the probe searches for, in its prescribed layout.
#[repr(C)]
struct Control {
    id: [u8; 16],
    channels_up: u32,
    channels_down: u32,
    up: Channel,
}

#[repr(C)]
struct Channel {
    name: &'static [u8; 6],
    buffer: &'static [AtomicU8; SIZE as usize],
    size: u32,
    /// Advanced by the program.
    write: AtomicU32,
    /// Advanced by the probe.
    read: AtomicU32,
    flags: AtomicU32,
}

static BUFFER: [AtomicU8; SIZE as usize] = [const { AtomicU8::new(0) }; SIZE as usize];

// SAFETY: no other symbol has this name; probes find the ring by it.
#[unsafe(no_mangle)]
static _SEGGER_RTT: Control = Control {
    id: *b"SEGGER RTT\0\0\0\0\0\0",
    channels_up: 1,
    channels_down: 0,
    up: Channel {
        name: b"defmt\0",
        buffer: &BUFFER,
        size: SIZE,
        write: AtomicU32::new(0),
        read: AtomicU32::new(0),
        flags: AtomicU32::new(DROP_WHAT_DOES_NOT_FIT),
    },
};

/// Write position within the present frame.
static CURSOR: AtomicU32 = AtomicU32::new(0);
static NO_ROOM: AtomicBool = AtomicBool::new(false);

pub(super) fn begin() {
    let written = _SEGGER_RTT.up.write.load(Ordering::Relaxed);
    CURSOR.store(written, Ordering::Relaxed);
    NO_ROOM.store(false, Ordering::Relaxed);
}

pub(super) fn write(bytes: &[u8]) {
    let read = _SEGGER_RTT.up.read.load(Ordering::Acquire);
    let mut cursor = CURSOR.load(Ordering::Relaxed);
    for byte in bytes {
        let next = (cursor + 1) % SIZE;
        if next == read {
            NO_ROOM.store(true, Ordering::Relaxed);
        }
        if NO_ROOM.load(Ordering::Relaxed) {
            return;
        }
        if let Some(slot) = BUFFER.get(cursor as usize) {
            slot.store(*byte, Ordering::Relaxed);
        }
        cursor = next;
    }
    CURSOR.store(cursor, Ordering::Relaxed);
}

pub(super) fn end() {
    if !NO_ROOM.load(Ordering::Relaxed) {
        let cursor = CURSOR.load(Ordering::Relaxed);
        _SEGGER_RTT.up.write.store(cursor, Ordering::Release);
    }
}
