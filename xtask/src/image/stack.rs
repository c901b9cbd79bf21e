//! A bound of the stack: the deepest call chain of each level of interrupts, and all levels that can nest on top of it.
//!
//! Frames are read from the instructions: a compiler lowers the stack pointer only in a function's prologue, so the sum of
//! all that lowers it is the frame. It was compared once with the compiler's `.stack_sizes`: equal for all 226 functions
//! that have an entry there; 34 of the compiler's own library have none. Interrupts of one priority do not nest. Each
//! pushes a frame of 104 bytes, also where the floating-point registers are saved lazily, and up to 4 bytes of alignment.

use std::fmt::Write as _;

use anyhow::{Result, bail};

use super::code::Image;
use super::graph::{Chain, Graph};
use super::lists::{BEFORE_TASKS, ENDS};

/// Bytes that the processor pushes when it enters an interrupt, with alignment.
const EXCEPTION_FRAME: u32 = 104 + 4;
/// Largest part of the stack that the bound may take, percent.
const MAX_PERCENT: u32 = 85;

/// Handlers of one priority. `board::prioritise` in the firmware sets them.
struct Level {
    name: &'static str,
    handlers: &'static [&'static str],
}

/// Lowest priority first.
const LEVELS: [Level; 6] = [
    Level { name: "console and servo tasks", handlers: &["SWPMI1"] },
    Level { name: "USARTs", handlers: &["USART1", "USART2", "DMA1_CHANNEL5", "DMA1_CHANNEL6"] },
    Level { name: "control task", handlers: &["TSC"] },
    Level { name: "clock", handlers: &["SysTick"] },
    Level { name: "NMI (flash ECC)", handlers: &["NonMaskableInt"] },
    // Continues at the top of the stack's memory; only its frame is pushed here.
    Level { name: "hard fault", handlers: &[] },
];
/// Of [`LEVELS`], those that can interrupt the start, before the tasks run.
const AT_START: usize = 3;

/// The deepest chain of each level, at start and while the tasks run.
pub(crate) struct Bound {
    start: Vec<(&'static str, Chain)>,
    run: Vec<(&'static str, Chain)>,
    /// Bytes of the stack's memory.
    size: u32,
}

impl Bound {
    /// Analyses an image with a stack of `size` bytes.
    ///
    /// # Errors
    /// When a call or a recursion cannot be resolved, see [`super::lists`].
    pub(crate) fn new(image: &Image, graph: &Graph<'_>) -> Result<Self> {
        let ends = |name: &str| ENDS.contains(&name);
        let returned = |name: &str| ends(name) || BEFORE_TASKS.contains(&name);
        let reset = graph.named("Reset")?;
        let levels = LEVELS.iter().map(|level| Ok((level.name, deepest_of(graph, level, &ends)?)));
        let levels = levels.collect::<Result<Vec<_>>>()?;
        let mut start = vec![("main, start", graph.deepest(reset, &ends)?)];
        start.extend(levels.iter().skip(AT_START).cloned());
        let mut run = vec![("main, tasks run", graph.deepest(reset, &returned)?)];
        run.extend(levels);
        Ok(Self { start, run, size: image.stack_bytes()? })
    }

    /// The bound in bytes.
    pub(crate) fn bytes(&self) -> u32 {
        total(&self.start).max(total(&self.run))
    }

    /// The size of the stack in bytes.
    pub(crate) fn size(&self) -> u32 {
        self.size
    }

    /// The levels with their deepest chains; each function with its frame when `with_chains`.
    pub(crate) fn table(&self, graph: &Graph<'_>, with_chains: bool) -> String {
        let mut text = String::new();
        for (title, levels) in [("At start", &self.start), ("While the tasks run", &self.run)] {
            let _ = writeln!(text, "{title}: {} bytes\n", total(levels));
            for (index, (name, chain)) in levels.iter().enumerate() {
                let pushed = if index == 0 { 0 } else { EXCEPTION_FRAME };
                let _ = writeln!(text, "{:8} + {pushed:3}  {name}", chain.bytes);
                for at in chain.functions.iter().filter(|_| with_chains) {
                    let frame = graph.image.functions.get(at).map_or(0, |function| function.frame);
                    let _ = writeln!(text, "        {frame:6}  {}", graph.name(*at));
                }
            }
            text.push('\n');
        }
        let (bytes, size) = (self.bytes(), self.size);
        let _ = writeln!(text, "Bound: {bytes} of {size} bytes, {} %", 100 * bytes / size);
        text
    }

    /// Fails when the bound takes too much of the stack.
    pub(crate) fn check(&self) -> Result<()> {
        let (bytes, size) = (self.bytes(), self.size);
        if 100 * bytes > MAX_PERCENT * size {
            bail!(
                "the stack may need {bytes} of {size} bytes, allowed are {MAX_PERCENT} %; \
                 `cargo xtask image --stack` prints the call chains"
            );
        }
        Ok(())
    }
}

fn total(levels: &[(&str, Chain)]) -> u32 {
    let frames = EXCEPTION_FRAME * (levels.len() as u32 - 1);
    frames + levels.iter().map(|(_, chain)| chain.bytes).sum::<u32>()
}

fn deepest_of(graph: &Graph<'_>, level: &Level, ends: &dyn Fn(&str) -> bool) -> Result<Chain> {
    let mut deepest = Chain::default();
    for handler in level.handlers {
        let chain = graph.deepest(graph.named(handler)?, ends)?;
        if chain.bytes > deepest.bytes {
            deepest = chain;
        }
    }
    Ok(deepest)
}
