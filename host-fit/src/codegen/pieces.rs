//! Small pieces of Rust that several items use.

use crate::user_effect::number;
use model_core::effect::Spec;
use proc_macro2::{Literal, TokenStream};
use quote::quote;

/// A list of the nearest `f32`s.
pub(super) fn listed(values: &[f64]) -> TokenStream {
    let values = values.iter().map(|value| number(*value, ""));
    quote!([#(#values),*])
}

/// A list of samples.
pub(super) fn lags(values: &[u16]) -> TokenStream {
    let values = values.iter().map(|lag| Literal::u16_unsuffixed(*lag));
    quote!([#(#values),*])
}

/// A whole number as a literal without a type suffix.
pub(super) fn count(value: usize) -> Literal {
    Literal::usize_unsuffixed(value)
}

/// A word of 32 bits as a hexadecimal literal.
pub(super) fn word(value: u32) -> Literal {
    let text = format!("0x{:04x}_{:04x}", value >> 16, value & 0xffff);
    text.parse()
        .unwrap_or_else(|_| Literal::u32_unsuffixed(value))
}

/// The parameters with their units.
pub(super) fn with_units(spec: &Spec) -> String {
    let each = spec.parameters.iter();
    let units: Vec<String> = each.map(|p| format!("{} ({})", p.name, p.unit)).collect();
    if units.is_empty() {
        return "no parameters".to_owned();
    }
    units.join(", ")
}
