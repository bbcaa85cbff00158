//! Use of the flash in a board's program, by crate and by symbol.

use crate::Task;
use crate::elf::{Elf, Symbol};
use crate::firmware::{self, BOARDS, Chosen, Size};
use anyhow::Result;
use std::collections::BTreeMap;

pub(crate) const TASK: Task = Task {
    name: "size",
    does: "prints the use of the flash by crate and by symbol: --board nucleo-f446re|qemu-mps2, --model FILE",
    run: size,
};

/// Symbols that are shown.
const LARGEST: usize = 20;

fn size(arguments: &[String]) -> Result<()> {
    let chosen = Chosen::read(arguments)?;
    let board = chosen.board.unwrap_or(BOARDS[0]);
    let path = chosen.build(board)?;
    let elf = Elf::read(&path)?;
    let Size { flash, ram } = firmware::size(&path)?;
    println!("{board}: flash {flash} bytes, static RAM {ram} bytes");

    let mut stored: Vec<(&Symbol, String)> = elf
        .symbols
        .iter()
        .filter(|symbol| elf.section(symbol).is_some_and(|s| s.stored))
        .map(|symbol| (symbol, readable(&symbol.name)))
        .collect();
    let mut crates = BTreeMap::<&str, u64>::new();
    for (symbol, name) in &stored {
        *crates.entry(crate_of(name)).or_default() += symbol.size;
    }
    let named: u64 = crates.values().sum();
    crates.insert("(constants without a name)", flash.saturating_sub(named));
    let mut crates: Vec<_> = crates.into_iter().collect();
    crates.sort_by_key(|(_, size)| std::cmp::Reverse(*size));
    println!("\nby crate; inlined code counts for the calling crate");
    for (name, size) in crates {
        println!(
            "{size:7} {:5.1} %  {name}",
            100.0 * size as f64 / flash as f64
        );
    }
    stored.sort_by_key(|(symbol, _)| std::cmp::Reverse(symbol.size));
    println!("\nlargest symbols");
    for (symbol, name) in stored.iter().take(LARGEST) {
        let short: String = name.chars().take(100).collect();
        println!(
            "{:7} {:5.1} %  {short}",
            symbol.size,
            100.0 * symbol.size as f64 / flash as f64
        );
    }
    Ok(())
}

/// The name as written in the source, without the compiler's hash.
fn readable(mangled: &str) -> String {
    format!("{:#}", rustc_demangle::demangle(mangled))
}

/// The crate that a path begins with; `(assembler and C)` for names without one.
fn crate_of(name: &str) -> &str {
    const OTHER: &str = "(assembler, C and exported names)";
    let path = name.trim_start_matches(['<', '&', '*', '[', '(']);
    let path = path.strip_prefix("mut ").unwrap_or(path);
    match path.split_once("::") {
        Some((first, _)) if first.chars().all(|c| c.is_alphanumeric() || c == '_') => first,
        _ => OTHER,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_crate_is_where_the_path_begins() {
        let name = readable("_ZN10model_core5model4step17h0123456789abcdefE");
        assert_eq!(name, "model_core::model::step");
        assert_eq!(crate_of(&name), "model_core");
        assert_eq!(
            crate_of("<firmware::Law as core::Clone>::clone"),
            "firmware"
        );
        assert_eq!(crate_of("<&mut core::fmt::X as T>::f"), "core");
        assert!(crate_of("__aeabi_memcpy4").starts_with('('));
    }
}
