//! PointContact: the tool touches the same unknown points in many postures, and nothing outside measures it.
//!
//! The residual of a row is where the model puts the tool less the mean over all rows of the same point; where pairs of
//! points are a known distance apart, a last axis holds the distance of their means less that. What moves all points
//! alike cannot show. Where no distance is known, an arm with all its lengths shorter closes better by itself: there the
//! residual is scaled to the size that the model has, and the scale of the arm is fixed.
//!
//! # Values
//!
//! | law | of a joint or the tool | values |
//! | --- | --- | --- |
//! | `joint-offset` | q + δ | rad |
//! | `axis-error` | its frame turned about the two axes across its own, before it turns | rad |
//! | `link-error` | its frame moved in the frame that carries it | m |
//! | `joint-compliance` | q + c·τ with τ the torque of the links' weight; where the robot has no masses, of 1 kg at each later joint and at the tool | rad/(N·m) |
//! | `link-compliance` | its frame turned about the two axes across by their moments, alike | rad/(N·m) |
//! | `encoder-periodic` | q + s·sin q + k·cos q | rad |
//! | `tool-frame` | the tool moved in its link | m |

mod calibrated;

use darm_core::actuator::JointKind;
use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, rotation_exp};

use crate::effect::{Law, Place, Site};
use crate::linearise::experiment::{Axis, Candidate, Experiment, Relinearise, Value};
use crate::measured::Measured;
use crate::measurement::{Finding, FindingKind, root_mean_square};
use crate::prepare::signals::{PrepareError, Prepared};
use darm_robot::robot::Robot;

pub use calibrated::{NotRigid, calibrated};

/// How far each kind of value may be off before anything is measured.
const PRIORS: [f64; 4] = [0.02, 0.005, 1e-4, 0.005];
/// Values of one joint: offset, two turns, three shifts, compliance, two of the link, sine and cosine.
const PER_JOINT: usize = 11;

/// Every row of a pair repeats the distance of its two points. These are means of n rows each with a noise σ along the way
/// between them, their distance has σ·√(2/n): repeated 2n times, each repetition counts with this many σ.
const PAIR_NOISE: f64 = 2.0;

/// What is known of the points that are touched.
#[derive(Clone, Debug, PartialEq)]
pub struct Points {
    /// Columns that name a point: rows in which they are the same touch the same one.
    pub point: Vec<String>,
    /// The column in which two points of a pair differ, and how far they are apart, m.
    pub pair: Option<(String, f64)>,
    /// The frame that touches; `None`: the robot's tool.
    pub tool: Option<String>,
}

/// One posture.
struct Posture {
    q: Vec<f64>,
    /// Torque of the weight about each joint's axis and the two axes across.
    moments: Vec<Vec3<f64>>,
    point: usize,
}

/// Two points and the distance between them.
type Pair = (usize, usize);

struct PointContact {
    robot: Robot,
    /// The joints up to the tool, the innermost first.
    path: Vec<usize>,
    tool: Pose<f64>,
    postures: Vec<Posture>,
    n_points: usize,
    pairs: Vec<Pair>,
    distance_m: f64,
    /// Reach of the model from the axis of the first joint, where no known distance gives its scale, m.
    reach_m: Option<f64>,
}

/// Adds to `data` the findings on what lengths and compliances rest on.
pub(crate) fn experiment(data: &mut Prepared, robot: &Robot, points: &Points) -> Result<Experiment, PrepareError> {
    let none = || PrepareError::Nothing("the robot has no frame that touches: name it as tool in the model".into());
    let tool = robot.frame_or_tool(points.tool.as_deref()).ok_or_else(none)?;
    let path = robot.path(tool);
    let slides = path.iter().find(|&&joint| robot.joints[joint].joint.axis.kind == JointKind::Prismatic);
    if let Some(&joint) = slides {
        let name = &robot.joints[joint].name;
        let why = format!("joint {name} before the tool slides: point contact identifies revolute joints only");
        return Err(PrepareError::Nothing(why));
    }
    let q = (1..=path.len()).map(|k| data.channel(&format!("q{k}"))).collect::<Result<Vec<_>, _>>()?;
    let (of_row, n_points, pairs) = named(data, points)?;
    let posture = |row: usize| Posture {
        q: q.iter().map(|channel| channel[row]).collect(),
        moments: Vec::new(),
        point: of_row[row],
    };
    let postures = (0..data.rows.len()).map(posture).collect();
    let distance_m = points.pair.as_ref().map_or(0.0, |(_, distance)| *distance);
    let mut contact = PointContact {
        robot: robot.clone(),
        path,
        tool: tool.pose,
        postures,
        n_points,
        pairs,
        distance_m,
        reach_m: None,
    };
    let zero = vec![0.0; contact.path.len() * PER_JOINT + 3];
    contact.load(&zero);
    if points.pair.is_none() {
        let reach = reach(&contact.arms(&contact.chains(&zero)));
        contact.reach_m = Some(reach).filter(|reach| *reach > 0.0);
    }
    data.findings.extend(contact.findings());
    let (residuals, columns) = contact.at(&zero);
    let candidates = candidates(&contact, columns);
    let mut axes: Vec<Axis> = ["x", "y", "z"].map(|name| Axis::new(name, "m")).into();
    if points.pair.is_some() {
        axes.push(Axis { noise_if_repeated: Some(PAIR_NOISE), ..Axis::new("distance of points", "m") });
    }
    let channels =
        q.into_iter().enumerate().map(|(k, channel)| (format!("position of joint {}", k + 1), channel)).collect();
    let relinearise: Relinearise = Box::new(move |values| contact.at(values));
    Ok(Experiment {
        kind: Measured::Closure,
        axes,
        n_norm: 3,
        rows: data.rows.clone(),
        residuals,
        measured: None,
        candidates,
        channels,
        bodies: Vec::new(),
        relinearise: Some(relinearise),
    })
}

/// The point of each row, how many there are, and which are pairs.
fn named(data: &Prepared, points: &Points) -> Result<(Vec<usize>, usize, Vec<Pair>), PrepareError> {
    let mut names: Vec<(Vec<String>, String)> = vec![(Vec::new(), String::new()); data.rows.len()];
    for column in &points.point {
        let own = points.pair.as_ref().is_some_and(|(pair, _)| pair == column);
        for (name, word) in names.iter_mut().zip(data.words(column)?) {
            if own { name.1 = word.into() } else { name.0.push(word.into()) }
        }
    }
    let mut known = names.clone();
    known.sort();
    known.dedup();
    let of_row = names.iter().map(|name| known.binary_search(name).expect("known has every name")).collect();
    let Some((column, _)) = &points.pair else { return Ok((of_row, known.len(), Vec::new())) };
    let pairs: Vec<Pair> = (1..known.len()).filter(|&k| known[k].0 == known[k - 1].0).map(|k| (k - 1, k)).collect();
    if let Some(both) = pairs.windows(2).find(|both| both[0].1 == both[1].0) {
        let point = known[both[0].0].0.join(", ");
        return Err(PrepareError::Nothing(format!(
            "{point} has more than two values of {column}: a pair has two points"
        )));
    }
    Ok((of_row, known.len(), pairs))
}

fn candidates(contact: &PointContact, columns: Vec<Vec<f64>>) -> Vec<Candidate> {
    let [turn, shift, compliance, periodic] = PRIORS;
    let mut columns = columns.into_iter();
    let mut candidates = Vec::new();
    let mut add = |law, site: &Site, values: &[(&str, &str, f64)]| {
        let values = values.iter().map(|(name, unit, prior)| Value {
            name: (*name).into(),
            unit: (*unit).into(),
            prior: *prior,
            min: f64::NEG_INFINITY,
            column: columns.next().expect("a column for each value"),
        });
        candidates.push(Candidate { law, site: site.clone(), shape: None, values: values.collect() });
    };
    for (k, &joint) in contact.path.iter().enumerate() {
        let site = site_of_joint(&contact.robot, k, joint);
        add(Law::JointOffset, &site, &[("offset", "rad", turn)]);
        add(Law::AxisError, &site, &[("first turn across", "rad", turn), ("second turn across", "rad", turn)]);
        add(Law::LinkError, &site, &[("x", "m", shift), ("y", "m", shift), ("z", "m", shift)]);
        add(Law::JointCompliance, &site, &[("compliance", "rad/(N·m)", compliance)]);
        let across = [("first, across", "rad/(N·m)", compliance), ("second, across", "rad/(N·m)", compliance)];
        add(Law::LinkCompliance, &site, &across);
        add(Law::EncoderPeriodic, &site, &[("sine", "rad", periodic), ("cosine", "rad", periodic)]);
    }
    add(Law::ToolFrame, &Site::new(Place::Tool, "the tool"), &[("x", "m", 0.02), ("y", "m", 0.02), ("z", "m", 0.02)]);
    candidates
}

/// The place of the joint of this index, which comes after `k` others on the way to the tool.
fn site_of_joint(robot: &Robot, k: usize, joint: usize) -> Site {
    Site::new(Place::Joint(k), format!("joint {} ({})", k + 1, robot.joints[joint].name))
}

/// Two axes across a unit vector.
fn across(axis: &Vec3<f64>) -> [Vec3<f64>; 2] {
    let aside = if axis.z.abs() > 0.9 { Vec3::x() } else { Vec3::z() };
    let first = (aside - axis * axis.dot(&aside)).normalize();
    [first, axis.cross(&first)]
}

/// The length of the arm, root mean square over all postures, m.
fn reach(arms: &[Vec3<f64>]) -> f64 {
    root_mean_square(&arms.iter().map(Vec3::norm).collect::<Vec<f64>>())
}

/// The frames along the arm in one posture: before each joint turns, and the tool.
struct FrameChain {
    before: Vec<Pose<f64>>,
    tool: Pose<f64>,
}

/// A mass, and the last joint that carries it.
struct PointMass {
    on: usize,
    place: Vec3<f64>,
    kg: f64,
}

impl PointContact {
    fn chain(&self, posture: &Posture, values: &[f64]) -> FrameChain {
        let mut pose = Pose::identity();
        let mut before = Vec::with_capacity(self.path.len());
        for (k, &joint) in self.path.iter().enumerate() {
            let joint = &self.robot.joints[joint].joint;
            let own = &values[k * PER_JOINT..(k + 1) * PER_JOINT];
            let [first, second] = across(&joint.axis.direction);
            let load = posture.moments.get(k).copied().unwrap_or_default();
            let shift = Vec3::new(own[3], own[4], own[5]);
            let turn = first * (own[1] + own[7] * load.y) + second * (own[2] + own[8] * load.z);
            pose = pose * Pose::at(shift) * joint.placement * Pose::new(&turn, Vec3::zeros());
            before.push(pose);
            let (sine, cosine) = posture.q[k].sin_cos();
            let angle = posture.q[k] + own[0] + own[6] * load.x + own[9] * sine + own[10] * cosine;
            pose = pose * Pose { rotation: rotation_exp(&(joint.axis.direction * angle)), position: Vec3::zeros() };
        }
        let last = self.path.len() * PER_JOINT;
        let tool = Pose::at(Vec3::new(values[last], values[last + 1], values[last + 2]));
        FrameChain { before, tool: pose * self.tool * tool }
    }

    /// Moments of what each joint carries in the nominal postures.
    fn load(&mut self, zero: &[f64]) {
        let gravity = self.robot.gravity;
        for index in 0..self.postures.len() {
            let chain = self.chain(&self.postures[index], zero);
            let masses = self.masses(&self.postures[index], &chain);
            let moments = (0..self.path.len()).map(|k| {
                let at = &chain.before[k];
                let carried = masses.iter().filter(|mass| mass.on >= k);
                let moment: Vec3<f64> = carried.map(|mass| (mass.place - at.position).cross(&gravity) * mass.kg).sum();
                let own = at.rotation.tr_mul(&moment);
                let axis = self.robot.joints[self.path[k]].joint.axis.direction;
                let [first, second] = across(&axis);
                Vec3::new(axis.dot(&own), first.dot(&own), second.dot(&own))
            });
            self.postures[index].moments = moments.collect();
        }
    }

    /// What the owner of the model should know.
    fn findings(&self) -> Vec<Finding> {
        let no_distance = "no two points have a known distance (pair, distance_mm in the model): \
                           the scale of the arm is taken from it";
        let no_masses =
            "the robot has no masses: its compliance is computed as if it had 1 kg at each joint and at the tool";
        let all = [(self.distance_m == 0.0, no_distance), (self.is_without_masses(), no_masses)];
        let holding = all.into_iter().filter(|(holds, _)| *holds);
        holding.map(|(_, text)| Finding::note(FindingKind::IncompleteModel, text)).collect()
    }

    fn is_without_masses(&self) -> bool {
        self.path.iter().all(|&joint| self.robot.joints[joint].joint.inertia.mass == 0.0)
    }

    /// The links up to the tool; of a robot without masses 1 kg at each joint after the first and at the tool.
    fn masses(&self, posture: &Posture, chain: &FrameChain) -> Vec<PointMass> {
        let inertia = |k: usize| self.robot.joints[self.path[k]].joint.inertia;
        if self.is_without_masses() {
            let places = chain.before[1..].iter().map(|pose| pose.position).chain([chain.tool.position]);
            return places.enumerate().map(|(on, place)| PointMass { on, place, kg: 1.0 }).collect();
        }
        let mass = |on: usize| {
            let turn = self.robot.joints[self.path[on]].joint.axis.direction * posture.q[on];
            let com = rotation_exp(&turn) * inertia(on).com;
            PointMass { on, place: chain.before[on] * com, kg: inertia(on).mass }
        };
        (0..self.path.len()).map(mass).collect()
    }

    /// How the tool's place moves with each value.
    fn slopes(&self, posture: &Posture, chain: &FrameChain) -> Vec<Vec3<f64>> {
        let mut slopes = Vec::with_capacity(self.path.len() * PER_JOINT + 3);
        let mut on = Mat3::identity();
        for (k, &joint) in self.path.iter().enumerate() {
            let at = &chain.before[k];
            let axis = self.robot.joints[joint].joint.axis.direction;
            let [first, second] = across(&axis);
            let turned = |about: &Vec3<f64>| (at.rotation * about).cross(&(chain.tool.position - at.position));
            let (along, one, two) = (turned(&axis), turned(&first), turned(&second));
            let load = posture.moments[k];
            slopes.extend([along, one, two]);
            slopes.extend((0..3).map(|k| Vec3::from(on.column(k))));
            slopes.extend([along * load.x, one * load.y, two * load.z]);
            slopes.extend([along * posture.q[k].sin(), along * posture.q[k].cos()]);
            on = at.rotation * rotation_exp(&(axis * posture.q[k]));
        }
        slopes.extend((0..3).map(|k| Vec3::from(chain.tool.rotation.column(k))));
        slopes
    }

    fn chains(&self, values: &[f64]) -> Vec<FrameChain> {
        self.postures.iter().map(|posture| self.chain(posture, values)).collect()
    }

    /// From the axis of the first joint to the tool, square to it, in each posture.
    fn arms(&self, chains: &[FrameChain]) -> Vec<Vec3<f64>> {
        let arm = |chain: &FrameChain| {
            let first = &chain.before[0];
            let axis = first.rotation * self.robot.joints[self.path[0]].joint.axis.direction;
            let from_origin = chain.tool.position - first.position;
            from_origin - axis * axis.dot(&from_origin)
        };
        chains.iter().map(arm).collect()
    }

    /// Residuals and columns at these values.
    fn at(&self, values: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let chains = self.chains(values);
        let places: Vec<Vec3<f64>> = chains.iter().map(|chain| chain.tool.position).collect();
        let means = self.means(&places);
        let arms = self.arms(&chains);
        let reach = reach(&arms);
        let size = self.reach_m.map_or(1.0, |reach_m| reach / reach_m);
        let apart = |(a, b): &Pair| means[*b] - means[*a];
        let distance = |pair: &Pair| apart(pair).norm() - self.distance_m;
        let mut residuals = self.axes(&places, &means, &distance);
        residuals.iter_mut().for_each(|residual| *residual /= size);
        let slopes: Vec<Vec<Vec3<f64>>> =
            self.postures.iter().zip(&chains).map(|(posture, chain)| self.slopes(posture, chain)).collect();
        let column = |k: usize| {
            let moved: Vec<Vec3<f64>> = slopes.iter().map(|row| row[k]).collect();
            let mean = self.means(&moved);
            let mut column = self.axes(&moved, &mean, &|pair| {
                let way = apart(pair);
                way.dot(&(mean[pair.1] - mean[pair.0])) / way.norm().max(1e-12)
            });
            // What moves the first joint itself takes the whole arm along.
            if let Some(reach_m) = self.reach_m.filter(|_| k >= PER_JOINT) {
                let outward: f64 = arms.iter().zip(&moved).map(|(arm, moved)| arm.dot(moved)).sum();
                let growth = outward / (arms.len() as f64 * reach * reach_m);
                column.iter_mut().zip(&residuals).for_each(|(slope, residual)| *slope -= residual * growth);
            }
            column.iter_mut().for_each(|slope| *slope /= size);
            column
        };
        let columns = (0..values.len()).map(column).collect();
        (residuals, columns)
    }

    fn means(&self, places: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
        let mut sums = vec![(Vec3::zeros(), 0.0); self.n_points];
        for (posture, place) in self.postures.iter().zip(places) {
            sums[posture.point].0 += place;
            sums[posture.point].1 += 1.0;
        }
        sums.into_iter().map(|(sum, count): (Vec3<f64>, f64)| sum / count.max(1.0)).collect()
    }

    /// Rows × axes: each place less the mean of its point, and the number of the point's pair.
    fn axes(&self, places: &[Vec3<f64>], means: &[Vec3<f64>], of_pair: &dyn Fn(&Pair) -> f64) -> Vec<f64> {
        let mut pair_numbers = vec![0.0; self.n_points];
        for pair in &self.pairs {
            let number = of_pair(pair);
            pair_numbers[pair.0] = number;
            pair_numbers[pair.1] = number;
        }
        let mut all = Vec::with_capacity(places.len() * 4);
        for (posture, place) in self.postures.iter().zip(places) {
            let from_mean = place - means[posture.point];
            all.extend([from_mean.x, from_mean.y, from_mean.z]);
            if self.distance_m > 0.0 {
                all.push(pair_numbers[posture.point]);
            }
        }
        all
    }
}

#[cfg(test)]
mod tests;
