//! Which functions can panic: calls of the core library's panic functions, by the call graph of the image.

use std::collections::BTreeSet;

use anyhow::{Result, bail};

use super::graph::Graph;
use super::lists::{LISTS, Lists};

/// A call that panics.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Panic {
    /// Who calls.
    caller: String,
    /// The panic function.
    entry: String,
    /// File, line and column, where the call passes them on.
    place: Option<String>,
}

impl std::fmt::Display for Panic {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} -> {}, {}", self.caller, self.entry, self.place.as_deref().unwrap_or("place unknown"))
    }
}

/// Every panic that the handler of an interrupt, or the reset, can reach.
fn reachable(graph: &Graph<'_>, root: &str) -> Result<BTreeSet<Panic>> {
    let ends = |name: &str| is_entry(name) || graph.lists.ends.contains(&name);
    let functions = graph.reached(graph.named(root)?, ends);
    let calls = functions.into_iter().filter(|from| !ends(graph.name(*from)));
    let calls = calls.flat_map(|from| graph.calls(from).iter().map(move |call| (from, call)));
    let panics = calls.filter(|(_, call)| is_entry(graph.name(call.to))).map(|(from, call)| Panic {
        caller: graph.name(from).to_owned(),
        entry: graph.name(call.to).to_owned(),
        place: graph.image.location(call.at),
    });
    Ok(panics.collect())
}

/// Whether a function of this name does nothing but panic. All panics pass one in `core::panicking`.
fn is_entry(name: &str) -> bool {
    let is_named_so = ["::panic_", "_fail::"].iter().any(|part| name.contains(part));
    let ends_so = ["_fail", "_failed"].iter().any(|end| name.ends_with(end));
    name.contains("core::panicking::") || name.starts_with("core::") && (is_named_so || ends_so)
}

/// Fails when the control tick can panic at all, or anything else outside the committed list.
pub(crate) fn check(graph: &Graph<'_>) -> Result<()> {
    let control = reachable(graph, graph.lists.control)?;
    let others = others(graph)?;
    if control.is_empty() && others.is_empty() {
        return Ok(());
    }
    bail!(
        "the control task can panic at {} places:\n{}other tasks can at {} that the list of {LISTS} does not list:\n{}",
        control.len(),
        lines(&control),
        others.len(),
        lines(&others)
    )
}

/// Panics outside the control task that the committed list does not allow.
fn others(graph: &Graph<'_>) -> Result<BTreeSet<Panic>> {
    let allowed = |panic: &Panic| {
        let line = panic.to_string();
        graph.lists.may_panic.iter().copied().flatten().any(|rule| line.contains(rule.part))
    };
    let mut others = BTreeSet::new();
    let handlers = graph.lists.levels.iter().flat_map(|level| level.handlers);
    for root in std::iter::once(&"Reset").chain(handlers).filter(|root| **root != graph.lists.control) {
        others.extend(reachable(graph, root)?.into_iter().filter(|panic| !allowed(panic)));
    }
    Ok(others)
}

/// How many panics the control task can reach.
pub(crate) fn in_control(graph: &Graph<'_>) -> Result<usize> {
    Ok(reachable(graph, graph.lists.control)?.len())
}

/// How many panics other tasks can reach that the committed list does not allow.
pub(crate) fn unlisted(graph: &Graph<'_>) -> Result<usize> {
    Ok(others(graph)?.len())
}

/// The panics that the list allows, with the reasons.
pub(crate) fn reasons(lists: &Lists) -> String {
    lists.may_panic.iter().copied().flatten().map(|rule| format!("  {}: {}\n", rule.part, rule.reason)).collect()
}

/// One a line.
fn lines(panics: &BTreeSet<Panic>) -> String {
    panics.iter().map(|panic| format!("  {panic}\n")).collect()
}
