//! Rates over all seeds, each with its 95 % interval.

use anyhow::Result;
use clap::ValueEnum;
use darm_diagnose::select::significance::clopper_pearson;

use super::case::Class;
use super::judge::Mark;
use super::{ArmKind, Outcome};
use darm_figures::figure::Figure;

/// Held-out error over the repeatability that still counts as explained.
pub(super) const RATIO: f64 = 1.15;

/// The figures: ours, then those of each baseline for which they are defined.
pub(super) fn figures(outcomes: &[Outcome]) -> Result<Vec<Figure>> {
    let mut figures = Vec::new();
    let mut add = |name: String, [hits, n]: [usize; 2]| -> Result<()> {
        if n > 0 {
            figures.push(rate(&name, hits, n)?);
        }
        Ok(())
    };
    for (name, counts) in common(outcomes, |outcome| Some(&outcome.darm)) {
        add(format!("blind: {name}"), counts)?;
    }
    let covered = outcomes.iter().fold([0, 0], |[hits, n], o| [hits + o.darm.covered[0], n + o.darm.covered[1]]);
    add("blind: intervals that hold the true value, at least".into(), covered)?;
    add("blind: intervals that hold the true value, at most".into(), covered)?;
    let variables = count(outcomes, |outcome| Some(&outcome.darm), outside, |mark| mark.variable);
    add("blind: right variable outside the list".into(), variables)?;
    for (name, counts) in common(outcomes, |outcome| outcome.baselines.as_ref().map(|marks| &marks.stepwise)) {
        add(format!("stepwise with BIC: {name}"), counts)?;
    }
    for (name, counts) in common(outcomes, |outcome| outcome.baselines.as_ref().map(|marks| &marks.sparse)) {
        add(format!("sparse regression: {name}"), counts)?;
    }
    Ok(figures)
}

/// Prints hits and tries of each arm by itself.
pub(super) fn by_arm(outcomes: &[Outcome]) {
    println!("{:10} {:>12} {:>12} {:>12} {:>12} {:>12}", "arm", "named", "place", "error", "false alarm", "variable");
    for arm in ArmKind::value_variants() {
        let own: Vec<&Outcome> = outcomes.iter().filter(|outcome| outcome.arm == *arm).collect();
        let cell = |choose: fn(&Outcome) -> bool, so: fn(&Mark) -> bool| {
            let chosen: Vec<&Mark> =
                own.iter().filter(|outcome| choose(outcome)).map(|outcome| &outcome.darm).collect();
            format!("{} of {}", chosen.iter().filter(|mark| so(mark)).count(), chosen.len())
        };
        if !own.is_empty() {
            let (named, placed) = (cell(inside, |mark| mark.named), cell(inside, |mark| mark.placed));
            let (error, alarms) = (cell(inside, |mark| mark.ratio <= RATIO), cell(clean, |mark| !mark.named));
            let variable = cell(outside, |mark| mark.variable);
            let arm = format!("{arm:?}");
            println!("{arm:10} {named:>12} {placed:>12} {error:>12} {alarms:>12} {variable:>12}");
        }
    }
}

fn inside(outcome: &Outcome) -> bool {
    matches!(outcome.class, Class::One | Class::Two)
}

fn outside(outcome: &Outcome) -> bool {
    outcome.class == Class::Outside
}

fn clean(outcome: &Outcome) -> bool {
    outcome.class == Class::Clean
}

/// Whose mark; `None` where a method was not asked.
type Of = fn(&Outcome) -> Option<&Mark>;

/// What is counted for every method: name, hits, tries.
fn common(outcomes: &[Outcome], of: Of) -> [(&'static str, [usize; 2]); 5] {
    [
        ("named rightly", count(outcomes, of, inside, |mark| mark.named)),
        ("place named rightly", count(outcomes, of, inside, |mark| mark.placed)),
        ("held-out error within 1.15 of the repeatability", count(outcomes, of, inside, |mark| mark.ratio <= RATIO)),
        ("false alarms on clean arms", count(outcomes, of, clean, |mark| !mark.named)),
        ("false names outside the list", count(outcomes, of, outside, |mark| !mark.named)),
    ]
}

/// Of the outcomes chosen, how many are so, and how many there are.
fn count(outcomes: &[Outcome], of: Of, choose: fn(&Outcome) -> bool, so: fn(&Mark) -> bool) -> [usize; 2] {
    let chosen: Vec<&Mark> = outcomes.iter().filter(|outcome| choose(outcome)).filter_map(of).collect();
    [chosen.iter().filter(|mark| so(mark)).count(), chosen.len()]
}

/// Hits of `n` tries in percent, with the 95 % interval.
pub(crate) fn rate(name: &str, hits: usize, n: usize) -> Result<Figure> {
    let percent = |share: f64| (1000.0 * share).round() / 10.0;
    let [low, high] = clopper_pearson(hits, n).map(percent);
    Figure::new(name, percent(hits as f64 / n as f64), &format!("% of {n} ({low}–{high})"))
}
