//! The libraries compiled by the oldest compiler that they say they need (`rust-version`).

use anyhow::{Context, Result, bail};

use crate::Task;
use crate::shell::{command, root, run, target};

pub(crate) const TASK: Task = Task {
    name: "msrv",
    does: "checks the published libraries with the compiler of `rust-version`, where rustup can get it",
    run: |_| msrv(),
};

pub(crate) fn msrv() -> Result<()> {
    let text = std::fs::read_to_string(root().join("Cargo.toml")).context("Cargo.toml")?;
    let manifest: toml::Table = toml::from_str(&text).context("Cargo.toml")?;
    let package = manifest
        .get("workspace")
        .and_then(|table| table.get("package"));
    let version = package.and_then(|table| table.get("rust-version")?.as_str());
    let Some(version) = version else {
        bail!("Cargo.toml: no `workspace.package.rust-version`");
    };
    // Debian's compiler comes without rustup, and in one version.
    let has_rustup = command("rustup", &["--version"]).output().is_ok();
    let mut check = if has_rustup {
        let install = ["toolchain", "install", version, "--profile", "minimal"];
        run(command("rustup", &install).arg("--no-self-update"))?;
        command("rustup", &["run", version, "cargo"])
    } else {
        println!("with the compiler that is there: there is no rustup to get Rust {version} with");
        command("cargo", &[])
    };
    // The libraries that are published, without the program: who uses one of them chooses the compiler. That the fitter
    // compiles without the simulator that it is judged by is checked by the way.
    check
        .args(["check", "--release", "--workspace", "--lib"])
        .args([
            "--no-default-features",
            "--exclude=scenarios",
            "--exclude=xtask",
        ]);
    // Build products of another compiler cannot be shared.
    run(check
        .env_remove("RUSTC")
        .env_remove("CARGO")
        .env_remove("RUSTUP_TOOLCHAIN")
        .env("CARGO_TARGET_DIR", target().join("msrv")))
}
