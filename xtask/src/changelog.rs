//! The changelog from its fragments: `cargo xtask changelog`.
//!
//! A user-visible change comes with a file `changelog/KIND-WHAT.md`, so that two changes do not edit the same file.
//! Its text is one entry. A release moves all of them into `CHANGELOG.md`.

use crate::Task;
use crate::shell::root;
use anyhow::{Context, Result, bail, ensure};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

pub(crate) const TASK: Task = Task {
    name: "changelog",
    does: "prints the changes since the last release; with VERSION DATE, moves these changes into CHANGELOG.md",
    run: |arguments| changelog(&root(), arguments),
};

/// Kinds of changes: word in file names and heading, in the order of a release.
const KINDS: [(&str, &str); 4] = [
    ("added", "Added"),
    ("changed", "Changed"),
    ("fixed", "Fixed"),
    ("removed", "Removed"),
];
/// Text at which the newest release begins in `CHANGELOG.md`.
const NEWEST: &str = "\n## [";

fn changelog(root: &Path, arguments: &[String]) -> Result<()> {
    let fragments = fragments(&root.join("changelog"))?;
    let section = section(&fragments)?;
    let [version, date] = arguments else {
        ensure!(
            arguments.is_empty(),
            "changelog accepts either no arguments, or VERSION DATE"
        );
        print!("{section}");
        return Ok(());
    };
    ensure!(
        !fragments.is_empty(),
        "changelog/ has no entries to release"
    );
    let path = root.join("CHANGELOG.md");
    let text = fs::read_to_string(&path).context("CHANGELOG.md")?;
    ensure!(
        !text.contains(&format!("{NEWEST}{version}]")),
        "CHANGELOG.md already has a release {version}"
    );
    let at = text.find(NEWEST).unwrap_or(text.len());
    let (head, rest) = text.split_at(at);
    fs::write(
        &path,
        format!("{head}\n## [{version}] - {date}\n\n{section}{rest}"),
    )
    .context("CHANGELOG.md")?;
    for (path, _, _) in fragments {
        fs::remove_file(&path).with_context(|| path.display().to_string())?;
    }
    Ok(())
}

/// File, index of its kind and text of every fragment, by name.
fn fragments(folder: &Path) -> Result<Vec<(PathBuf, usize, String)>> {
    let entries = fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    let mut paths: Vec<PathBuf> = entries
        .map(|entry| Ok(entry?.path()))
        .collect::<Result<_>>()?;
    paths.sort();
    let mut found = Vec::new();
    for path in paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name == "README.md" {
            continue;
        }
        let kind = KINDS.iter().position(|(kind, _)| {
            let what = name
                .strip_prefix(kind)
                .and_then(|rest| rest.strip_prefix('-'));
            what.is_some_and(|what| what.len() > 3 && what.ends_with(".md"))
        });
        let Some(kind) = kind else {
            bail!(
                "changelog/{name}: the name must be one of {}, followed by a word, as in `fixed-delay.md`",
                kinds()
            );
        };
        let text = fs::read_to_string(&path)?.trim().to_owned();
        ensure!(!text.is_empty(), "changelog/{name} is empty");
        found.push((path, kind, text));
    }
    Ok(found)
}

fn kinds() -> String {
    KINDS.map(|(kind, _)| kind).join(", ")
}

/// The entries under their headings.
fn section(fragments: &[(PathBuf, usize, String)]) -> Result<String> {
    let mut text = String::new();
    for (index, (_, heading)) in KINDS.iter().enumerate() {
        let mut own = fragments
            .iter()
            .filter(|(_, kind, _)| *kind == index)
            .peekable();
        if own.peek().is_none() {
            continue;
        }
        let gap = if text.is_empty() { "" } else { "\n" };
        writeln!(text, "{gap}### {heading}")?;
        for (_, _, entry) in own {
            let entry = entry.strip_prefix("- ").unwrap_or(entry);
            for (line, words) in entry.lines().enumerate() {
                let mark = if line == 0 { "- " } else { "  " };
                writeln!(text, "{}", format!("{mark}{}", words.trim()).trim_end())?;
            }
        }
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fragments_of_this_project_have_a_kind_and_a_text() {
        section(&fragments(&root().join("changelog")).expect("fragments")).expect("a section");
    }

    #[test]
    fn a_release_takes_the_fragments_into_the_changelog() {
        let folder = tempfile::tempdir().expect("a folder");
        let changes = folder.path().join("changelog");
        fs::create_dir(&changes).expect("a folder");
        let log = folder.path().join("CHANGELOG.md");
        fs::write(
            &log,
            "# Changelog\n\n## [0.1.0] - 2026-01-01\n\n### Added\n- All.\n",
        )
        .expect("a file");
        let write = |name: &str, text: &str| fs::write(changes.join(name), text).expect("a file");
        write("fixed-one.md", "One is\nright.\n");
        write("added-two.md", "- Two.\n");
        let release = ["0.2.0".to_owned(), "2026-02-01".to_owned()];
        changelog(folder.path(), &release).expect("a release");
        assert_eq!(
            fs::read_to_string(&log).expect("text"),
            "# Changelog\n\n## [0.2.0] - 2026-02-01\n\n### Added\n- Two.\n\n### Fixed\n- One is\n  right.\n\n\
             ## [0.1.0] - 2026-01-01\n\n### Added\n- All.\n"
        );
        assert!(changelog(folder.path(), &release).is_err());
        write("other.md", "Text.");
        let said = fragments(&changes).expect_err("no kind").to_string();
        assert!(said.contains("other.md"), "{said}");
    }
}
