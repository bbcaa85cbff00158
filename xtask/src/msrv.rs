//! The crates for boards, compiled by the oldest compiler that they support (`rust-version`).

use anyhow::{Context, Result, bail};

use crate::Task;
use crate::shell::{command, firmware_target, root, run, target};

pub(crate) const TASK: Task = Task {
    name: "msrv",
    does: "checks the crates for boards with the compiler of their `rust-version`, if rustup can install it",
    run: |_| msrv(),
};

/// The crates that other people's programs for boards depend on. All other crates support only the compiler of CI.
const PUBLISHED: [&str; 2] = ["model-core", "wire"];
const FIRMWARE: [&str; 2] = ["firmware", "identified"];

pub(crate) fn msrv() -> Result<()> {
    let text = std::fs::read_to_string(root().join("firmware/Cargo.toml"))
        .context("firmware/Cargo.toml")?;
    let manifest: toml::Table = toml::from_str(&text).context("firmware/Cargo.toml")?;
    let package = manifest
        .get("workspace")
        .and_then(|table| table.get("package"));
    let version = package.and_then(|table| table.get("rust-version")?.as_str());
    let Some(version) = version else {
        bail!("firmware/Cargo.toml: no `workspace.package.rust-version`");
    };
    // Debian's compiler comes without rustup and in one version only.
    let has_rustup = command("rustup", &["--version"]).output().is_ok();
    if has_rustup {
        let install = ["toolchain", "install", version, "--profile", "minimal"];
        run(command("rustup", &install).arg("--no-self-update"))?;
    } else {
        println!("rustup is missing, so the installed compiler is used in place of Rust {version}");
    }
    // Build products of another compiler cannot be shared.
    for (folder, packages, products) in [
        ("", PUBLISHED, target().join("msrv")),
        ("firmware", FIRMWARE, firmware_target().join("msrv")),
    ] {
        let mut check = if has_rustup {
            command("rustup", &["run", version, "cargo"])
        } else {
            command("cargo", &[])
        };
        check.args(["check", "--release", "--lib"]);
        for package in packages {
            check.args(["--package", package]);
        }
        run(check
            .current_dir(root().join(folder))
            .env_remove("RUSTC")
            .env_remove("CARGO")
            .env_remove("RUSTUP_TOOLCHAIN")
            .env("CARGO_TARGET_DIR", products))?;
    }
    Ok(())
}
