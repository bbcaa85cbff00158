//! Numbers that loggers write in place of a missing reading.

use serde::{Deserialize, Serialize};

use super::problem::ImportProblem;
use super::source::Variable;

/// Usual marks: of data loggers, of well and weather data, of integer registers, of the thermometer DS18B20.
const USUAL: [f64; 20] = [
    -9999.0,
    9999.0,
    -999.0,
    999.0,
    -99.0,
    -99999.0,
    99999.0,
    -999.25,
    -9999.9,
    9999.9,
    -999.9,
    999.9,
    -7999.0,
    -6999.0,
    32767.0,
    -32768.0,
    65535.0,
    2_147_483_647.0,
    -127.0,
    85.0,
];

/// The numbers that are missing readings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Marker {
    /// This number.
    Number(f64),
    /// Every number is a reading.
    None(NoMarker),
}

/// The word for [`Marker::None`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum NoMarker {
    /// `none`.
    None,
}

impl std::str::FromStr for Marker {
    type Err = String;

    /// A finite number or `none`.
    fn from_str(text: &str) -> Result<Self, String> {
        if text == "none" {
            return Ok(Self::None(NoMarker::None));
        }
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        let number = number.ok_or("give a number, such as -9999, or none")?;
        Ok(Self::Number(number))
    }
}

/// The values of a variable, NaN where they are the `marker`.
///
/// # Errors
/// Without a marker: the first row with a number that is probably one.
pub(super) fn without(
    variable: &Variable,
    marker: Option<Marker>,
) -> Result<Vec<f64>, (usize, ImportProblem)> {
    let mut values = variable.values.clone();
    match marker {
        Some(Marker::Number(mark)) => {
            let marked = values.iter_mut().filter(|value| **value == mark);
            marked.for_each(|value| *value = f64::NAN);
        }
        Some(Marker::None(_)) => {}
        None => {
            if let Some(fault) = USUAL.iter().find_map(|mark| suspected(&values, *mark)) {
                return Err(fault);
            }
        }
    }
    Ok(values)
}

/// Whether a number is probably no reading: it is farther from all other values than these are from each other.
fn suspected(values: &[f64], mark: f64) -> Option<(usize, ImportProblem)> {
    let first = values.iter().position(|value| *value == mark)?;
    let others = values.iter().copied().filter(|v| *v != mark && !v.is_nan());
    let (low, high, readings) = others.fold((f64::INFINITY, f64::NEG_INFINITY, 0), |all, v| {
        (all.0.min(v), all.1.max(v), all.2 + 1)
    });
    let count = values.iter().filter(|value| **value == mark).count();
    let far = (low - mark).max(mark - high);
    (high > low && far > high - low && count < readings).then_some((
        first,
        ImportProblem::Marker {
            mark,
            count,
            low,
            high,
        },
    ))
}

#[cfg(test)]
mod tests {
    use super::super::source::Exactness;
    use super::*;

    fn variable(values: &[f64]) -> Variable {
        Variable {
            name: "y".to_owned(),
            unit: None,
            values: values.to_vec(),
            exactness: Exactness::Relative(0.0),
            blanks: Vec::new(),
            stamped: None,
            notes: Vec::new(),
        }
    }

    #[test]
    fn a_mark_is_suspected_and_taken_out_on_request() {
        let oven = variable(&[20.5, 21.0, -127.0, 36.0, 85.0, 30.0]);
        let (row, problem) = without(&oven, None).expect_err("suspected");
        assert_eq!(row, 2);
        let words = problem.to_string();
        assert!(words.contains("--missing -127"), "{words}");
        let given = |text: &str| without(&oven, Some(text.parse().expect("a marker")));
        let left = given("-127").expect("values");
        assert!(left[2].is_nan() && left[4] == 85.0);
        assert_eq!(given("none").expect("values"), oven.values);
        assert!("inf".parse::<Marker>().is_err() && "".parse::<Marker>().is_err());
    }

    #[test]
    fn readings_are_no_marks() {
        for values in [
            &[20.0, 60.0, 85.0, 90.0][..],
            &[9999.0, 9999.5, 9998.0],
            &[0.0, 85.0, 85.0],
            &[-99.0, -99.0],
            &[0.0, 999.0, 0.0],
            &[f64::NAN, 85.0],
        ] {
            assert!(without(&variable(values), None).is_ok(), "{values:?}");
        }
    }
}
