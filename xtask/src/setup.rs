//! Installs the requirements of cross builds, board runs and pages.
//!
//! If rustup manages the toolchain, it downloads the targets' `core`. If the compiler is a distribution's own,
//! Debian's `rustc-web` with `rust-web-src` builds `core` from source.

use crate::Task;
use crate::shell::{cargo, command, exists, output, run};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;

pub(crate) const TASK: Task = Task {
    name: "setup",
    does: "installs the cross targets, QEMU, the C peer's compiler, node, chromium, GCC, NumPy, venv, Octave and strace",
    run: setup,
};

/// Cortex-M4F (the boards here), M0+ and M33 (builds without board code).
pub(crate) const TARGETS: [&str; 3] = [
    "thumbv7em-none-eabihf",
    "thumbv6m-none-eabi",
    "thumbv8m.main-none-eabihf",
];

/// Debian's compiler; `core` is built by it from `rust-web-src`.
const DEBIAN_RUSTC: &str = "/usr/bin/rustc";

/// Source of `core` for the targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Core {
    /// The toolchain in use contains the compiled `core`.
    Prebuilt,
    /// The toolchain in use contains the source of `core`.
    FromSource,
    /// Debian's compiler comes with the source of `core`.
    FromDebianSource,
}

pub(crate) fn setup(_arguments: &[String]) -> Result<()> {
    let packages: Vec<&str> = [
        ("qemu-system-arm", "qemu-system-arm"),
        ("arm-none-eabi-gcc", "gcc-arm-none-eabi"),
        ("arm-none-eabi-gcc", "libnewlib-arm-none-eabi"),
        ("node", "nodejs"),
        ("npm", "npm"),
        ("chromium", "chromium"),
        ("gcc", "gcc"),
        ("octave-cli", "octave"),
        ("strace", "strace"),
    ]
    .into_iter()
    .filter(|(program, _)| !exists(program))
    .map(|(_, package)| package)
    // NumPy is not a program, so it is checked by importing it in Python.
    .chain(python().is_err().then_some("python3-numpy"))
    // Makes virtual environments.
    .chain((!python().is_ok_and(|python| imports(python, "ensurepip"))).then_some("python3-venv"))
    .collect();
    install(&packages)?;
    if core_source().is_none() && exists("rustup") {
        let mut add = command("rustup", &["target", "add"]);
        add.args(TARGETS);
        if let Err(error) = run(&mut add) {
            eprintln!("rustup cannot fetch the targets ({error:#})");
        }
    }
    if core_source().is_none() {
        install(&["rustc-web", "rust-web-src", "rust-web-llvm"])?;
    }
    let core = core_source().context(
        "no `core` for the targets: install rustup, or Debian's rustc-web and rust-web-src",
    )?;
    eprintln!("set up; core: {core:?}");
    Ok(())
}

fn install(packages: &[&str]) -> Result<()> {
    if packages.is_empty() {
        return Ok(());
    }
    if !exists("apt-get") {
        bail!(
            "{} missing; install with the package manager of this system",
            packages.join(", ")
        );
    }
    let apt = |arguments: &[&str]| {
        let mut apt = if is_root() {
            command("apt-get", arguments)
        } else {
            let mut sudo = command("sudo", &["apt-get"]);
            sudo.args(arguments);
            sudo
        };
        apt.env("DEBIAN_FRONTEND", "noninteractive");
        apt
    };
    // Package lists may be old but good enough, so they are updated only after a failed install.
    let mut arguments = vec!["install", "--yes", "--quiet", "--no-install-recommends"];
    arguments.extend(packages);
    if run(&mut apt(&arguments)).is_ok() {
        return Ok(());
    }
    run(&mut apt(&["update", "--quiet"]))?;
    run(&mut apt(&arguments))
}

/// A Python that has NumPy: the first in the path, or the system's.
pub(crate) fn python() -> Result<&'static str> {
    PYTHONS
        .into_iter()
        .find(|python| imports(python, "numpy"))
        .context("no Python has NumPy; run `cargo xtask setup`")
}

const PYTHONS: [&str; 2] = ["python3", "/usr/bin/python3"];

fn imports(python: &str, module: &str) -> bool {
    let import = format!("import {module}");
    let found = command(python, &["-c", &import]).output();
    found.is_ok_and(|output| output.status.success())
}

fn is_root() -> bool {
    output(&mut command("id", &["-u"])).is_ok_and(|id| id.trim() == "0")
}

fn sysroot(rustc: &Path) -> Option<PathBuf> {
    let printed = Command::new(rustc)
        .args(["--print", "sysroot"])
        .current_dir(crate::shell::root())
        .output()
        .ok()?;
    let path = String::from_utf8(printed.stdout).ok()?;
    (!path.trim().is_empty()).then(|| PathBuf::from(path.trim()))
}

fn core_source() -> Option<Core> {
    let source = |root: &Path| root.join("lib/rustlib/src/rust/library/core").is_dir();
    let own = sysroot(Path::new("rustc"))?;
    let built = |target: &&str| own.join("lib/rustlib").join(target).join("lib").is_dir();
    if TARGETS.iter().all(built) {
        return Some(Core::Prebuilt);
    }
    if source(&own) {
        return Some(Core::FromSource);
    }
    let debian = Path::new(DEBIAN_RUSTC);
    let has_source = debian.is_file() && sysroot(debian).is_some_and(|root| source(&root));
    has_source.then_some(Core::FromDebianSource)
}

/// `cargo` with the options to build for `target`; the caller adds the subcommand's own arguments.
pub(crate) fn cross_cargo(subcommand: &str, target: &str) -> Result<Command> {
    let mut build = cargo(&format!("{subcommand} --release --target {target}"));
    // With several codegen units, the same source gives other instructions: the worst sample of a law needs 2.5
    // times as many.
    build.env("CARGO_INCREMENTAL", "0");
    let core = core_source().context("no `core` for the boards; run `cargo xtask setup`")?;
    if core != Core::Prebuilt {
        build.arg("-Zbuild-std=core").env("RUSTC_BOOTSTRAP", "1");
    }
    if core == Core::FromDebianSource {
        build.env("RUSTC", DEBIAN_RUSTC);
        let own = sysroot(Path::new("rustc")).context("rustc has no sysroot")?;
        let linker = rust_lld(&own).context("the toolchain has no rust-lld")?;
        let key = format!(
            "CARGO_TARGET_{}_LINKER",
            target.to_uppercase().replace(['-', '.'], "_")
        );
        build.env(key, linker);
    }
    Ok(build)
}

fn rust_lld(sysroot: &Path) -> Option<PathBuf> {
    let hosts = std::fs::read_dir(sysroot.join("lib/rustlib")).ok()?;
    hosts
        .flatten()
        .map(|host| host.path().join("bin/rust-lld"))
        .find(|path| path.is_file())
}
