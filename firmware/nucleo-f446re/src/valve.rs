//! The valve's pin, PB10, low from the first instruction that touches it.

use stm32f4xx_hal::gpio::{Output, PB10, PinState, PushPull};
use stm32f4xx_hal::pac::GPIOB;

/// High opens the valves. At reset the pin floats and the driver's pull-down
/// keeps them shut.
pub type Valve = PB10<Output<PushPull>>;

/// Low, then an output.
#[must_use]
pub fn shut(pin: PB10) -> Valve {
    pin.into_push_pull_output_in_state(PinState::Low)
}

/// Shuts the valves whoever holds the pin, for exceptions: then the watchdog
/// restarts the board.
pub fn emergency() {
    // SAFETY: one write that clears one pin and leaves the others.
    unsafe { (*GPIOB::ptr()).bsrr().write(|w| w.br10().set_bit()) };
}
