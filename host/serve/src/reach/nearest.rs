//! The nearest word: exact where an index of the arm's frames can be formed, else as far as a time limit leads, with a bound.

use std::time::{Duration, Instant};

use darm_arm::arm::Arm;
use darm_arm::reach::ReachError;
use darm_arm::reach::anytime;
use darm_arm::reach::exact::{Index, Near, Options, Query, switches, words_to_choose_from};
use darm_arm::reach::servo::{Gap, with_servos};
use darm_core::real::Vec3;
use darm_core::se::{Pose, rotation_exp};
use serde::{Deserialize, Serialize};

use super::check::{MAX_M, checked_servos, invalid, refused, word};
use crate::job_queue::Work;
use crate::picture::{Picture, Posture, Tool};
use crate::refusal::Refused;

/// Time limit of a search that is not exact, or that optimises servo angles.
const LIMIT: Duration = Duration::from_secs(10);
/// A search over servo angles ends when none can be nearer by more than this, m.
const GAP_M: f64 = 1e-3;
/// A distance is proven within this, m: rounding of the search.
const ROUNDING_M: f64 = 1e-9;

/// A pose to come near to.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct NearestRequest {
    target: Target,
    /// The orientation does not count.
    position_only: bool,
    /// Where the servo joints are, rad.
    servos_rad: Vec<f64>,
    /// Their angles are optimised too.
    optimise_servos: bool,
    /// The word that the arm comes from.
    from: String,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Target {
    position_m: [f64; 3],
    rotation_rad: [f64; 3],
}

/// What was found.
#[derive(Debug, Serialize)]
pub(super) struct NearestView {
    word: String,
    servos_rad: Vec<f64>,
    /// √(|Δp|² + ℓ²θ²), m.
    distance_m: f64,
    /// No word is closer than this, m.
    lower_bound_m: f64,
    /// The bound is the distance.
    is_proven: bool,
    error_m: f64,
    error_rad: f64,
    words: f64,
    /// Share of the words that were evaluated or excluded by a bound.
    searched: f64,
    took_s: f64,
    /// Actuators that switch.
    switches: usize,
    tool: Tool,
    /// Position and orientation error of the prediction with the effects of the model.
    with_effects: Option<[f64; 2]>,
    /// The arm in the word.
    picture: Picture,
}

/// An index, and what it holds.
pub(super) struct Search {
    options: Options,
    index: Index,
}

/// The result of one of the searches.
struct Found {
    near: Near,
    servos_rad: Vec<f64>,
    lower_bound_m: f64,
    searched: f64,
}

impl NearestRequest {
    /// Searches. `known` is the index of an earlier search, and then that of this one.
    pub(super) fn answer(&self, arm: &Arm, known: &mut Option<Search>, work: &Work) -> Result<NearestView, Refused> {
        let began = Instant::now();
        let target = self.target.pose(arm.model.chain.is_planar())?;
        checked_servos(arm, &self.servos_rad)?;
        let from = word(arm, &self.from)?;
        let length_scale_m = if self.position_only { 0.0 } else { arm.length_scale_m };
        let options = Options { servos_rad: self.servos_rad.clone(), length_scale_m, ..Options::of(arm) };
        let found =
            self.search(arm, &target, options, known, work)?.ok_or_else(|| refused("the search was given up"))?;
        let Found { near, servos_rad, lower_bound_m, searched } = found;
        let apart = near.pose_base_tool.to(&target);
        let posture = Posture { word: near.word, previous: from, servos_rad: servos_rad.clone() };
        let picture = Picture::of(arm, &posture).map_err(refused)?;
        let predicted = picture.tool.pose().to(&target);
        Ok(NearestView {
            word: near.word.to_string(),
            servos_rad,
            distance_m: near.distance_m,
            lower_bound_m,
            is_proven: near.distance_m - lower_bound_m <= ROUNDING_M,
            error_m: apart.position.norm(),
            error_rad: apart.angle_rad(),
            words: words_to_choose_from(arm, &Options::of(arm), &[]).map_err(refused)?,
            searched,
            took_s: began.elapsed().as_secs_f64(),
            switches: switches(&near.word, &from, near.word.len()),
            tool: Tool::of(&near.pose_base_tool),
            with_effects: (!arm.model.effects.is_empty()).then(|| [predicted.position.norm(), predicted.angle_rad()]),
            picture,
        })
    }

    /// `None` where nobody waits for it any more.
    fn search(
        &self,
        arm: &Arm,
        target: &Pose<f64>,
        options: Options,
        known: &mut Option<Search>,
        work: &Work,
    ) -> Result<Option<Found>, Refused> {
        let query = Query { target, count: 1, forbidden: &[] };
        if self.optimise_servos && arm.n_servos() > 0 {
            return over_servos(arm, &query, &options, work).map_err(refused);
        }
        if known.as_ref().is_none_or(|known| known.options != options) {
            work.is_at("index", 0.0);
            *known = None;
            match Index::new_while(arm, &options, || work.is_wanted()) {
                Ok(index) => *known = Some(Search { options: options.clone(), index }),
                Err(ReachError::TooManyWords { .. }) => {
                    return within_time(arm, &query, &options, work).map_err(refused);
                }
                Err(ReachError::GivenUp) => return Ok(None),
                Err(error) => return Err(refused(error)),
            }
        }
        work.is_at("words", 0.0);
        let near = known.as_ref().and_then(|known| known.index.nearest_while(&query, || work.is_wanted()));
        let near = near.and_then(|near| near.into_iter().next());
        Ok(near.map(|near| Found {
            lower_bound_m: near.distance_m,
            near,
            servos_rad: options.servos_rad,
            searched: 1.0,
        }))
    }
}

impl Target {
    fn pose(&self, is_planar: bool) -> Result<Pose<f64>, Refused> {
        let Self { position_m, rotation_rad } = self;
        if !position_m.iter().chain(rotation_rad).all(|number| number.abs() <= MAX_M) {
            return Err(invalid(format!("the target is further away than {MAX_M} m")));
        }
        let [[_, _, z], [rx, ry, _]] = [*position_m, *rotation_rad];
        if is_planar && [z, rx, ry].iter().any(|number| number.abs() > ROUNDING_M) {
            return Err(invalid("the arm is planar: z and the rotations about x and y are 0"));
        }
        Ok(Pose { position: Vec3::from(*position_m), rotation: rotation_exp(&Vec3::from(*rotation_rad)) })
    }
}

fn over_servos(arm: &Arm, query: &Query<'_>, options: &Options, work: &Work) -> Result<Option<Found>, ReachError> {
    let (began, gap) = (Instant::now(), Gap::of_m(GAP_M));
    let go_on = |boxes: usize| {
        work.is_at("servos", (boxes as f64 / gap.max_boxes as f64).max(share_of_limit(began)));
        work.is_wanted() && began.elapsed() < LIMIT
    };
    let found = with_servos(arm, query, options, &gap, go_on)?;
    let near = found.nearest.into_iter().next().filter(|_| work.is_wanted());
    let of = |near| Found { near, servos_rad: found.servos_rad, lower_bound_m: found.lower_bound_m, searched: 1.0 };
    Ok(near.map(of))
}

fn within_time(arm: &Arm, query: &Query<'_>, options: &Options, work: &Work) -> Result<Option<Found>, ReachError> {
    let began = Instant::now();
    let go_on = || {
        work.is_at("words", share_of_limit(began));
        work.is_wanted() && began.elapsed() < LIMIT
    };
    let found = anytime::nearest(arm, query, options, go_on)?;
    let near = found.nearest.into_iter().next().filter(|_| work.is_wanted());
    let of = |near| Found {
        near,
        servos_rad: options.servos_rad.clone(),
        lower_bound_m: found.lower_bound_m,
        searched: found.settled,
    };
    Ok(near.map(of))
}

fn share_of_limit(began: Instant) -> f64 {
    began.elapsed().as_secs_f64() / LIMIT.as_secs_f64()
}
