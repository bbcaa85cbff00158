//! Makes a module of every generated file in the folder that the variable `IDENTIFIED` names, or in `generated` if
//! it names none. The rig's constants, `rig.rs`, are a separate module; if the folder has none, those in
//! `generated` are used.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

fn main() {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("generated");
    let folder = std::env::var_os("IDENTIFIED").map_or(own.clone(), PathBuf::from);
    println!("cargo::rerun-if-env-changed=IDENTIFIED");
    println!("cargo::rerun-if-changed={}", folder.display());
    let out = std::env::var_os("OUT_DIR").map_or_else(PathBuf::new, PathBuf::from);
    println!("cargo::rerun-if-changed={}", own.display());
    let written = modules(&folder, &own).and_then(|text| {
        std::fs::write(out.join("models.rs"), text).map_err(|error| error.to_string())
    });
    if let Err(error) = written {
        println!("cargo::error={}: {error}", folder.display());
    }
}

/// The modules, the model of the boards, and a macro over all.
fn modules(folder: &Path, own: &Path) -> Result<String, String> {
    let entries = std::fs::read_dir(folder).map_err(|error| error.to_string())?;
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "rs"))
        .collect();
    files.sort();
    let is_rig = |file: &PathBuf| file.file_name().is_some_and(|name| name == "rig.rs");
    let rig = files.iter().find(|file| is_rig(file)).cloned();
    let rig = rig.unwrap_or_else(|| own.join("rig.rs"));
    files.retain(|file| !is_rig(file));
    let name = |file: &PathBuf| {
        file.file_stem()
            .map(|stem| stem.to_string_lossy().into_owned())
    };
    let names: Vec<String> = files.iter().filter_map(name).collect();
    let mut text = String::new();
    for (file, name) in files.iter().zip(&names) {
        let _ = writeln!(text, "#[path = {file:?}]\npub mod {name};");
    }
    let _ = writeln!(text, "#[path = {rig:?}]\npub mod rig;");
    if !names.iter().any(|name| name == "on_board") {
        text.push_str("/// The model that the boards run.\npub use full as on_board;\n");
    }
    let _ = writeln!(
        text,
        "/// `$with! {{ … }}` with the names of all models.
#[macro_export]
macro_rules! each_model {{
    ($with:ident) => {{ $with! {{ {} }} }};
}}",
        names.join(" ")
    );
    Ok(text)
}
