//! The scripts and styles of pages: checked, tested and bundled from `host-fit/web`.
//!
//! The bundle is checked in, so that building the program needs no node; `--check` verifies that it equals the
//! sources.

use crate::Task;
use crate::shell::{command, root, run};
use anyhow::{Context, Result, bail};
use std::fs;
use std::path::Path;

pub(crate) const TASK: Task = Task {
    name: "pages",
    does: "checks, tests and bundles the pages' scripts with node; --check compares the bundle only",
    run: pages,
};

pub(crate) fn pages(arguments: &[String]) -> Result<()> {
    let check = match arguments {
        [] => false,
        [only] if only == "--check" => true,
        _ => bail!("pages accepts --check and no other option"),
    };
    let web = root().join("host-fit/web");
    let npm = |arguments: &[&str]| {
        let mut npm = command("npm", arguments);
        npm.current_dir(&web);
        run(&mut npm)
    };
    // The installed versions are those of the lock file; scripts of packages are not run at
    // installation.
    npm(&["ci", "--ignore-scripts", "--no-audit", "--no-fund"])?;
    npm(&["run", "check"])?;
    npm(&["test"])?;
    if !check {
        return npm(&["run", "build"]);
    }
    let made = crate::shell::target().join("pages");
    if made.exists() {
        fs::remove_dir_all(&made)?;
    }
    let into = made.to_string_lossy().into_owned();
    npm(&["run", "build", "--", &into])?;
    same(&web.join("bundle"), &made)
}

fn same(checked_in: &Path, made: &Path) -> Result<()> {
    let names = |folder: &Path| -> Result<Vec<_>> {
        let entries = fs::read_dir(folder).with_context(|| folder.display().to_string())?;
        let mut names: Vec<_> = entries
            .map(|entry| Ok(entry?.file_name()))
            .collect::<Result<_>>()?;
        names.sort();
        Ok(names)
    };
    let all = names(made)?;
    if names(checked_in)? != all {
        bail!("the bundle has other files than the sources produce; run `cargo xtask pages`");
    }
    for name in all {
        if fs::read(checked_in.join(&name))? != fs::read(made.join(&name))? {
            bail!(
                "bundle/{} differs from the sources; run `cargo xtask pages`",
                name.display()
            );
        }
    }
    Ok(())
}
