//! Makes the script of a failing run smaller while it still fails.

use std::ops::Range;

use crate::run::run;
use crate::script::Script;

/// Runs that shrinking may take.
const MAX_RUNS: usize = 200;

/// A script with fewer entries that still breaks `rule`: halves, then quarters, then single entries are left out.
pub fn shrink(script: &Script, rule: &str) -> Script {
    let mut best = script.clone();
    let mut runs = 0;
    let mut part = best.world.len().max(best.host.len()).max(best.second.len()).max(1);
    while part > 0 && runs < MAX_RUNS {
        let mut smaller = false;
        for cut in cuts(&best, part) {
            runs += 1;
            if runs > MAX_RUNS {
                break;
            }
            if run(&cut, false).verdict.has(rule) {
                best = cut;
                smaller = true;
                break;
            }
        }
        if !smaller {
            part /= 2;
        }
    }
    best
}

/// The script without each run of `part` entries.
fn cuts(script: &Script, part: usize) -> Vec<Script> {
    let (world, host, second) = (script.world.len(), script.host.len(), script.second.len());
    let mut all = without(script, world, part, |script, range| drop(script.world.drain(range)));
    all.extend(without(script, host, part, |script, range| drop(script.host.drain(range))));
    all.extend(without(script, second, part, |script, range| drop(script.second.drain(range))));
    all
}

/// The script without each run of `part` of its `entries` of a kind, which `cut` takes out.
fn without(script: &Script, entries: usize, part: usize, cut: impl Fn(&mut Script, Range<usize>)) -> Vec<Script> {
    let smaller = |from: usize| {
        let mut smaller = script.clone();
        cut(&mut smaller, from..(from + part).min(entries));
        smaller
    };
    (0..entries).step_by(part).map(smaller).collect()
}
