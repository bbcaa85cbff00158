//! Builds the programs for the boards.

use crate::Task;
use crate::setup::{TARGETS, cross_cargo};
use crate::shell::{command, firmware_target, root, run};
use anyhow::{Context, Result, bail};
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
    let bytes = std::fs::read(elf).with_context(|| format!("could not read {}", elf.display()))?;
    sections(&bytes).with_context(|| format!("{} is no 32-bit ELF file", elf.display()))
}

fn sections(elf: &[u8]) -> Option<Size> {
    let half = |at: usize| Some(u16::from_le_bytes(elf.get(at..at + 2)?.try_into().ok()?));
    let word = |at: usize| Some(u32::from_le_bytes(elf.get(at..at + 4)?.try_into().ok()?));
    if elf.get(..5)? != b"\x7fELF\x01" {
        return None;
    }
    let (table, entry, count) = (word(0x20)? as usize, half(0x2E)?, half(0x30)?);
    let mut size = Size { flash: 0, ram: 0 };
    for i in 0..usize::from(count) {
        let at = table + i * usize::from(entry);
        let (kind, flags, bytes) = (word(at + 4)?, word(at + 8)?, u64::from(word(at + 20)?));
        const ALLOCATED: u32 = 2;
        const WRITABLE: u32 = 1;
        const WITHOUT_BYTES: u32 = 8;
        if flags & ALLOCATED == 0 {
            continue;
        }
        if kind != WITHOUT_BYTES {
            size.flash += bytes;
        }
        if flags & WRITABLE != 0 {
            size.ram += bytes;
        }
    }
    Some(size)
}
