//! The same problem with the poses of the platforms as unknowns, in place of the lengths of their legs.
//!
//! # Model
//!
//! T_k(X)  = T_k*                for every desired frame k: a product of poses, smooth everywhere
//! l_i(X_a) = l_i(X_b)           where two poses of a platform share a leg in one state
//! bounds on l(X), det D(X) > 0  in the assembly mode of the base-line: enter where they are broken
//!
//! A platform has as many poses X as there are digits of its legs among the words; the lengths follow from them in closed
//! form, so that no singular platform bars the way, as it does where the lengths are the unknowns (multiple shooting,
//! described for an arm). For words that switch complete modules no leg is shared, and every choice of X is a
//! geometry: the frames
//! and the gauge between the modules are all that is left.

use darm_core::actuator::Stage;
use darm_core::se::{Pose, Twist};
use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use super::SynthesisError;
use super::newton::{Damping, damped_inverse};
use super::problem::Problem;

/// Steps from one start.
const MAX_STEPS: u32 = 60;
/// The scaled determinant that a platform is kept above, three times of what it may be.
const MIN_DETERMINANT: f64 = 0.03;
/// Half the interval of the determinant's differences.
const HALF_INTERVAL: f64 = 1e-5;
/// A step moves no platform by more than this, m and rad.
const LONGEST_STEP: f64 = 0.3;
/// Below this the lengths are good enough for the last steps in the lengths themselves.
const SOLVED: f64 = 1e-9;

/// One pose of one platform.
#[derive(Clone)]
struct Place {
    stage: usize,
    /// The unknown of each leg's length.
    legs: Vec<usize>,
    /// Components of a twist that the platform is free to take.
    motions: &'static [usize],
    /// Its first column.
    first: usize,
    /// The sign of det D in the assembly mode that is meant.
    sign: f64,
}

pub(super) struct Lift<'p, 'a> {
    problem: &'p Problem<'a>,
    places: Vec<Place>,
    /// For each frame, the place of each stage that is a platform.
    visits: Vec<Vec<Option<usize>>>,
    /// The place, and the leg there, that each stop's length is taken from.
    owners: Vec<Option<(usize, usize)>>,
    /// The columns of the unknowns that are no lengths.
    columns: Vec<Option<usize>>,
    n_columns: usize,
    poses: Vec<Pose<f64>>,
    unknowns: DVector<f64>,
}

/// Equations to first order: the errors, and by which change of the columns it falls.
#[derive(Default)]
struct Rows {
    errors: Vec<f64>,
    slopes: Vec<DVector<f64>>,
}

impl<'p, 'a> Lift<'p, 'a> {
    /// The platforms as they stand at `start`.
    pub(super) fn new(problem: &'p mut Problem<'a>, start: &DVector<f64>) -> Result<Self, SynthesisError> {
        let postures = problem.postures(start)?;
        let problem = &*problem;
        let mut lift = Self {
            problem,
            places: Vec::new(),
            visits: Vec::new(),
            owners: vec![None; problem.n_stops()],
            columns: Vec::new(),
            n_columns: 0,
            poses: Vec::new(),
            unknowns: start.clone(),
        };
        for (target, posture) in problem.targets.iter().zip(&postures) {
            let mut used = target.used.iter().map(|&(column, _)| column);
            let stages = &problem.base_line().model.chain.stages;
            let visit = stages.iter().enumerate().map(|(stage, of)| {
                let legs: Vec<usize> = used.by_ref().take(of.n_actuators()).collect();
                of.leg(0).is_some().then(|| lift.place(stage, legs, posture[stage]))
            });
            let visit = visit.collect();
            lift.visits.push(visit);
        }
        let n_stops = problem.n_stops();
        for unknown in 0..lift.unknowns.len() {
            let free = if unknown < n_stops { !problem.is_leg(unknown) } else { !problem.servos_fixed };
            lift.columns.push(free.then_some(lift.n_columns));
            lift.n_columns += usize::from(free);
        }
        Ok(lift)
    }

    /// The number of the place with these legs; a new one is at `pose`.
    fn place(&mut self, stage: usize, legs: Vec<usize>, pose: Pose<f64>) -> usize {
        if let Some(known) = self.places.iter().position(|place| place.stage == stage && place.legs == legs) {
            return known;
        }
        let (motions, sign): (&[usize], f64) = match &self.problem.base_line().model.chain.stages[stage] {
            Stage::Planar(platform) => (&[2, 3, 4], platform.determinant(&platform.home).signum()),
            Stage::Spatial(platform) => (&[0, 1, 2, 3, 4, 5], platform.determinant(&platform.home).signum()),
            _ => (&[], 1.0),
        };
        let place = self.places.len();
        for (leg, &stop) in legs.iter().enumerate() {
            self.owners[stop].get_or_insert((place, leg));
        }
        self.places.push(Place { stage, legs, motions, first: self.n_columns, sign });
        self.poses.push(pose);
        self.n_columns += motions.len();
        place
    }

    /// Shifts the plates between platforms at random: what one platform gives the next takes, so that no frame moves.
    /// `length_m` and `angle_rad` are standard deviations.
    pub(super) fn shift(&mut self, (length_m, angle_rad): (f64, f64), rng: &mut ChaCha8Rng) {
        let stages = &self.problem.base_line().model.chain.stages;
        let mut random = |sigma: f64| Normal::new(0.0, sigma).map_or(0.0, |normal| normal.sample(rng));
        for stage in 0..stages.len().saturating_sub(1) {
            if [stage, stage + 1].iter().any(|&stage| stages[stage].leg(0).is_none()) {
                continue;
            }
            let motions = self.places.iter().find(|place| place.stage == stage).map_or(&[][..], |place| place.motions);
            let mut six = [0.0; 6];
            motions.iter().for_each(|&motion| six[motion] = random(if motion < 3 { angle_rad } else { length_m }));
            let (given, taken) = (Pose::exp(&twist(six)), Pose::exp(&twist(six.map(|number| -number))));
            for (place, pose) in self.places.iter().zip(&mut self.poses) {
                *pose = match place.stage.checked_sub(stage) {
                    Some(0) => *pose * given,
                    Some(1) => taken * *pose,
                    _ => *pose,
                };
            }
        }
    }

    /// Stops that come as near to the frames as this way leads, and the steps taken.
    pub(super) fn solve(mut self) -> (DVector<f64>, u32) {
        if self.places.is_empty() {
            return (self.unknowns, 0);
        }
        let mut rows = self.rows();
        let mut damping = Damping::default();
        for iteration in 0..MAX_STEPS {
            let size = rows.size();
            if size < SOLVED || damping.is_exhausted() {
                return (self.stops(), iteration);
            }
            let step = rows.step(self.n_columns, damping.value());
            let (poses, unknowns) = (self.poses.clone(), self.unknowns.clone());
            self.advance(&step);
            let next = self.rows();
            if next.size() < size {
                rows = next;
                damping.lower();
            } else {
                (self.poses, self.unknowns) = (poses, unknowns);
                damping.raise();
            }
        }
        (self.stops(), MAX_STEPS)
    }

    fn advance(&mut self, step: &DVector<f64>) {
        let step = step * (LONGEST_STEP / step.amax()).min(1.0);
        let length_scale_m = self.problem.base_line().length_scale_m;
        for (place, pose) in self.places.iter().zip(&mut self.poses) {
            let mut six = [0.0; 6];
            for (column, &motion) in place.motions.iter().enumerate() {
                six[motion] = step[place.first + column] / scale(motion, length_scale_m);
            }
            *pose = *pose * Pose::exp(&twist(six));
        }
        for (unknown, column) in self.columns.iter().enumerate() {
            if let Some(column) = column {
                self.unknowns[unknown] += step[*column] / self.problem.weights()[unknown];
            }
        }
    }

    /// All unknowns, the lengths taken from the poses.
    fn stops(&self) -> DVector<f64> {
        let mut unknowns = self.unknowns.clone();
        for stop in 0..self.problem.n_stops() {
            unknowns[stop] = self.stop(stop);
        }
        unknowns
    }

    fn stop(&self, stop: usize) -> f64 {
        self.owners[stop].map_or(self.unknowns[stop], |(place, leg)| self.length(place, leg).0)
    }

    /// The length of a leg, and how it grows with the columns.
    fn length(&self, place: usize, leg: usize) -> (f64, [f64; 6]) {
        let pose = &self.poses[place];
        let stage = &self.problem.base_line().model.chain.stages[self.places[place].stage];
        let Some(leg) = stage.leg(leg) else { return (0.0, [0.0; 6]) };
        let across = *pose * leg.top - leg.base;
        let length = across.norm();
        let along = pose.rotation.tr_mul(&across) / length;
        let moment = leg.top.cross(&along);
        (length, [moment.x, moment.y, moment.z, along.x, along.y, along.z])
    }

    /// Adds `factor` times the growth of a stop to a row.
    fn add_stop(&self, stop: usize, factor: f64, row: &mut DVector<f64>) {
        match (self.owners[stop], self.columns[stop]) {
            (Some((place, leg)), _) => self.add_motion(place, &self.length(place, leg).1, factor, row),
            (None, Some(column)) => row[column] += factor / self.problem.weights()[stop],
            _ => {}
        }
    }

    fn add_motion(&self, place: usize, slopes: &[f64; 6], factor: f64, row: &mut DVector<f64>) {
        let Place { motions, first, .. } = &self.places[place];
        for (column, &motion) in motions.iter().enumerate() {
            row[first + column] += factor * slopes[motion] / scale(motion, self.problem.base_line().length_scale_m);
        }
    }

    fn rows(&self) -> Rows {
        let mut rows = Rows::default();
        (0..self.visits.len()).for_each(|frame| self.add_frame(frame, &mut rows));
        self.add_shared_legs(&mut rows);
        for bound in &self.problem.bounds {
            let value = |unknown| if unknown < self.owners.len() { self.stop(unknown) } else { self.unknowns[unknown] };
            let slack = bound.terms.iter().map(|&(unknown, factor)| factor * value(unknown)).sum::<f64>() - bound.min;
            if slack < 0.0 {
                let mut slope = DVector::zeros(self.n_columns);
                for &(unknown, factor) in &bound.terms {
                    if unknown < self.owners.len() {
                        self.add_stop(unknown, factor, &mut slope);
                    } else if let Some(column) = self.columns[unknown] {
                        slope[column] += factor / self.problem.weights()[unknown];
                    }
                }
                rows.push(-slack, slope);
            }
        }
        (0..self.places.len()).for_each(|place| self.add_mode(place, &mut rows));
        rows
    }

    /// The equations of one desired frame.
    fn add_frame(&self, frame: usize, rows: &mut Rows) {
        let target = &self.problem.targets[frame];
        let chain = &self.problem.base_line().model.chain;
        let mut tops = Vec::with_capacity(chain.stages.len());
        let mut top = chain.mount;
        let (mut actuator, mut servo) = (0, self.problem.first_servo(frame));
        // What moves with each stage: a place, or the axis of a joint and its unknown.
        for (stage, place) in chain.stages.iter().zip(&self.visits[frame]) {
            let unknown = match stage {
                Stage::Servo(_) => Some(servo),
                Stage::Discrete(_) => target.used.get(actuator).map(|&(column, _)| column),
                _ => None,
            };
            let value = unknown.map_or(0.0, |unknown| self.unknowns[unknown]);
            top = top
                * match (stage, place) {
                    (_, Some(place)) => self.poses[*place],
                    (Stage::Servo(joint), _) => joint.axis.pose(joint.offset + value),
                    (Stage::Discrete(joint), _) => joint.axis.pose(value),
                    (Stage::Link(link), _) => *link,
                    _ => Pose::identity(),
                };
            tops.push((top, unknown));
            actuator += stage.n_actuators();
            servo += usize::from(matches!(stage, Stage::Servo(_)));
        }
        let tool = top * chain.tool;
        let mut errors = [0.0; 6];
        let n = target.error(&tool, &mut errors);
        let mut slopes = vec![DVector::zeros(self.n_columns); n];
        let mut add = |column: usize, own: Twist<f64>, top: &Pose<f64>, scale: f64| {
            let seen = target.seen(&top.to(&tool).adjoint_inverse(&own), &tool);
            for (slope, &(component, weight)) in slopes.iter_mut().zip(&target.rows) {
                slope[column] += weight * seen[component] / scale;
            }
        };
        let length_scale_m = self.problem.base_line().length_scale_m;
        for (stage, (top, unknown)) in tops.iter().enumerate() {
            if let Some(place) = self.visits[frame][stage] {
                let Place { motions, first, .. } = &self.places[place];
                for (column, &motion) in motions.iter().enumerate() {
                    let mut six = [0.0; 6];
                    six[motion] = 1.0;
                    add(first + column, twist(six), top, scale(motion, length_scale_m));
                }
            } else if let Some((unknown, column)) = unknown.and_then(|u| Some((u, self.columns[u]?))) {
                let axis = match &chain.stages[stage] {
                    Stage::Servo(joint) => joint.axis,
                    Stage::Discrete(joint) => joint.axis,
                    _ => continue,
                };
                add(column, axis.twist(), top, self.problem.weights()[unknown]);
            }
        }
        errors.into_iter().zip(slopes).for_each(|(error, slope)| rows.push(error, slope));
    }

    /// Every place gives a leg the length that its stop has.
    fn add_shared_legs(&self, rows: &mut Rows) {
        for (place, legs) in self.places.iter().map(|place| &place.legs).enumerate() {
            for (leg, &stop) in legs.iter().enumerate().filter(|&(leg, &stop)| self.owners[stop] != Some((place, leg)))
            {
                let (length, slopes) = self.length(place, leg);
                let mut slope = DVector::zeros(self.n_columns);
                self.add_motion(place, &slopes, 1.0, &mut slope);
                self.add_stop(stop, -1.0, &mut slope);
                rows.push(self.stop(stop) - length, slope);
            }
        }
    }

    /// A platform that comes near a singular posture is led back.
    fn add_mode(&self, place: usize, rows: &mut Rows) {
        let Place { stage, motions, sign, .. } = &self.places[place];
        let stage = &self.problem.base_line().model.chain.stages[*stage];
        let determinant = |pose: &Pose<f64>| match stage {
            Stage::Planar(platform) => sign * platform.determinant(pose),
            Stage::Spatial(platform) => sign * platform.determinant(pose),
            _ => 1.0,
        };
        let pose = self.poses[place];
        let slack = determinant(&pose) - MIN_DETERMINANT;
        if slack >= 0.0 {
            return;
        }
        let mut slopes = [0.0; 6];
        for &motion in *motions {
            let moved = |by: f64| {
                let mut six = [0.0; 6];
                six[motion] = by;
                determinant(&(pose * Pose::exp(&twist(six))))
            };
            slopes[motion] = (moved(HALF_INTERVAL) - moved(-HALF_INTERVAL)) / (2.0 * HALF_INTERVAL);
        }
        let mut slope = DVector::zeros(self.n_columns);
        self.add_motion(place, &slopes, 1.0, &mut slope);
        rows.push(-slack, slope);
    }
}

impl Rows {
    fn push(&mut self, error: f64, slope: DVector<f64>) {
        self.errors.push(error);
        self.slopes.push(slope);
    }

    fn size(&self) -> f64 {
        self.errors.iter().map(|error| error * error).sum::<f64>().sqrt()
    }

    fn step(&self, n_columns: usize, damping: f64) -> DVector<f64> {
        let matrix = DMatrix::from_fn(self.slopes.len(), n_columns, |row, column| self.slopes[row][column]);
        damped_inverse(&matrix, &DVector::from_column_slice(&self.errors), damping)
    }
}

fn twist([x, y, z, vx, vy, vz]: [f64; 6]) -> Twist<f64> {
    Twist { angular: [x, y, z].into(), linear: [vx, vy, vz].into() }
}

/// Metres that one unit of a motion weighs.
fn scale(motion: usize, length_scale_m: f64) -> f64 {
    if motion < 3 { length_scale_m } else { 1.0 }
}
