//! The parts of the program, as CycloneDX 1.5: every crate of its tree with version, licence and checksum.

use crate::shell::{cargo, output, root};
use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::PathBuf;

const PAGES: &str = "host-fit/web/package-lock.json";

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
    resolve: Graph,
}

#[derive(Deserialize)]
pub(super) struct Package {
    id: String,
    pub(super) name: String,
    pub(super) version: String,
    pub(super) license: Option<String>,
    /// `None` if it belongs to this project.
    pub(super) source: Option<String>,
    pub(super) manifest_path: PathBuf,
}

#[derive(Deserialize)]
struct Graph {
    nodes: Vec<Node>,
}

#[derive(Deserialize)]
struct Node {
    id: String,
    deps: Vec<Edge>,
}

#[derive(Deserialize)]
struct Edge {
    pkg: String,
    dep_kinds: Vec<Kind>,
}

/// `None` if the crate is part of the program; "dev" and "build" otherwise.
#[derive(Deserialize)]
struct Kind {
    kind: Option<String>,
}

/// The keys of `Cargo.lock` that are read here.
#[derive(Deserialize)]
struct Lock {
    package: Vec<Locked>,
}

#[derive(Deserialize)]
struct Locked {
    name: String,
    version: String,
    checksum: Option<String>,
}

/// The crates of the program for the target `triple`, and the checksums of all.
pub(super) struct Parts {
    metadata: Metadata,
    lock: Lock,
    pages: Value,
}

impl Parts {
    pub(super) fn new(triple: &str) -> Result<Self> {
        let metadata =
            output(cargo("metadata --locked --format-version=1 --filter-platform").arg(triple))?;
        let read = |path: &str| std::fs::read_to_string(root().join(path)).context(path.to_owned());
        Ok(Self {
            metadata: serde_json::from_str(&metadata).context("cargo metadata")?,
            lock: toml::from_str(&read("Cargo.lock")?).context("Cargo.lock")?,
            pages: serde_json::from_str(&read(PAGES)?).context(PAGES)?,
        })
    }

    /// Everything reachable from the program, by name, without the dependencies of tests and builds.
    pub(super) fn crates(&self) -> Result<Vec<&Package>> {
        let program = self.program()?;
        let (mut reached, mut open) = (BTreeSet::new(), vec![program.id.as_str()]);
        while let Some(id) = open.pop() {
            if reached.insert(id) {
                open.extend(self.needs(id));
            }
        }
        let packages = self.metadata.packages.iter();
        let mut crates: Vec<&Package> = packages
            .filter(|one| reached.contains(one.id.as_str()))
            .collect();
        ensure!(
            crates.len() == reached.len(),
            "cargo metadata lacks packages of its own graph"
        );
        crates.sort_by_key(|one| (&one.name, &one.version));
        Ok(crates)
    }

    fn program(&self) -> Result<&Package> {
        let program = self
            .metadata
            .packages
            .iter()
            .find(|one| one.name == "host-fit");
        program.context("no package `host-fit`")
    }

    fn needs(&self, id: &str) -> BTreeSet<&str> {
        let node = self
            .metadata
            .resolve
            .nodes
            .iter()
            .find(|node| node.id == id);
        let edges = node.map_or(&[][..], |node| &node.deps);
        let part = |edge: &&Edge| edge.dep_kinds.iter().any(|kind| kind.kind.is_none());
        edges
            .iter()
            .filter(part)
            .map(|edge| edge.pkg.as_str())
            .collect()
    }

    /// The document. It contains neither a time nor a serial number: the same tree gives the same bytes.
    pub(super) fn document(&self) -> Result<String> {
        Ok(serde_json::to_string_pretty(&self.bom()?)? + "\n")
    }

    fn bom(&self) -> Result<Value> {
        let (program, crates) = (self.program()?, self.crates()?);
        let (mut components, mut dependencies) = (Vec::new(), Vec::new());
        let pages = pages(&self.pages)?;
        for package in &crates {
            let needs = self.needs(&package.id);
            let on = crates.iter().filter(|one| needs.contains(one.id.as_str()));
            let mut on: Vec<Value> = on.map(|one| locator(one).into()).collect();
            let is_program = package.id == program.id;
            if is_program {
                on.extend(pages.iter().map(|one| one["bom-ref"].clone()));
            }
            dependencies.push(json!({ "ref": locator(package), "dependsOn": on }));
            if is_program {
                continue;
            }
            let is_it = |one: &&Locked| one.name == package.name && one.version == package.version;
            let checksum = self
                .lock
                .package
                .iter()
                .find(is_it)
                .and_then(|one| one.checksum.as_deref());
            ensure!(
                package.source.is_none() || checksum.is_some(),
                "Cargo.lock has no checksum of {} {}",
                package.name,
                package.version
            );
            components.push(component(package, "library", checksum)?);
        }
        components.extend(pages);
        Ok(json!({
            "bomFormat": "CycloneDX",
            "specVersion": "1.5",
            "version": 1,
            "metadata": { "component": component(program, "application", None)? },
            "components": components,
            "dependencies": dependencies,
        }))
    }
}

/// The parts of the report pages, which the program contains.
fn pages(lock: &Value) -> Result<Vec<Value>> {
    let packages = lock["packages"]
        .as_object()
        .with_context(|| format!("{PAGES}: no packages"))?;
    let mut components = Vec::new();
    for (path, package) in packages {
        let Some(name) = path.strip_prefix("node_modules/") else {
            continue;
        };
        if package["dev"] == true {
            continue;
        }
        let text = |key: &str| {
            package[key]
                .as_str()
                .with_context(|| format!("{PAGES}: {name} has no {key}"))
        };
        let (version, sum) = (text("version")?, text("integrity")?);
        let sum = sum.strip_prefix("sha512-").and_then(hexadecimal);
        let locator = format!("pkg:npm/{name}@{version}");
        components.push(json!({
            "type": "library",
            "bom-ref": locator,
            "name": name,
            "version": version,
            "purl": locator,
            "licenses": [{ "expression": text("license")? }],
            "hashes": [{ "alg": "SHA-512", "content": sum.with_context(|| format!("{PAGES}: cannot read the checksum of {name}"))? }],
        }));
    }
    Ok(components)
}

/// Base64 as digits of four bits.
fn hexadecimal(base64: &str) -> Option<String> {
    const DIGITS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digits = base64.trim_end_matches('=');
    let mut bits = String::new();
    for byte in digits.bytes() {
        let value = DIGITS.iter().position(|digit| *digit == byte)?;
        bits.push_str(&format!("{value:06b}"));
    }
    let whole = bits.get(..bits.len() / 8 * 8)?;
    let nibbles = (0..whole.len())
        .step_by(4)
        .map(|at| u8::from_str_radix(whole.get(at..at + 4)?, 2).ok());
    nibbles
        .map(|nibble| Some(format!("{:x}", nibble?)))
        .collect()
}

fn locator(package: &Package) -> String {
    format!(
        "pkg:cargo/{}@{}",
        package.name,
        package.version.replace('+', "%2B")
    )
}

fn component(package: &Package, kind: &str, checksum: Option<&str>) -> Result<Value> {
    let Package {
        name,
        version,
        license,
        ..
    } = package;
    let license = license
        .as_ref()
        .with_context(|| format!("{name} states no licence"))?;
    // Old notation of a licence expression.
    let license = license.replace('/', " OR ").replace("  ", " ");
    let mut component = json!({
        "type": kind,
        "bom-ref": locator(package),
        "name": name,
        "version": version,
        "purl": locator(package),
        "licenses": [{ "expression": license }],
    });
    if let Some(checksum) = checksum {
        component["hashes"] = json!([{ "alg": "SHA-256", "content": checksum }]);
    }
    Ok(component)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree(checksum: &str) -> Result<Value> {
        let package = |name: &str, source: Option<&str>| json!({ "id": name, "name": name, "version": "1.0.0", "license": "MIT/Apache-2.0", "source": source, "manifest_path": "/p" });
        let edge =
            |to: &str, kind: Option<&str>| json!({ "pkg": to, "dep_kinds": [{ "kind": kind }] });
        let metadata = json!({
            "packages": [
                package("host-fit", None), package("own", None),
                package("far", Some("registry")), package("tests-only", Some("registry")),
            ],
            "resolve": { "nodes": [
                { "id": "host-fit", "deps": [edge("own", None), edge("tests-only", Some("dev"))] },
                { "id": "own", "deps": [edge("far", None)] },
                { "id": "far", "deps": [] },
                { "id": "tests-only", "deps": [] },
            ] },
        });
        let lock = format!("[[package]]\nname = \"far\"\nversion = \"1.0.0\"\n{checksum}");
        let pages = json!({ "packages": {
            "": { "license": "MIT" },
            "node_modules/drawn": { "version": "2.0.0", "license": "MIT", "integrity": "sha512-q80=" },
            "node_modules/checked": { "version": "3.0.0", "dev": true },
        } });
        let metadata = serde_json::from_value(metadata)?;
        Parts {
            metadata,
            lock: toml::from_str(&lock)?,
            pages,
        }
        .bom()
    }

    #[test]
    fn the_tree_of_the_program_is_listed_and_nothing_else() {
        let bom = tree("checksum = \"ab\"").expect("a document");
        assert_eq!(
            bom["components"],
            json!([
                {
                    "type": "library", "bom-ref": "pkg:cargo/far@1.0.0", "name": "far", "version": "1.0.0",
                    "purl": "pkg:cargo/far@1.0.0", "licenses": [{ "expression": "MIT OR Apache-2.0" }],
                    "hashes": [{ "alg": "SHA-256", "content": "ab" }],
                },
                {
                    "type": "library", "bom-ref": "pkg:cargo/own@1.0.0", "name": "own", "version": "1.0.0",
                    "purl": "pkg:cargo/own@1.0.0", "licenses": [{ "expression": "MIT OR Apache-2.0" }],
                },
                {
                    "type": "library", "bom-ref": "pkg:npm/drawn@2.0.0", "name": "drawn", "version": "2.0.0",
                    "purl": "pkg:npm/drawn@2.0.0", "licenses": [{ "expression": "MIT" }],
                    "hashes": [{ "alg": "SHA-512", "content": "abcd" }],
                },
            ])
        );
        assert_eq!(
            bom["dependencies"][1],
            json!({ "ref": "pkg:cargo/host-fit@1.0.0", "dependsOn": ["pkg:cargo/own@1.0.0", "pkg:npm/drawn@2.0.0"] })
        );
    }

    #[test]
    fn a_crate_from_afar_without_a_checksum_is_refused() {
        let error = tree("").expect_err("refused");
        assert!(error.to_string().contains("far 1.0.0"), "{error}");
    }
}
