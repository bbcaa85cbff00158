//! The licences of the third-party code in the program: the text of each, and its owners.

use super::sbom::{Package, Parts};
use anyhow::{Context, Result};
use std::collections::BTreeMap;

/// Beginnings of the names of licence files.
const NAMES: [&str; 5] = ["licen", "copying", "notice", "unlicense", "copyright"];

/// The text: equal licences once, after the names of their crates.
pub(super) fn text(parts: &Parts) -> Result<String> {
    let mut crates: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut unsaid = Vec::new();
    for package in parts.crates()? {
        if package.source.is_none() {
            continue;
        }
        let name = format!("{} {}", package.name, package.version);
        let found = licences(package).with_context(|| name.clone())?;
        if found.is_empty() {
            let licence = package.license.as_deref().unwrap_or("none");
            unsaid.push(format!("{name}: {licence}"));
        }
        for licence in found {
            crates.entry(licence).or_default().push(name.clone());
        }
    }
    let mut sections: Vec<String> = crates
        .iter()
        .map(|(licence, names)| format!("{}\n\n{licence}\n", names.join(", ")))
        .collect();
    sections.sort();
    let rule = format!("\n{}\n\n", "-".repeat(80));
    let mut text =
        "The program contains these crates. The report pages contain uPlot, with its licence.\n"
            .to_owned();
    if !unsaid.is_empty() {
        text.push_str("\nPackages without the text of their licence:\n");
        text.push_str(&unsaid.join("\n"));
        text.push('\n');
    }
    for section in sections {
        text.push_str(&rule);
        text.push_str(&section);
    }
    Ok(text)
}

/// The licences in a crate's folder.
fn licences(package: &Package) -> Result<Vec<String>> {
    let folder = package.manifest_path.parent().context("no folder")?;
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().to_lowercase();
        if NAMES.iter().any(|begin| name.starts_with(begin)) && entry.path().is_file() {
            let text = std::fs::read_to_string(entry.path()).with_context(|| name.clone())?;
            found.push(text.replace('\r', "").trim().to_owned());
        }
    }
    Ok(found)
}
