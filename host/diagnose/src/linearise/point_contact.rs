//! PointContact: the tool touches the same unknown points in many postures, and nothing outside measures it.
//!
//! The residual of a row is where the model puts the tool less the mean over all rows of the same point; where pairs of
//! points are a known distance apart, a last axis holds the distance of their means less that. What moves all points
//! alike cannot show. Where no distance is known, an arm with all its lengths shorter closes better by itself: there the
//! residual is scaled to the size that the model has, and the scale of the arm is fixed.
//!
//! What may be wrong with the robot: the module `serial_chain`.

use darm_core::real::Vec3;

use crate::linearise::experiment::{Axis, Curvature, Experiment};
use crate::linearise::serial_chain::{FrameChain, PER_JOINT, SerialChain};
use crate::measured::Measured;
use crate::prepare::signals::{PrepareError, Prepared};
use darm_measure::{Finding, FindingKind, root_mean_square};
use darm_robot::robot::Robot;

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

/// Two points and the distance between them.
type Pair = (usize, usize);

struct PointContact {
    chain: SerialChain,
    /// The point that each row touches.
    of_row: Vec<usize>,
    n_points: usize,
    pairs: Vec<Pair>,
    distance_m: f64,
    /// Reach of the model from the axis of the first joint, where no known distance gives its scale, m.
    reach_m: Option<f64>,
}

/// The experiment of touched points.
pub(crate) fn experiment(data: &Prepared, robot: &Robot, points: &Points) -> Result<Experiment, PrepareError> {
    let chain = SerialChain::new(data, robot, points.tool.as_deref(), false)?;
    let (of_row, n_points, pairs) = named(data, points)?;
    let distance_m = points.pair.as_ref().map_or(0.0, |(_, distance)| *distance);
    let mut contact = PointContact { chain, of_row, n_points, pairs, distance_m, reach_m: None };
    let zero = vec![0.0; contact.chain.n_values()];
    if points.pair.is_none() {
        let reach = reach(&contact.arms(&contact.chain.frames(&zero)));
        contact.reach_m = Some(reach).filter(|reach| *reach > 0.0);
    }
    let findings = contact.findings().collect();
    let (residuals, columns) = contact.at(&zero);
    let candidates = contact.chain.candidates(columns.into_iter());
    let mut axes: Vec<Axis> = ["x", "y", "z"].map(|name| Axis::new(name, "m")).into();
    if points.pair.is_some() {
        axes.push(Axis { noise_if_repeated: Some(PAIR_NOISE), ..Axis::new("distance of points", "m") });
    }
    let channels = contact.chain.channels();
    let curvature = Curvature::Relinearise(Box::new(move |values| contact.at(values)));
    Ok(Experiment {
        kind: Measured::PointContact,
        axes,
        n_norm: 3,
        rows: data.rows.clone(),
        residuals,
        measured: None,
        candidates,
        channels,
        bodies: Vec::new(),
        findings,
        curvature,
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

/// The length of the arm, root mean square over all postures, m.
fn reach(arms: &[Vec3<f64>]) -> f64 {
    root_mean_square(&arms.iter().map(Vec3::norm).collect::<Vec<f64>>())
}

impl PointContact {
    /// What the owner of the model should know.
    fn findings(&self) -> impl Iterator<Item = Finding> {
        let no_distance = "no two points have a known distance (pair, distance_mm in the model): \
                           the scale of the arm is taken from it";
        let scale = (self.distance_m == 0.0).then(|| Finding::note(FindingKind::IncompleteModel, no_distance));
        scale.into_iter().chain(self.chain.finding())
    }

    /// From the axis of the first joint to the tool, square to it, in each posture.
    fn arms(&self, chains: &[FrameChain]) -> Vec<Vec3<f64>> {
        let arm = |chain: &FrameChain| {
            let first = &chain.before[0];
            let axis = self.chain.first_axis(first);
            let from_origin = chain.tool.position - first.position;
            from_origin - axis * axis.dot(&from_origin)
        };
        chains.iter().map(arm).collect()
    }

    /// Residuals and columns at these values.
    fn at(&self, values: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let chains = self.chain.frames(values);
        let places: Vec<Vec3<f64>> = chains.iter().map(|chain| chain.tool.position).collect();
        let means = self.means(&places);
        let arms = self.arms(&chains);
        let reach = reach(&arms);
        let size = self.reach_m.map_or(1.0, |reach_m| reach / reach_m);
        let distance = |(a, b): &Pair| (means[*b] - means[*a]).norm() - self.distance_m;
        let mut residuals = self.axes(&places, &means, &distance);
        residuals.iter_mut().for_each(|residual| *residual /= size);
        let slopes = self.chain.slopes(values, &chains);
        let mut columns = Vec::with_capacity(values.len());
        for k in 0..values.len() {
            let moved: Vec<Vec3<f64>> = slopes.iter().map(|row| row[k].linear).collect();
            let mut column = self.moved_axes(&moved, &means);
            // What moves the first joint itself takes the complete arm along.
            if let Some(reach_m) = self.reach_m.filter(|_| k >= PER_JOINT) {
                let outward: f64 = arms.iter().zip(&moved).map(|(arm, moved)| arm.dot(moved)).sum();
                let growth = outward / (arms.len() as f64 * reach * reach_m);
                column.iter_mut().zip(&residuals).for_each(|(slope, residual)| *slope -= residual * growth);
            }
            column.iter_mut().for_each(|slope| *slope /= size);
            columns.push(column);
        }
        (residuals, columns)
    }

    /// How the axes change, rows × axes, where the places move like this; `means` are those of the points, m.
    fn moved_axes(&self, moved: &[Vec3<f64>], means: &[Vec3<f64>]) -> Vec<f64> {
        let moved_means = self.means(moved);
        self.axes(moved, &moved_means, &|&(a, b)| {
            let apart = means[b] - means[a];
            apart.dot(&(moved_means[b] - moved_means[a])) / apart.norm().max(1e-12)
        })
    }

    fn means(&self, places: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
        let mut sums = vec![(Vec3::zeros(), 0.0); self.n_points];
        for (&point, place) in self.of_row.iter().zip(places) {
            sums[point].0 += place;
            sums[point].1 += 1.0;
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
        for (&point, place) in self.of_row.iter().zip(places) {
            let from_mean = place - means[point];
            all.extend([from_mean.x, from_mean.y, from_mean.z]);
            if self.distance_m > 0.0 {
                all.push(pair_numbers[point]);
            }
        }
        all
    }
}

#[cfg(test)]
mod tests;
