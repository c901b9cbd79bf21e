//! The loop for many seeds in this process, in one table: how often is it right?

use anyhow::Result;
use darm_diagnose::outcome::Verdict;

use darm_diagnose::truth::Kind;

use super::Demo;
use super::course::{self, Course};
use super::rig::Rig;
use crate::figures::{Figure, tell};
use crate::progress::Progress;

/// Runs seeds 1 to `seeds` and prints a row for each.
pub(super) fn run(demo: &Demo, seeds: u64) -> Result<()> {
    println!("{HEADER}");
    let (mut right, mut placed, mut false_names, mut closed, mut worst_ratio) = (0, 0, 0, 0, 0.0);
    for seed in 1..=seeds {
        let task = demo.task(seed)?;
        let synthesis = task.synthesis()?;
        let mut rig = Rig::in_process(&synthesis.arm)?;
        let course = course::run(&task, synthesis, &mut rig, &Progress::silent(), &mut |_, _| Ok(()))?;
        right += u64::from(course.named_rightly());
        placed += u64::from(course.placed_rightly());
        false_names += u64::from(course.diagnosis.verdict == Verdict::EffectFound && !course.named_rightly());
        worst_ratio = ratio(&course).map_or(worst_ratio, |ratio| ratio.max(worst_ratio));
        closed += u64::from(course.closed.as_ref().is_some_and(|closed| closed.restopped.rms_m() <= course.goal_m()));
        println!("{}", row(seed, &course));
    }
    let named = |name: &str, count: u64| Figure::new(&format!("{name}, of {seeds}"), count as f64, "arms");
    let figures = if demo.effect == Some(Kind::Nothing) {
        vec![named("false names on clean arms", false_names)?]
    } else {
        vec![
            named("effects named rightly", right)?,
            named("place named rightly too", placed)?,
            Figure::new(&format!("largest held-out error over repeatability, of {seeds}"), worst_ratio, "times")?,
            named("stops: arms that reach the goal", closed)?,
        ]
    };
    tell(&figures, seeds, demo.json.as_deref())
}

const HEADER: &str = "\
seed  hidden effect    place                       verdict                named                                     held-out error   at the frames, mm
                                                                                                                      over repeats   before  stops  table";

/// Held-out error with the effects found over the repeatability.
fn ratio(course: &Course) -> Option<f64> {
    let after = course.diagnosis.error.after.heldout.as_ref()?.norm.value;
    Some(after / course.diagnosis.repeatability.as_ref()?.norm.value)
}

fn row(seed: u64, course: &Course) -> String {
    let diagnosis = &course.diagnosis;
    let named: Vec<String> = diagnosis.effects.iter().map(|found| format!("{} {}", found.law, found.site)).collect();
    let ratio = ratio(course).map_or("-".to_owned(), |ratio| format!("{ratio:.2}"));
    let closed = course.closed.as_ref().map_or("     -      -".to_owned(), |closed| {
        format!("{:6.2} {:6.2}", 1e3 * closed.restopped.rms_m(), 1e3 * closed.table_only.rms_m())
    });
    let right = if course.placed_rightly() { "" } else { "  <-" };
    format!(
        "{seed:4}  {:15}  {:26}  {:21}  {:40}  {ratio:>14}   {:6.2} {closed}{right}",
        course.sealed.effect,
        course.sealed.place,
        format!("{:?}", diagnosis.verdict),
        named.join(" + "),
        1e3 * course.before.rms_m(),
    )
}
