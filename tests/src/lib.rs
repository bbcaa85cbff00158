//! Scenarios across the crates: campaigns with hidden effects, agreement of languages, lockstep runs, and
//! records from other loggers.

pub mod agreement;
pub mod browser;
pub mod campaign;
pub mod fuzz;
pub mod invariances;
pub mod laws;
pub mod lockstep;
pub mod strangers;

use std::path::PathBuf;
use std::process::Command;

/// Options of a `design` whose contract is tested, not its law: trials of half the length, and a coarse robustness margin.
pub const QUICK_DESIGN: [&str; 8] = [
    "--set",
    "design.trial=6000",
    "--set",
    "design.trial-from=2000",
    "--set",
    "design.margin-rays=4",
    "--set",
    "design.margin-bisections=2",
];

/// The program `host-fit`, built beside the running test or tool.
///
/// # Panics
/// If it is missing and cannot be built.
#[must_use]
pub fn program() -> PathBuf {
    let running = std::env::current_exe().expect("what is running");
    let folder = running.parent().expect("target/PROFILE, or its deps");
    let folder = match folder.parent() {
        Some(profile) if folder.ends_with("deps") => profile,
        _ => folder,
    };
    let program = folder.join(format!("host-fit{}", std::env::consts::EXE_SUFFIX));
    if !program.is_file() {
        let built = Command::new(env!("CARGO"))
            .args(["build", "--release", "--package", "host-fit", "--quiet"])
            .status()
            .expect("cargo");
        assert!(built.success());
    }
    program
}
