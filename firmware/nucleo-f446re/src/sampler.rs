//! The sensor on PA0 and the measured channel on PA1. TIM2 starts a conversion of the sensor every sample period,
//! and the converter then converts the channel. Its interrupt stores the readings and counts the period.

use crate::clocks::CORE;
use core::sync::atomic::{AtomicU32, Ordering};
use firmware::rig::{Clock, Sensor};
use stm32f4xx_hal::gpio::{Analog, PA0, PA1};
use stm32f4xx_hal::interrupt;
use stm32f4xx_hal::pac::{ADC_COMMON, ADC1, Interrupt, NVIC, TIM2};
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

static READING: AtomicU32 = AtomicU32::new(0);
static CHANNEL: AtomicU32 = AtomicU32::new(0);
static PERIODS: AtomicU32 = AtomicU32::new(0);

/// The converter, whose readings are the sample clock.
pub struct Sampler {
    _pins: (PA0<Analog>, PA1<Analog>),
}

impl Sampler {
    /// Starts the conversions, one every `period` µs. Written register by
    /// register: the HAL calibrates with a division that can panic (RM0390, 13.13).
    #[must_use]
    pub fn start(
        converter: ADC1,
        common: &ADC_COMMON,
        pins: (PA0<Analog>, PA1<Analog>),
        timer: TIM2,
        period: u32,
        rcc: &mut Rcc,
    ) -> Self {
        ADC1::enable(rcc);
        ADC1::reset(rcc);
        // 84 MHz / 4 = 21 MHz; 480 cycles of this clock are 23 µs, for sources of some kΩ.
        common.ccr().write(|w| w.adcpre().div4());
        converter
            .smpr2()
            .write(|w| w.smp0().cycles480().smp1().cycles480());
        // Channel 0 is converted once, as after a reset of SQR1 to SQR3. The conversion of channel 1, the only
        // channel of the injected group, follows automatically. That group has its own data register, so the two
        // cannot be confused. SAFETY: a channel number in its field.
        converter
            .jsqr()
            .write(|w| unsafe { w.jl().bits(0).jsq4().bits(1) });
        converter
            .cr1()
            .write(|w| w.jauto().enabled().jeocie().enabled());
        converter.cr2().write(|w| {
            w.exten().rising_edge().extsel().tim2trgo();
            w.eocs().each_conversion().adon().enabled()
        });
        TIM2::enable(rcc);
        TIM2::reset(rcc);
        timer
            .arr()
            .write(|w| w.set((CORE / 1_000_000).saturating_mul(period).saturating_sub(1)));
        timer.cr2().write(|w| w.mms().update());
        // SAFETY: the interrupt touches the converter and atomics only.
        unsafe { NVIC::unmask(Interrupt::ADC) };
        timer.cr1().write(|w| w.cen().enabled());
        Self { _pins: pins }
    }
}

/// Sample periods since the start, wrapping.
#[inline]
#[must_use]
pub fn periods() -> u32 {
    PERIODS.load(Ordering::Acquire)
}

impl Sensor for Sampler {
    fn counts(&mut self) -> f32 {
        READING.load(Ordering::Relaxed) as f32
    }
    fn channel(&mut self) -> f32 {
        CHANNEL.load(Ordering::Relaxed) as f32
    }
}

/// The sample clock.
#[derive(Clone, Copy, Debug)]
pub struct Periods;

impl Clock for Periods {
    fn periods(&self) -> u32 {
        periods()
    }
}

#[interrupt]
fn ADC() {
    // SAFETY: this interrupt alone touches status and data after the start.
    let converter = unsafe { &*ADC1::ptr() };
    // An overwritten reading also counts as a period, and the converter stops until its flag is cleared.
    let overwritten = converter.sr().read().ovr().bit_is_set();
    if overwritten {
        converter.sr().modify(|_, w| w.ovr().clear_bit());
    }
    converter.sr().modify(|_, w| w.jeoc().clear_bit());
    let (reading, channel) = (
        converter.dr().read().data().bits(),
        converter.jdr1().read().jdata().bits(),
    );
    READING.store(reading.into(), Ordering::Relaxed);
    CHANNEL.store(channel.into(), Ordering::Relaxed);
    let periods = PERIODS.load(Ordering::Relaxed);
    PERIODS.store(
        periods.wrapping_add(1 + u32::from(overwritten)),
        Ordering::Release,
    );
}
