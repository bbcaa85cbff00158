//! Citations in comments and pages exist: sections and equations of `docs/theory*.md`, pages, headings.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Every source and page of the project, with its path from the root.
fn files() -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    let mut folders = vec![root()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            // Build products and third-party files are skipped.
            let ours = !matches!(&*name, "target" | "out" | "node_modules");
            if path.is_dir() && !name.starts_with('.') && ours {
                folders.push(path);
            } else if [".rs", ".md", ".py"].iter().any(|end| name.ends_with(end)) {
                let text = std::fs::read_to_string(&path).expect("text");
                let path = path.strip_prefix(root()).expect("inside").to_owned();
                found.push((path, text));
            }
        }
    }
    assert!(found.len() > 200, "{} files", found.len());
    found
}

fn theory() -> String {
    ["theory", "theory-law", "theory-diagnosis"]
        .map(|page| root().join("docs").join(page).with_extension("md"))
        .map(|page| std::fs::read_to_string(page).expect("the page"))
        .concat()
}

/// The labels that follow `word` in a text: `theory 3.1 and 3.3`, `eqs. (3), (4) or (15)`.
fn cited(text: &str, word: &str, label: fn(&str) -> Option<(&str, &str)>) -> Vec<String> {
    // Comment markers and line ends may come between a word and its label.
    let plain = text
        .replace("///", " ")
        .replace("//!", " ")
        .replace("//", " ");
    let plain = plain.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut labels = Vec::new();
    for (at, _) in plain.match_indices(word) {
        let mut rest = &plain[at + word.len()..];
        while let Some((found, after)) = label(rest) {
            labels.push(found.to_owned());
            let joined = [", ", " and ", " or "];
            let Some(next) = joined.iter().find_map(|j| after.strip_prefix(j)) else {
                break;
            };
            rest = next;
        }
    }
    labels
}

/// `3.1` at the start of a text, and the remaining text.
fn section(text: &str) -> Option<(&str, &str)> {
    let end = text.find(|c: char| !(c.is_ascii_digit() || c == '.'));
    let (label, rest) = text.split_at(end.unwrap_or(text.len()));
    let kept = label.trim_end_matches('.');
    let digits = kept.starts_with(|c: char| c.is_ascii_digit());
    digits
        .then(|| (kept, &text[kept.len()..]))
        .filter(|_| !rest.starts_with(" s"))
}

/// `(3)` at the start of a text, and the remaining text.
fn equation(text: &str) -> Option<(&str, &str)> {
    let (label, rest) = text.strip_prefix('(')?.split_once(')')?;
    let digits = !label.is_empty() && label.chars().all(|c| c.is_ascii_digit());
    digits.then_some((label, rest))
}

#[test]
fn every_cited_section_and_equation_stands_on_the_theory_page() {
    let page = theory();
    let sections: BTreeSet<&str> = page
        .lines()
        .filter_map(|line| line.trim_start_matches('#').trim_start().split(' ').next())
        .collect();
    let (mut of_sections, mut of_equations) = (0, 0);
    for (path, text) in files() {
        for word in ["theory ", "Theory "] {
            for label in cited(&text, word, section) {
                assert!(sections.contains(&*label), "{path:?} cites theory {label}");
                of_sections += 1;
            }
        }
        for word in ["eq. ", "eqs. ", "Eq. ", "Eqs. ", "law ", "equation "] {
            for label in cited(&text, word, equation) {
                let tag = format!("\\tag{{{label}}}");
                assert!(page.contains(&tag), "{path:?} cites {word}({label})");
                of_equations += 1;
            }
        }
    }
    // Without this check a reader that finds no comments would pass the test.
    assert!(
        of_sections > 20 && of_equations > 60,
        "{of_sections} {of_equations}"
    );
}

/// A heading as an address within its page, as the usual renderers make it.
fn address(heading: &str) -> String {
    let kept = heading
        .trim_start_matches('#')
        .trim()
        .chars()
        .filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.collect::<String>().to_lowercase().replace(' ', "-")
}

#[test]
fn every_link_of_a_page_leads_somewhere() {
    let mut links = 0;
    for (path, text) in files() {
        if path.extension().is_none_or(|e| e != "md") {
            continue;
        }
        for (at, _) in text.match_indices("](") {
            let target = text[at + 2..].split(')').next().unwrap_or_default();
            if target.contains("://") || target.is_empty() {
                continue;
            }
            let (file, heading) = target.split_once('#').unwrap_or((target, ""));
            let page = match file {
                "" => root().join(&path),
                file => root()
                    .join(path.parent().unwrap_or(Path::new("")))
                    .join(file),
            };
            assert!(page.exists(), "{path:?} links to {target}");
            if !heading.is_empty() {
                let text = std::fs::read_to_string(&page).expect("a page");
                let mut headings = text.lines().filter(|line| line.starts_with('#'));
                let found = headings.any(|line| address(line) == heading);
                assert!(found, "{path:?} links to {target}");
            }
            links += 1;
        }
    }
    assert!(links > 5, "{links}");
}
