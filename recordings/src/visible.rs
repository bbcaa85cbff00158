//! Escaping of text of unknown origin before printing.

use std::borrow::Cow;

/// `text` with all characters escaped as `\u{…}` that control the display instead of being shown: control
/// characters other than line ends and tabs, and marks that change the direction of text.
///
/// In Rust the escape has the same meaning within a literal, and none within a comment.
///
/// ```
/// use recordings::visible;
/// assert_eq!(visible("wall\u{1b}[2J"), "wall\\u{1b}[2J");
/// assert_eq!(visible("τ, 20 °C\n"), "τ, 20 °C\n");
/// ```
#[must_use]
pub fn visible(text: &str) -> Cow<'_, str> {
    escaped(text, |c, out| out.extend(c.escape_unicode()))
}

/// A JSON document in which the same characters are escaped in the notation of JSON; they can occur only within
/// strings.
///
/// ```
/// assert_eq!(recordings::visible_json("[\"a\u{202e}b\"]"), "[\"a\\u202eb\"]");
/// ```
#[must_use]
pub fn visible_json(document: &str) -> Cow<'_, str> {
    escaped(document, |c, out| {
        let mut units = [0; 2];
        for unit in c.encode_utf16(&mut units) {
            out.push_str(&format!("\\u{unit:04x}"));
        }
    })
}

fn escaped(text: &str, escape: impl Fn(char, &mut String)) -> Cow<'_, str> {
    if !text.contains(acts) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match acts(c) {
            true => escape(c, &mut out),
            false => out.push(c),
        }
    }
    Cow::Owned(out)
}

/// Whether a character controls the display instead of being shown.
fn acts(c: char) -> bool {
    (c.is_control() && !matches!(c, '\n' | '\t'))
        || matches!(c,
        // These are marks of direction, line and paragraph separators, and invisible joiners.
        '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_acts_is_written_out_and_text_stays() {
        for text in ["", "plain", "a\tb\n", "Δτ ≥ 3 µs, 日本, عربي"] {
            assert!(matches!(visible(text), Cow::Borrowed(same) if same == text));
        }
        for (text, seen) in [
            ("a\rb", "a\\u{d}b"),
            ("\u{1b}]0;x\u{7}", "\\u{1b}]0;x\\u{7}"),
            ("a\u{9b}2J", "a\\u{9b}2J"),
            ("\u{202e}cba", "\\u{202e}cba"),
            ("\u{7f}", "\\u{7f}"),
        ] {
            assert_eq!(visible(text), seen);
        }
        let document = format!("{{\"a\": \"{}\"}}", "\u{7f}\u{2067}\u{9b}");
        assert_eq!(visible_json(&document), r#"{"a": "\u007f\u2067\u009b"}"#);
    }
}
