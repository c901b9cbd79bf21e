//! The functions of a linked image: their stack frames and whom they call, read from the machine code.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;

use anyhow::{Context, Result, bail};
use object::{Object as _, ObjectSection as _, ObjectSymbol as _, SymbolKind};

use super::thumb::{self, Op};

/// A linked image.
pub(crate) struct Image {
    /// By their addresses.
    pub(crate) functions: BTreeMap<u32, Function>,
    /// Constant bytes: code and read-only data, by their addresses.
    constants: Vec<(u32, Vec<u8>)>,
    /// Where instructions begin.
    instructions: BTreeSet<u32>,
    /// Lowest and one beyond the highest address of the stack.
    stack: Option<(u32, u32)>,
}

/// One function.
#[derive(Clone, Debug, Default)]
pub(crate) struct Function {
    /// Demangled, without the hash of its crate.
    pub(crate) name: String,
    /// Bytes of its code and of the constants between.
    pub(crate) size: u32,
    /// Bytes by which it lowers the stack pointer in total.
    pub(crate) frame: u32,
    /// Functions that it calls directly.
    pub(crate) calls: Vec<Call>,
    /// It calls functions whose addresses it has in registers.
    pub(crate) calls_indirectly: bool,
    /// Odd constants that its instructions put together, as addresses of code.
    pub(crate) constants: Vec<u32>,
    /// It changes the stack pointer by an amount that is not in the instruction.
    pub(crate) frame_unknown: bool,
    /// Address of the word from which a branch of the linker's takes its target.
    pub(crate) branch_target: Option<u32>,
}

/// A direct call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Call {
    /// Address of the instruction.
    pub(crate) at: u32,
    /// Address of the function.
    pub(crate) to: u32,
    /// A branch in place of the last call and return: the caller's frame is released already.
    pub(crate) is_tail: bool,
}

/// A stretch of one section, by what its mapping symbols say of it.
struct Stretch {
    from: u32,
    is_code: bool,
}

impl Image {
    /// Reads the image at `path`.
    ///
    /// # Errors
    /// When it cannot be read, is not an ELF file, has no symbols, or calls an address at which no function begins.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).with_context(|| format!("{} cannot be read", path.display()))?;
        let file = object::File::parse(&*bytes).with_context(|| format!("{} is not an ELF file", path.display()))?;
        let sections = file
            .sections()
            .filter(|section| [".text", ".rodata", ".data", ".fast"].contains(&section.name().unwrap_or("")));
        let constants: Vec<(u32, Vec<u8>)> =
            sections.map(|section| Ok((section.address() as u32, section.data()?.to_vec()))).collect::<Result<_>>()?;
        let address = |name: &str| file.symbol_by_name(name).map(|symbol| symbol.address() as u32);
        let stack = address("_stack_end").zip(address("_stack_start"));
        let mut image = Self { functions: BTreeMap::new(), constants, instructions: BTreeSet::new(), stack };
        let stretches = stretches(&file);
        for (address, size, name) in symbols(&file) {
            let operations = image.operations(address, size, &stretches);
            image.instructions.extend(operations.iter().map(|(at, _)| *at));
            let function = image.function(address..address + size, name, operations);
            image.functions.entry(address).or_insert(function);
        }
        if image.functions.is_empty() {
            bail!("{} has no symbols of functions", path.display());
        }
        image.check_targets()?;
        Ok(image)
    }

    /// An image of functions alone.
    #[cfg(test)]
    pub(crate) fn of(functions: BTreeMap<u32, Function>) -> Self {
        Self { functions, constants: Vec::new(), instructions: BTreeSet::new(), stack: None }
    }

    /// Bytes of the stack's memory.
    pub(crate) fn stack_bytes(&self) -> Result<u32> {
        let (end, start) = self.stack.context("the image has no symbols _stack_end and _stack_start")?;
        Ok(start - end)
    }

    /// Bytes of the function whose name ends with `::name`, together with what it calls directly and so on.
    ///
    /// # Errors
    /// When none or several end so, or when it calls by address: what those need is not known.
    pub(crate) fn code_bytes(&self, name: &str) -> Result<u32> {
        let ends = |function: &Function| function.name.strip_suffix(name).is_some_and(|path| path.ends_with("::"));
        let named: Vec<u32> =
            self.functions.iter().filter(|(_, function)| ends(function)).map(|(&address, _)| address).collect();
        let &[root] = named.as_slice() else { bail!("{} functions are called {name}, not one", named.len()) };
        let (mut found, mut open, mut bytes) = (BTreeSet::from([root]), vec![root], 0);
        while let Some(function) = open.pop().and_then(|at| self.functions.get(&at)) {
            if function.calls_indirectly {
                bail!("{name} reaches {}, which calls by address", function.name);
            }
            bytes += function.size;
            open.extend(function.calls.iter().map(|call| call.to).filter(|to| found.insert(*to)));
        }
        Ok(bytes)
    }

    /// Every direct call must lead to the beginning of a function.
    fn check_targets(&self) -> Result<()> {
        for function in self.functions.values() {
            for call in &function.calls {
                if !self.functions.contains_key(&call.to) {
                    bail!(
                        "{} branches at {:#010x} to {:#010x}: no function begins there",
                        function.name,
                        call.at,
                        call.to
                    );
                }
            }
        }
        Ok(())
    }

    fn function(&self, inside: Range<u32>, name: String, operations: Vec<(u32, Op)>) -> Function {
        let mut function = Function { name, size: inside.end - inside.start, ..Function::default() };
        let is_thunk = function.name.starts_with(THUNK);
        let (mut low, mut literals) = (BTreeMap::new(), BTreeMap::new());
        let mut below_frame = None;
        for (at, op) in operations {
            match op {
                // An ARMv6-M has no other branch that reaches the end of a long function.
                Op::Call(to) if to != inside.start && inside.contains(&to) => {}
                Op::Call(to) => function.calls.push(Call { at, to, is_tail: false }),
                Op::Branch(to) if !inside.contains(&to) => function.calls.push(Call { at, to, is_tail: true }),
                Op::CallRegister | Op::BranchRegister => function.calls_indirectly = true,
                Op::Push(bytes) => function.frame += bytes,
                Op::StackUnknown => function.frame_unknown = true,
                // A large frame of an ARMv6-M is a negative constant; its end adds or restores what its begin took.
                Op::AddToStack(register) => match literals.get(&register) {
                    Some(constant) => function.frame += u32::try_from(-i64::from(*constant)).unwrap_or(0),
                    None => function.frame_unknown = true,
                },
                Op::BelowFrame(register) => below_frame = Some(register),
                Op::SetStack(register) => function.frame_unknown |= below_frame != Some(register),
                Op::Literal(_, place) if is_thunk => {
                    function.branch_target = Some(place);
                    function.calls.extend(self.word(place).map(|to| Call { at, to: to & !1, is_tail: true }));
                }
                Op::Literal(register, place) => {
                    literals.extend(self.word(place).map(|word| (register, word as i32)));
                }
                Op::Low(register, value) => drop(low.insert(register, value)),
                Op::High(register, high) => {
                    function.constants.extend(low.get(&register).map(|low| (high << 16 | low) & !1));
                }
                Op::Branch(_) | Op::Other => {}
            }
        }
        function
    }

    /// The instructions of a function, data between them left out.
    fn operations(&self, address: u32, size: u32, stretches: &BTreeMap<u32, Stretch>) -> Vec<(u32, Op)> {
        let (mut at, end) = (address, address + size);
        let mut operations = Vec::new();
        while at < end {
            let stretch = stretches.range(..=at).next_back();
            if stretch.is_some_and(|(_, stretch)| !stretch.is_code) {
                at = stretches.range(at + 1..).next().map_or(end, |(_, next)| next.from);
                continue;
            }
            let Some(first) = self.half_word(at) else { break };
            let second = self.half_word(at + 2).unwrap_or(0);
            operations.push((at, thumb::decode(at, first, second)));
            at += thumb::length(first);
        }
        operations
    }

    fn bytes(&self, address: u32, count: usize) -> Option<&[u8]> {
        self.constants.iter().find_map(|(base, bytes)| {
            let offset = address.checked_sub(*base)? as usize;
            bytes.get(offset..offset.checked_add(count)?)
        })
    }

    fn half_word(&self, address: u32) -> Option<u16> {
        self.bytes(address, 2).and_then(|bytes| Some(u16::from_le_bytes(bytes.try_into().ok()?)))
    }

    fn word(&self, address: u32) -> Option<u32> {
        self.bytes(address, 4).and_then(|bytes| Some(u32::from_le_bytes(bytes.try_into().ok()?)))
    }

    /// Functions whose addresses are values somewhere in the image: whom an indirect call may reach.
    pub(crate) fn address_taken(&self) -> BTreeSet<u32> {
        let branches: BTreeSet<u32> = self.functions.values().filter_map(|function| function.branch_target).collect();
        let words = self.constants.iter().flat_map(|(base, bytes)| (*base..).step_by(4).zip(bytes.chunks_exact(4)));
        // Two halves of instructions can look like an address.
        let is_code = |at: u32| self.instructions.range(at..at + 4).next().is_some();
        let words = words.filter(|(at, _)| !branches.contains(at) && !is_code(*at));
        let values = words.filter_map(|(_, word)| Some(u32::from_le_bytes(word.try_into().ok()?)));
        let in_data = values.filter(|value| value & 1 == 1).map(|value| value & !1);
        let in_code = self.functions.values().flat_map(|function| function.constants.iter().copied());
        in_data.chain(in_code).filter(|address| self.functions.contains_key(address)).collect()
    }

    /// The source line that a panicking call at `at` passes on: the last constant before it that is a
    /// `core::panic::Location`, which is file name, its length, line and column.
    pub(crate) fn location(&self, at: u32) -> Option<String> {
        let window: Vec<(u32, Op)> = (at.saturating_sub(LOOK_BACK)..at)
            .step_by(2)
            .filter_map(|at| Some((at, thumb::decode(at, self.half_word(at)?, self.half_word(at + 2)?))))
            .collect();
        window.iter().enumerate().rev().find_map(|(index, (_, op))| {
            let address = match *op {
                Op::Literal(_, place) => self.word(place)?,
                Op::High(register, high) => {
                    let low = window.get(..index)?.iter().rev().find_map(|(_, op)| match *op {
                        Op::Low(other, low) if other == register => Some(low),
                        _ => None,
                    })?;
                    high << 16 | low
                }
                _ => return None,
            };
            self.location_at(address)
        })
    }

    fn location_at(&self, address: u32) -> Option<String> {
        let [name, len, line, column] = [0, 4, 8, 12].map(|offset| self.word(address + offset));
        let name = std::str::from_utf8(self.bytes(name?, len? as usize)?).ok()?;
        name.ends_with(".rs").then(|| Some(format!("{name}:{}:{}", line?, column?)))?
    }
}

/// Begin of the names of what the linker puts where a branch does not reach its target: it loads the target from a constant.
const THUNK: &str = "__Thumbv6MABSLongThunk";

/// Bytes of code in which a constant is sought before a call.
const LOOK_BACK: u32 = 40;

/// Address, size and name of each function; of several names for one, the first in the alphabet.
fn symbols(file: &object::File<'_>) -> Vec<(u32, u32, String)> {
    let mut found: Vec<_> = file
        .symbols()
        .filter(|symbol| symbol.kind() == SymbolKind::Text && symbol.size() > 0)
        .filter_map(|symbol| {
            let name = format!("{:#}", rustc_demangle::demangle(symbol.name().ok()?));
            Some((symbol.address() as u32 & !1, symbol.size() as u32, name))
        })
        .collect();
    found.sort();
    found
}

/// What `$t` and `$d` say of the code section.
fn stretches(file: &object::File<'_>) -> BTreeMap<u32, Stretch> {
    let mapping = file.symbols().filter_map(|symbol| {
        let (name, from) = (symbol.name().ok()?, symbol.address() as u32);
        let is_code = match name.get(..2)? {
            "$t" => true,
            "$d" => false,
            _ => return None,
        };
        Some((from, Stretch { from, is_code }))
    });
    mapping.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_code_of_a_function_is_its_own_and_that_of_all_it_calls_once() {
        let call = |to| Call { at: 0, to, is_tail: false };
        let function = |name: &str, size, calls: &[u32]| Function {
            name: name.into(),
            size,
            calls: calls.iter().map(|to| call(*to)).collect(),
            ..Function::default()
        };
        let mut functions = BTreeMap::from([
            (0, function("bench::mass", 100, &[4, 6])),
            (2, function("bench::generated_mass", 1, &[])),
            (4, function("sine", 20, &[6])),
            (6, function("copy", 3, &[4])),
        ]);
        assert_eq!(Image::of(functions.clone()).code_bytes("mass").unwrap(), 123);
        assert!(Image::of(functions.clone()).code_bytes("torques").is_err(), "there is none");
        functions.get_mut(&6).unwrap().calls_indirectly = true;
        assert!(Image::of(functions.clone()).code_bytes("mass").is_err(), "whom it calls is not known");
        functions.insert(8, function("probe::mass", 1, &[]));
        assert!(Image::of(functions).code_bytes("mass").is_err(), "there are two");
    }

    #[test]
    fn two_halves_of_instructions_are_not_an_address() {
        let word = 0x11u32.to_le_bytes().to_vec();
        let taken = |instructions: &[u32]| {
            let functions = BTreeMap::from([(0x10, Function::default())]);
            let instructions = instructions.iter().copied().collect();
            Image { functions, constants: vec![(0, word.clone())], instructions, stack: None }.address_taken()
        };
        assert_eq!(taken(&[4]), BTreeSet::from([0x10]));
        assert!(taken(&[0]).is_empty() && taken(&[2]).is_empty());
    }
}
