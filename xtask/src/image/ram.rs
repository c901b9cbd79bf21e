//! Static RAM by symbol: what each memory holds and what is free.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, Result};
use object::{Object as _, ObjectSymbol as _, SymbolKind};

/// Symbols of fewer bytes are summed up in one line.
const SMALL: u64 = 64;

/// A memory of the chip with what is in it.
struct Memory {
    name: &'static str,
    /// First address and one beyond the last.
    from: u64,
    to: u64,
}

/// The memories of the STM32L475VG, as `board.x` names them. The stack lies between the start of SRAM2 and `ABOVE`.
fn memories(file: &object::File<'_>) -> Result<[Memory; 2]> {
    let stack = file.symbol_by_name("_stack_start").context("the image has no symbol _stack_start")?.address();
    Ok([
        Memory { name: "SRAM1 (RAM)", from: 0x2000_0000, to: 0x2001_8000 },
        Memory { name: "SRAM2 (ABOVE)", from: stack, to: 0x1000_8000 },
    ])
}

/// Bytes of static RAM that no symbol has.
///
/// # Errors
/// When the image cannot be read.
pub(crate) fn free_bytes(path: &Path) -> Result<u64> {
    let bytes = std::fs::read(path).with_context(|| format!("{} cannot be read", path.display()))?;
    let file = object::File::parse(&*bytes).with_context(|| format!("{} is not an ELF file", path.display()))?;
    let free = |memory: &Memory| {
        let used: u64 = symbols(&file, memory).iter().map(|(size, _)| size).sum();
        (memory.to - memory.from).saturating_sub(used)
    };
    Ok(memories(&file)?.iter().map(free).sum())
}

/// The budget as a table in Markdown.
///
/// # Errors
/// When the image cannot be read.
pub(crate) fn table(path: &Path) -> Result<String> {
    let bytes = std::fs::read(path).with_context(|| format!("{} cannot be read", path.display()))?;
    let file = object::File::parse(&*bytes).with_context(|| format!("{} is not an ELF file", path.display()))?;
    let mut text = String::new();
    let mut free_in_all = 0;
    for memory in memories(&file)? {
        let symbols = symbols(&file, &memory);
        let used: u64 = symbols.iter().map(|(size, _)| size).sum();
        let (free, size) = ((memory.to - memory.from).saturating_sub(used), memory.to - memory.from);
        free_in_all += free;
        let _ = writeln!(
            text,
            "{}: {size} bytes, {used} used, {free} free\n\n| bytes | symbol |\n| ---: | --- |",
            memory.name
        );
        for (size, name) in symbols.iter().filter(|(size, _)| *size >= SMALL) {
            let _ = writeln!(text, "| {size} | `{name}` |");
        }
        let small: u64 = symbols.iter().map(|(size, _)| size).filter(|size| **size < SMALL).sum();
        let _ = writeln!(text, "| {small} | smaller ones |\n");
    }
    let _ = writeln!(text, "Free static RAM: {free_in_all} bytes.");
    Ok(text)
}

/// Size and name of what lies in a memory, largest first.
fn symbols(file: &object::File<'_>, memory: &Memory) -> Vec<(u64, String)> {
    let inside = |address: u64| (memory.from..memory.to).contains(&address);
    let mut found: Vec<_> = file
        .symbols()
        .filter(|symbol| symbol.kind() == SymbolKind::Data && inside(symbol.address()) && symbol.size() > 0)
        .filter_map(|symbol| Some((symbol.size(), format!("{:#}", rustc_demangle::demangle(symbol.name().ok()?)))))
        .collect();
    found.sort_by(|a, b| b.cmp(a));
    found
}
