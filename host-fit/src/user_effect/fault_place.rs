//! Position of an error in the text of an effect file, for editors.

use super::DefinitionError;
use toml::de::{DeTable, DeValue};

impl DefinitionError {
    /// Line and column of the error in `text`, both from 1, columns in characters; none if the file could not
    /// be read. For a missing key, the start of the file.
    #[must_use]
    pub fn place_in(&self, text: &str) -> Option<(usize, usize)> {
        match self {
            Self::Unreadable { .. } => None,
            Self::Syntax { line, column, .. } => Some((*line, *column)),
            Self::Key { key, .. } => Some(place(text, value(text, key).unwrap_or(0))),
            Self::Expression {
                key, line, column, ..
            } => {
                let start = value(text, key).unwrap_or(0);
                Some(place(text, within(text, start, *line, *column)))
            }
        }
    }
}

/// Line and column of a byte of `text`.
fn place(text: &str, at: usize) -> (usize, usize) {
    let before = text.get(..at).unwrap_or(text);
    let line = before.rsplit('\n').next().unwrap_or("");
    (before.matches('\n').count() + 1, line.chars().count() + 1)
}

/// The byte at which the value of `key` starts: `expression`, `parameter.NAME`, `state.NAME.update`.
fn value(text: &str, key: &str) -> Option<usize> {
    let table = DeTable::parse(text).ok()?;
    let mut words = key.split('.');
    let first = table.get_ref().get(words.next()?)?;
    let Some(name) = words.next() else {
        return Some(first.span().start);
    };
    let named = |entry: &&toml::Spanned<DeValue<'_>>| {
        let own = entry.get_ref().get("name");
        own.and_then(|own| own.get_ref().as_str()) == Some(name)
    };
    let entry = first.get_ref().as_array()?.iter().find(named)?;
    let of = entry.get_ref().get(words.next().unwrap_or("name"))?;
    Some(of.span().start)
}

/// The byte of a line and column of the string that starts with its quotes at `start`.
fn within(text: &str, start: usize, line: usize, column: usize) -> usize {
    let raw = text.get(start..).unwrap_or("");
    let mut at = start + 1;
    if raw.starts_with("\"\"\"") || raw.starts_with("'''") {
        at = start + 3;
        // A line break directly after the quotes is not part of the string.
        let rest = text.get(at..).unwrap_or("");
        let end = ["\r\n", "\n"].into_iter().find(|end| rest.starts_with(end));
        at += end.map_or(0, str::len);
    }
    for _ in 1..line {
        let rest = text.get(at..).unwrap_or("");
        at += rest.find('\n').map_or(0, |end| end + 1);
    }
    let rest = text.get(at..).unwrap_or("").char_indices();
    at + rest
        .take_while(|(_, c)| *c != '\n')
        .nth(column.saturating_sub(1))
        .map_or(0, |(offset, _)| offset)
}

#[cfg(test)]
mod tests {
    use crate::user_effect::Definition;

    const REST: &str = "name = \"warm\"\nplace = \"jet\"\nsummary = \"a line\"\n";

    fn place_of(text: &str) -> (usize, usize) {
        let error = Definition::from_toml(text, "x").unwrap_err();
        error.place_in(text).unwrap()
    }

    #[test]
    fn a_fault_of_an_expression_is_where_it_is_written() {
        assert_eq!(
            place_of(&format!("{REST}expression = \"jet * gian\"\n")),
            (4, 21)
        );
        let several = format!("{REST}expression = \"\"\"\nlet a = 2.0;\na * gian\n\"\"\"\n");
        assert_eq!(place_of(&several), (6, 5));
        let state =
            format!("{REST}expression = 'jet'\n[[state]]\nname = \"heat\"\nupdate = 'heat + ü'\n");
        assert_eq!(place_of(&state), (7, 18));
    }

    #[test]
    fn a_fault_of_a_key_is_at_its_value() {
        let text = format!("{REST}expression = \"jet\"\n").replace("warm", "Warm Film");
        assert_eq!(place_of(&text), (1, 8));
        assert_eq!(place_of("name = \"a\"\nplace =").0, 2);
    }
}
