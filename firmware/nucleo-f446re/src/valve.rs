//! The valve's pin, PB10, low from the first instruction that touches it.

use stm32f4xx_hal::gpio::{Output, PB10, PinState, PushPull};
use stm32f4xx_hal::pac::GPIOB;

/// High opens the valves. At reset the pin floats, and the driver's pull-down keeps them closed.
pub type Valve = PB10<Output<PushPull>>;

/// Sets the pin low, then makes it an output.
#[must_use]
pub fn shut(pin: PB10) -> Valve {
    pin.into_push_pull_output_in_state(PinState::Low)
}

/// Closes the valves from an exception, whoever owns the pin; the watchdog then restarts the board.
pub fn emergency() {
    // SAFETY: one write that clears one pin and leaves the others.
    unsafe { (*GPIOB::ptr()).bsrr().write(|w| w.br10().set_bit()) };
}
