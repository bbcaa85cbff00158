//! Sections and symbols of a board's program.

use anyhow::{Context, Result};
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionIndex, SymbolKind, elf};
use std::path::Path;

/// A section that is in the target's memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Section {
    index: SectionIndex,
    /// Bytes.
    pub(crate) size: u64,
    /// Whether the section's bytes are stored in the file, hence in flash.
    pub(crate) stored: bool,
    /// Whether the section is in RAM.
    pub(crate) writable: bool,
}

/// A function or an object with a size.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Symbol {
    /// Name as in the file, mangled.
    pub(crate) name: String,
    address: u64,
    /// Bytes.
    pub(crate) size: u64,
    section: SectionIndex,
}

/// Contents of a program in the target's memory.
#[derive(Clone, Debug)]
pub(crate) struct Elf {
    /// Sections in memory.
    pub(crate) sections: Vec<Section>,
    /// Symbols in these sections, each address once.
    pub(crate) symbols: Vec<Symbol>,
}

impl Elf {
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let place = || path.display().to_string();
        let bytes = std::fs::read(path).with_context(place)?;
        let file = object::File::parse(bytes.as_slice()).with_context(place)?;
        let sections: Vec<Section> = file
            .sections()
            .filter_map(|section| {
                let SectionFlags::Elf { sh_flags } = section.flags() else {
                    return None;
                };
                let is = |flag: u32| sh_flags & u64::from(flag) != 0;
                is(elf::SHF_ALLOC).then(|| Section {
                    index: section.index(),
                    size: section.size(),
                    stored: section.file_range().is_some(),
                    writable: is(elf::SHF_WRITE),
                })
            })
            .collect();
        let sized = |kind| matches!(kind, SymbolKind::Text | SymbolKind::Data);
        let mut symbols = Vec::new();
        for symbol in file.symbols().filter(|s| s.size() > 0 && sized(s.kind())) {
            let here = |index: &SectionIndex| sections.iter().any(|s| s.index == *index);
            if let Some(section) = symbol.section_index().filter(here) {
                symbols.push(Symbol {
                    name: symbol.name().with_context(place)?.to_owned(),
                    // The lowest bit marks Thumb code.
                    address: symbol.address() & !1,
                    size: symbol.size(),
                    section,
                });
            }
        }
        symbols.sort_by_key(|s| (s.section.0, s.address, std::cmp::Reverse(s.size)));
        symbols.dedup_by_key(|symbol| (symbol.section, symbol.address));
        Ok(Self { sections, symbols })
    }

    /// The section of a symbol.
    pub(crate) fn section(&self, symbol: &Symbol) -> Option<&Section> {
        self.sections.iter().find(|s| s.index == symbol.section)
    }
}
