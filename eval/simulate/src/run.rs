//! One run: a script in, what came of it out.

use std::collections::BTreeMap;

use darm_device::link::faulty::FaultCounts;

use crate::host::{FirstUpload, Host};
use crate::judge::Verdict;
use crate::panics::caught;
use crate::script::Script;
use crate::trace::Said;
use crate::world::{self, World};

/// What came of a run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Its seed.
    pub seed: u64,
    /// What the judges say.
    pub verdict: Verdict,
    /// Equal for equal runs.
    pub digest: u64,
    /// Lines for people, where they were wanted.
    pub lines: Vec<Said>,
    /// Disturbances by kind.
    pub injected: BTreeMap<&'static str, u32>,
    /// How long the host needed after each, ms.
    pub recoveries: Vec<(&'static str, u64)>,
    /// Pieces that the line struck.
    pub struck: FaultCounts,
    /// Loss of the line, percent.
    pub loss_percent: u32,
    /// How the first upload went.
    pub first_upload: Option<FirstUpload>,
    /// Virtual time, ms.
    pub virtual_ms: u64,
}

/// Runs a script.
#[expect(clippy::missing_panics_doc, reason = "the world was entered at the beginning")]
pub fn run(script: &Script, readable: bool) -> Outcome {
    world::enter(World::new(script, readable));
    let mut host = Host::new(script);
    let acted = caught(|| {
        host.run();
        let now_ms = world::with(|world| world.now_ns()) / 1_000_000;
        world::pass(script.min_ms.saturating_sub(now_ms));
        host.look_back();
        world::with(World::judge_wear);
    });
    if let Err(message) = acted {
        world::with(|world| world.reports.on_host_panic(world.now_ns(), &message));
    }
    let Host { struck, first_upload, .. } = host;
    let world = world::leave().expect("it was entered above");
    let now_ns = world.now_ns();
    let World { pins, servos, switches, board_supply, wear, person, reports, injected, recoveries, trace, .. } = world;
    let mut verdict = pins.finish(now_ns);
    verdict.extend(servos.finish());
    verdict.extend(switches.finish());
    verdict.extend(board_supply.finish());
    verdict.extend(wear.finish());
    verdict.extend(person.finish());
    verdict.extend(reports.finish());
    let (seed, loss_percent, digest) = (script.seed, script.loss_percent, trace.digest());
    let mut lines = trace.into_lines();
    for (violation, count) in verdict.firsts() {
        let what = format!("{}: {} ({count} times)", violation.rule, violation.sentence);
        lines.push(Said { at_ns: violation.at_ms * 1_000_000, who: violation.judge, what });
    }
    lines.sort_by_key(|line| line.at_ns);
    let virtual_ms = now_ns / 1_000_000;
    Outcome { seed, verdict, digest, lines, injected, recoveries, struck, loss_percent, first_upload, virtual_ms }
}
