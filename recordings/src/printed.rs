//! Rounding error of a printed number.

/// The value of one unit in the last printed place: 0.001 for `1.250`, 1 for `7`, 1e-7 for `1.5e-6`.
///
/// It bounds the rounding error of a printed time step (half of it at either end of the step).
pub(crate) fn printed_unit(cell: &[u8]) -> f64 {
    let (mantissa, exponent) = match cell.iter().position(|b| matches!(b, b'e' | b'E')) {
        Some(at) => {
            let (m, e) = cell.split_at(at);
            let e = std::str::from_utf8(e.get(1..).unwrap_or_default())
                .ok()
                .and_then(|t| t.parse::<i32>().ok())
                .unwrap_or(0);
            (m, e)
        }
        None => (cell, 0),
    };
    let decimals = mantissa
        .iter()
        .rev()
        .position(|&b| b == b'.')
        .unwrap_or(0)
        .min(400) as i32;
    10f64.powi(exponent.saturating_sub(decimals).clamp(-300, 300))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_in_the_last_place() {
        for (text, unit) in [
            ("1.250", 1e-3),
            ("7", 1.0),
            ("1.5e-6", 1e-7),
            (".5", 0.1),
            ("2e3", 1e3),
        ] {
            let found = printed_unit(text.as_bytes());
            assert!((found / unit - 1.0).abs() < 1e-12, "{text}: {found}");
        }
    }
}
