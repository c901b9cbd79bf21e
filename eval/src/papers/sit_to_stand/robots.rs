//! Robots whose true masses are drawn: each is identified from 88 postures, plans with what it believes, and executes.

use anyhow::{Context, Result};
use darm_papers::motion::execution::{Executed, Gains, execute};
use darm_papers::motion::mapping::{Mapped, map};
use darm_papers::motion::person::Person;
use darm_papers::motion::setup::Setup;
use darm_papers::motion::{Capture, feed_forward};
use darm_robot::robot::Robot;
use rayon::prelude::*;

use super::figure::figure;
use super::postures::{Robots, drawn};
use darm_figures::figure::Figure;
use darm_figures::progress::Progress;

/// A demonstration, and the robots that follow it.
pub(super) struct Followed<'a> {
    pub(super) name: &'a str,
    pub(super) setup: &'a Setup,
    pub(super) person: &'a Person,
    pub(super) capture: &'a Capture,
}

/// What came of one robot.
struct Run {
    identified: Executed,
    /// The same plan without torques beforehand.
    loops_alone: Executed,
    cad: Executed,
    moved_m: f64,
}

/// The robots of a seed.
pub(super) fn draw(cad: &Robot, count: u64, seed: u64) -> Result<Vec<Robots>> {
    (0..count).into_par_iter().map(|k| drawn(cad, seed.wrapping_mul(2_000_003).wrapping_add(k))).collect()
}

/// A plan executed by joint loops on `real`, with the torques that `believed` predicts.
pub(super) fn executed(real: &Robot, believed: &Robot, setup: &Setup, plan: &Mapped) -> Result<Executed> {
    let torque = feed_forward(believed, setup, plan)?;
    Ok(execute(real, setup, plan, (Gains::default(), &torque))?)
}

/// How many of the robots stand.
pub(super) fn count_standing(
    figures: &mut Vec<Figure>,
    progress: &Progress,
    robots: &[Robots],
    followed: &Followed<'_>,
) -> Result<()> {
    let Followed { name, setup, person, capture } = *followed;
    let cad = &robots.first().context("no robot is drawn")?.cad;
    let by_cad = map(cad, setup, person, capture)?;
    let bar = progress.bar("robots", robots.len() as u64);
    let one = |robots| run(robots, (cad, &by_cad), followed).inspect(|_| bar.inc(1));
    let runs = robots.par_iter().map(one).collect::<Result<Vec<_>>>()?;
    bar.finish_and_clear();
    let of = robots.len();
    let each = |own: fn(&Run) -> &Executed| runs.iter().map(own).collect::<Vec<_>>();
    figures.extend(standing(name, "identified", &each(|run| &run.identified))?);
    figures.extend(standing(name, "CAD", &each(|run| &run.cad))?);
    figures.extend(standing(name, "identified, PD alone", &each(|run| &run.loops_alone))?);
    let moved = runs.iter().map(|run| run.moved_m).fold(0.0, f64::max);
    figures.push(figure(&format!("{name}: centre of mass moved for balance, most of {of}"), 1e3 * moved, "mm")?);
    Ok(())
}

/// One robot follows the demonstration by what was identified, and by `cad` with its plan.
fn run(robots: &Robots, (cad, by_cad): (&Robot, &Mapped), followed: &Followed<'_>) -> Result<Run> {
    let Followed { setup, person, capture, .. } = *followed;
    let plan = map(&robots.identified, setup, person, capture)?;
    Ok(Run {
        identified: executed(&robots.real, &robots.identified, setup, &plan)?,
        loops_alone: execute(&robots.real, setup, &plan, (Gains::default(), &[]))?,
        cad: executed(&robots.real, cad, setup, by_cad)?,
        moved_m: plan.moved_m,
    })
}

/// How many stand, and the median and the smallest margin of the centre of pressure, mm.
fn standing(name: &str, what: &str, all: &[&Executed]) -> Result<[Figure; 3]> {
    let standing = all.iter().filter(|own| !own.fell).count();
    let of = all.len();
    let mut margins: Vec<f64> = all.iter().map(|own| 1e3 * own.cop_margin_m).collect();
    margins.sort_by(f64::total_cmp);
    let (smallest, median) = (margins[0], margins[of / 2]);
    Ok([
        figure(&format!("{name}: robots that stand, {what}, of {of}"), standing as f64, "")?,
        figure(&format!("{name}: margin of the centre of pressure, {what}, median"), median, "mm")?,
        figure(&format!("{name}: margin of the centre of pressure, {what}, smallest"), smallest, "mm")?,
    ])
}
