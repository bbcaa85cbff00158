//! Checks that every published crate can be published: its metadata are complete, its package contains all files
//! that are compiled, and cargo packs it.
//!
//! Cargo's own check compiles each package (`--verify`), which takes minutes. The list of files that the compiler
//! read for the program shows files outside a package at once.

use crate::Task;
use crate::shell::{cargo, output, root, run, target};
use anyhow::{Context, Result, bail};
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

pub(crate) const TASK: Task = Task {
    name: "package",
    does: "packs every published crate and searches for missing files and metadata; --verify compiles the packages, too",
    run: package,
};

/// The programs whose lists of files are read; together they contain every published crate.
const PROGRAMS: [&str; 2] = ["host-fit", "firmware-sim"];

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Card>,
}

/// Metadata of a crate that a registry and its users need.
#[derive(Clone, Deserialize)]
struct Card {
    name: String,
    manifest_path: PathBuf,
    /// Empty if the crate is not published.
    publish: Option<Vec<String>>,
    description: Option<String>,
    license: Option<String>,
    readme: Option<String>,
    rust_version: Option<String>,
    #[serde(default)]
    keywords: Vec<String>,
    #[serde(default)]
    categories: Vec<String>,
    dependencies: Vec<Dependency>,
}

#[derive(Clone, Deserialize)]
struct Dependency {
    name: String,
    req: String,
    kind: Option<String>,
    path: Option<PathBuf>,
}

impl Card {
    fn is_published(&self) -> bool {
        self.publish
            .as_ref()
            .is_none_or(|where_to| !where_to.is_empty())
    }

    fn folder(&self) -> &Path {
        self.manifest_path.parent().unwrap_or(&self.manifest_path)
    }
}

fn package(arguments: &[String]) -> Result<()> {
    let verify = match arguments {
        [] => false,
        [only] if only == "--verify" => true,
        _ => bail!("the only option is --verify"),
    };
    let metadata = output(&mut cargo(
        "metadata --no-deps --offline --format-version 1",
    ))?;
    let metadata: Metadata = serde_json::from_str(&metadata).context("cargo metadata")?;
    let (published, kept): (Vec<Card>, Vec<Card>) =
        metadata.packages.into_iter().partition(Card::is_published);
    let mut faults = cards(&published);

    let mut packed = BTreeSet::new();
    for card in &published {
        let list = cargo("package --list --allow-dirty --quiet --package");
        let list = files(list, &card.name)?;
        for licence in ["LICENSE-MIT", "LICENSE-APACHE"] {
            if !list.contains(Path::new(licence)) {
                faults.push(format!("{}: {licence} is not in its package", card.name));
            }
        }
        packed.extend(list.into_iter().map(|file| card.folder().join(file)));
    }
    faults.extend(outside(&packed)?);

    let mut pack = cargo("package --workspace --offline --allow-dirty --quiet");
    if !verify {
        pack.arg("--no-verify");
    }
    for card in &kept {
        pack.args(["--exclude", &card.name]);
    }
    if let Err(error) = run(&mut pack) {
        faults.push(format!("{error:#}"));
    }
    println!(
        "{} crates to publish, {} faults",
        published.len(),
        faults.len()
    );
    if faults.is_empty() {
        return Ok(());
    }
    bail!("{}", faults.join("\n"))
}

/// The files of a package, relative to its folder.
fn files(mut list: std::process::Command, name: &str) -> Result<BTreeSet<PathBuf>> {
    let list = output(list.arg(name))?;
    Ok(list.lines().map(PathBuf::from).collect())
}

/// Missing metadata of the crates, one line each.
fn cards(published: &[Card]) -> Vec<String> {
    let mut faults = Vec::new();
    for card in published {
        for (key, is_there) in [
            ("description", card.description.is_some()),
            ("license", card.license.is_some()),
            ("readme", card.readme.is_some()),
            ("rust-version", card.rust_version.is_some()),
            ("keywords", !card.keywords.is_empty()),
            ("categories", !card.categories.is_empty()),
        ] {
            if !is_there {
                faults.push(format!("{}: Cargo.toml has no `{key}`", card.name));
            }
        }
        // Cargo omits development dependencies from a package.
        let needed = card
            .dependencies
            .iter()
            .filter(|d| d.kind.as_deref() != Some("dev"));
        for dependency in needed.filter(|dependency| dependency.path.is_some()) {
            let name = &dependency.name;
            if dependency.req == "*" {
                faults.push(format!(
                    "{}: its dependency {name} has no version",
                    card.name
                ));
            }
            if !published.iter().any(|other| other.name == *name) {
                faults.push(format!(
                    "{}: it needs {name}, which is not published",
                    card.name
                ));
            }
        }
    }
    faults
}

/// The project's files from which the programs are compiled and that no package contains.
fn outside(packed: &BTreeSet<PathBuf>) -> Result<Vec<String>> {
    // `cargo test` compiles the programs without these lists.
    let mut build = cargo("build --release --quiet");
    run(build.args(PROGRAMS.map(|program| format!("--package={program}"))))?;
    let mut missing = BTreeSet::new();
    let root = root();
    for program in PROGRAMS {
        let list = target().join("release").join(program).with_extension("d");
        let text = std::fs::read_to_string(&list).with_context(|| list.display().to_string())?;
        let read = read_files(&text);
        if read.is_empty() {
            bail!("{} names no files", list.display());
        }
        let own = read.into_iter().filter(|file| file.starts_with(&root));
        missing.extend(own.filter(|file| !packed.contains(file)));
    }
    let missing = missing.iter().map(|file| {
        let file = file.strip_prefix(&root).unwrap_or(file);
        format!(
            "{}: it is compiled into the program, but no package contains it",
            file.display()
        )
    });
    Ok(missing.collect())
}

/// The files in a rule `program: file file …` in make's notation, without `.` and `..`.
fn read_files(rule: &str) -> BTreeSet<PathBuf> {
    let Some((_, files)) = rule.lines().next().and_then(|line| line.split_once(": ")) else {
        return BTreeSet::new();
    };
    // A space in a name is preceded by a backslash.
    let files = files.replace("\\ ", "\0");
    let files = files.split_whitespace().map(|file| file.replace('\0', " "));
    files.map(|file| straight(Path::new(&file))).collect()
}

fn straight(path: &Path) -> PathBuf {
    path.components()
        .fold(PathBuf::new(), |mut straight, part| {
            match part {
                Component::ParentDir => {
                    straight.pop();
                }
                Component::CurDir => {}
                part => straight.push(part),
            }
            straight
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_compiler_read_is_found_straight() {
        let rule =
            "/t/host-fit: /p/a/src/main.rs /p/a/src/b/../../../data/my\\ set.csv\n\n/p/other:\n";
        let found: Vec<PathBuf> = read_files(rule).into_iter().collect();
        assert_eq!(
            found,
            ["/p/a/src/main.rs", "/p/data/my set.csv"].map(PathBuf::from)
        );
        assert!(read_files("").is_empty());
    }

    #[test]
    fn what_a_card_lacks_is_named() {
        let dependency = |name: &str, req: &str, kind: Option<&str>| Dependency {
            name: name.into(),
            req: req.into(),
            kind: kind.map(str::to_owned),
            path: Some("/p".into()),
        };
        let good = Card {
            name: "a".into(),
            manifest_path: "/p/a/Cargo.toml".into(),
            publish: None,
            description: Some("does".into()),
            license: Some("MIT".into()),
            readme: Some("README.md".into()),
            rust_version: Some("1.89".into()),
            keywords: vec!["k".into()],
            categories: vec!["science".into()],
            dependencies: vec![dependency("firmware", "*", Some("dev"))],
        };
        assert_eq!(cards(std::slice::from_ref(&good)), Vec::<String>::new());
        let bad = Card {
            keywords: Vec::new(),
            dependencies: vec![dependency("a", "*", None), dependency("b", "^0.1.0", None)],
            ..good
        };
        assert_eq!(
            cards(&[bad]),
            [
                "a: Cargo.toml has no `keywords`",
                "a: its dependency a has no version",
                "a: it needs b, which is not published",
            ]
        );
    }
}
