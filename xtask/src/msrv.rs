//! The workspace compiled by the oldest compiler that it says it needs (`rust-version`).

use anyhow::{Context, Result, bail};

use crate::Task;
use crate::shell::{command, root, run, target};

pub(crate) const TASK: Task = Task {
    name: "msrv",
    does: "checks what is published with the compiler of `rust-version`, where rustup can get it",
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
    if command("rustup", &["--version"]).output().is_err() {
        println!("not checked: there is no rustup to get Rust {version} with");
        return Ok(());
    }
    run(&mut command(
        "rustup",
        &[
            "toolchain",
            "install",
            version,
            "--profile",
            "minimal",
            "--no-self-update",
        ],
    ))?;
    // What is published: scenarios and tasks are compiled by who works on them.
    let check = [
        "run",
        version,
        "cargo",
        "check",
        "--release",
        "--workspace",
        "--exclude=scenarios",
        "--exclude=xtask",
    ];
    // Build products of another compiler cannot be shared.
    run(command("rustup", &check)
        .env_remove("RUSTC")
        .env_remove("CARGO")
        .env_remove("RUSTUP_TOOLCHAIN")
        .env("CARGO_TARGET_DIR", target().join("msrv")))
}
