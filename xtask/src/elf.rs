//! Reads 32-bit little-endian ELF files: sections and symbols.

use anyhow::{Context, Result};
use std::path::Path;

/// A section that is in the target's memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Section {
    index: u16,
    /// Bytes.
    pub(crate) size: u64,
    /// Bytes are in the file, hence in flash.
    pub(crate) stored: bool,
    /// In RAM.
    pub(crate) writable: bool,
}

/// A function or an object with a size.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Symbol {
    /// As in the file, mangled.
    pub(crate) name: String,
    address: u32,
    /// Bytes.
    pub(crate) size: u64,
    section: u16,
}

/// What a program puts into the target's memory.
#[derive(Clone, Debug)]
pub(crate) struct Elf {
    /// Sections in memory.
    pub(crate) sections: Vec<Section>,
    /// Symbols in them, each address once.
    pub(crate) symbols: Vec<Symbol>,
}

impl Elf {
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let bytes =
            std::fs::read(path).with_context(|| format!("could not read {}", path.display()))?;
        Self::parse(&bytes).with_context(|| format!("{} is no 32-bit ELF file", path.display()))
    }

    fn parse(elf: &[u8]) -> Option<Self> {
        if elf.get(..5)? != b"\x7fELF\x01" {
            return None;
        }
        let (table, entry, count) = (
            word(elf, 0x20)? as usize,
            half(elf, 0x2E)?,
            half(elf, 0x30)?,
        );
        let header = |i: u16| table + usize::from(i) * usize::from(entry);
        let mut sections = Vec::new();
        let mut symbols = Vec::new();
        for index in 0..count {
            const SYMBOLS: u32 = 2;
            const WITHOUT_BYTES: u32 = 8;
            const WRITABLE: u32 = 1;
            const ALLOCATED: u32 = 2;
            let at = header(index);
            let (kind, flags) = (word(elf, at + 4)?, word(elf, at + 8)?);
            let size = word(elf, at + 20)?;
            if kind == SYMBOLS {
                let names = header(word(elf, at + 24)? as u16);
                let offset = word(elf, at + 16)? as usize;
                let table = elf.get(offset..offset + size as usize)?;
                symbols = read_symbols(table, elf.get(word(elf, names + 16)? as usize..)?)?;
            }
            if flags & ALLOCATED != 0 {
                sections.push(Section {
                    index,
                    size: size.into(),
                    stored: kind != WITHOUT_BYTES,
                    writable: flags & WRITABLE != 0,
                });
            }
        }
        symbols.retain(|symbol| sections.iter().any(|s| s.index == symbol.section));
        symbols.sort_by(|a, b| (a.section, a.address, b.size).cmp(&(b.section, b.address, a.size)));
        symbols.dedup_by_key(|symbol| (symbol.section, symbol.address));
        Some(Self { sections, symbols })
    }

    /// The section of a symbol.
    pub(crate) fn section(&self, symbol: &Symbol) -> Option<&Section> {
        self.sections.iter().find(|s| s.index == symbol.section)
    }
}

fn read_symbols(table: &[u8], names: &[u8]) -> Option<Vec<Symbol>> {
    const ENTRY: usize = 16;
    const OBJECT: u8 = 1;
    const FUNCTION: u8 = 2;
    let mut symbols = Vec::new();
    for entry in table.chunks_exact(ENTRY) {
        let (size, kind) = (word(entry, 8)?, entry.get(12)? & 0xF);
        if size > 0 && (kind == OBJECT || kind == FUNCTION) {
            let name = names.get(word(entry, 0)? as usize..)?;
            let name = name.split(|byte| *byte == 0).next()?;
            symbols.push(Symbol {
                name: String::from_utf8_lossy(name).into_owned(),
                // The lowest bit says Thumb.
                address: word(entry, 4)? & !1,
                size: size.into(),
                section: half(entry, 14)?,
            });
        }
    }
    Some(symbols)
}

fn half(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?))
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}
