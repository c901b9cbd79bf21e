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
use super::lists::Level;

/// Largest part of the stack that the bound may take, percent.
const MAX_PERCENT: u32 = 85;

/// The deepest chain of each level in each part of a run.
pub(crate) struct Bound {
    phases: Vec<Phase>,
    exception_frame: u32,
    /// Bytes of the stack's memory.
    size: u32,
}

/// A part of a run.
struct Phase {
    title: &'static str,
    /// That of `main` first, then those that can interrupt it.
    levels: Vec<(&'static str, Chain)>,
}

impl Bound {
    /// Analyses an image with a stack of `size` bytes.
    ///
    /// # Errors
    /// When a call or a recursion cannot be resolved, see [`super::lists`].
    pub(crate) fn new(image: &Image, graph: &Graph<'_>) -> Result<Self> {
        let lists = graph.lists;
        let levels = lists.levels.iter().map(|level| Ok((level.name, deepest_of(graph, level)?)));
        let levels = levels.collect::<Result<Vec<_>>>()?;
        let phase = |title, name, returned: &[&[&str]], from| -> Result<Phase> {
            let stop = |name: &str| lists.ends.contains(&name) || returned.iter().any(|names| names.contains(&name));
            let main = (name, graph.deepest(graph.named("Reset")?, &stop)?);
            Ok(Phase { title, levels: std::iter::once(main).chain(levels.iter().skip(from).cloned()).collect() })
        };
        let mut phases = vec![phase("At start", "main, start", &[], lists.at_start)?];
        if !lists.last_spawn.is_empty() {
            let title = "While the last task moves to its place";
            phases.push(phase(title, "main, spawns", &[lists.before_tasks], 1)?);
        }
        let returned = [lists.before_tasks, lists.last_spawn];
        phases.push(phase("While the tasks run", "main, tasks run", &returned, 0)?);
        Ok(Self { phases, exception_frame: lists.exception_frame, size: image.stack_bytes()? })
    }

    /// The bound in bytes.
    pub(crate) fn bytes(&self) -> u32 {
        self.phases.iter().map(|phase| self.total(&phase.levels)).max().unwrap_or(0)
    }

    fn total(&self, levels: &[(&str, Chain)]) -> u32 {
        let frames = self.exception_frame * (levels.len() as u32 - 1);
        frames + levels.iter().map(|(_, chain)| chain.bytes).sum::<u32>()
    }

    /// The size of the stack in bytes.
    pub(crate) fn size(&self) -> u32 {
        self.size
    }

    /// The levels with their deepest chains; each function with its frame when `with_chains`.
    pub(crate) fn table(&self, graph: &Graph<'_>, with_chains: bool) -> String {
        let mut text = String::new();
        for Phase { title, levels } in &self.phases {
            let _ = writeln!(text, "{title}: {} bytes\n", self.total(levels));
            for (index, (name, chain)) in levels.iter().enumerate() {
                let pushed = if index == 0 { 0 } else { self.exception_frame };
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

fn deepest_of(graph: &Graph<'_>, level: &Level) -> Result<Chain> {
    let stop = |name: &str| graph.lists.ends.contains(&name) || level.never.iter().any(|part| name.contains(part));
    let mut deepest = Chain::default();
    for handler in level.handlers {
        let chain = graph.deepest(graph.named(handler)?, &stop)?;
        if chain.bytes > deepest.bytes {
            deepest = chain;
        }
    }
    Ok(deepest)
}
