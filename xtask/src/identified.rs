//! The generated constants in `firmware/identified`, whether they are fresh, and
//! those of a user's model for one build.

use crate::Task;
use crate::shell::{cargo, firmware_target, root, run};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};

pub(crate) const TASK: Task = Task {
    name: "identified",
    does: "generates firmware/identified from its model files; --check compares instead",
    run: identified,
};

/// The model files in `firmware/identified/models`, without `.toml`.
const MODELS: [&str; 4] = ["full", "averaged", "effects", "own"];

pub(crate) fn identified(arguments: &[String]) -> Result<()> {
    let check = match arguments {
        [] => false,
        [only] if only == "--check" => true,
        _ => bail!("the only option is --check"),
    };
    let folder = root().join("firmware/identified");
    for model in MODELS {
        let kept = folder.join("generated").join(model).with_extension("rs");
        let written = if check {
            std::env::temp_dir().join(format!("{}-{model}.rs", std::process::id()))
        } else {
            kept.clone()
        };
        let file = folder.join("models").join(model).with_extension("toml");
        generate(&file, &written, &[])?;
        if check {
            let read = |path: &Path| {
                std::fs::read(path).with_context(|| format!("could not read {}", path.display()))
            };
            let equal = read(&written)? == read(&kept)?;
            std::fs::remove_file(&written)?;
            if !equal {
                bail!(
                    "{} is not what codegen writes now; run `cargo xtask identified`",
                    kept.display()
                );
            }
        }
    }
    Ok(())
}

/// A folder with the constants of a user's model, for a build of the firmware;
/// a model that no board can run is refused.
pub(crate) fn of(model: &Path) -> Result<PathBuf> {
    // As the user typed it: relative to where the task was called.
    let model = std::path::absolute(model)?;
    let folder = firmware_target().join("identified");
    std::fs::create_dir_all(&folder)?;
    generate(&model, &folder.join("on_board.rs"), &["--board"])?;
    Ok(folder)
}

fn generate(model: &Path, to: &Path, options: &[&str]) -> Result<()> {
    run(
        cargo(&["run", "--release", "--quiet", "--package", "host-fit", "--"])
            .arg("codegen")
            .arg(model)
            .arg("--output")
            .arg(to)
            .args(options),
    )
}
