//! Different delays of rising and falling edges: attachment propagates through the separated flow, release
//! does not.

use crate::delay::Transport;
use crate::effect::{
    LawCard, Parameter, Physics, Place, Setting, Spec, StartValue, Starts, Unit, take,
};
use crate::real::Real;

/// Rising and falling edges have different delays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeDependentDelay<T> {
    /// The shorter delay, samples.
    shorter: T,
    /// Additional delay of rising edges, samples.
    hold_rise: T,
    /// Additional delay of falling edges, samples.
    hold_fall: T,
}

/// The duration of the present command level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run<T> {
    /// The present level of the command.
    level: T,
    /// The level that was passed on when the command changed to the present level.
    before: T,
    /// The passed level.
    through: T,
    samples: u32,
}

impl<T: Real> Transport<T> for EdgeDependentDelay<T> {
    type State = Run<T>;
    /// Off since ever.
    fn start(&self) -> Run<T> {
        Run {
            level: T::ZERO,
            before: T::ZERO,
            through: T::ZERO,
            samples: u32::MAX,
        }
    }

    #[inline(always)]
    fn command(&self, run: &mut Run<T>, command: T) -> T {
        if command == run.level {
            run.samples = run.samples.saturating_add(1);
        } else {
            *run = Run {
                level: command,
                before: run.through,
                through: run.through,
                samples: 1,
            };
        }
        // Beyond 2²⁰ samples no edge is pending; the count stays exact in f32.
        let since = T::from_count(run.samples.min(1 << 20));
        let hold = if run.level > run.before {
            self.hold_rise
        } else {
            self.hold_fall
        };
        let passed = (since - hold).at_least(T::ZERO).at_most(T::ONE);
        run.through = run.before + (run.level - run.before) * passed;
        run.through
    }

    #[inline(always)]
    fn delay(&self, _output: T) -> T {
        self.shorter
    }
    #[inline(always)]
    fn bounds(&self) -> Option<[T; 2]> {
        Some([self.shorter; 2])
    }
    #[inline(always)]
    fn held_back(&self) -> [T; 2] {
        [self.hold_rise, self.hold_fall]
    }
}

impl<T: Real> Physics<T> for EdgeDependentDelay<T> {
    const SPEC: Spec = Spec {
        name: "edge-dependent-delay",
        rust: "edge_dependent_delay::EdgeDependentDelay",
        place: Place::Delay,
        summary: "rising and falling edges have different dead times",
        equation: "the dead time is h_r for rising edges and h_f for falling edges",
        parameters: &[
            Parameter::new("rise_delay", Unit::Second, [0.001, 0.5], &[0.045]),
            Parameter::new("fall_delay", Unit::Second, [0.001, 0.5], &[0.03]),
        ],
        starts: Starts::Rows(&[
            &[StartValue::Delay(6.0), StartValue::Delay(-6.0)],
            &[StartValue::Delay(-6.0), StartValue::Delay(6.0)],
            &[StartValue::Delay(18.0), StartValue::Delay(-18.0)],
            &[StartValue::Delay(1.0), StartValue::Delay(-1.0)],
        ]),
        law: Some(LawCard {
            words: "{} after rising edges, {} after falling edges",
            shapes_command: true,
            ..LawCard::PLAIN
        }),
        source: "Darabi & Wygnanski, J. Fluid Mech. 510 (2004): attachment and separation are different processes",
        ..Spec::PLAIN
    };

    fn new(parameters: &[T], setting: &Setting<T>) -> Self {
        let [rise, fall] = take(parameters);
        let (rise, fall) = (rise / setting.period, fall / setting.period);
        let shorter = rise.at_most(fall);
        Self {
            shorter,
            hold_rise: rise - shorter,
            hold_fall: fall - shorter,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::delay::Tap;

    fn arrivals(rise: f64, fall: f64, command: impl Fn(usize) -> bool) -> [f64; 200] {
        graded_arrivals(rise, fall, |k| f64::from(u8::from(command(k))))
    }

    fn graded_arrivals(rise: f64, fall: f64, command: impl Fn(usize) -> f64) -> [f64; 200] {
        let setting = Setting {
            period: 0.001,
            channel: 0,
            reference: 1.0,
        };
        let law = EdgeDependentDelay::new(&[rise, fall], &setting);
        let mut run = law.start();
        let shaped: [f64; 200] = core::array::from_fn(|k| law.command(&mut run, command(k)));
        core::array::from_fn(|k| {
            let tap = Tap::between(law.delay(0.0));
            let read = |lag: usize| if lag <= k { shaped[k - lag] } else { 0.0 };
            read(tap.whole) + tap.fraction * (read(tap.whole + 1) - read(tap.whole))
        })
    }

    #[test]
    fn each_edge_has_its_own_delay() {
        for (rise, fall) in [(0.050, 0.020), (0.020, 0.050), (0.030, 0.030)] {
            let arrived = arrivals(rise, fall, |k| (10..100).contains(&k));
            let on = 10 + (rise * 1000.0_f64) as usize;
            let off = 100 + (fall * 1000.0_f64) as usize;
            for (k, level) in arrived.iter().enumerate() {
                let expected = f64::from(u8::from((on..off).contains(&k)));
                assert!((level - expected).abs() < 1e-9, "{rise} {fall} sample {k}");
            }
        }
    }

    #[test]
    fn a_pulse_shorter_than_the_difference_never_arrives() {
        let arrived = arrivals(0.050, 0.020, |k| (10..39).contains(&k));
        assert!(arrived.iter().all(|level| level.abs() < 1e-9));
    }

    #[test]
    fn the_area_of_a_pulse_follows_fractional_delays() {
        let arrived = arrivals(0.0304, 0.0201, |k| (10..100).contains(&k));
        let area: f64 = arrived.iter().sum();
        assert!((area - (90.0 - 10.3)).abs() < 1e-9, "{area}");
    }

    #[test]
    fn every_level_of_a_graded_command_arrives_up_late_and_down_early() {
        let command = |k: usize| match k {
            10..60 => 0.4,
            60..110 => 0.9,
            110..150 => 0.2,
            _ => 0.0,
        };
        let arrived = graded_arrivals(0.030, 0.020, command);
        let expected = |k: usize| match k {
            40..90 => 0.4,
            90..130 => 0.9,
            130..170 => 0.2,
            _ => 0.0,
        };
        for (k, level) in arrived.iter().enumerate() {
            assert!((level - expected(k)).abs() < 1e-9, "sample {k}: {level}");
        }
    }

    #[test]
    fn single_precision_follows_double() {
        fn shaped<T: Real>() -> [f64; 300] {
            let setting = Setting {
                period: T::from_f64(0.001),
                channel: 0,
                reference: T::ONE,
            };
            let law = EdgeDependentDelay::new(&[0.0304, 0.0201].map(T::from_f64), &setting);
            let mut run = law.start();
            core::array::from_fn(|k| {
                let command = if k / 60 % 2 == 1 { T::ONE } else { T::ZERO };
                law.command(&mut run, command).value()
            })
        }
        for (single, double) in shaped::<f32>().iter().zip(shaped::<f64>()) {
            assert!((single - double).abs() < 1e-5);
        }
    }
}
