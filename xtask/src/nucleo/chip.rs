//! The parts of the Nucleo's F446 that QEMU's STM32F405 lacks, register by register: clock tree, pins, flash's wait
//! states, watchdog, and a converter that a timer starts. They behave as the reference manual (RM0390) states, as
//! far as the program uses them.

use std::collections::BTreeMap;

/// Where the peripherals are (RM0390, 2.2.2).
pub(super) const TIM2: u32 = 0x4000_0000;
pub(super) const IWDG: u32 = 0x4000_3000;
pub(super) const USART2: u32 = 0x4000_4400;
pub(super) const ADC1: u32 = 0x4001_2000;
pub(super) const GPIOA: u32 = 0x4002_0000;
pub(super) const GPIOB: u32 = 0x4002_0400;
pub(super) const GPIOC: u32 = 0x4002_0800;
pub(super) const RCC: u32 = 0x4002_3800;
pub(super) const FLASH: u32 = 0x4002_3C00;

/// Register and bit of RCC that give a peripheral its clock.
type Clock = (u32, u32);

/// Each peripheral with its address, its length in bytes and its clock; a peripheral without an entry for the clock
/// always has one.
pub(super) const BLOCKS: [(&str, u32, u32, Option<Clock>); 9] = [
    ("TIM2", TIM2, 0x54, Some((RCC + 0x40, 0))),
    ("IWDG", IWDG, 0x10, None),
    ("USART2", USART2, 0x1C, Some((RCC + 0x40, 17))),
    ("ADC1", ADC1, 0x50, Some((RCC + 0x44, 8))),
    ("GPIOA", GPIOA, 0x28, Some((RCC + 0x30, 0))),
    ("GPIOB", GPIOB, 0x28, Some((RCC + 0x30, 1))),
    ("GPIOC", GPIOC, 0x28, Some((RCC + 0x30, 2))),
    ("RCC", RCC, 0x98, None),
    ("FLASH", FLASH, 0x1C, None),
];
/// The converters' common control register has a separate address.
pub(super) const ADC_CCR: u32 = ADC1 + 0x304;
/// Registers of RCC that are also written bit by bit, through their alias.
const BIT_BANDED: [u32; 6] = [0x10, 0x20, 0x24, 0x30, 0x40, 0x44];

pub(super) const RCC_CR: u32 = RCC;
pub(super) const RCC_PLLCFGR: u32 = RCC + 0x04;
pub(super) const RCC_CFGR: u32 = RCC + 0x08;
const RCC_CSR: u32 = RCC + 0x74;
const ADC_SR: u32 = ADC1;
const ADC_DR: u32 = ADC1 + 0x4C;
const ADC_JDR1: u32 = ADC1 + 0x3C;
const IWDG_KR: u32 = IWDG;

/// Bits of the converter's status register.
const EOC: u32 = 1 << 1;
const JEOC: u32 = 1 << 2;
const OVR: u32 = 1 << 5;

/// A write of one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Written {
    pub(super) address: u32,
    pub(super) value: u32,
}

/// The registers, the writes to them, and errors in these writes.
pub(super) struct Chip {
    values: BTreeMap<u32, u32>,
    pub(super) written: Vec<Written>,
    /// Accesses to peripherals without a clock.
    pub(super) unclocked: Vec<String>,
    /// Number of watchdog feeds.
    pub(super) fed: u32,
    /// The blue button.
    pub(super) pressed: bool,
}

impl Chip {
    /// State after power-on (RM0390: reset values).
    pub(super) fn after_reset() -> Self {
        let values = [
            (RCC_CR, 0x0000_0083),
            (RCC_PLLCFGR, 0x2400_3010),
            (RCC_CSR, 0x0E00_0000),
            (RCC + 0x30, 0x0000_0000),
            (GPIOA, 0xA800_0000),
            (GPIOA + 0x08, 0x0C00_0000),
            (GPIOA + 0x0C, 0x6400_0000),
            (GPIOB, 0x0000_0280),
            (GPIOB + 0x08, 0x0000_00C0),
            (GPIOB + 0x0C, 0x0000_0100),
            (IWDG + 0x08, 0x0000_0FFF),
            (TIM2 + 0x2C, 0xFFFF_FFFF),
        ];
        Self {
            values: values.into_iter().collect(),
            written: Vec::new(),
            unclocked: Vec::new(),
            fed: 0,
            pressed: false,
        }
    }

    /// Every watched word.
    pub(super) fn words() -> Vec<u32> {
        let whole = BLOCKS
            .iter()
            .flat_map(|(_, base, length, _)| (*base..base + length).step_by(4));
        let bits = BIT_BANDED
            .iter()
            .flat_map(|register| (0..32).map(move |bit| alias(RCC + register) + 4 * bit));
        // Status and data of the serial line are handled by QEMU and read constantly.
        let whole = whole.filter(|word| ![USART2, USART2 + 4].contains(word));
        whole.chain([ADC_CCR]).chain(bits).collect()
    }

    /// Whether QEMU implements the peripheral and only its set-up is checked.
    pub(super) fn is_qemus(address: u32) -> bool {
        (USART2..USART2 + 0x1C).contains(&address)
    }

    /// A register's value, without side effects.
    pub(super) fn value(&self, address: u32) -> u32 {
        let stored = self.values.get(&address).copied().unwrap_or(0);
        match address {
            // Clocks are ready as soon as they are enabled.
            RCC_CR => {
                stored & !(1 << 17 | 1 << 25) | (stored >> 16 & 1) << 17 | (stored >> 24 & 1) << 25
            }
            RCC_CFGR => stored & !0b1100 | (stored & 0b11) << 2,
            // Output pins read their own level; others are pulled up.
            _ if [GPIOA, GPIOB, GPIOC].contains(&(address - 0x10)) => self.inputs(address - 0x10),
            _ => stored,
        }
    }

    fn inputs(&self, port: u32) -> u32 {
        let (mode, driven) = (self.value(port), self.value(port + 0x14));
        let outputs: u32 = (0..16)
            .filter(|pin| mode >> (2 * pin) & 3 == 1)
            .map(|pin| 1 << pin)
            .sum();
        let button = if port == GPIOC && self.pressed {
            1 << 13
        } else {
            0
        };
        driven & outputs | 0xFFFF & !outputs & !button
    }

    /// A read by the program.
    pub(super) fn read(&mut self, address: u32) -> u32 {
        self.clocked(address, "read");
        let value = self.value(address);
        if address == ADC_DR {
            self.change(ADC_SR, |status| status & !EOC);
        }
        value
    }

    /// A write by the program.
    pub(super) fn write(&mut self, address: u32, value: u32) {
        if let Some((register, bit)) = banded(address) {
            let old = self.value(register);
            let set = old & !(1 << bit) | (value & 1) << bit;
            return self.write(register, set);
        }
        self.clocked(address, "written");
        self.written.push(Written { address, value });
        match address {
            // Writing 0 clears a flag, writing 1 keeps it (RM0390, 13.13.1).
            ADC_SR => self.change(ADC_SR, |status| status & value),
            // Bits 24 to 31: reason of the last restart; RMVF clears it.
            RCC_CSR if value & 1 << 24 != 0 => self.set(RCC_CSR, value & 0xFF_FFFF),
            IWDG_KR => self.fed += u32::from(value & 0xFFFF == 0xAAAA),
            // Set and reset of single pins (RM0390, 7.4.7).
            _ if [GPIOA, GPIOB, GPIOC].contains(&address.wrapping_sub(0x18)) => {
                self.change(address - 4, |out| out & !(value >> 16) | value & 0xFFFF);
            }
            _ => self.set(address, value),
        }
    }

    fn set(&mut self, address: u32, value: u32) {
        self.values.insert(address, value);
    }

    fn change(&mut self, address: u32, change: impl FnOnce(u32) -> u32) {
        let value = self.value(address);
        self.set(address, change(value));
    }

    /// Completes a conversion started by the timer: counts of both channels. Returns `false` if the converter
    /// is not set up.
    pub(super) fn convert(&mut self, counts: [u16; 2]) -> bool {
        let timer = self.value(TIM2) & 1 == 1;
        // The conversion must be enabled and triggered by TIM2's update (RM0390, 13.13.3).
        let triggered =
            self.value(ADC1 + 0x08) & (3 << 28 | 0xF << 24 | 1) == 1 << 28 | 6 << 24 | 1;
        if !timer || !triggered {
            return false;
        }
        let unread = self.value(ADC_SR) & EOC != 0;
        let lost = if unread { OVR } else { 0 };
        self.change(ADC_SR, |status| status | EOC | JEOC | lost);
        let [reading, channel] = counts.map(u32::from);
        if !unread {
            self.set(ADC_DR, reading);
        }
        self.set(ADC_JDR1, channel);
        true
    }

    /// A register without its clock reads 0 and ignores writes; such accesses are errors of the program.
    fn clocked(&mut self, address: u32, done: &str) {
        let block = BLOCKS
            .iter()
            .find(|(_, base, length, _)| (*base..base + length).contains(&address));
        let Some((name, base, _, Some((enable, bit)))) = block else {
            return;
        };
        if self.value(*enable) >> bit & 1 == 0 {
            self.unclocked
                .push(format!("{name} + {:#x} is {done}", address - base));
        }
    }
}

/// Bit-band alias of bit 0 of a register (RM0390, 2.2.3).
fn alias(register: u32) -> u32 {
    0x4200_0000 + (register - 0x4000_0000) * 32
}

/// Register and bit of a bit-band alias.
fn banded(address: u32) -> Option<(u32, u32)> {
    let offset = address.checked_sub(0x4200_0000)?;
    Some((0x4000_0000 + offset / 128 * 4, offset / 4 % 32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_reach_their_register_and_clocks_come_first() {
        let mut chip = Chip::after_reset();
        chip.write(GPIOB + 0x18, 1 << 10);
        assert_eq!(chip.unclocked, ["GPIOB + 0x18 is written"]);
        chip.write(alias(RCC + 0x30) + 4, 1);
        assert_eq!(chip.value(RCC + 0x30), 0b10);
        chip.write(GPIOB + 0x18, 1 << 10);
        assert_eq!(
            (chip.value(GPIOB + 0x14), chip.unclocked.len()),
            (1 << 10, 1)
        );
        chip.write(GPIOB + 0x18, 1 << 26);
        assert_eq!(chip.value(GPIOB + 0x14), 0);
    }

    #[test]
    fn the_converter_converts_when_the_timer_says_so_and_notices_what_was_not_read() {
        let mut chip = Chip::after_reset();
        chip.write(RCC + 0x40, 1);
        chip.write(RCC + 0x44, 1 << 8);
        assert!(!chip.convert([1, 2]));
        chip.write(ADC1 + 0x08, 1 << 28 | 6 << 24 | 1);
        chip.write(TIM2, 1);
        assert!(chip.convert([700, 800]));
        assert_eq!((chip.read(ADC_DR), chip.read(ADC_JDR1)), (700, 800));
        assert_eq!(chip.read(ADC_SR), JEOC);
        chip.write(ADC_SR, !JEOC);
        assert_eq!(chip.read(ADC_SR), 0);
        chip.convert([1, 2]);
        chip.convert([3, 4]);
        assert_eq!(chip.read(ADC_SR) & OVR, OVR);
        assert_eq!(chip.read(ADC_DR), 1);
    }
}
