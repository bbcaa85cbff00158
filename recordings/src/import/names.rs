//! Assignment of a file's variables: by the name in an option, by a usual name, or because only one variable
//! is suitable.

use super::mapping::near_two_levels;
use super::problem::ImportProblem;
use super::source::{Source, Variable};
use crate::error::{DataError, FilePlace};

/// Usual names of the time; these lists are in the order of priority.
pub(super) const TIMES: &str = "t time zeit temps tout x_value x_axis time_s t_s sec secs seconds elapsed elapsed_s elapsed_time \
    time_ms t_ms elapsed_ms millis milliseconds ms time_us t_us micros microseconds us \
    time_min t_min timestamp timestamps time_stamp timestamp_ms timestamp_us datetime \
    date_time date_and_time zeitstempel epoch epoch_s epoch_ms epoch_us unixtime unix_time unix unix_s unix_ms \
    clock uhrzeit date datum received";

/// Usual names of the command.
pub(super) const COMMANDS: &str = "u input command valve actuator ventil cmd stell heater heizung pwm duty duty_cycle relay \
    switch pump fan controller_output co control";

/// Names that mean the command if the file has a process value, and the output of the rig otherwise.
pub(super) const CONTROLLER_OUTPUTS: &str = "out output op mv";

/// Names of the output that a controller measures.
pub(super) const PROCESS_VALUES: &str = "pv process_value process_variable";

/// Usual names of the output.
pub(super) const OUTPUTS: &str = "y pv process_value process_variable output shear friction sensor response temperature \
    temperatur temp reading measurement measured";

/// The name after its last point, in the form of the lists.
fn usual(name: &str) -> String {
    let last = name.rsplit('.').next().unwrap_or_default().trim();
    // `T` is a temperature, `Time` a time.
    match last.chars().count() {
        1 => last.to_owned(),
        _ => last.to_lowercase().replace([' ', '-'], "_"),
    }
}

/// Whether a name is one of the `known` ones.
pub(super) fn is_known(known: &str, name: &str) -> bool {
    let name = usual(name);
    known.split_whitespace().any(|known| known == name)
}

/// A name without a trailing unit or kind: `heater_pct`, `temp_c`, `valve_state`.
fn stem(name: &str) -> String {
    const ENDS: [&str; 16] = [
        "pct", "percent", "c", "degc", "celsius", "f", "k", "v", "volt", "pa", "bar", "state",
        "status", "on", "value", "cmd",
    ];
    let name = usual(name);
    match name.rsplit_once('_') {
        Some((stem, end)) if ENDS.contains(&end) => stem.to_owned(),
        _ => name,
    }
}

/// Whether a name says that the numbers are in percent.
pub(super) fn is_in_percent(name: &str) -> bool {
    let name = usual(name);
    name.ends_with("_pct") || name.ends_with("_percent")
}

/// The variable with a usual name, alone or as the field of a structure; an earlier name in the list has
/// priority.
///
/// # Errors
/// An unreadable cell in the column of that name, in `file`.
pub(super) fn known_as<'a>(
    source: &'a Source,
    known: &str,
    file: &FilePlace,
) -> Result<Option<&'a Variable>, DataError> {
    let exact: fn(&str) -> String = usual;
    let names = || known.split_whitespace();
    let exactly = names().map(|name| (name, exact));
    for (name, by) in exactly.chain(names().map(|name| (name, stem as _))) {
        let is_it = |v: &&Variable| v.values.len() > 1 && by(&v.name) == name;
        let mut found = source.variables.iter().filter(is_it);
        match (found.next(), found.next()) {
            (Some(one), None) => return Ok(Some(one)),
            (Some(_), Some(_)) => continue,
            (None, _) => {}
        }
        if let Some(unread) = source.unread.iter().find(|u| by(&u.name) == name) {
            return Err(unread.error(file));
        }
    }
    Ok(None)
}

/// The variable named by an option.
///
/// # Errors
/// It does not exist, or cannot be used, in `file`.
pub(super) fn find<'a>(
    source: &'a Source,
    name: &str,
    file: &FilePlace,
) -> Result<&'a Variable, DataError> {
    if let Some(found) = source.get(name) {
        return Ok(found);
    }
    if let Some(unread) = source.unread.iter().find(|u| u.name == name) {
        return Err(unread.error(file));
    }
    let problem = match source.skipped.iter().find(|(n, _)| n == name) {
        Some((_, why)) => ImportProblem::Unusable(format!("the variable `{name}` is {why}")),
        None => ImportProblem::NoVariable {
            wanted: name.to_owned(),
            found: source.listed(),
        },
    };
    Err(file.clone().error(problem.into()))
}

/// The command without a usual name: the only on/off variable not in `taken`.
pub(super) fn only_switch<'a>(source: &'a Source, taken: &[&Variable]) -> Option<&'a Variable> {
    let is_switch = |v: &&Variable| {
        let values = || v.values.iter().filter(|value| !value.is_nan());
        let takes = |level: f64| values().any(|&value| value == level);
        takes(0.0) && takes(1.0) && values().all(|&value| value == 0.0 || value == 1.0)
    };
    only(source, taken, is_switch)
}

/// The only variable not in `taken` that lies near two levels, and these levels in ascending order.
pub(super) fn only_two_levels<'a>(
    source: &'a Source,
    taken: &[&Variable],
) -> Option<(&'a Variable, [f64; 2])> {
    let levels = |v: &Variable| {
        let present: Vec<f64> = v.values.iter().copied().filter(|v| !v.is_nan()).collect();
        near_two_levels(&present)
    };
    let found = only(source, taken, |v| levels(v).is_some())?;
    let (low, high) = levels(found)?;
    Some((found, [low, high]))
}

/// The output without a usual name: the only numeric variable not in `taken` that is not constant.
pub(super) fn only_other<'a>(source: &'a Source, taken: &[&Variable]) -> Option<&'a Variable> {
    only(source, taken, |v| !v.is_constant())
}

fn only<'a>(
    source: &'a Source,
    taken: &[&Variable],
    fits: impl Fn(&&'a Variable) -> bool,
) -> Option<&'a Variable> {
    let is_free = |v: &&'a Variable| {
        v.values.len() > 1 && v.stamped.is_none() && taken.iter().all(|t| t.name != v.name)
    };
    let mut found = source.variables.iter().filter(is_free).filter(fits);
    found.next().filter(|_| found.next().is_none())
}

/// The unit at the end of a time's name, in seconds; none without one.
pub(super) fn seconds_by_name(name: &str) -> Option<f64> {
    let name = usual(name);
    match name.rsplit('_').next().unwrap_or_default() {
        "ms" | "millis" | "milliseconds" => Some(1e-3),
        "us" | "micros" | "microseconds" => Some(1e-6),
        "min" | "minutes" => Some(60.0),
        "s" | "sec" | "secs" | "seconds" => Some(1.0),
        _ => None,
    }
}

/// Seconds in a unit of time.
pub(super) fn seconds(unit: &str) -> Option<f64> {
    Some(match unit {
        "s" | "sec" | "S" | "second" | "Second" | "seconds" | "Seconds" => 1.0,
        "ms" | "msec" => 1e-3,
        "us" | "µs" | "μs" => 1e-6,
        "ns" => 1e-9,
        "min" => 60.0,
        "h" => 3600.0,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_known_in_any_case_but_single_letters() {
        assert_eq!(usual("run.Time"), "time");
        assert_eq!(usual("Date Time"), "date_time");
        assert_eq!(usual("T"), "T");
        assert_eq!(
            (stem("Heater_pct"), stem("temp-C")),
            ("heater".into(), "temp".into())
        );
        assert!(is_in_percent("heater_pct") && !is_in_percent("u"));
        assert_eq!(seconds_by_name("time_ms"), Some(1e-3));
        assert_eq!(seconds_by_name("millis"), Some(1e-3));
        assert_eq!(seconds_by_name("run.t s"), Some(1.0));
        assert_eq!(seconds_by_name("t"), None);
        assert_eq!(seconds_by_name("timestamp"), None);
    }
}
