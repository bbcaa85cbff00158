//! Checks the dependencies of both workspaces against `deny.toml`: licences, sources, versions.
//!
//! `cargo deny` reads the same file and checks more (advisories, which need the network); this check works offline.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result, bail};
use serde::Deserialize;

use crate::Task;
use crate::shell::root;

pub(crate) const TASK: Task = Task {
    name: "supply",
    does: "compares licences, sources and versions of the dependencies with deny.toml",
    run: |_| supply(),
};

/// The keys of `deny.toml` that are read here.
#[derive(Deserialize)]
struct Rules {
    graph: Graph,
    licenses: Licences,
    sources: Sources,
    bans: Bans,
}

#[derive(Deserialize)]
struct Graph {
    targets: Vec<String>,
}

#[derive(Deserialize)]
struct Licences {
    allow: BTreeSet<String>,
    exceptions: Vec<Exception>,
}

#[derive(Deserialize)]
struct Exception {
    #[serde(rename = "crate")]
    name: String,
    allow: BTreeSet<String>,
}

#[derive(Deserialize)]
struct Sources {
    #[serde(rename = "allow-registry")]
    allow_registry: Vec<String>,
}

#[derive(Deserialize)]
struct Bans {
    skip: Vec<Skip>,
}

#[derive(Deserialize)]
struct Skip {
    #[serde(rename = "crate")]
    name: String,
    #[allow(dead_code, reason = "there must be one")]
    reason: String,
}

/// The fields of `cargo metadata` that are read here.
#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

#[derive(Deserialize)]
struct Package {
    name: String,
    version: String,
    license: Option<String>,
    source: Option<String>,
}

pub(crate) fn supply() -> Result<()> {
    let path = root().join("deny.toml");
    let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    let rules: Rules = toml::from_str(&text).context("deny.toml")?;
    let mut workspaces = Vec::new();
    for workspace in [root(), root().join("firmware")] {
        workspaces.push(metadata(&workspace, &rules.graph.targets)?.packages);
    }
    let faults = faults(&workspaces, &rules);
    let packages: usize = workspaces.iter().map(Vec::len).sum();
    println!("{packages} packages, {} faults", faults.len());
    if faults.is_empty() {
        return Ok(());
    }
    bail!("{}", faults.join("\n"))
}

fn metadata(workspace: &Path, targets: &[String]) -> Result<Metadata> {
    let program = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let mut command = std::process::Command::new(program);
    command
        .args(["metadata", "--locked", "--format-version", "1"])
        .current_dir(workspace);
    for target in targets {
        command.args(["--filter-platform", target]);
    }
    let output = command.output().context("cargo metadata")?;
    if !output.status.success() {
        bail!("{}", String::from_utf8_lossy(&output.stderr));
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// Violations of the rules, one line each.
fn faults(workspaces: &[Vec<Package>], rules: &Rules) -> Vec<String> {
    let mut faults = Vec::new();
    let mut versions: BTreeMap<(&str, usize), BTreeSet<&str>> = BTreeMap::new();
    let each = workspaces.iter().enumerate();
    for (workspace, package) in each.flat_map(|(at, all)| all.iter().map(move |one| (at, one))) {
        let Package {
            name,
            version,
            license,
            source,
        } = package;
        versions
            .entry((name, workspace))
            .or_default()
            .insert(version);
        let allowed = |licence: &str| {
            let mut own = rules.licenses.exceptions.iter().filter(|e| e.name == *name);
            rules.licenses.allow.contains(licence) || own.any(|e| e.allow.contains(licence))
        };
        match license {
            None => faults.push(format!("{name} {version}: no licence is stated")),
            Some(text) if !is_allowed(text, &allowed) => {
                faults.push(format!("{name} {version}: licence {text}"));
            }
            Some(_) => {}
        }
        let registry = |source: &String| {
            let mut known = rules.sources.allow_registry.iter();
            known.any(|known| source.strip_prefix("registry+") == Some(known))
        };
        if source.as_ref().is_some_and(|source| !registry(source)) {
            faults.push(format!(
                "{name} {version}: from {}",
                source.as_deref().unwrap_or("")
            ));
        }
    }
    for ((name, _), versions) in &versions {
        let skipped = rules.bans.skip.iter().any(|skip| skip.name == *name);
        if versions.len() > 1 && !skipped {
            let versions: Vec<&str> = versions.iter().copied().collect();
            faults.push(format!(
                "{name}: the versions {} are used; find the reason and state it in deny.toml",
                versions.join(", ")
            ));
        }
    }
    for skip in &rules.bans.skip {
        let mut own = versions.iter().filter(|((name, _), _)| *name == skip.name);
        if own.all(|(_, versions)| versions.len() < 2) {
            let name = &skip.name;
            faults.push(format!(
                "{name}: only one version is used; remove the exception from deny.toml"
            ));
        }
    }
    faults
}

/// Whether an SPDX expression can be satisfied with the allowed licences: `AND` has precedence over `OR`, and `/`
/// is an old `OR`.
fn is_allowed(expression: &str, allowed: &impl Fn(&str) -> bool) -> bool {
    let text = expression
        .replace('/', " OR ")
        .replace('(', " ( ")
        .replace(')', " ) ");
    let mut words = text.split_whitespace().peekable();
    let satisfied = any_of(&mut words, allowed);
    satisfied && words.next().is_none()
}

type Words<'a> = std::iter::Peekable<std::str::SplitWhitespace<'a>>;

fn any_of(words: &mut Words<'_>, allowed: &impl Fn(&str) -> bool) -> bool {
    let mut satisfied = all_of(words, allowed);
    while words.next_if_eq(&"OR").is_some() {
        satisfied |= all_of(words, allowed);
    }
    satisfied
}

fn all_of(words: &mut Words<'_>, allowed: &impl Fn(&str) -> bool) -> bool {
    let mut satisfied = one(words, allowed);
    while words.next_if_eq(&"AND").is_some() {
        satisfied &= one(words, allowed);
    }
    satisfied
}

fn one(words: &mut Words<'_>, allowed: &impl Fn(&str) -> bool) -> bool {
    match words.next() {
        Some("(") => {
            let satisfied = any_of(words, allowed);
            satisfied & words.next_if_eq(&")").is_some()
        }
        Some(licence) if words.next_if_eq(&"WITH").is_some() => {
            let exception = words.next().unwrap_or_default();
            allowed(&format!("{licence} WITH {exception}"))
        }
        Some(licence) => allowed(licence),
        None => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expressions_are_understood() {
        let allowed = |licence: &str| {
            ["MIT", "BSD-3-Clause", "Apache-2.0 WITH LLVM-exception"].contains(&licence)
        };
        for (expression, expected) in [
            ("MIT", true),
            ("MIT/Apache-2.0", true),
            ("Apache-2.0", false),
            ("GPL-3.0 OR MIT", true),
            ("MIT AND GPL-3.0", false),
            ("MIT AND BSD-3-Clause", true),
            ("GPL-3.0 OR MIT AND GPL-2.0", false),
            ("(GPL-3.0 OR MIT) AND BSD-3-Clause", true),
            ("Apache-2.0 WITH LLVM-exception OR GPL-3.0", true),
            ("(MIT", false),
            ("", false),
        ] {
            assert_eq!(is_allowed(expression, &allowed), expected, "{expression}");
        }
    }

    #[test]
    fn what_is_against_the_rules_is_named() {
        let rules: Rules = toml::from_str(
            "[graph]\ntargets = []\n[licenses]\nallow = [\"MIT\"]\nexceptions = [{ crate = \"odd\", allow = [\"MPL-2.0\"] }]\n\
             [sources]\nallow-registry = [\"https://here\"]\n[bans]\nskip = [{ crate = \"gone\", reason = \"x\" }]\n",
        )
        .expect("rules");
        let package = |name: &str, version: &str, license: &str, source: Option<&str>| Package {
            name: name.into(),
            version: version.into(),
            license: Some(license.into()).filter(|text: &String| !text.is_empty()),
            source: source.map(str::to_owned),
        };
        let good = [package(
            "odd",
            "1.0.0",
            "MPL-2.0",
            Some("registry+https://here"),
        )];
        assert_eq!(faults(&[good.into()], &rules).len(), 1, "gone");
        let bad = [
            package("a", "1.0.0", "GPL-3.0", None),
            package("b", "1.0.0", "", None),
            package("c", "1.0.0", "MIT", Some("git+https://here")),
            package("c", "2.0.0", "MPL-2.0", None),
        ];
        let found = faults(&[bad.into()], &rules).join("\n");
        for part in [
            "a 1.0.0: licence GPL",
            "b 1.0.0: no licence",
            "c 1.0.0: from git",
            "c 2.0.0: licence MPL",
            "c: the versions 1.0.0, 2.0.0",
            "gone: ",
        ] {
            assert!(found.contains(part), "{part}: {found}");
        }
    }
}
