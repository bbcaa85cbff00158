//! A model and its law in other languages than Rust: one readable file each.
//!
//! The recursion, the delays and the law stand in a template for each language (`model.py` …). Effects and delay
//! laws come from one description ([`forms.toml`](../../user_effect/forms.toml) and the user's own effects), which
//! each language's printer writes out.

mod c;
mod common;
mod matlab;
mod piece;
mod plain;
mod python;
mod sheet;
mod template;

use super::{CodegenError, check};
use crate::model::Model;
use sheet::Sheet;

/// Precision of the numbers in C.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// `float`, as the boards do.
    #[default]
    Single,
    /// `double`, as `simulate` does.
    Double,
}

/// The model and its law as C99: `model_step`, `law_step`, static state, no heap; bit-identical to the host in its
/// precision.
///
/// # Errors
/// A number beyond single precision, or an effect that can be written in Rust only.
pub fn c(model: &Model, precision: Precision) -> Result<String, CodegenError> {
    check(model)?;
    Ok(match precision {
        Precision::Single => c::write::<f32>(&Sheet::new::<f32>(model)?, precision),
        Precision::Double => c::write::<f64>(&Sheet::new::<f64>(model)?, precision),
    })
}

/// The model and its law as a module for Python and NumPy: classes `Model` and `Law`.
///
/// # Errors
/// As [`c`].
pub fn python(model: &Model) -> Result<String, CodegenError> {
    check(model)?;
    Ok(python::write(&Sheet::new::<f64>(model)?))
}

/// The model and its law as a function file for MATLAB and GNU Octave. The function has the name of the file:
/// letters, digits and `_` of `name`, after `model_` if the name does not begin with a letter.
///
/// # Errors
/// As [`c`].
pub fn matlab(model: &Model, name: &str) -> Result<String, CodegenError> {
    check(model)?;
    Ok(matlab::write(
        &Sheet::new::<f64>(model)?,
        &function_name(name),
    ))
}

/// The name of MATLAB's function and file for `name`.
#[must_use]
pub fn function_name(name: &str) -> String {
    let clean = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let name: String = name.chars().map(clean).take(40).collect();
    // The name must begin with a letter and must not be a keyword of the language.
    const TAKEN: [&str; 6] = ["end", "for", "function", "if", "law", "while"];
    if name.starts_with(|c: char| c.is_ascii_alphabetic()) && !TAKEN.contains(&name.as_str()) {
        name
    } else {
        format!("model_{name}")
    }
}
