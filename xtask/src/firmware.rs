//! Builds the programs for the boards.

use crate::Task;
use crate::elf::{Elf, Section};
use crate::setup::{TARGETS, cross_cargo};
use crate::shell::{command, firmware_target, root, run};
use anyhow::{Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;

pub(crate) const TASK: Task = Task {
    name: "firmware",
    does: "builds the flashable ELF: --board nucleo-f446re|qemu-mps2",
    run: firmware,
};

/// Cortex-M4F: both boards.
pub(crate) const BOARD_TARGET: &str = TARGETS[0];

/// A board with a program of its own name.
pub(crate) const BOARDS: [&str; 2] = ["nucleo-f446re", "qemu-mps2"];

pub(crate) fn firmware(arguments: &[String]) -> Result<()> {
    let board = match arguments {
        [option, board] if option == "--board" && BOARDS.contains(&board.as_str()) => board,
        _ => bail!("name a board: --board {}", BOARDS.join(" or --board ")),
    };
    let elf = build(board, board, &[])?;
    let size = size(&elf)?;
    eprintln!("flash {} bytes, static RAM {} bytes", size.flash, size.ram);
    println!("{}", elf.display());
    Ok(())
}

/// Builds program `bin` of package `board`; a panic in it would not link.
pub(crate) fn build(board: &str, bin: &str, options: &[&str]) -> Result<PathBuf> {
    let mut cargo = cross_cargo("build", BOARD_TARGET)?;
    cargo
        .args(["--package", board, "--bin", bin])
        .args(options)
        .current_dir(root().join("firmware"))
        .env("CARGO_TARGET_DIR", firmware_target());
    run(&mut cargo)?;
    Ok(firmware_target()
        .join(BOARD_TARGET)
        .join("release")
        .join(bin))
}

/// Builds the loop's library, with its log messages, for `target`.
pub(crate) fn library(target: &str) -> Result<()> {
    let mut cargo = cross_cargo("build", target)?;
    cargo
        .args(["--package", "firmware", "--features", "defmt"])
        .current_dir(root().join("firmware"))
        .env("CARGO_TARGET_DIR", firmware_target());
    run(&mut cargo)
}

/// QEMU with the program, its serial line on standard input and output. Time
/// goes by instructions, as fast as the host can.
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

/// What a program takes.
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
