//! A joint whose angle jumps, as by play that lies on the one side or on the other of what the joint carries.
//!
//! The laws of a joint's own angle are smooth; waves, a scale and a compliance together come near a jump. So in the place of all that a
//! joint has of them a jump is tried, δ·sgn sin(q − φ), which turns round twice a turn as the weight does about a level axis. Where it
//! leaves less, of the rows that chose φ and of those that are held out, none of these laws is named.

use std::f64::consts::PI;

use crate::effect::{Effect, LawName, Place};
use crate::judge::selected::SelectedSignals;
use crate::least_squares::{Linear, losses, moved};
use crate::outcome::{Dependence, Regressor, Shape};

/// Places of a jump that are tried in half a turn: 7.5° apart, a jump beside its place takes all but the rows between.
const PLACES: usize = 24;
/// A fit is weighted again as often at the most.
const REWEIGHTINGS: usize = 6;

/// Leaves the effects of a joint's own angle in whose place a jump does better; gives what the residual depends on instead.
pub(super) fn leave_jumping(selected: &SelectedSignals, effects: &mut Vec<Effect>) -> Vec<Dependence> {
    let experiment = &selected.problem.experiment;
    if !experiment.kind.is_of_tool() {
        return Vec::new();
    }
    let mut joints: Vec<Place> =
        effects.iter().filter(|found| is_of_angle(found.law)).map(|found| found.site.place).collect();
    joints.sort_unstable();
    joints.dedup();
    let mut found = Vec::new();
    for joint in joints {
        let jump = jump(selected, joint);
        effects.retain(|found| jump.is_none() || found.site.place != joint || !is_of_angle(found.law));
        found.extend(jump);
    }
    found
}

/// Whether a law adds to a joint's angle what that angle says, smoothly.
fn is_of_angle(law: LawName) -> bool {
    matches!(law, LawName::EncoderPeriodic | LawName::EncoderScale | LawName::JointCompliance)
}

/// The jump of a joint that does better than all that the model has of its angle.
fn jump(selected: &SelectedSignals, joint: Place) -> Option<Dependence> {
    let (problem, best) = (&selected.problem, &selected.best);
    let (experiment, sigma) = (&problem.experiment, &best.weighting.sigma);
    let (candidates, n_axes) = (&experiment.candidates, sigma.len());
    let Place::Joint(number) = joint else { return None };
    let name = format!("position of joint {}", number + 1);
    let (_, angle) = experiment.channels.iter().find(|(channel, _)| *channel == name)?;
    let offset = candidates.iter().find(|one| one.law == LawName::JointOffset && one.site.place == joint)?;
    let is_own = |k: &usize| candidates[*k].site.place == joint && is_of_angle(candidates[*k].law);
    let (own, others): (Vec<usize>, Vec<usize>) = best.fit.active.iter().copied().partition(is_own);
    let in_noise = |numbers: &[f64]| -> Vec<f64> {
        numbers.iter().enumerate().map(|(entry, number)| number / sigma[entry % n_axes]).collect()
    };
    let mut values = best.fit.values.clone();
    let with_laws = in_noise(&experiment.at(&values));
    problem.indices(&own).into_iter().for_each(|value| values[value] = 0.0);
    let without = in_noise(&experiment.at(&values));
    let offset_column = in_noise(&offset.values[0].column);
    let kept = others.iter().flat_map(|&k| &candidates[k].values).map(|value| in_noise(&value.column));
    let kept: Vec<Vec<f64>> = kept.chain([offset_column.clone()]).collect();
    let counts: Vec<f64> = experiment.rows.iter().map(|row| f64::from(u8::from(!row.held_out))).collect();
    let with_jump_at = |place: usize| {
        let at = PI * place as f64 / PLACES as f64;
        let side = |entry: usize| (angle[entry / n_axes] - at).sin().signum();
        let jump = offset_column.iter().enumerate().map(|(entry, slope)| slope * side(entry)).collect();
        let columns: Vec<Vec<f64>> = kept.iter().cloned().chain([jump]).collect();
        let step = Linear { columns: &columns, residuals: &without, n_axes }.step(&counts, &counts, REWEIGHTINGS);
        moved(&columns, &without, &step)
    };
    let loss = |residuals: &[f64], held_out: bool| -> f64 {
        let rows = losses(residuals, n_axes).into_iter().zip(&experiment.rows);
        rows.filter(|(_, row)| row.held_out == held_out).map(|(loss, _)| loss).sum()
    };
    let with_jump = (0..PLACES).map(with_jump_at).min_by(|a, b| loss(a, false).total_cmp(&loss(b, false)))?;
    let is_better = [false, true].into_iter().all(|held_out| loss(&with_jump, held_out) < loss(&with_laws, held_out));
    let squares = |residuals: &[f64]| -> f64 {
        residuals.iter().enumerate().map(|(entry, r)| counts[entry / n_axes] * r * r).sum()
    };
    let share = 1.0 - squares(&with_jump) / squares(&without).max(f64::MIN_POSITIVE);
    let axis = Some(format!("the angle of {}", offset.site));
    let of_angle = Dependence::of_share(Regressor::Signals(vec![name]), share);
    is_better.then_some(Dependence { axis, shape: Shape::Step, ..of_angle })
}
