//! The generated constants in `firmware/identified`: freshness check, and constants of a user's model for one
//! build.

use crate::Task;
use crate::shell::{firmware_target, program, root, run};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};

pub(crate) const TASK: Task = Task {
    name: "identified",
    does: "generates firmware/identified from its model files; --check only compares",
    run: identified,
};

/// The rig file in `firmware/identified/models`, without `.toml`; its constants are written with
/// those of the first model.
const RIG: &str = "rig";

/// The model files in `firmware/identified/models`, without `.toml`.
const MODELS: [&str; 6] = ["full", "averaged", "effects", "own", "slow", "volts"];

pub(crate) fn identified(arguments: &[String]) -> Result<()> {
    let check = match arguments {
        [] => false,
        [only] if only == "--check" => true,
        _ => bail!("the only option is --check"),
    };
    let folder = root().join("firmware/identified");
    let (models, generated) = (folder.join("models"), folder.join("generated"));
    let written = if check {
        std::env::temp_dir().join(format!("identified-{}", std::process::id()))
    } else {
        generated.clone()
    };
    std::fs::create_dir_all(&written)?;
    let rig = models.join(RIG).with_extension("toml");
    for (i, model) in MODELS.into_iter().enumerate() {
        let file = models.join(model).with_extension("toml");
        let to = written.join(model).with_extension("rs");
        generate(&file, &to, (i == 0).then_some(rig.as_path()), &[])?;
    }
    if check {
        for name in MODELS.into_iter().chain([RIG]) {
            let kept = generated.join(name).with_extension("rs");
            let read = |path: &Path| {
                std::fs::read(path).with_context(|| format!("could not read {}", path.display()))
            };
            let equal = read(&written.join(name).with_extension("rs"))? == read(&kept)?;
            if !equal {
                bail!(
                    "{} differs from the output of codegen; run `cargo xtask identified`",
                    kept.display()
                );
            }
        }
        std::fs::remove_dir_all(&written)?;
    }
    Ok(())
}

/// A folder with the constants of a user's model and rig, for a build of the firmware; a model that no board can run,
/// and a rig that contradicts it, are refused. Without `model` the bundled model is used.
pub(crate) fn of(model: Option<&Path>, rig: Option<&Path>) -> Result<PathBuf> {
    let bundled = root().join("firmware/identified/models/full.toml");
    // Relative paths refer to the folder where the task was called.
    let model = model.map_or(Ok(bundled), std::path::absolute)?;
    let rig = rig.map(std::path::absolute).transpose()?;
    let folder = firmware_target().join("identified");
    // Constants of another rig must not remain.
    if folder.exists() {
        std::fs::remove_dir_all(&folder)?;
    }
    std::fs::create_dir_all(&folder)?;
    generate(
        &model,
        &folder.join("on_board.rs"),
        rig.as_deref(),
        &["--board"],
    )?;
    Ok(folder)
}

fn generate(model: &Path, to: &Path, rig: Option<&Path>, options: &[&str]) -> Result<()> {
    let mut codegen = program()?;
    codegen
        .arg("codegen")
        .arg(model)
        .arg("--output")
        .arg(to)
        .args(options);
    if let Some(rig) = rig {
        codegen.arg("--rig").arg(rig);
    }
    run(&mut codegen)
}
