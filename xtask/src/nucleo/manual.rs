//! Checks of the register set-up after the start against the reference manual (RM0390) and the data sheet
//! (DS10693).

use super::chip::{
    ADC_CCR, ADC1, Chip, FLASH, GPIOA, GPIOB, GPIOC, IWDG, RCC_CFGR, RCC_CR, RCC_PLLCFGR, TIM2,
    USART2, Written,
};
use anyhow::{Context, Result, ensure};

/// The ST-LINK's crystal, Hz.
const CRYSTAL: f64 = 8e6;
/// The bundled model's sample period, s.
const PERIOD: f64 = 0.001;

/// A group of registers: its subject and its check.
type Group = (&'static str, fn(&Chip) -> Result<String>);

const GROUPS: [Group; 8] = [
    ("clock tree", clock_tree),
    ("order of the clock's start", clock_order),
    ("sample timer", timer),
    ("converter", converter),
    ("pins", pins),
    ("valve's pin", valve),
    ("serial line", serial),
    ("watchdog", watchdog),
];

/// Checks all groups; one line each.
pub(super) fn check(chip: &Chip) -> Result<Vec<String>> {
    ensure!(
        chip.unclocked.is_empty(),
        "registers were used while their clock was off: {}",
        chip.unclocked.join(", ")
    );
    GROUPS
        .iter()
        .map(|(name, group)| {
            let said = group(chip).context(*name)?;
            Ok(format!("{name}: {said}"))
        })
        .collect()
}

/// `bits` bits of a register starting at bit `low`.
pub(super) fn field(value: u32, low: u32, bits: u32) -> u32 {
    value >> low & ((1 << bits) - 1)
}

/// Clock frequencies of the core with APB2, and of APB1, Hz.
fn clocks(chip: &Chip) -> [f64; 2] {
    let (pll, buses) = (chip.value(RCC_PLLCFGR), chip.value(RCC_CFGR));
    let [m, n] = [field(pll, 0, 6), field(pll, 6, 9)].map(f64::from);
    let p = f64::from(2 * (field(pll, 16, 2) + 1));
    let core = CRYSTAL / m * n / p;
    // Codes 0xx: the clock is not divided; codes 100 to 111: it is divided by 2 to 16.
    let divisor = |code: u32| {
        if code < 4 {
            1.0
        } else {
            f64::from(2 << (code - 4))
        }
    };
    [
        core / divisor(field(buses, 13, 3)),
        core / divisor(field(buses, 10, 3)),
    ]
}

fn clock_tree(chip: &Chip) -> Result<String> {
    let (pll, buses) = (chip.value(RCC_PLLCFGR), chip.value(RCC_CFGR));
    ensure!(
        field(chip.value(RCC_CR), 16, 4) & 0b101 == 0b101,
        "the crystal oscillator is off, or not in bypass mode"
    );
    ensure!(pll >> 22 & 1 == 1, "the PLL does not use the crystal");
    let input = CRYSTAL / f64::from(field(pll, 0, 6));
    let inside = input * f64::from(field(pll, 6, 9));
    ensure!(
        (1e6..=2e6).contains(&input),
        "the PLL's input is {input} Hz"
    );
    ensure!(
        (100e6..=432e6).contains(&inside),
        "the PLL's oscillator is at {inside} Hz"
    );
    ensure!(
        field(buses, 2, 2) == 2,
        "the core does not run from the PLL"
    );
    ensure!(field(buses, 4, 4) < 8, "AHB is divided");
    let [fast, slow] = clocks(chip);
    ensure!(
        [fast, slow] == [84e6, 42e6],
        "core and APB2 at {fast} Hz, APB1 at {slow} Hz"
    );
    // RM0390, table 5, for 2.7 to 3.6 V: two wait states above 60 and up to 90 MHz.
    let waits = field(chip.value(FLASH), 0, 4);
    ensure!(waits == 2, "{waits} wait states");
    Ok(format!(
        "crystal 8 MHz, PLL input {:.0} MHz, PLL oscillator {:.0} MHz; core {:.0} MHz, APB1 {:.0} MHz; {waits} wait states",
        input / 1e6,
        inside / 1e6,
        fast / 1e6,
        slow / 1e6
    ))
}

/// Position of the first write for which `wanted` is true, among all writes.
fn first(chip: &Chip, what: &str, wanted: impl Fn(&Written) -> bool) -> Result<usize> {
    chip.written
        .iter()
        .position(wanted)
        .with_context(|| format!("{what} was never written"))
}

fn clock_order(chip: &Chip) -> Result<String> {
    let waits = first(chip, "the flash's wait states", |w| {
        w.address == FLASH && w.value & 0xF == 2
    })?;
    let divisors = first(chip, "the PLL's divisors", |w| w.address == RCC_PLLCFGR)?;
    let pll = first(chip, "the PLL", |w| {
        w.address == RCC_CR && w.value >> 24 & 1 == 1
    })?;
    let switch = first(chip, "the switch to the PLL", |w| {
        w.address == RCC_CFGR && w.value & 3 == 2
    })?;
    ensure!(
        divisors < pll,
        "the PLL's divisors were written while it ran"
    );
    ensure!(pll < switch, "the core switched to a PLL that was off");
    ensure!(waits < switch, "the flash was too slow for the new clock");
    Ok("divisors, PLL, wait states, then the switch".into())
}

fn timer(chip: &Chip) -> Result<String> {
    let [core, apb1] = clocks(chip);
    // RM0390, 6.2: timers have twice the divided APB clock.
    let clock = if apb1 < core { 2.0 * apb1 } else { apb1 };
    let counts =
        (f64::from(chip.value(TIM2 + 0x28)) + 1.0) * (f64::from(chip.value(TIM2 + 0x2C)) + 1.0);
    ensure!(
        (counts / clock / PERIOD - 1.0).abs() < 1e-9,
        "a period of {} s",
        counts / clock
    );
    ensure!(
        field(chip.value(TIM2 + 0x04), 4, 3) == 0b010,
        "TRGO is not the timer's update event"
    );
    ensure!(chip.value(TIM2) & 1 == 1, "the timer stands still");
    let reload = first(chip, "TIM2's period", |w| w.address == TIM2 + 0x2C)?;
    let start = first(chip, "TIM2's start", |w| {
        w.address == TIM2 && w.value & 1 == 1
    })?;
    ensure!(reload < start, "the timer ran before its period was set");
    Ok(format!(
        "{counts} counts of {:.0} MHz, TRGO at the update",
        clock / 1e6
    ))
}

fn converter(chip: &Chip) -> Result<String> {
    let [apb2, _] = clocks(chip);
    let clock = apb2 / f64::from(2 * (field(chip.value(ADC_CCR), 16, 2) + 1));
    // DS10693: 0.6 to 36 MHz at 2.4 to 3.6 V.
    ensure!((0.6e6..=36e6).contains(&clock), "a clock of {clock} Hz");
    let [cr1, cr2, times] = [0x04, 0x08, 0x10].map(|offset| chip.value(ADC1 + offset));
    ensure!(field(cr1, 24, 2) == 0, "not 12 bits");
    ensure!(
        cr1 >> 10 & 1 == 1 && cr1 >> 7 & 1 == 1,
        "no automatic injected conversion, or no interrupt at its end"
    );
    ensure!(
        field(cr2, 28, 2) == 1 && field(cr2, 24, 4) == 0b0110,
        "not started by TIM2's TRGO"
    );
    ensure!(cr2 & 1 == 1, "off");
    ensure!(
        field(times, 0, 3) == 7 && field(times, 3, 3) == 7,
        "not 480 cycles of sampling"
    );
    ensure!(
        field(chip.value(ADC1 + 0x2C), 20, 4) == 0 && field(chip.value(ADC1 + 0x34), 0, 5) == 0,
        "not channel 0 alone"
    );
    // With JL = 0 there is one injected conversion, that of JSQ4.
    ensure!(
        field(chip.value(ADC1 + 0x38), 20, 2) == 0 && field(chip.value(ADC1 + 0x38), 15, 5) == 1,
        "not channel 1 after it"
    );
    let both = 2.0 * (480.0 + 12.0) / clock;
    ensure!(both < PERIOD / 2.0, "both take {both} s");
    Ok(format!(
        "{:.0} MHz, PA0 and PA1 in {:.0} µs, started by TIM2, interrupt after the second",
        clock / 1e6,
        both * 1e6
    ))
}

fn pins(chip: &Chip) -> Result<String> {
    let mode = |port: u32, pin: u32| field(chip.value(port), 2 * pin, 2);
    ensure!(
        [0, 1].map(|pin| mode(GPIOA, pin)) == [3, 3],
        "PA0, PA1 are not analogue"
    );
    ensure!(
        [2, 3].map(|pin| mode(GPIOA, pin)) == [2, 2],
        "PA2, PA3 are not assigned to the USART"
    );
    let functions = field(chip.value(GPIOA + 0x20), 8, 8);
    ensure!(functions == 0x77, "PA2, PA3 have functions {functions:#x}");
    ensure!(mode(GPIOA, 5) == 1, "LD2 is no output");
    ensure!(mode(GPIOC, 13) == 0, "B1 is no input");
    // The probe's own pins keep their state.
    ensure!([13, 14].map(|pin| mode(GPIOA, pin)) == [2, 2], "SWD is off");
    Ok("PA0 and PA1 analogue, PA2 and PA3 AF7, PA5 output, PC13 input, SWD unchanged".into())
}

fn valve(chip: &Chip) -> Result<String> {
    ensure!(field(chip.value(GPIOB), 20, 2) == 1, "PB10 is no output");
    ensure!(
        chip.value(GPIOB + 0x04) >> 10 & 1 == 0,
        "PB10 is not push-pull"
    );
    let low = first(chip, "PB10's level", |w| {
        w.address == GPIOB + 0x18 && w.value >> 26 & 1 == 1
    })?;
    let output = first(chip, "PB10's mode", |w| {
        w.address == GPIOB && field(w.value, 20, 2) == 1
    })?;
    ensure!(
        low < output,
        "PB10 became an output before its level was low"
    );
    let clock = first(chip, "the crystal", |w| w.address == RCC_CR)?;
    ensure!(
        output < clock,
        "the program waits for the clock before it closes the valve"
    );
    let raised = chip
        .written
        .iter()
        .any(|w| [GPIOB + 0x14, GPIOB + 0x18].contains(&w.address) && w.value >> 10 & 1 == 1);
    ensure!(!raised, "PB10 was high during the start");
    Ok("PB10 is set low, then made an output, before the program waits for the clock".into())
}

fn serial(chip: &Chip) -> Result<String> {
    let [_, apb1] = clocks(chip);
    let [rate, cr1, cr2, cr3] = [0x08, 0x0C, 0x10, 0x14].map(|offset| chip.value(USART2 + offset));
    // A bit has sixteen samples, and the divisor is in sixteenths, so the register holds the clock
    // cycles of a bit.
    ensure!(cr1 >> 15 & 1 == 0, "eight samples a bit");
    let baud = apb1 / f64::from(rate);
    ensure!((baud / 115_200.0 - 1.0).abs() < 0.01, "{baud} baud");
    // UE, RXNEIE, TE, RE; eight bits, no parity, one stop bit.
    ensure!(
        cr1 & 0x342C == 0x202C && cr1 & 0x1000 == 0,
        "CR1 is {cr1:#x}"
    );
    ensure!(
        field(cr2, 12, 2) == 0 && cr3 == 0,
        "CR2 is {cr2:#x}, CR3 {cr3:#x}"
    );
    Ok(format!(
        "{baud:.0} baud ({:+.2} %), 8N1, interrupt of the receiver",
        100.0 * (baud / 115_200.0 - 1.0)
    ))
}

fn watchdog(chip: &Chip) -> Result<String> {
    let start = first(chip, "the watchdog's start", |w| {
        w.address == IWDG && w.value == 0xCCCC
    });
    start?;
    first(chip, "the watchdog's key", |w| {
        w.address == IWDG && w.value == 0x5555
    })?;
    let cycles =
        f64::from(4 << chip.value(IWDG + 0x04)) * (f64::from(chip.value(IWDG + 0x08)) + 1.0);
    // DS10693: the watchdog's clock is 17 to 47 kHz.
    let [least, most] = [47e3, 17e3].map(|clock| cycles / clock);
    ensure!(
        least > 2.0 * PERIOD && most < 0.1,
        "the watchdog restarts the board after {least} to {most} s"
    );
    Ok(format!(
        "restart after {:.0} to {:.0} ms, within the tolerance of the watchdog's clock",
        1e3 * least,
        1e3 * most
    ))
}
