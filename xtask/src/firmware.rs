//! Builds the programs for the boards.

use crate::Task;
use crate::elf::{Elf, Section};
use crate::identified;
use crate::setup::{TARGETS, cross_cargo};
use crate::shell::{command, firmware_target, root, run};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;

pub(crate) const TASK: Task = Task {
    name: "firmware",
    does: "builds the flashable ELF: --board nucleo-f446re|qemu-mps2|qemu-rig, --model FILE, --rig FILE",
    run: firmware,
};

/// Cortex-M4F: both boards.
pub(crate) const BOARD_TARGET: &str = TARGETS[0];

/// Boards, each with a program of the same name.
pub(crate) const BOARDS: [&str; 3] = ["nucleo-f446re", "qemu-mps2", "qemu-rig"];

/// Package of a board's program.
pub(crate) fn package(board: &str) -> &str {
    if board == "qemu-rig" {
        "qemu-mps2"
    } else {
        board
    }
}

/// Options of a firmware build.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Chosen {
    /// The board.
    pub(crate) board: Option<&'static str>,
    /// A user's model instead of the bundled one.
    pub(crate) model: Option<PathBuf>,
    /// A user's rig instead of the bundled one.
    pub(crate) rig: Option<PathBuf>,
}

impl Chosen {
    /// Reads `--board`, `--model` and `--rig`.
    pub(crate) fn read(arguments: &[String]) -> Result<Self> {
        let mut chosen = Self::default();
        let mut rest = arguments.iter();
        while let Some(option) = rest.next() {
            let value = rest
                .next()
                .with_context(|| format!("{option} needs a value"))?;
            match option.as_str() {
                "--board" => {
                    let known = BOARDS.into_iter().find(|board| board == value);
                    chosen.board = Some(known.with_context(|| {
                        format!(
                            "there is no board `{value}`; the boards are {}",
                            BOARDS.join(", ")
                        )
                    })?);
                }
                "--model" => chosen.model = Some(value.into()),
                "--rig" => chosen.rig = Some(value.into()),
                _ => bail!("unknown option {option}; the options are --board, --model and --rig"),
            }
        }
        Ok(chosen)
    }

    /// The board's own program with the chosen model.
    pub(crate) fn build(&self, board: &str) -> Result<PathBuf> {
        let (model, rig) = (self.model.as_deref(), self.rig.as_deref());
        let Some(named) = model.or(rig) else {
            return build(package(board), board, &[], None);
        };
        let constants = identified::of(model, rig)?;
        let elf = build(package(board), board, &[], Some(&constants)).with_context(|| {
            format!(
                "{} does not fit the board; see the message above",
                named.display()
            )
        })?;
        // The program gets a separate name, so that a build of the bundled model does not overwrite
        // it.
        let stem = named.file_stem().unwrap_or_default().to_string_lossy();
        let own = firmware_target().join(format!("{board}-{stem}"));
        std::fs::copy(&elf, &own).with_context(|| own.display().to_string())?;
        Ok(own)
    }
}

pub(crate) fn firmware(arguments: &[String]) -> Result<()> {
    let chosen = Chosen::read(arguments)?;
    let board = chosen
        .board
        .with_context(|| format!("name a board: --board {}", BOARDS.join(" or --board ")))?;
    let elf = chosen.build(board)?;
    let size = size(&elf)?;
    eprintln!("flash {} bytes, static RAM {} bytes", size.flash, size.ram);
    println!("{}", elf.display());
    Ok(())
}

/// Builds program `bin` of package `board`; a panic in it would not link. The folder `constants` replaces the
/// bundled ones.
pub(crate) fn build(
    board: &str,
    bin: &str,
    options: &[&str],
    constants: Option<&Path>,
) -> Result<PathBuf> {
    let mut cargo = cross_cargo("build", BOARD_TARGET)?;
    cargo
        .args(["--package", board, "--bin", bin])
        .args(options)
        .current_dir(root().join("firmware"))
        .env("CARGO_TARGET_DIR", firmware_target());
    if let Some(constants) = constants {
        cargo.env("IDENTIFIED", constants);
    }
    run(&mut cargo)?;
    Ok(firmware_target()
        .join(BOARD_TARGET)
        .join("release")
        .join(bin))
}

/// Checks the libraries of loop, line and model for `target`, without log messages and with them.
pub(crate) fn libraries(target: &str) -> Result<()> {
    let libraries = |arguments: &[&str]| {
        let mut cargo = cross_cargo("check", target)?;
        cargo
            .args(["--package", "firmware"])
            .args(arguments)
            .current_dir(root().join("firmware"))
            .env("CARGO_TARGET_DIR", firmware_target());
        run(&mut cargo).with_context(|| format!("for {target}"))
    };
    libraries(&[])?;
    libraries(&["--features", "defmt"])
}

/// QEMU with the program, its serial line on standard input and output. Time is counted in instructions and
/// runs at full speed.
pub(crate) fn qemu(elf: &Path) -> Command {
    let mut qemu = command(
        "qemu-system-arm",
        &["-machine", "mps2-an386", "-cpu", "cortex-m4"],
    );
    qemu.args(["-icount", "shift=5,sleep=off"])
        .args(["-display", "none", "-monitor", "none", "-serial", "stdio"])
        .arg("-kernel")
        .arg(elf);
    qemu
}

/// Memory of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    /// Code, constants and initial values, bytes.
    pub(crate) flash: u64,
    /// Static data, bytes.
    pub(crate) ram: u64,
}

/// Flash and RAM of an ELF file, from its section headers.
pub(crate) fn size(elf: &Path) -> Result<Size> {
    let sections = Elf::read(elf)?.sections;
    let sum = |of: fn(&Section) -> bool| sections.iter().filter(|s| of(s)).map(|s| s.size).sum();
    Ok(Size {
        flash: sum(|section| section.stored),
        ram: sum(|section| section.writable),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_read_in_any_order_and_unknown_ones_named() {
        let read = |line: &str| {
            let arguments: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
            Chosen::read(&arguments)
        };
        let chosen = read("--model a/b.toml --board qemu-mps2").expect("both");
        assert_eq!(chosen.board, Some("qemu-mps2"));
        assert_eq!(chosen.model, Some("a/b.toml".into()));
        assert_eq!(read("").expect("none"), Chosen::default());
        for (line, named) in [
            ("--board uno", "`uno`"),
            ("--board", "--board"),
            ("--modle x", "--modle"),
        ] {
            let error = read(line).expect_err("wrong").to_string();
            assert!(error.contains(named), "{error}");
        }
    }
}
