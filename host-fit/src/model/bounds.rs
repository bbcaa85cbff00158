//! Valid ranges of the numbers in a model file; they limit memory and time.
//!
//! | number | range | limits |
//! |---|---|---|
//! | sample period | 1 ns to 10⁹ s, as of records | times in samples |
//! | lags, delays (also those of a law), window | up to 65 535 samples | memory: 0.5 MB a signal |
//! | times of effects | 0 to 10⁹ s | |
//! | times of a law | up to 2³¹ − 1 samples | sums of two in 32 bits |
//! | numbers used on a board | range of single precision | |

use super::{Delay, Law};
use crate::data::PERIODS_S;
use model_core::effect::{Parameter, Unit};
use std::fmt::{Debug, Display};
use std::ops::RangeInclusive;

/// A key and the problem with its value.
pub(super) type Fault = (String, String);

/// Longest memory of a model, samples: lags and delays are 16-bit numbers on the board.
pub(super) const LONGEST: u16 = u16::MAX;

/// Longest time in a law, samples: the board adds two of them in 32 bits.
const LONGEST_LAW: u32 = i32::MAX as u32;

/// Longest time of an effect, s: 30 years.
const LONGEST_S: f64 = 1e9;

/// Whether `value` lies in `range`; otherwise the key with value, range and unit.
pub(super) fn within<T: PartialOrd + Display + Debug>(
    key: &str,
    value: T,
    range: RangeInclusive<T>,
    unit: &str,
) -> Result<(), Fault> {
    if range.contains(&value) {
        return Ok(());
    }
    let space = if unit.is_empty() { "" } else { " " };
    let (low, high) = range.into_inner();
    let problem = format!("{value:?} lies outside {low} to {high}{space}{unit}");
    Err((key.to_owned(), problem))
}

/// Checks the sample period.
pub(super) fn period(seconds: f64) -> Result<(), Fault> {
    let [shortest, longest] = PERIODS_S;
    if seconds <= 0.0 || !seconds.is_finite() {
        let problem = "the sample period must be above 0".to_owned();
        return Err(("sample_period_s".to_owned(), problem));
    }
    within("sample_period_s", seconds, shortest..=longest, "s")
}

/// Checks the averaging window.
pub(super) fn window(samples: u32) -> Result<(), Fault> {
    within("structure.window", samples, 2..=LONGEST.into(), "samples")
}

/// Checks a parameter of an effect or delay law under `key` against its physical range. The card's search
/// range assumes signals of order 1; this range holds for any size.
pub(super) fn parameter(key: &str, card: &Parameter, value: f64) -> Result<(), Fault> {
    if card.low >= 0.0 && value < 0.0 {
        let problem = format!("{value:?} is negative, which is not allowed");
        return Err((key.to_owned(), problem));
    }
    match card.unit {
        Unit::Second => within(key, value, -LONGEST_S..=LONGEST_S, "s"),
        Unit::Samples => {
            let most = f64::from(LONGEST);
            within(key, value, -most..=most, "samples")
        }
        _ => Ok(()),
    }
}

/// Checks that the command history for the delays fits into memory.
pub(super) fn delay(delay: &Delay, period_s: f64) -> Result<(), Fault> {
    let Delay::Law(law) = delay else {
        return Ok(());
    };
    for factor in &law.factors {
        within("delay.factors", *factor, 0.0..=f64::from(LONGEST), "")?;
    }
    let longest = delay.longest(period_s);
    if longest <= f64::from(LONGEST) {
        return Ok(());
    }
    let key = law.spec.parameters.first().map_or("law", |p| p.name);
    let problem = format!(
        "the parameters and factors of the law give a longest delay of {longest:?} samples; at most {LONGEST} are allowed"
    );
    Err((format!("delay.{key}"), problem))
}

/// Checks the times and numbers of a law.
pub(super) fn law(law: &Law) -> Result<(), Fault> {
    let count = |key: &str, value: u32| within(&format!("law.{key}"), value, 0..=LONGEST_LAW, "");
    let hold = |hold: &model_core::control::HoldTimes| {
        count("hold.on", hold.on)?;
        count("hold.off", hold.off)
    };
    match law {
        Law::Track(law) => {
            hold(&law.hold)?;
            for value in law.switches.iter().flatten() {
                count("switches", *value)?;
            }
            for value in law.air.iter().flatten() {
                count("air", *value)?;
            }
            let [low, high] = law.reachable;
            for (key, value) in [
                ("reference", law.reference),
                ("reachable", low),
                ("reachable", high),
                ("slope", law.slope),
                ("play", law.play),
                ("correction_limit", law.correction_limit),
                ("residual_limit", law.residual_limit),
            ] {
                single(&format!("law.{key}"), value)?;
            }
            Ok(())
        }
        Law::Maximise(law) => {
            hold(&law.hold)?;
            count("period", law.period)?;
            for (first, length) in &law.pulses {
                count("pulses", *first)?;
                count("pulses", *length)?;
            }
            single("law.air_price", law.air_price)
        }
    }
}

/// Checks that single precision, used on a board, can represent the value.
fn single(key: &str, value: f64) -> Result<(), Fault> {
    if (value as f32).is_finite() {
        return Ok(());
    }
    let problem = format!("{value:?} is outside single precision, in which the board calculates");
    Err((key.to_owned(), problem))
}

#[cfg(test)]
mod tests {
    use super::super::{Maximise, Model};
    use model_core::control::HoldTimes;

    /// A file with every number that has a range.
    fn text() -> String {
        include_str!("../../../tests/data/hostile/model.toml").to_owned()
    }

    /// One case of each kind: sizes of memory or time, negative values, values beyond single precision.
    #[test]
    fn every_number_has_its_range_and_is_refused_with_its_key() {
        assert!(Model::from_toml(&text(), "m").is_ok());
        for (name, from, to, key) in [
            ("window", "250", "4294967295", "structure.window"),
            ("window", "250", "65536", "structure.window"),
            ("period_s", "0.001", "1e-300", "sample_period_s"),
            ("period_s", "0.001", "1e300", "sample_period_s"),
            ("delay_floor", "30.0", "1e18", "delay.delay_floor"),
            ("delay_floor", "30.0", "-100.0", "delay.delay_floor"),
            ("delay_floor", "30.0", "65500.0", "delay.delay_floor"),
            ("delay_rise", "40.0", "-1e300", "delay.delay_rise"),
            ("delay_rate", "4.0", "-4.0", "delay.delay_rate"),
            ("factors", "[1.0]", "[-1.0]", "delay.factors"),
            ("factors", "[1.0]", "[1e9]", "delay.factors"),
            ("factors", "[1.0]", "[2000.0]", "delay.delay_floor"),
            (
                "recovery_time",
                "0.8",
                "-0.8",
                "effect.plenum-droop.recovery_time",
            ),
            (
                "recovery_time",
                "0.8",
                "1e18",
                "effect.plenum-droop.recovery_time",
            ),
            ("y_range", "[0.0, 1.0]", "[-inf, 1.0]", "training.y_range"),
            ("reachable", "[0.0, 0.84]", "[-inf, inf]", "law.reachable"),
            ("reachable", "[0.0, 0.84]", "[0.0, 1e300]", "law.reachable"),
            ("residual_limit", "0.8", "1e39", "law.residual_limit"),
            ("on", "10", "4294967295", "law.hold.on"),
            ("state_lags", "[1]", "[65536]", "line 10"),
        ] {
            let line = |value: &str| format!("{name} = {value}");
            let (from, to) = (line(from), line(to));
            let broken = text().replacen(&from, &to, 1);
            assert_ne!(broken, text(), "{from}");
            let error = Model::from_toml(&broken, "m").expect_err(&to).to_string();
            assert!(error.contains(key), "{to}: {error}");
            assert!(error.len() < 300, "{error}");
        }
    }

    #[test]
    fn an_effect_acts_once() {
        let effect = "[[effect]]\nname = \"plenum-droop\"\n[effect.parameters]\ndepletion_rate = 0.3\nrecovery_time = 0.5\n\n";
        let twice = text().replacen("[training]", &format!("{effect}[training]"), 1);
        let error = Model::from_toml(&twice, "m")
            .expect_err("twice")
            .to_string();
        assert!(
            error.contains("effect.plenum-droop") && error.contains("twice"),
            "{error}"
        );
    }

    #[test]
    fn times_of_pulses_are_counted_in_31_bits() {
        let law = |period, pulses| Model {
            law: Some(super::Law::Maximise(Maximise {
                period,
                pulses,
                hold: HoldTimes { on: 1, off: 1 },
                air_price: 0.0,
                lost: Vec::new(),
            })),
            ..Model::default()
        };
        let read = |model: Model| Model::from_toml(&model.to_toml(), "m").map(|_| ());
        assert!(read(law(i32::MAX as u32, vec![(0, 100)])).is_ok());
        for (period, pulses, key) in [
            (u32::MAX, vec![(0, 100)], "law.period"),
            (1000, vec![(0, u32::MAX)], "law.pulses"),
        ] {
            let error = read(law(period, pulses)).expect_err(key).to_string();
            assert!(error.contains(key), "{error}");
        }
    }
}
