//! The clock tree: 84 MHz from the ST-LINK's 8 MHz crystal.
//!
//! Written register by register: the HAL searches the divisors at run time and panics if it finds none, and a panic
//! must not be linked here.

use stm32f4xx_hal::pac::{FLASH, RCC};

/// Core, AHB and APB2, and the timers on APB1, Hz.
pub const CORE: u32 = 84_000_000;
/// APB1, Hz.
pub const APB1: u32 = CORE / 2;

/// Divisors of the PLL: 8 MHz / 4 · 168 / 4.
const DIVIDE: u8 = 4;
const MULTIPLY: u16 = 168;

/// Starts crystal and PLL and switches to them. Waits for the crystal; a board without one stays here with
/// its valve closed.
pub fn start(rcc: &RCC, flash: &FLASH) {
    rcc.cr()
        .modify(|_, w| w.hsebyp().set_bit().hseon().set_bit());
    while rcc.cr().read().hserdy().bit_is_clear() {}
    // SAFETY: values from the reference manual (RM0390, 3.4 and 6.3).
    unsafe {
        flash.acr().write(|w| {
            w.latency().bits(2);
            w.prften().set_bit().icen().set_bit().dcen().set_bit()
        });
        rcc.pllcfgr().write(|w| {
            w.pllsrc().hse();
            w.pllm().bits(DIVIDE).plln().bits(MULTIPLY);
            w.pllp().div4().pllq().bits(7).pllr().bits(2)
        });
    }
    rcc.cr().modify(|_, w| w.pllon().set_bit());
    while rcc.cr().read().pllrdy().bit_is_clear() {}
    rcc.cfgr()
        .write(|w| w.ppre1().div2().ppre2().div1().sw().pll());
    while !rcc.cfgr().read().sws().is_pll() {}
}

/// Whether the independent watchdog restarted the board; clears the reset flags.
pub fn restarted_by_watchdog(rcc: &RCC) -> bool {
    let by_watchdog = rcc.csr().read().wdgrstf().bit_is_set();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    by_watchdog
}
