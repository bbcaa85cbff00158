//! The generated constants in `firmware/identified`, and whether they are fresh.

use crate::Task;
use crate::shell::{cargo, root, run};
use anyhow::{Context, Result, bail};
use std::path::Path;

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
        let kept = folder.join("src").join(model).with_extension("rs");
        let written = if check {
            std::env::temp_dir().join(format!("{}-{model}.rs", std::process::id()))
        } else {
            kept.clone()
        };
        generate(
            &folder.join("models").join(model).with_extension("toml"),
            &written,
        )?;
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

fn generate(model: &Path, to: &Path) -> Result<()> {
    run(
        cargo(&["run", "--release", "--quiet", "--package", "host-fit", "--"])
            .arg("codegen")
            .arg(model)
            .arg("--output")
            .arg(to),
    )
}
