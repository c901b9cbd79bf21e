//! Who reaches whom, and how deep the stack gets.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Result, bail};

use super::code::{Call, Function, Image};
use super::fit::rule_of;
use super::lists::{Callee, LISTS, Lists};

/// The image's functions with the indirect calls resolved.
pub(crate) struct Graph<'i> {
    pub(crate) image: &'i Image,
    pub(crate) lists: &'static Lists,
    /// Callees of each function.
    edges: BTreeMap<u32, Vec<Call>>,
}

/// A call chain and the bytes of stack it needs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Chain {
    /// Bytes.
    pub(crate) bytes: u32,
    /// Addresses of the functions, outermost first.
    pub(crate) functions: Vec<u32>,
}

/// How often each function of [`Lists::recursion`] may still be entered.
type Entries = Vec<u32>;

impl<'i> Graph<'i> {
    /// Resolves the indirect calls by the committed list.
    ///
    /// # Errors
    /// For functions that call indirectly and are not in the list, and for functions whose addresses are values somewhere
    /// and that no rule of the list reaches.
    pub(crate) fn new(image: &'i Image, lists: &'static Lists) -> Result<Self> {
        let (mut edges, mut missing) = (BTreeMap::new(), Vec::new());
        for (&address, function) in &image.functions {
            let mut calls = function.calls.clone();
            if function.calls_indirectly {
                match rule_of(lists, &function.name) {
                    Some((_, rule)) => calls.extend(callees(image, rule.callees)),
                    None => missing.push(function.name.as_str()),
                }
            }
            edges.insert(address, calls);
        }
        if !missing.is_empty() {
            bail!("{LISTS} does not list whom these call indirectly:\n  {}", missing.join("\n  "));
        }
        let listed: BTreeSet<u32> =
            lists.indirect.iter().flat_map(|rule| callees(image, rule.callees)).map(|call| call.to).collect();
        let unlisted: Vec<&str> = image.address_taken().difference(&listed).map(|at| name(image, *at)).collect();
        let unlisted: Vec<&str> = unlisted.into_iter().filter(|name| !lists.never_called.contains(name)).collect();
        if !unlisted.is_empty() {
            bail!(
                "no indirect call of {LISTS} reaches these, but their addresses are taken:\n  {}",
                unlisted.join("\n  ")
            );
        }
        Ok(Self { image, lists, edges })
    }

    /// The function of this name.
    pub(crate) fn named(&self, name: &str) -> Result<u32> {
        let found = self.image.functions.iter().find(|(_, function)| function.name == name);
        match found {
            Some((&address, _)) => Ok(address),
            None => bail!("the image has no function {name}"),
        }
    }

    pub(crate) fn name(&self, address: u32) -> &str {
        name(self.image, address)
    }

    pub(crate) fn calls(&self, from: u32) -> &[Call] {
        self.edges.get(&from).map_or(&[], Vec::as_slice)
    }

    /// Everything that `root` reaches without passing through `stop`, itself among it.
    pub(crate) fn reached(&self, root: u32, stop: impl Fn(&str) -> bool) -> BTreeSet<u32> {
        let (mut found, mut open) = (BTreeSet::from([root]), vec![root]);
        while let Some(from) = open.pop() {
            if stop(self.name(from)) {
                continue;
            }
            open.extend(self.calls(from).iter().map(|call| call.to).filter(|to| found.insert(*to)));
        }
        found
    }

    /// The deepest chain from `root`, what `stop` names left out.
    ///
    /// # Errors
    /// For recursion that is not listed, and for a frame of unknown size.
    pub(crate) fn deepest(&self, root: u32, stop: &dyn Fn(&str) -> bool) -> Result<Chain> {
        let entries = self.lists.recursion.iter().copied().flatten().map(|rule| rule.depth).collect();
        Search { graph: self, stop, known: BTreeMap::new(), open: Vec::new() }.deepest(root, entries)
    }
}

fn name(image: &Image, address: u32) -> &str {
    image.functions.get(&address).map_or("?", |function| &function.name)
}

fn callees<'a>(image: &'a Image, callees: &'a [Callee]) -> impl Iterator<Item = Call> + 'a {
    let matches = move |function: &Function| callees.iter().any(|Callee::Named(part)| function.name.contains(part));
    let found = image.functions.iter().filter(move |(_, function)| matches(function));
    found.map(|(&to, _)| Call { at: 0, to, is_tail: false })
}

struct Search<'g, 'i> {
    graph: &'g Graph<'i>,
    stop: &'g dyn Fn(&str) -> bool,
    known: BTreeMap<(u32, Entries), Chain>,
    open: Vec<(u32, Entries)>,
}

impl Search<'_, '_> {
    fn deepest(&mut self, from: u32, mut entries: Entries) -> Result<Chain> {
        let name = self.graph.name(from);
        if let Some((_, left)) = self
            .graph
            .lists
            .recursion
            .iter()
            .copied()
            .flatten()
            .zip(&mut entries)
            .find(|(rule, _)| name == rule.function)
        {
            let Some(fewer) = left.checked_sub(1) else { return Ok(Chain::default()) };
            *left = fewer;
        }
        let state = (from, entries);
        if let Some(known) = self.known.get(&state) {
            return Ok(known.clone());
        }
        // A function that is entered again with as many entries left comes back to itself past no listed one.
        if let Some(start) = self.open.iter().position(|open| *open == state) {
            let cycle: Vec<&str> = self.open[start..].iter().map(|(open, _)| self.graph.name(*open)).collect();
            bail!("{LISTS} does not list this recursion:\n  {}", cycle.join("\n  "));
        }
        self.open.push(state.clone());
        let chain = self.deepest_below(from, &state.1)?;
        self.open.pop();
        self.known.insert(state, chain.clone());
        Ok(chain)
    }

    fn deepest_below(&mut self, from: u32, entries: &Entries) -> Result<Chain> {
        let Some(function) = self.graph.image.functions.get(&from) else { bail!("no function at {from:#010x}") };
        if function.frame_unknown {
            bail!("{} changes the stack pointer by an unknown amount", function.name);
        }
        let mut deepest = Chain { bytes: function.frame, functions: vec![from] };
        for call in self.graph.calls(from) {
            if (self.stop)(self.graph.name(call.to)) {
                continue;
            }
            let below = self.deepest(call.to, entries.clone())?;
            let own = if call.is_tail { 0 } else { function.frame };
            if own + below.bytes > deepest.bytes {
                let functions = std::iter::once(from).chain(below.functions).collect();
                deepest = Chain { bytes: own + below.bytes, functions };
            }
        }
        Ok(deepest)
    }
}

#[cfg(test)]
mod tests {
    use super::super::lists::B_L475E_IOT01A;
    use super::*;

    /// Functions at 0, 2, 4, … with name, frame, calls and tail calls.
    fn image(functions: &[(&str, u32, &[u32], &[u32])]) -> Image {
        let functions = functions.iter().zip((0..).step_by(2)).map(|((name, frame, calls, tails), address)| {
            let call = |is_tail| move |to: &u32| Call { at: address, to: *to, is_tail };
            let calls = calls.iter().map(call(false)).chain(tails.iter().map(call(true))).collect();
            (address, Function { name: (*name).into(), frame: *frame, calls, ..Function::default() })
        });
        Image::of(functions.collect())
    }

    fn deepest(image: &Image) -> Result<Chain> {
        Graph::new(image, &B_L475E_IOT01A)?.deepest(0, &|name| name == "end")
    }

    #[test]
    fn the_deepest_chain_is_not_the_longest() {
        let image = image(&[
            ("root", 8, &[2, 4], &[]),
            ("a", 8, &[6], &[]),
            ("b", 100, &[], &[]),
            ("c", 8, &[8], &[]),
            ("end", 999, &[], &[]),
        ]);
        assert_eq!(deepest(&image).unwrap(), Chain { bytes: 108, functions: vec![0, 4] });
    }

    #[test]
    fn a_tail_call_has_released_its_frame() {
        let image = image(&[("root", 8, &[2], &[]), ("a", 50, &[], &[4]), ("b", 30, &[], &[])]);
        assert_eq!(deepest(&image).unwrap().bytes, 58);
    }

    #[test]
    fn recursion_is_rejected_unless_it_is_listed() {
        let error = deepest(&image(&[("root", 8, &[2], &[]), ("a", 8, &[4], &[]), ("b", 8, &[2], &[])])).unwrap_err();
        assert!(error.to_string().contains("a\n  b"), "{error}");
        let listed = &B_L475E_IOT01A.recursion[0][0];
        let image = image(&[("root", 8, &[2], &[]), (listed.function, 10, &[4], &[]), ("b", 1, &[2], &[])]);
        assert_eq!(deepest(&image).unwrap().bytes, 8 + listed.depth * 11);
    }

    #[test]
    fn an_indirect_call_that_is_not_listed_is_rejected() {
        let mut image = image(&[("unknown", 8, &[], &[])]);
        image.functions.values_mut().for_each(|function| function.calls_indirectly = true);
        assert!(deepest(&image).unwrap_err().to_string().contains("unknown"));
    }
}
