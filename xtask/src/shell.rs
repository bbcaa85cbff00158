//! Runs other programs.

use anyhow::{Context, Result, bail};
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// The root of the project.
pub(crate) fn root() -> PathBuf {
    let here = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    here.parent().map_or(here.clone(), PathBuf::from)
}

/// A command in the project's root.
pub(crate) fn command(program: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(program);
    command.args(arguments).current_dir(root());
    command
}

/// `cargo` as it was called for this program, in the project's root, with the words of `line`.
pub(crate) fn cargo(line: &str) -> Command {
    let program = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    command(&program, &line.split_whitespace().collect::<Vec<_>>())
}

/// Set if the workspace's programs are built already; a step then need not wait for another step's compiler.
pub(crate) const BUILT: &str = "XTASK_BUILT";

/// A program of the scenarios; arguments follow.
pub(crate) fn scenario(program: &str) -> Command {
    if std::env::var_os(BUILT).is_some() {
        return built(program);
    }
    let mut command = cargo("run --release --quiet --package scenarios");
    command.args(["--bin", program, "--"]);
    command
}

/// The present `host-fit`; arguments follow.
pub(crate) fn program() -> Result<Command> {
    if std::env::var_os(BUILT).is_none() {
        run(&mut cargo("build --release --quiet --package host-fit"))?;
    }
    Ok(built("host-fit"))
}

fn built(program: &str) -> Command {
    let mut path = target().join("release").join(program);
    path.set_extension(std::env::consts::EXE_EXTENSION);
    let mut command = Command::new(path);
    command.current_dir(root());
    command
}

/// `cargo` in the firmware's workspace, with a separate target folder, because the two workspaces build the same
/// crates with different features.
pub(crate) fn firmware_cargo(line: &str) -> Command {
    let mut command = cargo(line);
    command
        .current_dir(root().join("firmware"))
        .env("CARGO_TARGET_DIR", firmware_target());
    command
}

/// Where the workspace builds.
pub(crate) fn target() -> PathBuf {
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or("target".into(), PathBuf::from);
    root().join(target)
}

/// Where the firmware's workspace builds.
pub(crate) fn firmware_target() -> PathBuf {
    target().join("firmware")
}

/// The command as a person would type it.
pub(crate) fn shown(command: &Command) -> String {
    let program = PathBuf::from(command.get_program());
    let name = program.file_name().unwrap_or(command.get_program());
    let mut line = name.to_string_lossy().into_owned();
    for argument in command.get_args() {
        line.push(' ');
        line.push_str(&argument.to_string_lossy());
    }
    line
}

/// Runs the command with its output shown.
pub(crate) fn run(command: &mut Command) -> Result<()> {
    let line = shown(command);
    eprintln!("$ {line}");
    let status = command
        .stdin(Stdio::null())
        .status()
        .with_context(|| format!("could not start `{line}`"))?;
    if !status.success() {
        bail!("`{line}` ended with {status}");
    }
    Ok(())
}

/// Standard output of the command.
pub(crate) fn output(command: &mut Command) -> Result<String> {
    let line = shown(command);
    let output = command
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| format!("could not start `{line}`"))?;
    if !output.status.success() {
        bail!("`{line}` ended with {}", output.status);
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Whether the program is installed.
pub(crate) fn exists(program: &str) -> bool {
    std::env::var_os("PATH").is_some_and(|path| {
        std::env::split_paths(&path).any(|folder| folder.join(program).is_file())
    })
}
