//! Rust text as rustfmt would lay it out.

use std::fmt::Write as _;

/// Shortest text that reads back as the nearest `f32`.
pub(super) fn number(value: f64) -> String {
    format!("{:?}", value as f32)
}

pub(super) fn numbers(values: &[f64]) -> Vec<String> {
    values.iter().map(|value| number(*value)).collect()
}

/// `pub const NAME: TYPE = [values];` as rustfmt lays it out: on one line, in
/// rows where all elements are short, otherwise one element a line.
pub(super) fn array(out: &mut String, name: &str, kind: &str, values: &[String]) {
    const LONGEST_ON_A_LINE: usize = 60;
    const SHORT: usize = 10;
    let joined = values.join(", ");
    let line = format!("pub const {name}: {kind} = [{joined}];");
    if joined.len() + 2 <= LONGEST_ON_A_LINE && line.len() <= 100 {
        out.push_str(&line);
        out.push('\n');
        return;
    }
    let _ = writeln!(out, "pub const {name}: {kind} = [");
    if values.iter().all(|value| value.len() <= SHORT) {
        let mut row = String::from("   ");
        for value in values {
            if row.len() + value.len() + 2 > 100 {
                let _ = writeln!(out, "{row}");
                row = String::from("   ");
            }
            let _ = write!(row, " {value},");
        }
        let _ = writeln!(out, "{row}");
    } else {
        for value in values {
            let _ = writeln!(out, "    {value},");
        }
    }
    out.push_str("];\n");
}

pub(super) fn documented(out: &mut String, doc: &str, name: &str, kind: &str, values: &[String]) {
    let _ = writeln!(out, "/// {doc}");
    array(out, name, kind, values);
}
