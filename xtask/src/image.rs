//! The firmware image: the ELF that is flashed and that runs in the emulator, and what can be proved of its machine code.
//!
//! | file     | holds                                                            |
//! |----------|------------------------------------------------------------------|
//! | `board`  | the boards that there are images for                              |
//! | `embedded` | the images that a release of the tool has in it                |
//! | `thumb`  | the instructions that matter for calls and stack                  |
//! | `code`   | functions, frames and direct calls of a linked image              |
//! | `graph`  | the call graph with indirect calls, deepest chains                |
//! | `fit`    | whether the lists still fit an image                              |
//! | `lists`  | what the code does not say: indirect calls, recursion, panics     |
//! | `stack`  | the bound of the stack over all interrupts                        |
//! | `panics` | which panics can be reached                                       |
//! | `ram`    | static RAM by symbol                                              |

mod board;
mod code;
mod embedded;
mod fit;
mod graph;
mod lists;
mod panics;
mod ram;
mod stack;
mod thumb;

use std::path::{Path, PathBuf};
use std::process;

use anyhow::{Context, Result, bail};

use crate::setup::{self, Emulator};
pub use board::Board;
pub use embedded::build_all;

/// Builds the firmware image and prints its path, or analyses it
#[derive(clap::Args)]
pub struct Command {
    /// Which board
    #[arg(long, value_enum, default_value = "b-l475e-iot01a")]
    board: Board,
    /// Builds the images of all boards without debug information and prints their folder: `DARM_IMAGES` of a build of the
    /// tool that has them in it
    #[arg(long, conflicts_with_all = ["board", "stack", "ram", "budget", "panics"])]
    all: bool,
    /// Prints the bound of the stack with the deepest call chains; fails above 85 % of the stack
    #[arg(long)]
    stack: bool,
    /// Prints static RAM by symbol
    #[arg(long)]
    ram: bool,
    /// Writes stack and static RAM to docs/memory-budget.md
    #[arg(long)]
    budget: bool,
    /// Fails when the control task can panic, or another task where the list does not allow it
    #[arg(long)]
    panics: bool,
}

impl Command {
    /// Builds, and analyses what the options name.
    ///
    /// # Errors
    ///
    /// The image cannot be built or read, the budget cannot be written, or as [`check`] where the stack or the panics
    /// are analysed.
    pub fn run(self) -> Result<()> {
        if self.all {
            println!("{}", build_all()?.display());
            return Ok(());
        }
        if self.board != Board::BL475eIot01a && (self.ram || self.budget) {
            bail!("only the memory of b-l475e-iot01a is listed; drop the option");
        }
        if self.board != Board::BL475eIot01a && !self.stack && !self.panics {
            if let Emulator::Absent(why) = self.board.emulator() {
                eprintln!("NO EMULATOR for this image: {why}");
            }
            println!("{}", build_for(self.board)?.display());
            return Ok(());
        }
        let path = build_for(self.board)?;
        if self.ram {
            print!("{}", ram::table(&path)?);
        }
        if self.budget {
            let document = setup::root().join("docs/memory-budget.md");
            std::fs::write(&document, budget(&path)?)
                .with_context(|| format!("{} cannot be written", document.display()))?;
            println!("{}", document.display());
        }
        if self.stack || self.panics {
            self.analyse(&path)?;
        } else if !self.ram && !self.budget {
            println!("{}", path.display());
        }
        Ok(())
    }

    fn analyse(&self, path: &Path) -> Result<()> {
        let Some(lists) = self.board.lists() else { bail!("the image of this board is not analysed; drop the option") };
        let image = read(path, lists)?;
        let graph = graph::Graph::new(&image, lists)?;
        let bound = stack::Bound::new(&image, &graph)?;
        if self.stack {
            print!("{}", bound.table(&graph, true));
        }
        if self.panics {
            println!("Panics that are allowed outside the control task:\n{}", panics::reasons(lists));
            panics::check(&graph)?;
        }
        if self.stack { bound.check() } else { Ok(()) }
    }
}

/// Reads an image that the committed lists fit.
fn read(path: &Path, lists: &lists::Lists) -> Result<code::Image> {
    let image = code::Image::read(path)?;
    fit::check(&image, lists)?;
    Ok(image)
}

/// Stack and static RAM of an image as a page of the documentation.
fn budget(path: &Path) -> Result<String> {
    let image = read(path, &lists::B_L475E_IOT01A)?;
    let graph = graph::Graph::new(&image, &lists::B_L475E_IOT01A)?;
    let stack = stack::Bound::new(&image, &graph)?.table(&graph, false);
    let ram = ram::table(path)?;
    Ok(format!(
        "# Memory budget\n\nWritten by `cargo xtask image --budget`. `cargo xtask image --stack` adds the call chains.\n\n\
         ## Stack\n\nBytes of the deepest call chain and of the frame that an interrupt pushes, by level of priority.\n\n\
         ```text\n{stack}```\n\n## Static RAM\n\n{ram}"
    ))
}

/// Stack and reachable panics of the images that are analysed, and the free static RAM of the first: name, value and unit of each figure.
///
/// # Errors
/// When an image does not build or cannot be analysed.
pub fn figures() -> Result<Vec<(String, f64, &'static str)>> {
    let mut figures = analysed("image", Board::BL475eIot01a)?;
    figures.push(("image: free static RAM".to_owned(), ram::free_bytes(&build()?)? as f64, "bytes"));
    figures.extend(analysed("pico", Board::Pico)?);
    Ok(figures)
}

fn analysed(name: &str, board: Board) -> Result<Vec<(String, f64, &'static str)>> {
    let path = build_for(board)?;
    let lists = board.lists().context("the image of this board is not analysed")?;
    let image = read(&path, lists)?;
    let graph = graph::Graph::new(&image, lists)?;
    let bound = stack::Bound::new(&image, &graph)?;
    let (bytes, size) = (f64::from(bound.bytes()), f64::from(bound.size()));
    Ok(vec![
        (format!("{name}: stack by static bound"), bytes, "bytes"),
        (format!("{name}: stack by static bound, share"), (1000.0 * bytes / size).round() / 10.0, "%"),
        (format!("{name}: panics that the control tick can reach"), panics::in_control(&graph)? as f64, ""),
        (format!("{name}: panics of other tasks that the list does not allow"), panics::unlisted(&graph)? as f64, ""),
    ])
}

/// Bytes of flash and of RAM without the stack that an image takes, from the section headers of its ELF.
///
/// # Errors
/// When the image cannot be read.
pub fn sizes(elf: &Path) -> Result<[(&'static str, f64); 2]> {
    use object::{Object as _, ObjectSection as _};
    let bytes = std::fs::read(elf).with_context(|| format!("{} cannot be read", elf.display()))?;
    let file = object::File::parse(&*bytes).with_context(|| format!("{} is no ELF", elf.display()))?;
    let size = |names: &[&str]| {
        let sections = file.sections().filter(|section| section.name().is_ok_and(|name| names.contains(&name)));
        sections.map(|section| section.size()).sum::<u64>() as f64
    };
    let flash = size(&[".boot2", ".vector_table", ".text", ".rodata", ".data", ".fast"]);
    let ram = size(&[".data", ".fast", ".bss", ".uninit", ".above"]);
    Ok([("flash of the image", flash), ("RAM of the image without its stack", ram)])
}

/// Bytes of code of functions of an image, each with all that it calls directly and so on.
///
/// # Errors
/// When the image cannot be read, has no such function or several, or one of those calls by address.
pub fn code_bytes<const N: usize>(elf: &Path, names: [&str; N]) -> Result<[u32; N]> {
    let image = code::Image::read(elf)?;
    let mut sizes = [0; N];
    for (size, name) in sizes.iter_mut().zip(names) {
        *size = image.code_bytes(name)?;
    }
    Ok(sizes)
}

/// Builds the image of a board, checks the bound of its stack and its panics, and prints the bound.
///
/// # Errors
///
/// The image cannot be built, read or analysed, the stack may need more than its share, the control tick can panic, or other
/// code can panic at a place that is not listed.
pub fn check(board: Board) -> Result<()> {
    let path = build_for(board)?;
    let Some(lists) = board.lists() else { return Ok(()) };
    let image = read(&path, lists)?;
    let graph = graph::Graph::new(&image, lists)?;
    let bound = stack::Bound::new(&image, &graph)?;
    eprint!("{}", bound.table(&graph, false));
    bound.check()?;
    panics::check(&graph)
}

/// Builds the image of the first board and returns its path.
///
/// # Errors
///
/// The compiler does not start or fails.
pub fn build() -> Result<PathBuf> {
    build_for(Board::BL475eIot01a)
}

/// Builds the image of a board and returns its path.
///
/// # Errors
///
/// The compiler does not start or fails.
pub fn build_for(board: Board) -> Result<PathBuf> {
    build_binary(board, board.name(), "chip")
}

/// Builds the image that counts the instructions of the tasks and returns its path.
///
/// # Errors
///
/// The compiler does not start or fails.
pub fn build_bench() -> Result<PathBuf> {
    build_binary(Board::BL475eIot01a, "bench", "bench")
}

/// Builds the image that counts the instructions of kinematics and dynamics and returns its path.
///
/// # Errors
///
/// The compiler does not start or fails.
pub fn build_kinematics() -> Result<PathBuf> {
    build_binary(Board::BL475eIot01a, "kinematics", "bench")
}

/// Builds the image that does kinematics alone and fails when anything in it can panic: no code of that may be linked.
///
/// # Errors
///
/// The image cannot be built or read, has no symbols, or has code that panics.
pub fn check_that_kinematics_cannot_panic() -> Result<()> {
    use object::{Object as _, ObjectSymbol as _};
    let elf = build_binary(Board::BL475eIot01a, "probe", "chip")?;
    let bytes = std::fs::read(&elf).with_context(|| format!("{} cannot be read", elf.display()))?;
    let file = object::File::parse(&*bytes).with_context(|| format!("{} is no ELF", elf.display()))?;
    let names: Vec<&str> = file.symbols().filter_map(|symbol| symbol.name().ok()).collect();
    if !names.iter().any(|name| name.contains("probe")) {
        bail!("{} has no symbols: nothing can be looked for in it", elf.display());
    }
    let panics: Vec<&str> = names.into_iter().filter(|name| name.contains("panic")).collect();
    if !panics.is_empty() {
        bail!("kinematics can panic on the chip: {}", panics.join(", "));
    }
    Ok(())
}

/// Builds one of a board's binaries for its chip and returns its path.
fn build_binary(board: Board, name: &str, feature: &str) -> Result<PathBuf> {
    setup::rust()?;
    let status = process::Command::new("cargo")
        .current_dir(setup::root())
        .args(["build", "--package", board.package(), "--features", feature, "--profile", "firmware"])
        .args(["--target", board.target(), "--bin", name])
        .status()
        .context("cargo did not start")?;
    if !status.success() {
        bail!("the firmware does not build; see the compiler's errors above");
    }
    Ok(setup::target().join(board.target()).join("firmware").join(name))
}
