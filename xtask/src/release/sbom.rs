//! What the program is made of, as CycloneDX 1.5: every crate of its tree with version, licence and checksum.

use crate::shell::{cargo, output, root};
use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
    resolve: Graph,
}

#[derive(Deserialize)]
struct Package {
    id: String,
    name: String,
    version: String,
    license: Option<String>,
    source: Option<String>,
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

/// None where the crate is part of the program; "dev" and "build" otherwise.
#[derive(Deserialize)]
struct Kind {
    kind: Option<String>,
}

/// What of `Cargo.lock` is read here.
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

/// The document for the program `host-fit` as built for the target `triple`. It has neither a time nor a number of its own:
/// the same tree gives the same bytes.
pub(super) fn document(triple: &str) -> Result<String> {
    let metadata = output(&mut cargo(&[
        "metadata",
        "--locked",
        "--format-version=1",
        "--filter-platform",
        triple,
    ]))?;
    let metadata: Metadata = serde_json::from_str(&metadata).context("cargo metadata")?;
    let lock = std::fs::read_to_string(root().join("Cargo.lock")).context("Cargo.lock")?;
    let lock: Lock = toml::from_str(&lock).context("Cargo.lock")?;
    Ok(serde_json::to_string_pretty(&bom(&metadata, &lock)?)? + "\n")
}

fn bom(metadata: &Metadata, lock: &Lock) -> Result<Value> {
    let packages: BTreeMap<&str, &Package> = metadata
        .packages
        .iter()
        .map(|one| (one.id.as_str(), one))
        .collect();
    let nodes: BTreeMap<&str, &Node> = metadata
        .resolve
        .nodes
        .iter()
        .map(|node| (node.id.as_str(), node))
        .collect();
    let checksums: BTreeMap<(&str, &str), &str> = lock
        .package
        .iter()
        .filter_map(|one| {
            Some((
                (one.name.as_str(), one.version.as_str()),
                one.checksum.as_deref()?,
            ))
        })
        .collect();
    let program = metadata.packages.iter().find(|one| one.name == "host-fit");
    let program = program.context("no package `host-fit`")?;
    let needs = |id: &str| -> BTreeSet<&str> {
        let edges = nodes.get(id).map_or(&[][..], |node| &node.deps);
        let part = |edge: &&Edge| edge.dep_kinds.iter().any(|kind| kind.kind.is_none());
        edges
            .iter()
            .filter(part)
            .map(|edge| edge.pkg.as_str())
            .collect()
    };
    // Everything that is reached from the program.
    let (mut reached, mut open) = (BTreeSet::new(), vec![program.id.as_str()]);
    while let Some(id) = open.pop() {
        if reached.insert(id) {
            open.extend(needs(id));
        }
    }
    let find = |id: &str| {
        packages
            .get(id)
            .copied()
            .with_context(|| format!("no package {id}"))
    };
    let mut made_of = reached
        .iter()
        .map(|id| find(id))
        .collect::<Result<Vec<_>>>()?;
    made_of.sort_by_key(|one| (&one.name, &one.version));
    let mut components = Vec::new();
    let mut dependencies = Vec::new();
    for package in made_of {
        let mut on = needs(&package.id)
            .into_iter()
            .map(|id| find(id).map(locator))
            .collect::<Result<Vec<_>>>()?;
        on.sort();
        dependencies.push(json!({ "ref": locator(package), "dependsOn": on }));
        if package.id != program.id {
            let checksum = checksums.get(&(package.name.as_str(), package.version.as_str()));
            ensure!(
                package.source.is_none() || checksum.is_some(),
                "Cargo.lock has no checksum of {} {}",
                package.name,
                package.version
            );
            components.push(component(package, "library", checksum.copied())?);
        }
    }
    Ok(json!({
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": { "component": component(program, "application", None)? },
        "components": components,
        "dependencies": dependencies,
    }))
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
    // An old way to write it.
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
        let package = |name: &str, source: Option<&str>| json!({ "id": name, "name": name, "version": "1.0.0", "license": "MIT/Apache-2.0", "source": source });
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
        bom(&serde_json::from_value(metadata)?, &toml::from_str(&lock)?)
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
            ])
        );
        assert_eq!(
            bom["dependencies"][1],
            json!({ "ref": "pkg:cargo/host-fit@1.0.0", "dependsOn": ["pkg:cargo/own@1.0.0"] })
        );
    }

    #[test]
    fn a_crate_from_afar_without_a_checksum_is_refused() {
        let error = tree("").expect_err("refused");
        assert!(error.to_string().contains("far 1.0.0"), "{error}");
    }
}
