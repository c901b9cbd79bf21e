//! Whether the committed lists still fit an image: a name that nothing in it has any more says nothing, and hides what took its place.

use anyhow::{Result, bail};

use super::code::{Function, Image};
use super::lists::{Callee, Indirect, LISTS, Lists};

/// Fails for names that the image does not have.
///
/// # Errors
/// The lists name what is not there any more.
pub(crate) fn check(image: &Image, lists: &Lists) -> Result<()> {
    let stale = stale(image, lists);
    if stale.is_empty() {
        return Ok(());
    }
    bail!("{LISTS} names what the image does not have; remove these or give their new names:\n  {}", stale.join("\n  "))
}

/// What the lists name and the image does not have, one line each.
fn stale(image: &Image, lists: &Lists) -> Vec<String> {
    let functions = || image.functions.values();
    let has = |name: &str| functions().any(|function| function.name == name);
    let has_part = |part: &str| functions().any(|function| function.name.contains(part));
    let mut stale = Vec::new();
    for (number, rule) in lists.indirect.iter().enumerate() {
        let decides = |function: &Function| {
            function.calls_indirectly && rule_of(lists, &function.name).is_some_and(|(first, _)| first == number)
        };
        if !functions().any(decides) {
            stale.push(format!("no function calls indirectly by the rule of {}", rule.callers.join(", ")));
        }
        for Callee::Named(part) in rule.callees.iter().filter(|Callee::Named(part)| !has_part(part)) {
            stale.push(format!("callee of {}: {part}", rule.callers.join(", ")));
        }
    }
    let recursion = lists.recursion.iter().copied().flatten().map(|rule| rule.function);
    let exact = [lists.never_called, lists.ends, lists.before_tasks, lists.last_spawn];
    let exact = exact.into_iter().flatten().copied().chain(recursion);
    stale.extend(exact.filter(|name| !has(name)).map(str::to_owned));
    let never = lists.levels.iter().flat_map(|level| level.never);
    stale.extend(never.filter(|part| !has_part(part)).map(|part| format!("never called: {part}")));
    stale
}

/// The rule for the indirect calls of a function, with its number: the first that names a part of its name.
pub(crate) fn rule_of<'l>(lists: &'l Lists, name: &str) -> Option<(usize, &'l Indirect)> {
    let names = |rule: &Indirect| rule.callers.iter().any(|part| name.contains(part));
    lists.indirect.iter().enumerate().find(|(_, rule)| names(rule))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::super::code::{Function, Image};
    use super::super::lists::{Callee, Indirect, Level, Lists, Recursion};
    use super::stale;

    const LISTS: Lists = Lists {
        indirect: &[
            Indirect { callers: &["poll"], callees: &[Callee::Named("task")] },
            Indirect { callers: &["wake", "poll_all"], callees: &[Callee::Named("waker")] },
        ],
        never_called: &["unused"],
        recursion: &[&[Recursion { function: "format", depth: 2 }]],
        ends: &["panic"],
        before_tasks: &["build"],
        last_spawn: &["spawn"],
        levels: &[Level { name: "tasks", handlers: &[], never: &["search"] }],
        at_start: 0,
        exception_frame: 0,
        control: "tick",
        may_panic: &[],
    };
    const CALLERS: [&str; 2] = ["executor::poll", "wake_all"];
    const OTHERS: [&str; 8] = ["a_task", "a_waker", "unused", "format", "panic", "build", "spawn", "search_on"];

    /// An image of all that the lists name but one.
    fn without(missing: &str) -> Image {
        let callers = CALLERS.map(|name| (name, true)).into_iter();
        let functions = callers.chain(OTHERS.map(|name| (name, false))).filter(|(name, _)| *name != missing);
        let function = |(name, calls_indirectly): (&str, bool)| Function {
            name: name.to_owned(),
            calls_indirectly,
            ..Function::default()
        };
        Image::of((0..).step_by(2).zip(functions.map(function)).collect::<BTreeMap<_, _>>())
    }

    #[test]
    fn every_name_of_the_lists_has_to_be_in_the_image() {
        assert_eq!(stale(&without(""), &LISTS), Vec::<String>::new());
        for missing in CALLERS.into_iter().chain(OTHERS) {
            assert_eq!(stale(&without(missing), &LISTS).len(), 1, "without {missing}");
        }
    }

    #[test]
    fn a_rule_that_an_earlier_one_hides_is_stale() {
        let mut image = without("wake_all");
        let poll_all = Function { name: "poll_all".to_owned(), calls_indirectly: true, ..Function::default() };
        image.functions.insert(100, poll_all);
        assert_eq!(stale(&image, &LISTS), ["no function calls indirectly by the rule of wake, poll_all"]);
    }
}
