//! Text of a model file that is written into a comment or a string of another language. It must not end either of
//! them.

/// Longest text in a comment, characters.
const LONGEST: usize = 160;

/// `text` for a comment of one line in any of the languages: without control characters, marks that change the
/// direction of the text, or signs that end a comment of C.
pub(super) fn comment(text: &str) -> String {
    let turns = |c: char| matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}');
    let clean = text
        .chars()
        .map(|c| if c.is_control() || turns(c) { ' ' } else { c });
    let clean: String = clean.take(LONGEST).collect();
    // A line of C that ends in a backslash continues on the next line; `??/` is a backslash in old C.
    clean
        .replace('\\', "/")
        .replace("??", "? ?")
        .replace("*/", "* /")
        .replace("/*", "/ *")
}

/// `text` as a string of C: printable ASCII unchanged, other characters as bytes.
pub(super) fn c_string(text: &str) -> String {
    let byte = |b: u8| match b {
        b'"' | b'\\' | b'?' => format!("\\{}", char::from(b)),
        b' '..=b'~' => char::from(b).to_string(),
        // An escape has three digits, so that a following digit cannot belong to it.
        _ => format!("\\{b:03o}"),
    };
    format!("\"{}\"", text.bytes().map(byte).collect::<String>())
}

/// `text` as a string of Python, in ASCII.
pub(super) fn python_string(text: &str) -> String {
    let letter = |c: char| match c {
        '"' | '\\' => format!("\\{c}"),
        ' '..='~' => c.to_string(),
        _ => format!("\\U{:08x}", u32::from(c)),
    };
    format!("\"{}\"", text.chars().map(letter).collect::<String>())
}

/// `text` as a string of MATLAB: quotes twice, control characters as spaces.
pub(super) fn matlab_string(text: &str) -> String {
    let letter = |c: char| match c {
        '\'' => "''".to_owned(),
        c if c.is_control() => " ".to_owned(),
        c => c.to_string(),
    };
    format!("'{}'", text.chars().map(letter).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_ends_a_comment_or_a_string() {
        let hostile = "a */ x(); /* b\nimport os\r\u{2028}system('rm') ??/\n\\";
        let text = comment(hostile);
        assert!(!text.contains("*/") && !text.contains("/*"), "{text}");
        assert!(!text.contains(char::is_control) && !text.contains(['\\', '\u{2028}']));
        // The replacement must not create a sequence that it removes.
        assert!(
            !comment("*//*/ /*/").contains("*/"),
            "{}",
            comment("*//*/ /*/")
        );
        assert_eq!(c_string("a\"b\\??/\n1"), "\"a\\\"b\\\\\\?\\?/\\0121\"");
        assert_eq!(python_string("\"\\\n"), "\"\\\"\\\\\\U0000000a\"");
        assert_eq!(matlab_string("it's\n%{"), "'it''s %{'");
    }
}
