//! ST's Nucleo-F446RE: drivers for the rig's programs. Pins and levels are in `firmware/WIRING.md`.
#![no_std]

pub mod clocks;
pub mod cycles;
pub mod sampler;
pub mod uart;
pub mod valve;
