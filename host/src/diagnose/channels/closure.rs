//! Closure: the tool touches the same unknown points in many postures, and nothing outside measures it.
//!
//! The residual of a row is where the model puts the tool less the mean over all rows of the same point; where pairs of
//! points are a known distance apart, a last axis holds the distance of their means less that. What moves all points
//! alike cannot show.
//!
//! # Values
//!
//! | law | of a joint or the tool | values |
//! | --- | --- | --- |
//! | `joint-offset` | q + δ | rad |
//! | `axis-error` | its frame turned about the two axes across its own, before it turns | rad |
//! | `link-error` | its frame moved in the frame that it stands in | m |
//! | `joint-compliance` | q + c·τ with τ the torque of 1 kg at each later joint and at the tool | rad/(N·m) |
//! | `link-compliance` | its frame turned about the two axes across by their moments, alike | rad/(N·m) |
//! | `encoder-periodic` | q + s·sin q + k·cos q | rad |
//! | `tool-frame` | the tool moved in its link | m |

use darm_core::real::{Mat3, Vec3};
use darm_core::se::{Pose, rotation_exp};

use super::experiment::{Axis, Candidate, Experiment, Relinearise, Value};
use super::prepared::{PrepareError, Prepared};
use crate::robot::Robot;

/// How far each kind of value may be off before anything is measured.
const PRIORS: [f64; 4] = [0.02, 0.005, 1e-4, 0.005];
/// Values of one joint: offset, two turns, three shifts, compliance, two of the link, sine and cosine.
const PER_JOINT: usize = 11;

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
    /// Torque about each joint's axis and the two axes across, of unit masses.
    moments: Vec<Vec3<f64>>,
    point: usize,
}

/// Two points and the distance between them.
type Pair = (usize, usize);

struct Closure {
    robot: Robot,
    /// The joints up to the tool, the innermost first.
    path: Vec<usize>,
    tool: Pose<f64>,
    postures: Vec<Posture>,
    n_points: usize,
    pairs: Vec<Pair>,
    distance_m: f64,
}

pub(super) fn experiment(data: &Prepared, robot: &Robot, points: &Points) -> Result<Experiment, PrepareError> {
    let tool = match &points.tool {
        Some(name) => robot.frame(name).or(None),
        None => robot.tool(),
    };
    let none = || PrepareError::Nothing("the robot has no such tool frame".into());
    let tool = tool.ok_or_else(none)?;
    let path = robot.path(tool);
    let mut q = Vec::new();
    for k in 1..=path.len() {
        q.push(data.channel(&format!("q{k}"))?);
    }
    let (of_row, n_points, pairs) = named(data, points)?;
    let posture = |row: usize| Posture {
        q: q.iter().map(|channel| channel[row]).collect(),
        moments: Vec::new(),
        point: of_row[row],
    };
    let postures = (0..data.rows.len()).map(posture).collect();
    let distance_m = points.pair.as_ref().map_or(0.0, |(_, distance)| *distance);
    let mut closure = Closure { robot: robot.clone(), path, tool: tool.pose, postures, n_points, pairs, distance_m };
    closure.load();
    let n_values = closure.path.len() * PER_JOINT + 3;
    let (residuals, columns) = closure.at(&vec![0.0; n_values]);
    let candidates = candidates(&closure, columns);
    let mut axes: Vec<Axis> = ["x", "y", "z"].map(|name| Axis { name: name.into(), unit: "m" }).into();
    if points.pair.is_some() {
        axes.push(Axis { name: "distance of points".into(), unit: "m" });
    }
    let channels = q.into_iter().enumerate().map(|(k, channel)| (format!("position of joint {}", k + 1), channel)).collect();
    let relinearise: Relinearise = Box::new(move |values| closure.at(values));
    Ok(Experiment {
        kind: "closure",
        axes,
        n_norm: 3,
        rows: data.rows.clone(),
        residuals,
        candidates,
        channels,
        masses: Vec::new(),
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
    let of_row = names.iter().map(|name| known.binary_search(name).unwrap_or_default()).collect();
    let pairs = match &points.pair {
        Some(_) => (1..known.len()).filter(|&k| known[k].0 == known[k - 1].0).map(|k| (k - 1, k)).collect(),
        None => Vec::new(),
    };
    Ok((of_row, known.len(), pairs))
}

fn candidates(closure: &Closure, columns: Vec<Vec<f64>>) -> Vec<Candidate> {
    let [turn, shift, compliance, periodic] = PRIORS;
    let mut columns = columns.into_iter();
    let mut candidates = Vec::new();
    let mut add = |law, place: &str, values: &[(&str, &str, f64)]| {
        let values = values.iter().map(|(name, unit, prior)| Value {
            name: (*name).into(),
            unit: (*unit).into(),
            prior: *prior,
            column: columns.next().unwrap_or_default(),
        });
        candidates.push(Candidate { law, place: place.into(), shape: None, values: values.collect() });
    };
    for (k, &joint) in closure.path.iter().enumerate() {
        let place = format!("joint {} ({})", k + 1, closure.robot.joints[joint].name);
        add("joint-offset", &place, &[("offset", "rad", turn)]);
        add("axis-error", &place, &[("first turn across", "rad", turn), ("second turn across", "rad", turn)]);
        add("link-error", &place, &[("x", "m", shift), ("y", "m", shift), ("z", "m", shift)]);
        add("joint-compliance", &place, &[("compliance", "rad/(N·m)", compliance)]);
        let across = [("first, across", "rad/(N·m)", compliance), ("second, across", "rad/(N·m)", compliance)];
        add("link-compliance", &place, &across);
        add("encoder-periodic", &place, &[("sine", "rad", periodic), ("cosine", "rad", periodic)]);
    }
    add("tool-frame", "the tool", &[("x", "m", 0.02), ("y", "m", 0.02), ("z", "m", 0.02)]);
    candidates
}

/// Two axes across a unit vector.
fn across(axis: &Vec3<f64>) -> [Vec3<f64>; 2] {
    let aside = if axis.z.abs() > 0.9 { Vec3::x() } else { Vec3::z() };
    let first = (aside - axis * axis.dot(&aside)).normalize();
    [first, axis.cross(&first)]
}

/// The frames along the arm in one posture: before each joint turns, and the tool.
struct Stand {
    before: Vec<Pose<f64>>,
    tool: Pose<f64>,
}

impl Closure {
    fn stand(&self, posture: &Posture, values: &[f64]) -> Stand {
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
        Stand { before, tool: pose * self.tool * tool }
    }

    /// Moments of unit masses at the later joints and the tool, in the nominal postures.
    fn load(&mut self) {
        let zero = vec![0.0; self.path.len() * PER_JOINT + 3];
        let gravity = self.robot.gravity;
        for index in 0..self.postures.len() {
            let stand = self.stand(&self.postures[index], &zero);
            let moments = (0..self.path.len()).map(|k| {
                let at = &stand.before[k];
                let later = stand.before[k + 1..].iter().map(|pose| pose.position).chain([stand.tool.position]);
                let moment: Vec3<f64> = later.map(|mass| (mass - at.position).cross(&gravity)).sum();
                let own = at.rotation.tr_mul(&moment);
                let axis = self.robot.joints[self.path[k]].joint.axis.direction;
                let [first, second] = across(&axis);
                Vec3::new(axis.dot(&own), first.dot(&own), second.dot(&own))
            });
            self.postures[index].moments = moments.collect();
        }
    }

    /// How the tool's place moves with each value.
    fn slopes(&self, posture: &Posture, stand: &Stand) -> Vec<Vec3<f64>> {
        let mut slopes = Vec::with_capacity(self.path.len() * PER_JOINT + 3);
        let mut on = Mat3::identity();
        for (k, &joint) in self.path.iter().enumerate() {
            let at = &stand.before[k];
            let axis = self.robot.joints[joint].joint.axis.direction;
            let [first, second] = across(&axis);
            let turned = |about: &Vec3<f64>| (at.rotation * about).cross(&(stand.tool.position - at.position));
            let (along, one, two) = (turned(&axis), turned(&first), turned(&second));
            let load = posture.moments[k];
            slopes.extend([along, one, two]);
            slopes.extend((0..3).map(|k| Vec3::from(on.column(k))));
            slopes.extend([along * load.x, one * load.y, two * load.z]);
            slopes.extend([along * posture.q[k].sin(), along * posture.q[k].cos()]);
            on = at.rotation * rotation_exp(&(axis * posture.q[k]));
        }
        slopes.extend((0..3).map(|k| Vec3::from(stand.tool.rotation.column(k))));
        slopes
    }

    /// Residuals and columns at these values.
    fn at(&self, values: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let stands: Vec<Stand> = self.postures.iter().map(|posture| self.stand(posture, values)).collect();
        let places: Vec<Vec3<f64>> = stands.iter().map(|stand| stand.tool.position).collect();
        let means = self.means(&places);
        let apart = |(a, b): &Pair| means[*b] - means[*a];
        let distance = |pair: &Pair| apart(pair).norm() - self.distance_m;
        let residuals = self.axes(&places, &means, &distance);
        let slopes: Vec<Vec<Vec3<f64>>> = self.postures.iter().zip(&stands).map(|(p, s)| self.slopes(p, s)).collect();
        let column = |k: usize| {
            let moved: Vec<Vec3<f64>> = slopes.iter().map(|row| row[k]).collect();
            let mean = self.means(&moved);
            self.axes(&moved, &mean, &|pair| {
                let way = apart(pair);
                way.dot(&(mean[pair.1] - mean[pair.0])) / way.norm().max(1e-12)
            })
        };
        (residuals, (0..values.len()).map(column).collect())
    }

    fn means(&self, places: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
        let mut sums = vec![(Vec3::zeros(), 0.0); self.n_points];
        for (posture, place) in self.postures.iter().zip(places) {
            sums[posture.point].0 += place;
            sums[posture.point].1 += 1.0;
        }
        sums.into_iter().map(|(sum, count): (Vec3<f64>, f64)| sum / count.max(1.0)).collect()
    }

    /// Rows × axes: each place less the mean of its point, and what the pair of the point tells.
    fn axes(&self, places: &[Vec3<f64>], means: &[Vec3<f64>], of_pair: &dyn Fn(&Pair) -> f64) -> Vec<f64> {
        let mut told = vec![0.0; self.n_points];
        for pair in &self.pairs {
            let number = of_pair(pair);
            told[pair.0] = number;
            told[pair.1] = number;
        }
        let mut all = Vec::with_capacity(places.len() * 4);
        for (posture, place) in self.postures.iter().zip(places) {
            let from_mean = place - means[posture.point];
            all.extend([from_mean.x, from_mean.y, from_mean.z]);
            if self.distance_m > 0.0 {
                all.push(told[posture.point]);
            }
        }
        all
    }
}
