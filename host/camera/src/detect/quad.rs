//! Quadrilaterals: borders that are four straight lines with black inside.

use darm_core::real::Vec2;

use super::binary::Level;
use super::borders::BorderPoint;

/// Points on each side of a possible corner to which a line is fitted: a twelfth of the border, at most 20, at least 2.
const WINDOW_SHARE: usize = 12;
const MAX_WINDOW: usize = 20;
const MIN_WINDOW: usize = 2;

/// Places that are tried as corners: those where a line fits worst.
const MAX_PLACES: usize = 10;

/// Mean squared distance of a border's points from its lines that is a quadrilateral's, px² of the level.
const MAX_MEAN_SQUARE: f64 = 10.0;

/// Cosine of the least angle between two sides of a quadrilateral, 10°.
const MAX_COS: f64 = 0.984_8;

/// Smallest side of a quadrilateral, px of the level.
const MIN_SIDE: f64 = 4.0;

/// Weights of the errors of neighbouring places: a normal distribution with a standard deviation of one point.
const SMOOTHING: [f64; 7] = [0.011_1, 0.135_3, 0.606_5, 1.0, 0.606_5, 0.135_3, 0.011_1];

/// Sums over points from the first to one.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    weight: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    count: f64,
}

impl Sums {
    fn plus(self, other: &Self, sign: f64) -> Self {
        Self {
            weight: self.weight + sign * other.weight,
            x: self.x + sign * other.x,
            y: self.y + sign * other.y,
            xx: self.xx + sign * other.xx,
            xy: self.xy + sign * other.xy,
            yy: self.yy + sign * other.yy,
            count: self.count + sign * other.count,
        }
    }
}

/// A line through points.
#[derive(Clone, Copy, Debug)]
struct Line {
    point: Vec2<f64>,
    normal: Vec2<f64>,
    /// Weighted mean of the squared distance.
    mean_square: f64,
    count: f64,
}

/// A border around its middle, with sums for fitting lines to any part of it.
struct Walk {
    sums: Vec<Sums>,
}

impl Walk {
    fn new(level: &Level, points: &[Vec2<f64>]) -> Self {
        let mut sums = vec![Sums::default()];
        let mut sum = Sums::default();
        for point in points {
            // A strong gradient is the edge itself, a weak one its blur.
            let weight = 1.0 + level.gradient(point.x.max(0.0) as usize, point.y.max(0.0) as usize);
            let (x, y) = (point.x, point.y);
            let (wx, wy) = (weight * x, weight * y);
            let one = Sums { weight, x: wx, y: wy, xx: wx * x, xy: wx * y, yy: wy * y, count: 1.0 };
            sum = sum.plus(&one, 1.0);
            sums.push(sum);
        }
        Self { sums }
    }

    fn len(&self) -> usize {
        self.sums.len() - 1
    }

    /// The line through the points from one to another, both included, around the end if the first is behind.
    fn line(&self, from: usize, to: usize) -> Line {
        let until = self.sums[to + 1];
        let mut sum = until.plus(&self.sums[from], -1.0);
        if from > to {
            sum = sum.plus(&self.sums[self.len()], 1.0);
        }
        let point = Vec2::new(sum.x, sum.y) / sum.weight;
        let xx = sum.xx / sum.weight - point.x * point.x;
        let xy = sum.xy / sum.weight - point.x * point.y;
        let yy = sum.yy / sum.weight - point.y * point.y;
        let mean_square = ((xx + yy - (xx - yy).hypot(2.0 * xy)) / 2.0).max(0.0);
        // The eigenvector of the smaller eigenvalue; of its two forms the one without cancellation.
        let normal = match xx > yy {
            true => Vec2::new(xy, mean_square - xx),
            false => Vec2::new(mean_square - yy, xy),
        };
        Line { point, normal: normal.try_normalize(0.0).unwrap_or_else(Vec2::x), mean_square, count: sum.count }
    }

    /// The places where a line through the neighbouring points fits worst, in their order.
    fn places(&self) -> Vec<usize> {
        let count = self.len();
        let window = (count / WINDOW_SHARE).min(MAX_WINDOW);
        if window < MIN_WINDOW {
            return Vec::new();
        }
        let error = |at: usize| {
            let line = self.line((at + count - window) % count, (at + window) % count);
            line.mean_square * line.count
        };
        let errors: Vec<f64> = (0..count).map(error).collect();
        let smooth = |at: usize| -> f64 {
            let near = (0..SMOOTHING.len()).map(|k| errors[(at + count + k - SMOOTHING.len() / 2) % count]);
            near.zip(SMOOTHING).map(|(error, weight)| error * weight).sum()
        };
        let errors: Vec<f64> = (0..count).map(smooth).collect();
        let is_peak =
            |at: &usize| errors[*at] > errors[(at + 1) % count] && errors[*at] > errors[(at + count - 1) % count];
        let mut places: Vec<usize> = (0..count).filter(is_peak).collect();
        places.sort_by(|a, b| errors[*b].total_cmp(&errors[*a]));
        places.truncate(MAX_PLACES);
        places.sort_unstable();
        places
    }

    /// The four lines between four of the places that fit best.
    fn best_lines(&self) -> Option<[Line; 4]> {
        let places = self.places();
        let mut best: Option<(f64, [Line; 4])> = None;
        let straight = |line: &Line| line.mean_square <= MAX_MEAN_SQUARE;
        for (i, &a) in places.iter().enumerate() {
            for (j, &b) in places.iter().enumerate().skip(i + 1) {
                let first = self.line(a, b);
                if !straight(&first) {
                    continue;
                }
                for (k, &c) in places.iter().enumerate().skip(j + 1) {
                    let second = self.line(b, c);
                    if !straight(&second) || first.normal.dot(&second.normal).abs() > MAX_COS {
                        continue;
                    }
                    for &d in places.iter().skip(k + 1) {
                        let lines = [first, second, self.line(c, d), self.line(d, a)];
                        let error: f64 = lines.iter().map(|line| line.mean_square * line.count).sum();
                        if lines.iter().all(straight) && best.is_none_or(|(smallest, _)| error < smallest) {
                            best = Some((error, lines));
                        }
                    }
                }
            }
        }
        best.filter(|(error, _)| error / (self.len() as f64) < MAX_MEAN_SQUARE).map(|(_, lines)| lines)
    }
}

/// The corners of a border that is a black quadrilateral, in pixels of the image, clockwise as it is seen.
pub(super) fn corners(level: &Level, border: &[BorderPoint]) -> Option<[Vec2<f64>; 4]> {
    let points = black_inside(border)?;
    let lines = Walk::new(level, &points).best_lines()?;
    let mut corners = [Vec2::zeros(); 4];
    for (k, corner) in corners.iter_mut().enumerate() {
        *corner = crossing(&lines[(k + 3) % 4], &lines[k])?;
    }
    let side = |k: usize| corners[(k + 1) % 4] - corners[k % 4];
    for k in 0..4 {
        let (first, second) = (side(k), side(k + 1));
        let size = first.norm() * second.norm();
        if !(first.perp(&second) > 0.0 && first.dot(&second).abs() <= MAX_COS * size) {
            return None;
        }
    }
    let area = (side(0).perp(&side(1)) + side(2).perp(&side(3))) / 2.0;
    // Pixel (0, 0) of half the resolution is the mean of (0, 0) to (1, 1).
    let (factor, shift) = (level.factor as f64, (level.factor - 1) as f64 / 2.0);
    (area >= MIN_SIDE * MIN_SIDE).then(|| corners.map(|corner| corner * factor + Vec2::repeat(shift)))
}

/// The points of a border in the order of their angles around its middle, clockwise; `None` if white is inside, or if it is too
/// narrow.
fn black_inside(border: &[BorderPoint]) -> Option<Vec<Vec2<f64>>> {
    let first = border.first()?;
    let mut range = [first.x2, first.x2, first.y2, first.y2];
    for BorderPoint { x2, y2, .. } in border {
        range = [range[0].min(*x2), range[1].max(*x2), range[2].min(*y2), range[3].max(*y2)];
    }
    let [left, right, upper, lower] = range.map(|half| f64::from(half) / 2.0);
    if (right - left).min(lower - upper) < MIN_SIDE / 2.0 || (right - left) * (lower - upper) < MIN_SIDE * MIN_SIDE {
        return None;
    }
    // Off the grid, so that no point is at the middle and no two are at opposite angles.
    let middle = Vec2::new((left + right) / 2.0 + 0.051_18, (upper + lower) / 2.0 - 0.028_581);
    let mut outwards = 0.0;
    let mut by_angle: Vec<(f64, Vec2<f64>)> = Vec::with_capacity(border.len());
    for BorderPoint { x2, y2, to_white } in border {
        let point = Vec2::new(f64::from(*x2), f64::from(*y2)) / 2.0;
        let from_middle = point - middle;
        outwards += from_middle.x * f64::from(to_white[0]) + from_middle.y * f64::from(to_white[1]);
        by_angle.push((from_middle.y.atan2(from_middle.x), point));
    }
    if outwards <= 0.0 {
        return None;
    }
    by_angle.sort_by(|a, b| a.0.total_cmp(&b.0));
    Some(by_angle.into_iter().map(|(_, point)| point).collect())
}

fn crossing(first: &Line, second: &Line) -> Option<Vec2<f64>> {
    let determinant = first.normal.perp(&second.normal);
    if determinant.abs() < 1e-3 {
        return None;
    }
    let (a, b) = (first.normal.dot(&first.point), second.normal.dot(&second.point));
    Some(Vec2::new(a * second.normal.y - b * first.normal.y, b * first.normal.x - a * second.normal.x) / determinant)
}
