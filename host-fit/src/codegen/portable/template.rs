//! Templates of generated files: text in the target language with holes.
//!
//! - `@name@` is replaced by a text. A hole alone in its line may be replaced by several lines, which get the
//!   indentation of the hole, or by no line.
//! - The lines between `@if name` and `@end` are kept if the text `name` is not empty; the lines after `@else` are kept
//!   if it is empty.
//! - The lines between `@for name` and `@end` are repeated for each row of the list `name`.

use std::collections::BTreeMap;

/// The texts that are inserted into a template, by name.
#[derive(Debug, Default)]
pub(super) struct Holes {
    texts: BTreeMap<&'static str, String>,
    lists: BTreeMap<&'static str, Vec<Holes>>,
}

impl Holes {
    pub(super) fn set(&mut self, name: &'static str, text: impl ToString) -> &mut Self {
        self.texts.insert(name, text.to_string());
        self
    }

    /// A condition of `@if`.
    pub(super) fn flag(&mut self, name: &'static str, holds: bool) -> &mut Self {
        self.set(name, if holds { "yes" } else { "" })
    }

    pub(super) fn list(&mut self, name: &'static str, rows: Vec<Holes>) -> &mut Self {
        self.lists.insert(name, rows);
        self
    }

    /// The template with its holes filled.
    pub(super) fn fill(&self, template: &str) -> String {
        let mut filled = String::new();
        let lines: Vec<&str> = template.lines().collect();
        fill(&lines, &[self], &mut filled);
        filled
    }
}

/// The text `name` of the innermost scope that has it.
fn text<'a>(scopes: &[&'a Holes], name: &str) -> Option<&'a str> {
    let mut found = scopes.iter().rev().map(|holes| holes.texts.get(name));
    found.find_map(|text| text.map(String::as_str))
}

fn fill(mut lines: &[&str], scopes: &[&Holes], filled: &mut String) {
    while let Some((line, rest)) = lines.split_first() {
        lines = rest;
        let Some((word @ ("@if" | "@for"), name)) = line.trim_start().split_once(' ') else {
            fill_line(line, scopes, filled);
            continue;
        };
        let (first, second, after) = block(rest);
        lines = after;
        if word == "@if" {
            let holds = text(scopes, name).is_some_and(|text| !text.is_empty());
            fill(if holds { first } else { second }, scopes, filled);
        } else {
            let rows = scopes.iter().find_map(|holes| holes.lists.get(name));
            for row in rows.into_iter().flatten() {
                fill(first, &[scopes, &[row]].concat(), filled);
            }
        }
    }
}

/// Splits the lines after `@if` into those up to `@else`, those from there to `@end`, and those
/// after `@end`.
fn block<'a, 'b>(lines: &'a [&'b str]) -> (&'a [&'b str], &'a [&'b str], &'a [&'b str]) {
    let (mut depth, mut otherwise) = (0_usize, None);
    for (i, line) in lines.iter().enumerate() {
        let line = line.trim_start();
        match line {
            "@else" if depth == 0 => otherwise = Some(i),
            "@end" if depth == 0 => {
                let second = otherwise.map_or(&[][..], |at| &lines[at + 1..i]);
                return (&lines[..otherwise.unwrap_or(i)], second, &lines[i + 1..]);
            }
            "@end" => depth -= 1,
            _ if line.starts_with("@if ") || line.starts_with("@for ") => depth += 1,
            _ => {}
        }
    }
    (lines, &[], &[])
}

fn fill_line(line: &str, scopes: &[&Holes], filled: &mut String) {
    let words: Vec<&str> = line.split('@').collect();
    let of = |name: &str| text(scopes, name).unwrap_or_default();
    if let [indent, name, ""] = words[..]
        && indent.trim().is_empty()
    {
        for line in of(name).lines() {
            if !line.is_empty() {
                filled.push_str(indent);
            }
            filled.push_str(line);
            filled.push('\n');
        }
        return;
    }
    for (i, word) in words.iter().enumerate() {
        filled.push_str(if i % 2 == 1 { of(word) } else { word });
    }
    filled.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_conditions_and_lists_are_filled() {
        let row = |name: &str| {
            let mut row = Holes::default();
            row.set("name", name);
            row
        };
        let mut holes = Holes::default();
        holes
            .set("x", "1@y@")
            .set("several", "a\n\nb")
            .set("none", "");
        holes.flag("yes", true).flag("no", false);
        holes.list("rows", vec![row("p"), row("q")]);
        let template = "f(@x@, @x@)\n  @several@\n  @none@\n@if no\n@if yes\nwrong\n@end\n@else\n\
                        @for rows\n@if yes\n@name@ = @x@;\n@else\nwrong\n@end\n@end\n@end\nend\n";
        let filled = "f(1@y@, 1@y@)\n  a\n\n  b\np = 1@y@;\nq = 1@y@;\nend\n";
        assert_eq!(holes.fill(template), filled);
    }
}
