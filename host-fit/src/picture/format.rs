//! Formatting of numbers and lists for readers.

/// A time, s, as a number with a suitable unit.
#[must_use]
pub fn readable_time(seconds: f64) -> (f64, &'static str) {
    match seconds.abs() {
        s if s >= 1.0 => (seconds, "s"),
        s if s >= 1e-3 || s == 0.0 => (1e3 * seconds, "ms"),
        _ => (1e6 * seconds, "µs"),
    }
}

/// A time, s, with `digits` significant digits and its unit.
///
/// ```
/// use host_fit::picture::time;
/// assert_eq!(time(0.029_4, 2), "29 ms");
/// assert_eq!(time(29.0, 2), "29 s");
/// assert_eq!(time(0.000_25, 2), "250 µs");
/// ```
#[must_use]
pub fn time(seconds: f64, digits: usize) -> String {
    let (value, unit) = readable_time(seconds);
    format!("{} {unit}", significant(value, digits))
}

/// `value` with `digits` significant digits, no trailing zeros, a true minus sign and
/// powers of ten outside 10⁻⁴…10⁶; an en dash when it is not finite.
///
/// ```
/// use host_fit::picture::significant;
/// assert_eq!(significant(0.041_26, 3), "0.0413");
/// assert_eq!(significant(-12.0, 3), "−12");
/// assert_eq!(significant(1.5e-7, 3), "1.5×10⁻⁷");
/// assert_eq!(significant(f64::NAN, 3), "–");
/// ```
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    let digits = digits.clamp(1, 17);
    // The number is rounded first: 0.99996 to three digits is 1, in the next decade. Rounding the largest
    // numbers would give infinity.
    let rounded: f64 = format!("{value:.*e}", digits - 1).parse().unwrap_or(value);
    let rounded = if rounded.is_finite() { rounded } else { value };
    if rounded == 0.0 {
        return "0".to_owned();
    }
    let magnitude = rounded.abs().log10().floor() as i32;
    if (-4..6).contains(&magnitude) {
        let decimals = (digits as i32 - 1 - magnitude).max(0) as usize;
        fixed(rounded, decimals, true)
    } else {
        power_of_ten(rounded, digits - 1)
    }
}

/// `value` with a fixed number of decimals, a true minus sign, and a plus sign if it is positive.
///
/// ```
/// use host_fit::picture::signed;
/// assert_eq!([0.138, -0.011, -1e-9].map(|x| signed(x, 3)), ["+0.138", "−0.011", "0.000"]);
/// ```
#[must_use]
pub fn signed(value: f64, decimals: usize) -> String {
    let text = fixed(value, decimals, false);
    let is_zero = text.chars().all(|c| c == '0' || c == '.');
    match value > 0.0 && !is_zero {
        true => format!("+{text}"),
        false => text,
    }
}

/// `value` with a fixed number of decimals and a true minus sign; `trim` drops
/// trailing zeros.
#[must_use]
pub fn fixed(value: f64, decimals: usize, trim: bool) -> String {
    let mut text = format!("{value:.decimals$}");
    if trim && text.contains('.') {
        let kept = text.trim_end_matches('0').trim_end_matches('.').len();
        text.truncate(kept);
    }
    with_minus(text)
}

/// A number that was written with a hyphen, as `−12.3`.
pub(super) fn with_minus(text: String) -> String {
    match text.strip_prefix('-') {
        // "−0" is a rounded tiny negative number.
        Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
        Some(rest) => format!("−{rest}"),
        None => text,
    }
}

/// `value` as mantissa × 10 to a power.
pub(super) fn power_of_ten(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$e}");
    let Some((mantissa, exponent)) = text.split_once('e') else {
        return text;
    };
    let mantissa = mantissa.replacen('-', "−", 1);
    let mantissa = if mantissa.contains('.') {
        mantissa.trim_end_matches('0').trim_end_matches('.')
    } else {
        mantissa.as_str()
    };
    let exponent: String = exponent.chars().map(superscript).collect();
    match mantissa {
        "1" => format!("10{exponent}"),
        "−1" => format!("−10{exponent}"),
        _ => format!("{mantissa}×10{exponent}"),
    }
}

fn superscript(c: char) -> char {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    match c {
        '-' => '⁻',
        _ => c
            .to_digit(10)
            .and_then(|d| DIGITS.get(d as usize).copied())
            .unwrap_or(c),
    }
}

/// `text` for HTML and XML; characters that these forbid become U+FFFD.
pub(super) fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '&' => safe.push_str("&amp;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            c if !allowed(c) => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

/// Whether XML 1.0 allows the character (its `Char` production).
fn allowed(c: char) -> bool {
    matches!(c, '\t' | '\n' | '\r' | '\u{20}'..='\u{d7ff}' | '\u{e000}'..='\u{fffd}' | '\u{10000}'..)
}

/// A list in words: "a", "a and b", "a, b and c".
#[must_use]
pub fn listed<T: AsRef<str>>(items: &[T]) -> String {
    let items: Vec<&str> = items.iter().map(AsRef::as_ref).collect();
    match items.as_slice() {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [before @ .., last] => format!("{} and {last}", before.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn significant_digits_round_across_decades_and_keep_signs() {
        assert_eq!(significant(0.999_96, 3), "1");
        assert_eq!(significant(123_456.0, 3), "123000");
        assert_eq!(significant(1_234_567.0, 3), "1.23×10⁶");
        assert_eq!(significant(-0.000_012, 2), "−1.2×10⁻⁵");
        assert_eq!(significant(1e9, 3), "10⁹");
        assert_eq!(significant(-0.0, 3), "0");
        assert_eq!(significant(f64::INFINITY, 3), "–");
    }

    #[test]
    fn fixed_never_prints_minus_zero() {
        assert_eq!(fixed(-0.0004, 2, false), "0.00");
        assert_eq!(fixed(-1.5, 2, true), "−1.5");
        assert_eq!(fixed(-1.5, 2, false), "−1.50");
    }

    #[test]
    fn lists_have_commas_before_the_last_item() {
        let cases: [(&[&str], &str); 4] = [
            (&[], ""),
            (&["a"], "a"),
            (&["a", "b"], "a and b"),
            (&["a", "b", "c"], "a, b and c"),
        ];
        for (items, expected) in cases {
            assert_eq!(listed(items), expected);
        }
    }
}
