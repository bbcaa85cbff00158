//! The architecture page agrees with the code: dependencies of crates have one direction, and modules of the library
//! use only the modules below them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: impl AsRef<Path>) -> String {
    std::fs::read_to_string(root().join(path)).expect("a file of the project")
}

/// The crates of this project on which `package` depends, without those of its tests.
fn dependencies(package: &str) -> BTreeSet<String> {
    let manifest: toml::Table = read(format!("{package}/Cargo.toml")).parse().expect("TOML");
    let listed = manifest.get("dependencies").and_then(|d| d.as_table());
    let names = listed.into_iter().flat_map(|d| d.keys().cloned());
    let ours = |name: &String| CRATES.iter().any(|(crate_name, _)| crate_name == name);
    names.filter(ours).collect()
}

/// The crates from bottom to top, each with its allowed dependencies.
const CRATES: [(&str, &[&str]); 9] = [
    ("model-core", &[]),
    ("wire", &["model-core"]),
    ("numerics", &[]),
    ("recordings", &[]),
    ("rig-line", &["recordings", "wire"]),
    ("workbench", &["recordings"]),
    ("closed-loop", &["model-core"]),
    ("firmware-sim", &["closed-loop", "recordings"]),
    (
        "host-fit",
        // Simulator, line and workbench are used by the program only, so they are optional dependencies; see
        // the CI step "library alone".
        &[
            "closed-loop",
            "firmware-sim",
            "model-core",
            "numerics",
            "recordings",
            "rig-line",
            "workbench",
        ],
    ),
];

#[test]
fn crates_know_what_the_picture_says() {
    for (package, known) in CRATES {
        let known: BTreeSet<String> = known.iter().map(|name| (*name).to_owned()).collect();
        assert_eq!(dependencies(package), known, "{package}");
    }
    let manifest: toml::Table = read("host-fit/Cargo.toml").parse().expect("TOML");
    for package in ["firmware-sim", "rig-line", "workbench"] {
        let dependency = &manifest["dependencies"][package];
        assert_eq!(dependency.get("optional"), Some(&true.into()));
    }
}

/// The modules in the order of the page, from top to bottom.
fn rooms() -> Vec<String> {
    let page = read("docs/architecture.md");
    let (_, table) = page
        .split_once("## The modules of the library")
        .expect("the heading");
    let (table, _) = table.split_once("\n## ").expect("a next heading");
    let rows = table.lines().filter_map(|line| line.strip_prefix("| `"));
    rows.filter_map(|row| Some(row.split_once('`')?.0.to_owned()))
        .collect()
}

/// Sources of a module without unit tests and test files.
fn sources(path: &Path) -> Vec<(PathBuf, String)> {
    if path.is_dir() {
        let entries = std::fs::read_dir(path).expect("a folder");
        return entries
            .flat_map(|e| sources(&e.expect("an entry").path()))
            .collect();
    }
    let text = std::fs::read_to_string(path).expect("a source");
    let code = text
        .find("#[cfg(test)]\n")
        .map_or(&*text, |at| match &text[at..] {
            tests if tests.contains("mod tests {") => &text[..at],
            _ => &text,
        });
    let code = code
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"));
    vec![(path.to_owned(), code.collect::<Vec<_>>().join("\n"))]
}

/// Names after `crate::`, also those in braces.
fn used(code: &str) -> Vec<String> {
    let mut names = Vec::new();
    for (at, word) in code.match_indices("crate::") {
        let rest = &code[at + word.len()..];
        let name = |text: &str| -> String {
            let kept = text.trim_start().chars();
            kept.take_while(|c| c.is_alphanumeric() || *c == '_')
                .collect()
        };
        match rest.strip_prefix('{') {
            // One level is enough: names after a comma in nested braces are not modules.
            Some(list) => names.extend(list.split(';').next().unwrap_or("").split(',').map(name)),
            None => names.push(name(rest)),
        }
    }
    names
}

#[test]
fn rooms_use_the_rooms_below_them() {
    let rooms = rooms();
    let library = read("host-fit/src/lib.rs");
    let declared: BTreeSet<&str> = library
        .lines()
        .filter_map(|line| line.trim_start_matches("pub ").strip_prefix("mod "))
        .filter_map(|rest| rest.strip_suffix(';'))
        .collect();
    let listed: BTreeSet<&str> = rooms.iter().map(String::as_str).collect();
    assert_eq!(listed, declared, "the page lists what lib.rs declares");
    let mut arrows = 0;
    for (floor, room) in rooms.iter().enumerate() {
        let folder = root().join("host-fit/src").join(room);
        let path = if folder.is_dir() {
            folder
        } else {
            folder.with_extension("rs")
        };
        for (file, code) in sources(&path) {
            // A file of tests may use any module.
            if file.ends_with("residual/plants.rs") {
                continue;
            }
            for name in used(&code) {
                if let Some(other) = rooms.iter().position(|r| *r == name) {
                    arrows += usize::from(other > floor);
                    assert!(
                        other >= floor,
                        "{} uses {name}, which is above it",
                        file.display()
                    );
                }
            }
        }
    }
    assert!(arrows > 50, "{arrows} arrows");
}
