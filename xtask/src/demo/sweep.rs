//! The loop for many seeds in this process, in one table: how often is it right?

use anyhow::Result;
use darm::diagnose::outcome::Verdict;

use super::Demo;
use super::course::{self, Course};
use super::rig::Rig;
use crate::progress::Progress;

/// Runs seeds 1 to `seeds` and prints a row for each.
pub(super) fn run(demo: &Demo, seeds: u64) -> Result<()> {
    println!("{HEADER}");
    let (mut right, mut placed, mut false_names) = (0, 0, 0);
    for seed in 1..=seeds {
        let task = demo.task(seed)?;
        let synthesis = task.synthesis()?;
        let mut rig = Rig::in_process(&synthesis.arm)?;
        let course = course::run(&task, synthesis, &mut rig, &Progress::silent(), &mut |_, _| Ok(()))?;
        right += u64::from(course.named_rightly());
        placed += u64::from(course.placed_rightly());
        false_names += u64::from(course.diagnosis.verdict == Verdict::EffectFound && !course.named_rightly());
        println!("{}", row(seed, &course));
    }
    println!("named rightly {right} of {seeds}, place too {placed}, false names {false_names}");
    Ok(())
}

const HEADER: &str = "\
seed  hidden effect    place                 verdict               named                      held-out error   at the frames, mm
                                                                                              over repeats     before  stops  table";

fn row(seed: u64, course: &Course) -> String {
    let diagnosis = &course.diagnosis;
    let named: Vec<String> = diagnosis.effects.iter().map(|found| format!("{} {}", found.law, found.place)).collect();
    let after = diagnosis.error.after.heldout.as_ref().map(|figure| figure.distance_m);
    let repeats = diagnosis.repeatability.as_ref().map(|repeats| repeats.distance_m);
    let ratio = after.zip(repeats).map_or("-".to_owned(), |(after, repeats)| format!("{:.2}", after / repeats));
    let closed = course.closed.as_ref().map_or("     -      -".to_owned(), |closed| {
        format!("{:6.2} {:6.2}", 1e3 * closed.restopped.rms_m(), 1e3 * closed.table_only.rms_m())
    });
    let right = if course.placed_rightly() { "" } else { "  <-" };
    format!(
        "{seed:4}  {:15}  {:20}  {:20}  {:25}  {ratio:>14}   {:6.2} {closed}{right}",
        course.sealed.effect,
        course.sealed.place,
        format!("{:?}", diagnosis.verdict),
        named.join(" + "),
        1e3 * course.before.rms_m(),
    )
}
