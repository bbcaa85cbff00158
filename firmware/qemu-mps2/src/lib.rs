//! Peripherals of QEMU's mps2-an386: a serial line, a clock that counts instructions, and a watchdog.
#![no_std]

pub mod clock;
pub mod uart;
pub mod watchdog;
