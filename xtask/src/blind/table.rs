//! Rates over all seeds, each with its 95 % interval.

use anyhow::Result;
use darm::diagnose::significance::clopper_pearson;

use super::Outcome;
use super::case::Class;
use super::judge::Mark;
use crate::figures::Figure;

/// Held-out error over the repeatability that still counts as explained.
pub(super) const RATIO: f64 = 1.15;

/// The figures, printed with their intervals.
pub(super) fn figures(outcomes: &[Outcome]) -> Result<Vec<Figure>> {
    let mut figures = Vec::new();
    let inside = |outcome: &Outcome| matches!(outcome.class, Class::One | Class::Two);
    let outside = |outcome: &Outcome| outcome.class == Class::Outside;
    let clean = |outcome: &Outcome| outcome.class == Class::Clean;
    let mut add = |name: &str, [hits, n]: [usize; 2]| -> Result<()> {
        if n > 0 {
            figures.push(rate(&format!("blind: {name}"), hits, n)?);
        }
        Ok(())
    };
    add("named rightly", count(outcomes, inside, |mark| mark.named))?;
    add("place named rightly", count(outcomes, inside, |mark| mark.placed))?;
    add("held-out error within 1.15 of the repeatability", count(outcomes, inside, |mark| mark.ratio <= RATIO))?;
    add("false alarms on clean arms", count(outcomes, clean, |mark| !mark.named))?;
    let covered = outcomes.iter().fold([0, 0], |[hits, n], o| [hits + o.darm.covered[0], n + o.darm.covered[1]]);
    add("intervals that hold the true value, at least", covered)?;
    add("intervals that hold the true value, at most", covered)?;
    add("false names outside the list", count(outcomes, outside, |mark| !mark.named))?;
    add("right variable outside the list", count(outcomes, outside, |mark| mark.variable))?;
    Ok(figures)
}

/// Of the outcomes chosen, how many are so, and how many there are.
fn count(outcomes: &[Outcome], choose: impl Fn(&Outcome) -> bool, so: impl Fn(&Mark) -> bool) -> [usize; 2] {
    let chosen: Vec<&Outcome> = outcomes.iter().filter(|outcome| choose(outcome)).collect();
    [chosen.iter().filter(|outcome| so(&outcome.darm)).count(), chosen.len()]
}

fn rate(name: &str, hits: usize, n: usize) -> Result<Figure> {
    let percent = |share: f64| (1000.0 * share).round() / 10.0;
    let [low, high] = clopper_pearson(hits, n).map(percent);
    Figure::new(name, percent(hits as f64 / n as f64), &format!("% of {n} ({low}–{high})"))
}
