//! The verdict on signals: what else explains them, what is not identifiable, what remains, and what is named.

use crate::agreement;
use crate::effect::{Effect, LawName, Place};
use crate::judge::constancy::Fitted;
use crate::judge::far_rows::{are_too_many, far_rows_of_signals};
use crate::judge::gate::{self, Evidence, UNEXPLAINED_SHARE};
use crate::judge::held_out::HeldOut;
use crate::judge::jumps::leave_jumping;
use crate::judge::lack_of_fit::{AxisLeft, MAX_OVER_NOISE, exceeds_noise};
use crate::judge::remaining::{self, Remaining};
use crate::judge::scatter::{self, Scatter};
use crate::judge::selected::SelectedSignals;
use crate::judge::{Judgement, intervals, next_rows, own_angle};
use crate::linearise::experiment::{Candidate, Experiment};
use crate::linearise::torque::is_ripple;
use crate::measured::Measured;
use crate::outcome::{Alternative, Dependence, Regressor, RepeatedIn, Shape, Structure, Verdict};
use crate::progress::Cancelled;
use crate::select::problem::{Neighbours as _, RegressionProblem as _};
use crate::select::signals::factored::judged;
use crate::select::signals::simplify::{MAX_COMPARED, single_rivals};
use crate::select::significance::{RIVAL_LEVEL, STRUCTURE_LEVEL};

/// Share of the squares that may be left by effects which are named beside what remains.
const MAX_PARTLY_LEFT: f64 = 0.5;

/// An error as many times the scatter of neighbouring rows is no noise, though these may not have all of it.
const FAR: f64 = 10.0;

/// An error this many times that scatter, which continues from row to row, is none either.
const FAR_WITH_MEMORY: f64 = 3.0;

/// Steps whose moments differ by less than this share of the log are one event: moments are tried on a coarse grid.
const AT_ONCE: f64 = 0.15;

/// What is left of the orientation of a tool, root mean square over its axes, from which on the model is not its own.
const MAX_TURN_RAD: f64 = 0.5;

/// A candidate that would do as well in the place of an effect.
struct Rival {
    /// Number of the effect among those of the model.
    order: usize,
    candidate: usize,
    cross_validated: f64,
    /// The confidence that it is worse.
    worse_with: f64,
}

/// Judges a selection; behind a filter noise is correlated from row to row as well. `pooled` has the held-out residuals of other
/// searches.
///
/// # Errors
///
/// The diagnosis was given up.
pub(crate) fn judge(
    selected: &SelectedSignals,
    pooled: Option<&HeldOut>,
    is_filtered: bool,
) -> Result<Judgement, Cancelled> {
    let (problem, best) = (&selected.problem, &selected.best);
    let (mut effects, mut unobservable) = intervals::effects(selected)?;
    let mut rivals = rivals_of_effects(selected, &effects)?;
    let balanced = balancers(selected, &effects)?;
    let no_row_distinguishes = !balanced.is_empty() && rivals.is_empty();
    rivals.extend(balanced);
    unobservable.extend(impossible(selected));
    effects.retain(|found| !rivals.iter().any(|rival| is_of(found, selected.candidate(rival.order))));
    let doubtful = doubtful(selected, effects.is_empty(), &rivals);
    let Remaining { terms: mut remaining, share: left, over_noise } = remaining::remaining(problem, best)?;
    let after = problem.experiment.at(&best.fit.values);
    let scatter = scatter::scatter(&problem.experiment, &after, is_filtered);
    let sigma = &best.weighting.sigma;
    let explained = agreement::signals::explained(&problem.experiment, &best.unseen_residuals);
    let n_fitted = problem.indices(&best.fit.active).len();
    let rest = Rest::of(&problem.experiment, &after, n_fitted, scatter.as_ref());
    let memory = if is_filtered { Vec::new() } else { remaining::memory(problem, best) };
    // Postures follow each other in any order: what lasts from one to the next is of time.
    let is_in_order = rest.is_beyond_neighbours || problem.experiment.kind.is_of_tool();
    let has_shape = is_in_order && !memory.is_empty();
    if effects.is_empty() || has_shape {
        let is_open = |one: &Dependence| !remaining.iter().any(|term| term.axis == one.axis);
        let open: Vec<Dependence> = memory.into_iter().filter(is_open).collect();
        remaining.extend(open);
    }
    if let Some(scatter) = &scatter {
        remaining.splice(0..0, leave_beaten(selected, &mut effects, &after, scatter)?);
    }
    let jumps = leave_jumping(selected, &mut effects);
    let is_jumping = !jumps.is_empty();
    remaining.splice(0..0, jumps);
    let changing = withhold_of_changing(selected, &mut effects);
    let is_changing = !changing.is_empty();
    remaining.splice(0..0, changing);
    let event = event(selected);
    let is_event = event.is_some();
    remaining.splice(0..0, event);
    if remaining.is_empty() && rest.is_beyond_repeats {
        remaining
            .extend(scatter.as_ref().map(|scatter| by_condition(&scatter.left(&problem.experiment, &after, n_fitted))));
    }
    let is_any = !effects.is_empty() || !doubtful.is_empty();
    let is_wrong_in_part = is_wrong_in_part(selected);
    let evidence = Evidence {
        agrees: selected.agreement.allows(selected.n_found(), explained)
            && is_orientation_near(&problem.experiment, &after),
        named: effects.len(),
        is_ambiguous: !doubtful.is_empty(),
        was_beyond_noise: is_wrong_in_part
            || rest.is_beyond_repeats
            || !remaining.is_empty()
            || is_any && chance_of_gain(selected)? < STRUCTURE_LEVEL,
        is_left: is_wrong_in_part
            || is_event
            || is_changing
            || is_jumping
            || left > UNEXPLAINED_SHARE
            || over_noise > MAX_OVER_NOISE
            || rest.is_beyond_repeats
            || rest.is_far_from_neighbours
            || has_shape,
        is_mainly_taken: !is_event
            && !is_jumping
            && left < MAX_PARTLY_LEFT
            && is_halved(&problem.experiment, &after)
            && scatter.as_ref().is_none_or(|scatter| is_excess_taken(&problem.experiment, &after, scatter)),
        held_out_falls: match pooled {
            Some(pooled) => pooled.falls(sigma, problem.experiment.n_norm),
            None => HeldOut::of(selected).falls(sigma, problem.experiment.n_norm),
        },
        noise_dof: rest.noise_dof,
    };
    let verdict = gate::verdict(&evidence);
    if !verdict.names_effects() && verdict != Verdict::NotIdentifiable {
        effects.clear();
    }
    let unconfirmed = unconfirmed(selected, &effects);
    let asks_for_repeats = matches!(verdict, Verdict::PartlyExplained | Verdict::TooLittleData)
        && !evidence.is_noise_known()
        && !evidence.is_left;
    let next_measurement = match () {
        () if no_row_distinguishes => None,
        () if !doubtful.is_empty() => Some(next_rows::proposal(problem, best, &doubtful)),
        () => asks_for_repeats.then(|| next_rows::to_repeat(problem)),
    };
    let alternatives = alternatives(selected, &rivals);
    Ok(Judgement {
        verdict,
        effects,
        alternatives,
        unobservable,
        unconfirmed,
        repeatability: scatter.map(|scatter| scatter.figure),
        is_noise_known: evidence.is_noise_known(),
        is_more_left: evidence.is_left,
        structure: None,
        remaining: structure(remaining),
        next_measurement,
    })
}

/// What remains, without the numbers that only poses have.
fn structure(depends_on: Vec<Dependence>) -> Structure {
    Structure { ratio: None, p: None, beyond_noise: !depends_on.is_empty(), excess: 0.0, over_noise: 0.0, depends_on }
}

/// Whether more rows of a measured tool are far off than an instrument blunders in.
fn is_wrong_in_part(selected: &SelectedSignals) -> bool {
    let (problem, best) = (&selected.problem, &selected.best);
    let far = || far_rows_of_signals(&problem.under(best).training_residuals(&best.fit), problem.experiment.axes.len());
    problem.experiment.kind.is_of_tool() && are_too_many(far().len(), problem.groups.training.len())
}

/// The effects that have rivals; where none is certain and none has rivals, they help together and none of them by itself: the
/// likeliest.
fn doubtful(selected: &SelectedSignals, is_none_certain: bool, rivals: &[Rival]) -> Vec<usize> {
    let is_undecided = is_none_certain && rivals.is_empty() && selected.n_found() > 0;
    match is_undecided {
        true => intervals::likeliest(selected, MAX_COMPARED),
        false => of_rivals(selected, rivals),
    }
}

/// The effects that fit best with sizes which cannot be.
fn impossible(selected: &SelectedSignals) -> impl Iterator<Item = String> {
    let candidates = selected.impossible.iter().map(|&k| &selected.problem.experiment.candidates[k]);
    candidates.map(|candidate| {
        format!(
            "{} at {} (it fits best with a size below the least possible: is the sign of that channel right?)",
            candidate.law, candidate.site
        )
    })
}

/// The effects of the best model beside those that are named and those of the model before.
fn unconfirmed(selected: &SelectedSignals, named: &[Effect]) -> Vec<String> {
    let added = selected.best.fit.active.iter().skip(selected.n_known);
    let candidates = added.map(|&k| &selected.problem.experiment.candidates[k]);
    let open = candidates.filter(|candidate| !named.iter().any(|found| is_of(found, candidate)));
    open.map(|candidate| format!("{} at {}", candidate.law, candidate.site)).collect()
}

/// Chance that all effects selected together predict unseen rows so much better where there is none, times the number of
/// candidates.
fn chance_of_gain(selected: &SelectedSignals) -> Result<f64, Cancelled> {
    let SelectedSignals { problem, best, n_known, .. } = selected;
    let known = judged(problem.under(best), best.fit.active[..*n_known].to_vec(), None)?;
    Ok(problem.under(best).reduction(&known, best).p * problem.moves().len() as f64)
}

/// Whether effects take half of the mean square of the rows that fits see, without what is far off.
fn is_halved(experiment: &Experiment, after: &[f64]) -> bool {
    let size = |residuals: &[f64]| agreement::training::size(experiment, &experiment.training_rows(residuals)).powi(2);
    size(after) < MAX_PARTLY_LEFT * size(&experiment.residuals)
}

/// What rows under the same conditions share and no channel that was tried explains: each condition is off by its own.
fn by_condition(left: &[AxisLeft]) -> Dependence {
    let ratio = left.iter().map(|axis| axis.ratio).sum::<f64>() / left.len().max(1) as f64;
    Dependence::of_share(Regressor::Condition, 1.0 - ratio.max(1.0).recip())
}

/// The moment at which several joints change at once: that is one cause, such as what the tool carries, and no law of each of them.
/// A step that is too small to be named by itself shows it too.
fn event(selected: &SelectedSignals) -> Option<Dependence> {
    let experiment = &selected.problem.experiment;
    let found = (selected.n_known..selected.best.fit.active.len()).map(|order| selected.candidate(order));
    let steps = found.filter(|candidate| candidate.law == LawName::StepInTime);
    let moments: Vec<f64> = steps.filter_map(|step| step.shape.as_ref().map(|(_, moment, _)| *moment)).collect();
    let times = || experiment.rows.iter().map(|row| row.time_s);
    let length_s = times().fold(f64::MIN, f64::max) - times().fold(f64::MAX, f64::min);
    let is_together = |a: &f64| moments.iter().filter(|b| (*a - **b).abs() < AT_ONCE * length_s).count() > 1;
    let moment = moments.iter().find(|moment| is_together(moment))?;
    Some(Dependence {
        variable: format!("time, at several joints from {moment:.1} s after the start on"),
        shape: Shape::Step,
        ..Dependence::of_share(Regressor::Time, 1.0)
    })
}

/// Whether effects take most of what was beyond the scatter of repeated rows (mean squares of the norm).
fn is_excess_taken(experiment: &Experiment, after: &[f64], scatter: &Scatter) -> bool {
    if scatter.figure.repeated_in != RepeatedIn::Rows {
        return true;
    }
    let excess = |residuals: &[f64]| {
        let size = agreement::training::size(experiment, &experiment.training_rows(residuals));
        size.powi(2) - scatter.figure.norm.value.powi(2)
    };
    excess(after) < UNEXPLAINED_SHARE * excess(&experiment.residuals)
}

/// Whether a model shows the way that a measured tool is turned: it is another one, or the log is read in another way, where what
/// is left of the orientation is an angle that no error of a robot makes.
fn is_orientation_near(experiment: &Experiment, after: &[f64]) -> bool {
    let axes = (experiment.n_norm..experiment.axes.len()).filter(|&axis| experiment.axes[axis].unit == "rad");
    let squares: Vec<f64> = axes.map(|axis| experiment.mean_square(after, axis)).collect();
    !experiment.kind.is_of_tool() || squares.iter().sum::<f64>().sqrt() < MAX_TURN_RAD
}

/// The error that is left, next to the scatter of the rows.
struct Rest {
    /// Whether it exceeds the scatter of rows under the same conditions, on any axis.
    is_beyond_repeats: bool,
    /// Whether it is far larger than the scatter of neighbouring rows.
    is_far_from_neighbours: bool,
    /// Whether the error, without rows that are far off, is several times the scatter of neighbouring rows: something is left where it
    /// continues from row to row as well.
    is_beyond_neighbours: bool,
    /// Degrees of freedom of the scatter; none where the error exceeds that of neighbouring rows on any axis: they do not have all of
    /// the noise, and show neither that something is left nor that nothing is.
    noise_dof: usize,
}

impl Rest {
    fn of(experiment: &Experiment, after: &[f64], n_fitted: usize, scatter: Option<&Scatter>) -> Self {
        let nothing =
            Self { is_beyond_repeats: false, is_far_from_neighbours: false, is_beyond_neighbours: false, noise_dof: 0 };
        let Some(scatter) = scatter else { return nothing };
        let (exceeds, dof) = (exceeds_noise(&scatter.left(experiment, after, n_fitted)), scatter.figure.dof);
        match scatter.figure.repeated_in {
            RepeatedIn::Rows => Self { is_beyond_repeats: exceeds, noise_dof: dof, ..nothing },
            RepeatedIn::Neighbours => {
                let (rows, noise) = (experiment.training_rows(after), scatter.figure.norm.value);
                let size = agreement::training::size(experiment, &rows);
                let is = |times: f64| noise > 0.0 && size > times * noise;
                Self {
                    is_far_from_neighbours: is(FAR),
                    is_beyond_neighbours: is(FAR_WITH_MEMORY),
                    noise_dof: if exceeds { 0 } else { dof },
                    ..nothing
                }
            }
        }
    }
}

/// Takes the intervals from values that are not the same all the time; gives what the residual depends on by them.
fn withhold_of_changing(selected: &SelectedSignals, effects: &mut [Effect]) -> Vec<Dependence> {
    let SelectedSignals { problem, best, .. } = selected;
    let (experiment, weighted) = (&problem.experiment, problem.under(best));
    let n_axes = experiment.axes.len();
    // Where each fitted value is reported: its effect, and its number there.
    let mut places: Vec<Option<(usize, usize)>> = Vec::new();
    for order in 0..best.fit.active.len() {
        let candidate = selected.candidate(order);
        let effect = effects.iter().position(|found| is_of(found, candidate));
        for value in &candidate.values {
            let place = effect.and_then(|effect| {
                let is_own = |number: &usize| {
                    let own = &effects[effect].values[*number];
                    own.name == value.name && own.ci95.is_some() && !places.contains(&Some((effect, *number)))
                };
                (0..effects[effect].values.len()).find(is_own).map(|number| (effect, number))
            });
            places.push(place);
        }
    }
    let residuals = weighted.training_residuals(&best.fit);
    let columns: Vec<Vec<f64>> =
        problem.indices(&best.fit.active).iter().map(|&value| weighted.column(value)).collect();
    let time_s: Vec<f64> = problem.groups.training.iter().map(|&row| experiment.rows[row].time_s).collect();
    let (groups, level) = (&problem.groups.blocks, STRUCTURE_LEVEL);
    let fitted = Fitted { residuals: &residuals, columns: &columns, time_s: &time_s, groups, level };
    let on_axis = |(value, dependence): (usize, Dependence)| {
        let square =
            |axis: &usize| columns[value].iter().skip(*axis).step_by(n_axes).map(|slope| slope * slope).sum::<f64>();
        let axis = (0..n_axes).max_by(|a, b| square(a).total_cmp(&square(b))).unwrap_or(0);
        Dependence { axis: Some(experiment.axes[axis].name.clone()), ..dependence }
    };
    fitted.withhold_intervals(effects, &places).into_iter().map(on_axis).collect()
}

/// Springs of joints in the place of bodies that are named.
fn balancers(selected: &SelectedSignals, effects: &[Effect]) -> Result<Vec<Rival>, Cancelled> {
    let orders = selected.n_known..selected.best.fit.active.len();
    let is_named = |order: &usize| effects.iter().any(|found| is_of(found, selected.candidate(*order)));
    let rival = |order: usize| {
        let candidate = own_angle::balancer(selected, order).transpose()?;
        let of = |candidate| Rival { order, candidate, cross_validated: selected.best.error, worse_with: 0.0 };
        Some(candidate.map(of))
    };
    orders.filter(is_named).filter_map(rival).collect()
}

/// Leaves effects of one axis that leave more than noise there, where something that is no law, in their place, leaves no more and
/// lowers the error on the held-out rows; gives what that is. `after` are the residuals of the model.
fn leave_beaten(
    selected: &SelectedSignals,
    effects: &mut Vec<Effect>,
    after: &[f64],
    scatter: &Scatter,
) -> Result<Vec<Dependence>, Cancelled> {
    let SelectedSignals { problem, best, n_known, .. } = selected;
    let experiment = &problem.experiment;
    let held_out = experiment.held_out_rows(after);
    let is_more = |residuals: &[f64], axis: usize| {
        let left = scatter.left(experiment, residuals, problem.indices(&best.fit.active).len());
        exceeds_noise(&left.into_iter().filter(|left| left.axis == axis).collect::<Vec<_>>())
    };
    let beaten_by = |found: &Effect| {
        let axis = match found.site.place {
            Place::Joint(joint) if experiment.kind == Measured::JointTorque => joint,
            _ if experiment.axes.len() == 1 => 0,
            _ => return Ok(None),
        };
        if held_out.is_empty() || !is_more(after, axis) {
            return Ok(None);
        }
        let mut orders = (*n_known..best.fit.active.len()).filter(|&order| is_of(found, selected.candidate(order)));
        let (Some(order), None) = (orders.next(), orders.next()) else { return Ok(None) };
        let without = problem.neighbours(best)?.with_one_less(order)?;
        let Some((term, left)) = remaining::instead(problem, &without, axis)? else { return Ok(None) };
        let of_both = HeldOut { before: held_out.clone(), after: experiment.held_out_rows(&left) };
        Ok((!is_more(&left, axis) && of_both.falls(&best.weighting.sigma, 0)).then_some(term))
    };
    let beaten = effects.iter().map(beaten_by).collect::<Result<Vec<Option<Dependence>>, Cancelled>>()?;
    let mut are_beaten = beaten.iter().map(Option::is_some);
    effects.retain(|_| !are_beaten.next().unwrap_or(false));
    Ok(beaten.into_iter().flatten().collect())
}

/// Whether a candidate is this effect, in whatever shape.
fn is_of(found: &Effect, candidate: &Candidate) -> bool {
    candidate.law == found.law && candidate.site == found.site
}

/// What explains the rows as well in the place of an effect that differs from zero, where the model has few.
///
/// Another shape of the same law at the same place is no other explanation, and neither is what is in the model already. What
/// explains the lesser part of an effect as well leaves the effect where it is.
fn rivals_of_effects(selected: &SelectedSignals, effects: &[Effect]) -> Result<Vec<Rival>, Cancelled> {
    let SelectedSignals { problem, best, n_known, .. } = selected;
    if selected.n_found() == 0 || selected.n_found() > MAX_COMPARED {
        return Ok(Vec::new());
    }
    let candidates = &problem.experiment.candidates;
    let is_named = |order: &usize| effects.iter().any(|found| is_of(found, selected.candidate(*order)));
    let mut all: Vec<Rival> = Vec::new();
    let is_certain = |order: &usize| is_named(order) && !is_lesser_part(selected, *order);
    for order in (*n_known..best.fit.active.len()).filter(is_certain) {
        for (candidate, rival, worse_with) in single_rivals(problem, best, order)? {
            let is_same = |other: usize| candidates[other].is_same(&candidates[candidate]);
            let is_known = all.iter().any(|rival| rival.order == order && is_same(rival.candidate));
            // Laws of one place differ in their shape; what is elsewhere often adds the same.
            let is_here = candidates[candidate].site == selected.candidate(order).site;
            let is_worse = is_here && worse_with >= 1.0 - RIVAL_LEVEL;
            if !best.fit.active.iter().any(|&k| is_same(k)) && !is_known && !is_worse {
                all.push(Rival { order, candidate, cross_validated: rival.error, worse_with });
            }
        }
    }
    Ok(all)
}

/// Whether an effect is the lesser part of another: a second shape of its law, or the other phase of a ripple.
fn is_lesser_part(selected: &SelectedSignals, order: usize) -> bool {
    let SelectedSignals { problem, best, .. } = selected;
    let candidate = selected.candidate(order);
    let size = |k: usize| problem.indices(&[k]).first().map_or(0.0, |&value| best.fit.values[value].abs());
    let period = |candidate: &Candidate| candidate.shape.as_ref().map(|(_, number, _)| *number);
    let own = size(best.fit.active[order]);
    let is_larger_part = |k: usize| {
        let other = &problem.experiment.candidates[k];
        let is_phase = is_ripple(other.law) && is_ripple(candidate.law) && period(other) == period(candidate);
        other.site == candidate.site && (is_phase || other.law == candidate.law) && size(k) > own
    };
    best.fit.active.iter().any(|&k| is_larger_part(k))
}

/// The effects that have rivals, and these, once each.
fn of_rivals(selected: &SelectedSignals, rivals: &[Rival]) -> Vec<usize> {
    let of = |rival: &Rival| [selected.best.fit.active[rival.order], rival.candidate];
    let mut all: Vec<usize> = rivals.iter().flat_map(of).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Alternatives as they are reported, the best one of each set first.
fn alternatives(selected: &SelectedSignals, rivals: &[Rival]) -> Vec<Alternative> {
    let alternative = |order: usize, candidate: &Candidate, cross_validated: f64, worse_with: f64| Alternative {
        instead_of: order - selected.n_known,
        law: candidate.law,
        site: candidate.site.clone(),
        cross_validated,
        worse_with,
    };
    let mut all = Vec::new();
    for set in rivals.chunk_by(|a, b| a.order == b.order) {
        let order = set[0].order;
        all.push(alternative(order, selected.candidate(order), selected.best.error, 0.0));
        let of_set = set.iter().map(|rival| {
            let candidate = &selected.problem.experiment.candidates[rival.candidate];
            alternative(order, candidate, rival.cross_validated, rival.worse_with)
        });
        all.extend(of_set);
    }
    all
}
