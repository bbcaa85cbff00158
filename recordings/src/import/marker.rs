//! Numbers that loggers write in place of a missing reading.

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

/// The values of a variable, NaN where they are one of the `marks`.
///
/// # Errors
/// The first row with a number that is probably another mark; none if `marks` is an empty list.
pub(super) fn without(
    variable: &Variable,
    marks: Option<&[f64]>,
) -> Result<Vec<f64>, (usize, ImportProblem)> {
    let mut values = variable.values.clone();
    for value in &mut values {
        if marks.is_some_and(|marks| marks.contains(value)) {
            *value = f64::NAN;
        }
    }
    // With an empty list every number is a reading.
    let may_be_marks = marks.is_none_or(|marks| !marks.is_empty());
    match USUAL.iter().find_map(|mark| suspected(&values, *mark)) {
        Some(fault) if may_be_marks => Err(fault),
        _ => Ok(values),
    }
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
        let given = |marks: &[f64]| without(&oven, Some(marks));
        let left = given(&[-127.0, 85.0]).expect("values");
        assert!(left[2].is_nan() && left[4].is_nan() && left[5] == 30.0);
        assert_eq!(given(&[]).expect("values"), oven.values);
        // The thermometer's second mark is suspected beside the first.
        let (row, _) = given(&[-127.0]).expect_err("suspected");
        assert_eq!(row, 4);
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
