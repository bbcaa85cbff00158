//! Test that an effect of each place and a delay law can be added with one file and one line. They are
//! added to a copy of the tree, which is built. The program then has to list them, try them in a diagnosis,
//! fit the law and generate constants from it.

use super::{MODEL, write};
use crate::shell::{cargo, output, root, run, target};
use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// An effect at every place, from the templates.
const EFFECTS: [(&str, &str); 3] = [
    ("scratch-nozzle", "jet"),
    ("scratch-wall", "flow"),
    ("scratch-film", "sensor"),
];
const LAW: &str = "clamped-linear-delay";
/// A different name from the product's, since both share the folder of build products.
const PROGRAM: &str = "host-fit-scratch";

pub(crate) fn proof() -> Result<()> {
    let copy = target().join("scratch-copy");
    if copy.exists() {
        fs::remove_dir_all(&copy)?;
    }
    copy_tree(&root(), &copy)?;
    for workspace in ["", "firmware"] {
        rename_version(&copy.join(workspace).join("Cargo.toml"))?;
    }
    compile_quickly(&copy.join("Cargo.toml"))?;
    for (name, place) in EFFECTS {
        write(&copy, name, place)?;
    }
    write(&copy, LAW, "delay")?;
    let law = copy.join(MODEL).join("clamped_linear_delay.rs");
    fs::write(&law, include_str!("clamped_linear_delay.txt"))?;

    run(
        cargo("test --release --package=model-core --package=firmware-sim --lib effects")
            .in_copy(&copy),
    )?;
    let manifest = copy.join("host-fit/Cargo.toml");
    let mut text = fs::read_to_string(&manifest)?;
    write!(
        text,
        "\n[[bin]]\nname = \"{PROGRAM}\"\npath = \"src/main.rs\"\n"
    )?;
    fs::write(&manifest, text)?;
    run(cargo("build --release --package host-fit --bin")
        .arg(PROGRAM)
        .in_copy(&copy))?;
    let tool = |arguments: &[&str]| -> Result<Value> {
        let program = target().join("release").join(PROGRAM);
        let mut command = std::process::Command::new(program);
        let text = output(command.args(arguments).arg("--json").current_dir(&copy))?;
        serde_json::from_str(&text).with_context(|| format!("no JSON from {arguments:?}"))
    };

    let listed = tool(&["effects"])?;
    let added = || EFFECTS.map(|(name, _)| name).into_iter().chain([LAW]);
    for name in added() {
        if !has(&listed, "name", name) {
            bail!("`host-fit effects` does not list {name}");
        }
    }
    let data = copy.join("scratch-data");
    let model = recordings(&data)?;
    let (data, model) = (data.display().to_string(), model.display().to_string());
    let diagnosis = tool(&["diagnose", &model, &data, "--most-effects", "1"])?;
    for name in added() {
        if !has(&diagnosis["ranking"], "effect", name) {
            bail!("`host-fit diagnose` has not tried {name}: {diagnosis}");
        }
    }
    let with_law = copy.join("scratch-model.toml").display().to_string();
    tool(&["extend", &model, &data, "--effect", LAW, "-o", &with_law])?;
    let constants = copy
        .join("firmware/identified/src/full.rs")
        .display()
        .to_string();
    tool(&["codegen", &with_law, "-o", &constants])?;
    run(cargo("check --release --package identified").in_copy(&copy))
}

/// Gives the packages of a workspace another version: cargo distinguishes build products by name and version,
/// not by folder.
fn rename_version(manifest: &Path) -> Result<()> {
    const BEFORE: &str = "[workspace.package]\nversion = \"";
    let text = fs::read_to_string(manifest)?;
    let version = text.find(BEFORE).map(|at| at + BEFORE.len());
    let end = version.and_then(|from| Some(from + text[from..].find('"')?));
    let Some(end) = end else {
        bail!("{} names no version first", manifest.display());
    };
    let (before, after) = text.split_at(end);
    let own = &before[version.unwrap_or(end)..];
    // The packages of the copy refer to each other by this version.
    let after = after.replace(
        &format!("version = \"{own}\" }}"),
        &format!("version = \"{own}-scratch\" }}"),
    );
    Ok(fs::write(manifest, format!("{before}-scratch{after}"))?)
}

/// Reduces the optimisation of the copy's packages, which run for seconds only.
fn compile_quickly(manifest: &Path) -> Result<()> {
    let mut text = fs::read_to_string(manifest)?;
    let workspace: toml::Table = text.parse()?;
    let members = workspace["workspace"]["members"].as_array();
    for member in members.into_iter().flatten().filter_map(|m| m.as_str()) {
        let table = format!("[profile.release.package.{member}]");
        // The scenarios' package has another name than its folder and is not compiled.
        if member != "tests" && !text.contains(&table) {
            write!(text, "\n{table}\nopt-level = 0\n")?;
        }
    }
    Ok(fs::write(manifest, text)?)
}

trait InCopy {
    fn in_copy(&mut self, copy: &Path) -> &mut Self;
}

impl InCopy for std::process::Command {
    /// Uses the product's build folder, so that the libraries are not rebuilt.
    fn in_copy(&mut self, copy: &Path) -> &mut Self {
        self.current_dir(copy).env("CARGO_TARGET_DIR", target())
    }
}

/// Whether a list has an entry whose `key` is `value`.
fn has(list: &Value, key: &str, value: &str) -> bool {
    let entries = list.as_array().map_or(&[][..], Vec::as_slice);
    entries.iter().any(|entry| entry[key] == value)
}

/// Copies everything except build products and hidden files.
fn copy_tree(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        // Links are followed: the program's data is linked into its package.
        let (name, kind) = (entry.file_name(), fs::metadata(entry.path())?);
        let skipped = name.to_string_lossy().starts_with('.') && name != ".cargo";
        if skipped || entry.path() == target() || name == "target" {
            continue;
        }
        let path = to.join(&name);
        if kind.is_dir() {
            copy_tree(&entry.path(), &path)?;
        } else if kind.is_file() {
            fs::copy(entry.path(), &path)
                .with_context(|| format!("could not copy {}", entry.path().display()))?;
        }
    }
    Ok(())
}

/// Short records of a flow whose delay decreases linearly with its mean friction down to a minimum, and a
/// low-order model without that law.
fn recordings(folder: &Path) -> Result<std::path::PathBuf> {
    const RECORDS: [(&str, &str, usize); 2] = [("a", "identify", 330), ("b", "validate", 230)];
    const WINDOW: usize = 250;
    fs::create_dir_all(folder)?;
    let mut set = String::from("sample_period_s = 0.001\n");
    let mut noise = 1_u32;
    for (name, role, half_period) in RECORDS {
        let mut table = String::from("t,u,y\n");
        let (mut friction, mut commands) = (vec![0.0_f64], Vec::new());
        for k in 0..1200_usize {
            let u = f64::from(u8::from(k / half_period % 2 == 1 && k / 60 % 5 != 3));
            commands.push(u);
            let y = friction[k];
            // A linear congruential generator as noise.
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let measured = y + (f64::from(noise) / f64::from(u32::MAX) - 0.5) * 0.01;
            writeln!(table, "{},{u},{measured}", k as f64 * 0.001)?;
            let recent: f64 = friction.iter().rev().skip(1).take(WINDOW - 1).sum();
            let delay = f64::max(60.0 - 50.0 * recent / WINDOW as f64, 25.0);
            let (whole, part) = (delay.floor(), delay.fract());
            let jet = |back: usize| k.checked_sub(back).map_or(0.0, |past| commands[past]);
            let whole = whole as usize;
            let arrived = jet(whole) + part * (jet(whole + 1) - jet(whole));
            friction.push(y + 0.03 * (arrived - y));
        }
        fs::write(folder.join(name).with_extension("csv"), table)?;
        write!(
            set,
            "[[record]]\nname = \"{name}\"\nfile = \"{name}.csv\"\nuse = \"{role}\"\n"
        )?;
    }
    fs::write(folder.join("dataset.toml"), set)?;
    let model = folder.join("lean.toml");
    fs::write(
        &model,
        "format_version = 1
sample_period_s = 0.001
lag_convention = \"one-step\"
[structure]
averaged = false
window = 250
state_lags = [1]
product_lags = [1]
[coefficients]
a = [0.98]
b = [0.02]
c = [[0.0]]
[delay]
law = \"fixed\"
delays = [40]
",
    )?;
    Ok(model)
}
