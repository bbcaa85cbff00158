//! Scenarios across the crates: campaigns with hidden effects, agreement of languages, lockstep and long
//! runs, and records from other loggers.

pub mod agreement;
pub mod browser;
pub mod campaign;
pub mod fuzz;
pub mod invariances;
pub mod laws;
pub mod lockstep;
pub mod long_run;
pub mod strangers;

use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::Command;

/// Options of `design` for tests of its messages and files, in which the quality of the law is irrelevant: trials of
/// half the length, and a coarse robustness margin.
pub const QUICK_DESIGN: &str = "--set design.trial=6000 --set design.trial-from=2000 --set design.margin-rays=4 \
     --set design.margin-bisections=2";

/// Paths and other words of a command.
pub type Parts<'a> = &'a [&'a dyn AsRef<OsStr>];

/// `host-fit` with the words of `line`. Each `{}` stands for the next of `parts`, which may contain spaces.
///
/// # Panics
/// Unless there are as many `{}` as parts.
#[must_use]
pub fn host_fit(line: &str, parts: Parts<'_>) -> Command {
    let mut command = Command::new(program());
    let mut parts = parts.iter();
    for word in line.split_whitespace() {
        match word {
            "{}" => command.arg(parts.next().expect("a part for each {}")),
            word => command.arg(word),
        };
    }
    assert!(parts.next().is_none(), "a part without a {{}}");
    command
}

/// The file of a model with a first-order flow and guessed coefficients, as a user would write it by hand;
/// `delay` are the keys of its delay.
#[must_use]
pub fn first_order(a: f64, b: f64, delay: &str) -> String {
    format!(
        r#"format_version = 1
sample_period_s = 0.001
lag_convention = "one-step"
[structure]
averaged = false
window = 250
state_lags = [1]
product_lags = [1]
[coefficients]
a = [{a}]
b = [{b}]
c = [[0.0]]
[delay]
{delay}
"#
    )
}

/// A constant delay for [`first_order`].
pub const FIXED_DELAY: &str = "law = \"fixed\"
delays = [40]";

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
