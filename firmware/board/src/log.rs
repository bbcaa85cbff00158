//! Output of `defmt` frames: to the probe (RTT) or to QEMU (semihosting).
//!
//! The usual transports panic on misuse, and panics must not be linked here. No call waits: a frame that does not
//! fit is dropped as a whole.

#[cfg(all(feature = "rtt", feature = "semihosting"))]
compile_error!("logs go to one place: choose `rtt` or `semihosting`");

#[cfg_attr(feature = "semihosting", path = "log/semihosting.rs")]
#[cfg_attr(feature = "rtt", path = "log/rtt.rs")]
mod transport;

use core::cell::UnsafeCell;

#[defmt::global_logger]
struct Logger;

struct Frames {
    encoder: UnsafeCell<defmt::Encoder>,
    restore: UnsafeCell<critical_section::RestoreState>,
}

// SAFETY: the data are used only between `acquire` and `release`, which is a critical section on a
// single core.
unsafe impl Sync for Frames {}

static FRAMES: Frames = Frames {
    encoder: UnsafeCell::new(defmt::Encoder::new()),
    restore: UnsafeCell::new(critical_section::RestoreState::invalid()),
};

// SAFETY: a frame is complete before another begins, see `Frames`.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        // SAFETY: the section is released in `release`, which defmt calls after each `acquire`.
        unsafe {
            FRAMES.restore.get().write(critical_section::acquire());
            transport::begin();
            (*FRAMES.encoder.get()).start_frame(transport::write);
        }
    }
    unsafe fn flush() {}
    unsafe fn release() {
        // SAFETY: after `acquire`.
        unsafe {
            (*FRAMES.encoder.get()).end_frame(transport::write);
            transport::end();
            critical_section::release(FRAMES.restore.get().read());
        }
    }
    unsafe fn write(bytes: &[u8]) {
        // SAFETY: after `acquire`.
        unsafe { (*FRAMES.encoder.get()).write(bytes, transport::write) };
    }
}
