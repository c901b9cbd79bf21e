//! A person from markers and force plates: a general tree scaled to the person who moved.
//!
//! Lengths come from the markers: for given angles the markers are linear in the scales of the links, so angles and lengths are
//! found in turn over frames of the whole motion. Masses come from the plates: for a given motion the wrench is linear in the
//! scales of the masses, so one regularised least squares finds those whose centre of pressure is the measured one. Both are
//! done anew until the simulated centre of pressure lies within [`WITHIN_M`] of the measured one, where the paper did it by hand.
//! A left and a right link share their scale.

use darm_core::real::Vec3;
use darm_core::se::Pose;
use nalgebra::{DMatrix, DVector, Matrix3};
use rand::{Rng, RngExt as _};
use rand_distr::StandardNormal;
use serde::Serialize;

use super::markers::Capture;
use super::placed::{Placed, dynamic, wrench};
use super::smooth::Smooth;
use super::trajectory::{Problem, Trajectory, TrajectoryError, solve};
use super::{Fixed, Posture};
use darm_robot::robot::Robot;

/// How near the simulated centre of pressure shall come to the measured one, m (the paper's 2 cm).
pub const WITHIN_M: f64 = 0.02;
/// Corner of the low-pass on the motion and on the plates, Hz.
pub const CORNER_HZ: f64 = 4.0;
/// Markers on skin are this good, m.
const MARKER_M: f64 = 0.01;
/// Accelerations of a person, rad/s² and m/s².
const ACCELERATION: f64 = 20.0;
/// How far the lengths and masses of people lie from the average, as a share.
const SPREAD: (f64, f64) = (0.1, 0.25);
/// The centre of pressure of a good model, m, and its weight as a share.
const GOOD: (f64, f64) = (0.004, 0.01);
/// Frames that lengths are found from, and rounds of angles and lengths.
const LENGTH_FRAMES: usize = 9;
const LENGTH_ROUNDS: usize = 12;
/// Rounds of masses.
const MASS_ROUNDS: i32 = 5;
/// A moment has the wrong sign when its centre of pressure is this far off, mm, and turned this share of it.
const TURNED: (f64, f64) = (60.0, 0.3);
/// No link is lighter than this share of the average one.
const LIGHTEST: f64 = 0.3;

/// A link's scale.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scale {
    /// Name of the link, without its side.
    pub link: String,
    /// Length over that of the general tree.
    pub length: f64,
    /// Mass over that of the general tree.
    pub mass: f64,
}

/// How far the simulated centre of pressure is from the measured one, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CopError {
    /// RMS over the frames.
    pub rms_m: f64,
    /// Largest of the frames.
    pub worst_m: f64,
}

/// A person who moved.
#[derive(Clone, Debug)]
pub struct Person {
    /// The tree with the person's lengths and masses.
    pub tree: Robot,
    /// The markers on it.
    pub markers: Vec<Fixed>,
    /// How it moved.
    pub motion: Trajectory,
    /// Its centre of mass, low-passed, m.
    pub com: Vec<Vec3<f64>>,
    /// Its simulated centre of pressure, m.
    pub cop: Vec<[f64; 2]>,
    /// Scales of the links.
    pub scales: Vec<Scale>,
    /// Centre of pressure before anything was scaled.
    pub before: CopError,
    /// And after.
    pub after: CopError,
}

/// Fits a tree with markers to a motion.
pub fn person(tree: &Robot, markers: &[Fixed], capture: &Capture) -> Result<Person, TrajectoryError> {
    let groups = Groups::new(tree);
    let average = follow(tree, markers, capture)?;
    let simulated_before = simulated(tree, &groups, &average, capture);
    simulated_before.agrees(capture)?;
    let before = simulated_before.error;
    let lengths = lengths(tree, markers, capture, &groups)?;
    let even = vec![1.0; groups.names.len()];
    let long = groups.scaled(tree, &lengths, &even);
    let placed_on = groups.markers(markers, &lengths);
    let motion = follow(&long, &placed_on, capture)?;
    let mut masses = even;
    let mut scaled = groups.scaled(tree, &lengths, &masses);
    let mut now = simulated(&scaled, &groups, &motion, capture);
    // As near to the average as it can be: the masses get more room only while the centre of pressure is not met.
    for round in 0..MASS_ROUNDS {
        if now.error.worst_m <= WITHIN_M {
            break;
        }
        let next = now.masses(&masses, capture, SPREAD.1 * 2f64.powi(round));
        let tree_next = groups.scaled(tree, &lengths, &next);
        let tried = simulated(&tree_next, &groups, &motion, capture);
        if tried.error.rms_m >= now.error.rms_m {
            break;
        }
        (masses, scaled, now) = (next, tree_next, tried);
    }
    let com = com(&scaled, &motion.postures, &capture.time_s)?;
    let scales = groups.names.iter().zip(lengths.iter().zip(&masses));
    let scales = scales.map(|(link, (length, mass))| Scale { link: link.clone(), length: *length, mass: *mass });
    Ok(Person {
        scales: scales.collect(),
        tree: scaled,
        markers: placed_on,
        motion,
        com,
        cop: now.cop,
        before,
        after: now.error,
    })
}

/// Links that share their scales.
pub(super) struct Groups {
    names: Vec<String>,
    /// The group of each body, the base first.
    of: Vec<usize>,
}

impl Groups {
    pub(super) fn new(tree: &Robot) -> Self {
        let base = tree.frames.first().map_or("base", |frame| frame.name.as_str());
        let links = std::iter::once(base).chain(tree.joints.iter().map(|joint| joint.link.as_str()));
        let (mut names, mut of) = (Vec::<String>::new(), Vec::new());
        for link in links {
            let sided = ["left_", "right_", "l_", "r_"].iter().find_map(|side| link.strip_prefix(side)).unwrap_or(link);
            // Links between the joints at one place carry nothing and have no length of their own.
            let plain = sided.split("_virtual").next().unwrap_or(sided).to_owned();
            let at = names.iter().position(|name| *name == plain).unwrap_or_else(|| {
                names.push(plain);
                names.len() - 1
            });
            of.push(at);
        }
        Self { names, of }
    }

    /// A scale for every group, drawn about 1.
    pub(super) fn drawn(&self, random: &mut impl Rng, spread: f64) -> Vec<f64> {
        self.names.iter().map(|_| 1.0 + spread * random.sample::<f64, _>(StandardNormal).clamp(-2.0, 2.0)).collect()
    }

    fn body(&self, joint: Option<usize>) -> usize {
        self.of[joint.map_or(0, |joint| joint + 1)]
    }

    /// The tree with these lengths and masses of the groups.
    pub(super) fn scaled(&self, tree: &Robot, lengths: &[f64], masses: &[f64]) -> Robot {
        let mut scaled = tree.clone();
        let grow = |inertia: &mut darm_core::tree::Inertia<f64>, group: usize| {
            inertia.mass *= masses[group];
            inertia.com *= lengths[group];
            inertia.about_com *= masses[group] * lengths[group].powi(2);
        };
        grow(&mut scaled.base, self.of[0]);
        for (k, joint) in scaled.joints.iter_mut().enumerate() {
            joint.joint.placement.position *= lengths[self.body(joint.joint.parent)];
            grow(&mut joint.joint.inertia, self.of[k + 1]);
        }
        scaled
    }

    pub(super) fn markers(&self, markers: &[Fixed], lengths: &[f64]) -> Vec<Fixed> {
        markers.iter().map(|m| Fixed { point: m.point * lengths[self.body(m.joint)], ..*m }).collect()
    }
}

/// The tree's motion by the markers, from a first frame that is found by itself.
fn follow(tree: &Robot, markers: &[Fixed], capture: &Capture) -> Result<Trajectory, TrajectoryError> {
    let start = walk(tree, markers, &capture.places)?;
    let problem = problem(tree, markers, &capture.places, capture.step_s());
    solve(&problem, &start)
}

fn problem<'a>(
    tree: &'a Robot,
    markers: &'a [Fixed],
    targets: &'a [Vec<Option<Vec3<f64>>>],
    step_s: f64,
) -> Problem<'a> {
    Problem {
        robot: tree,
        step_s,
        markers,
        targets,
        feet: &[],
        chair: None,
        com: None,
        marker_m: MARKER_M,
        acceleration: ACCELERATION,
    }
}

/// A posture for every frame, each from the one before; the walk begins at the end that fits the tree's zero posture better.
fn walk(tree: &Robot, markers: &[Fixed], targets: &[Vec<Option<Vec3<f64>>>]) -> Result<Vec<Posture>, TrajectoryError> {
    let one = |frame: usize, start: &Posture| {
        let alone = problem(tree, markers, &targets[frame..=frame], 1.0);
        solve(&alone, std::slice::from_ref(start))
    };
    let last = targets.len() - 1;
    let (at_first, at_last) =
        (one(0, &laid_on(tree, markers, &targets[0])?)?, one(last, &laid_on(tree, markers, &targets[last])?)?);
    let backwards = at_last.marker_rms_m < at_first.marker_rms_m;
    let mut posture = if backwards { at_last } else { at_first }.postures[0].clone();
    let mut all = vec![posture.clone()];
    for step in 1..targets.len() {
        let frame = if backwards { last - step } else { step };
        posture = one(frame, &posture)?.postures[0].clone();
        all.push(posture.clone());
    }
    if backwards {
        all.reverse();
    }
    Ok(all)
}

/// The zero posture with its base laid on the markers: the rotation that turns one cloud of points onto the other (Kabsch).
fn laid_on(tree: &Robot, markers: &[Fixed], targets: &[Option<Vec3<f64>>]) -> Result<Posture, TrajectoryError> {
    let q = tree.joints.iter().map(|j| j.limits.map_or(0.0, |[low, high]| 0.0f64.clamp(low, high))).collect();
    let mut posture = Posture { base: Pose::identity(), q };
    let mut placed = Placed::new(tree)?;
    placed.place(&posture);
    let pairs: Vec<(Vec3<f64>, Vec3<f64>)> =
        markers.iter().zip(targets).filter_map(|(m, t)| Some((placed.point(m), (*t)?))).collect();
    let count = pairs.len().max(1) as f64;
    let (own, seen) = pairs.iter().fold((Vec3::zeros(), Vec3::zeros()), |(a, b), (own, seen)| (a + own, b + seen));
    let (own, seen) = (own / count, seen / count);
    let across: Matrix3<f64> = pairs.iter().map(|(a, b)| (b - seen) * (a - own).transpose()).sum();
    let svd = across.svd(true, true);
    if let (Some(u), Some(v_t)) = (svd.u, svd.v_t) {
        let proper = Matrix3::from_diagonal(&Vec3::new(1.0, 1.0, (u * v_t).determinant().signum()));
        let rotation = u * proper * v_t;
        posture.base = Pose { rotation, position: seen - rotation * own };
    }
    Ok(posture)
}

/// Scales of the lengths: angles and lengths in turn, over frames spread evenly.
fn lengths(tree: &Robot, markers: &[Fixed], capture: &Capture, groups: &Groups) -> Result<Vec<f64>, TrajectoryError> {
    let last = capture.places.len() - 1;
    let chosen: Vec<Vec<Option<Vec3<f64>>>> =
        (0..LENGTH_FRAMES).map(|k| capture.places[k * last / (LENGTH_FRAMES - 1)].clone()).collect();
    let mut lengths = vec![1.0; groups.names.len()];
    let even = lengths.clone();
    let mut postures = walk(tree, markers, &chosen)?;
    for round in 0..LENGTH_ROUNDS {
        let scaled = groups.scaled(tree, &lengths, &even);
        let on = groups.markers(markers, &lengths);
        if round > 0 {
            for (posture, targets) in postures.iter_mut().zip(&chosen) {
                let alone = problem(&scaled, &on, std::slice::from_ref(targets), 1.0);
                *posture = solve(&alone, std::slice::from_ref(posture))?.postures[0].clone();
            }
        }
        let change = lengthen(tree, markers, (&lengths, &postures), &chosen, groups)?;
        lengths.iter_mut().zip(&change).for_each(|(length, change)| *length += change);
        if change.amax() < 1e-4 {
            break;
        }
    }
    Ok(lengths)
}

/// The change of the scales that brings the markers nearer, with base and angles free to follow.
fn lengthen(
    tree: &Robot,
    markers: &[Fixed],
    (lengths, postures): (&[f64], &[Posture]),
    targets: &[Vec<Option<Vec3<f64>>>],
    groups: &Groups,
) -> Result<DVector<f64>, TrajectoryError> {
    const SMALL: f64 = 1e-4;
    let (g, even) = (lengths.len(), vec![1.0; lengths.len()]);
    let spread = SPREAD.0.powi(-2);
    let mut matrix = DMatrix::from_diagonal_element(g, g, spread);
    let mut right = DVector::from_iterator(g, lengths.iter().map(|length| (1.0 - length) * spread));
    let grown = |k: Option<usize>| -> Result<(Placed, Vec<Fixed>), TrajectoryError> {
        let mut own = lengths.to_vec();
        if let Some(k) = k {
            own[k] += SMALL;
        }
        Ok((Placed::new(&groups.scaled(tree, &own, &even))?, groups.markers(markers, &own)))
    };
    let mut now = grown(None)?;
    let mut others = (0..g).map(|k| grown(Some(k))).collect::<Result<Vec<_>, _>>()?;
    for (posture, targets) in postures.iter().zip(targets) {
        let points = |(placed, on): &mut (Placed, Vec<Fixed>)| -> DVector<f64> {
            placed.place(posture);
            let seen = on.iter().zip(targets).filter(|(_, target)| target.is_some());
            DVector::from_vec(seen.flat_map(|(marker, _)| placed.point(marker).data.0[0]).collect())
        };
        let here = points(&mut now);
        let aim = DVector::from_vec(targets.iter().flatten().flat_map(|target| target.data.0[0]).collect::<Vec<_>>());
        let columns: Vec<DVector<f64>> = others.iter_mut().map(|other| (points(other) - &here) / SMALL).collect();
        let slopes = DMatrix::from_columns(&columns);
        let seen = now.1.iter().zip(targets).filter(|(_, target)| target.is_some());
        let moves: Vec<_> = seen
            .map(|(marker, _)| now.0.jacobian(marker.joint, &Pose::at(marker.point)).rows(3, 3).into_owned())
            .collect();
        let mut jacobian = DMatrix::zeros(here.len(), 6 + posture.q.len());
        moves.iter().enumerate().for_each(|(k, rows)| jacobian.rows_mut(3 * k, 3).copy_from(rows));
        // What base and angles can follow is no matter of lengths.
        let svd = jacobian.svd(true, false);
        let told = (0..svd.singular_values.len()).filter(|&k| svd.singular_values[k] > 1e-3).collect::<Vec<_>>();
        let axes = svd.u.map(|u| u.select_columns(&told)).unwrap_or_else(|| DMatrix::zeros(here.len(), 0));
        let rest = |m: &DMatrix<f64>| m - &axes * axes.tr_mul(m);
        let (slopes, left) = (rest(&slopes), aim - here);
        matrix += slopes.tr_mul(&slopes) / MARKER_M.powi(2);
        right += slopes.tr_mul(&left) / MARKER_M.powi(2);
    }
    Ok(matrix.cholesky().map_or_else(|| DVector::zeros(g), |factor| factor.solve(&right)))
}

/// A simulated centre of pressure.
struct Simulated {
    cop: Vec<[f64; 2]>,
    error: CopError,
    /// Wrench of each group in each frame: Fz, Mx, My.
    parts: Vec<Vec<[f64; 3]>>,
}

fn simulated(tree: &Robot, groups: &Groups, motion: &Trajectory, capture: &Capture) -> Simulated {
    let moving = dynamic(&motion.postures, &capture.time_s, CORNER_HZ, &tree.gravity);
    let mut parts = Vec::new();
    for frame in wrench(tree, &moving) {
        let mut of = vec![[0.0; 3]; groups.names.len()];
        for (own, group) in frame.iter().zip(&groups.of) {
            [5, 0, 1].iter().enumerate().for_each(|(k, &part)| of[*group][k] += own[part]);
        }
        parts.push(of);
    }
    let whole = |frame: &Vec<[f64; 3]>| -> [f64; 3] { std::array::from_fn(|k| frame.iter().map(|part| part[k]).sum()) };
    let cop: Vec<[f64; 2]> = parts.iter().map(whole).map(|[fz, mx, my]| [-my / fz, mx / fz]).collect();
    let apart = |(own, plate): (&[f64; 2], [f64; 2])| (own[0] - plate[0]).hypot(own[1] - plate[1]);
    let distances: Vec<f64> = cop.iter().zip(measured_cop(capture)).map(apart).collect();
    let square: f64 = distances.iter().map(|d| d * d).sum();
    let error = CopError {
        rms_m: (square / distances.len().max(1) as f64).sqrt(),
        worst_m: distances.iter().copied().fold(0.0, f64::max),
    };
    Simulated { cop, error, parts }
}

/// The measured centre of pressure, as slow as the simulated one.
pub fn measured_cop(capture: &Capture) -> Vec<[f64; 2]> {
    let smooth = Smooth::new(&capture.time_s, CORNER_HZ);
    let [x, y]: [Vec<f64>; 2] = std::array::from_fn(|k| smooth.pass(capture.plates.iter().map(|p| p.cop[k]).collect()));
    x.into_iter().zip(y).map(|(x, y)| [x, y]).collect()
}

impl Simulated {
    /// Whether the plates' moments have the sign that the motion asks for.
    fn agrees(&self, capture: &Capture) -> Result<(), TrajectoryError> {
        let plates = measured_cop(capture);
        for (axis, column) in ["My", "Mx"].into_iter().enumerate() {
            let rms_mm = |sign: f64| {
                let square: f64 = self.cop.iter().zip(&plates).map(|(a, b)| (a[axis] - sign * b[axis]).powi(2)).sum();
                1e3 * (square / plates.len().max(1) as f64).sqrt()
            };
            let (off_mm, turned_mm) = (rms_mm(1.0), rms_mm(-1.0));
            if off_mm > TURNED.0 && turned_mm < TURNED.1 * off_mm {
                return Err(TrajectoryError::Turned { column, off_mm, turned_mm });
            }
        }
        Ok(())
    }

    /// Scales of the masses, in those of the general tree, whose centre of pressure and weight are the measured ones.
    fn masses(&self, now: &[f64], capture: &Capture, spread: f64) -> Vec<f64> {
        let g = now.len();
        let smooth = Smooth::new(&capture.time_s, CORNER_HZ);
        let forces = smooth.pass(capture.plates.iter().map(|plate| plate.force_n).collect());
        let spread = spread.powi(-2);
        let mut matrix = DMatrix::from_diagonal_element(g, g, spread);
        let mut right = DVector::from_element(g, spread);
        let share = (self.parts.len() as f64 / 10.0).max(1.0);
        for ((parts, [x, y]), force) in self.parts.iter().zip(measured_cop(capture)).zip(&forces) {
            let row = |of: &dyn Fn(&[f64; 3]) -> f64| {
                DVector::from_iterator(g, parts.iter().zip(now).map(|(part, scale)| of(part) / scale))
            };
            // Neighbouring frames tell the same.
            let mut add = |row: DVector<f64>, value: f64, sigma: f64| {
                let weight = (sigma * sigma * share).recip();
                matrix += &row * row.transpose() * weight;
                right += row * (value * weight);
            };
            add(row(&|[fz, _, my]| (-my - x * fz) / force), 0.0, GOOD.0);
            add(row(&|[fz, mx, _]| (mx - y * fz) / force), 0.0, GOOD.0);
            add(row(&|[fz, ..]| fz / force), 1.0, GOOD.1);
        }
        let found = matrix.cholesky().map_or_else(|| DVector::from_element(g, 1.0), |factor| factor.solve(&right));
        found.iter().map(|scale| scale.max(LIGHTEST)).collect()
    }
}

/// The centre of mass along a motion, low-passed.
pub fn com(tree: &Robot, postures: &[Posture], time_s: &[f64]) -> Result<Vec<Vec3<f64>>, TrajectoryError> {
    let mut placed = Placed::new(tree)?;
    let raw: Vec<Vec3<f64>> = postures
        .iter()
        .map(|posture| {
            placed.place(posture);
            placed.com().0
        })
        .collect();
    let smooth = Smooth::new(time_s, CORNER_HZ);
    let [x, y, z]: [Vec<f64>; 3] = std::array::from_fn(|k| smooth.pass(raw.iter().map(|c| c[k]).collect()));
    Ok((0..raw.len()).map(|k| Vec3::new(x[k], y[k], z[k])).collect())
}
