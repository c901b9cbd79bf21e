//! Corners of a tag to hundredths of a pixel, with their covariance: the four outer edges of its border are fitted to the pixels
//! around them, and the corners are where neighbouring edges cross.
//!
//! # Model of an edge
//!
//! A pixel at the distance h from the line between two corners (outwards positive) and at t along it (−1 to 1 from corner to
//! corner) has the grey level
//!
//! ```text
//! I(t, h) = d₀ + d₁ t + (c₀ + c₁ t) (1 − g Φ(−(h − a − b t) / w) + e)
//! ```
//!
//! with the normal distribution function Φ; in sharp pictures its mean over the pixel, across the edge. Unknown are the line (a, b), the width w of the blur, the dark border (d₀, d₁) and
//! the contrast to the white margin (c₀, c₁); the slopes follow uneven light. Least squares over some hundred pixels an edge
//! give a and b with their covariance, which goes with the variance of the pixels, estimated from what the fit leaves.
//!
//! What the edge shares its pixels with is known from the corners of the pass before: g is how much of the black square the two
//! neighbouring edges leave, e the light of the white data cells, which blur into the border.
//!
//! With a lens, the fit is in the picture that a lens without distortion would give, where edges are straight: an edge of 60 px
//! in a picture with k₁ = −0.3 bends by about 0.1 px, several times the noise of a corner.
//!
//! Lengths in px, in the coordinates of [`crate::grey`]. Valid for a grey level that is linear in light or nearly so: a camera's
//! tone curve moves all edges of a tag outwards or inwards by the same part of the blur.

use std::f64::consts::{PI, SQRT_2};

use darm_core::real::{Mat3, Vec2};
use nalgebra::{Matrix2, SMatrix, SVector, U7};

use crate::family::{CELLS, cells};
use crate::grey::GreyImage;
use crate::homography::of_unit_square;
use crate::least_squares::{NormalEquations, Problem, minimise};
use crate::lens::{Lens, PARAMETERS};
use crate::target::CORNERS;

/// Unknowns of an edge, and the place of its width among them.
const UNKNOWNS: usize = 7;
const WIDTH: usize = 2;

/// Width of the blur at the start, and the least of what is left of it without the pixel's own area.
const START_WIDTH: f64 = 0.8;
const MIN_WIDTH: f64 = 0.15;

/// Width of the blur below which the pixel's area is not taken as a part of it: an edge along rows or columns is then no normal
/// distribution, and one that is taken for it moves with its place between two rows.
const SHARP: f64 = 0.75;

/// Gauss-Legendre's three points of an interval of length 1, with their weights.
const ACROSS_PIXEL: [(f64, f64); 3] = [(-0.387_298_3, 5.0 / 18.0), (0.0, 8.0 / 18.0), (0.387_298_3, 5.0 / 18.0)];

/// Pixels closer to a neighbouring edge than this number of widths of the blur are left out: where two edges meet at an angle
/// other than 90°, g is not exact.
const REACH: f64 = 2.5;

/// Widths of the blur beyond which nothing of an edge is seen.
const SIGHT: f64 = 4.0;

/// Pixels farther from an edge than this number of widths, and at least this number of px, say nothing about its place.
const BAND_WIDTHS: f64 = 3.0;
const MIN_BAND: f64 = 1.5;

/// Passes over all edges at most, each with what the one before has found, and the change of a corner that needs no other, px.
const MAX_PASSES: usize = 4;
const UNMOVED: f64 = 0.01;

/// Pixels that an edge must have for its seven unknowns to be determined with some certainty.
const MIN_PIXELS: usize = 24;

/// Steps of the least squares of an edge: about six are usual.
const MAX_STEPS: usize = 30;

/// Farthest that a fitted edge may be from the detector's, px.
const MAX_SHIFT: f64 = 3.0;

/// Smallest contrast that counts as an edge, grey levels.
const MIN_CONTRAST: f64 = 8.0;

/// Parts into which an edge is cut to see whether something covers one of them.
const PARTS: usize = 8;

/// A part whose grey levels differ by this part of the contrast from the model, root mean square, is covered: what covers a tenth
/// of a part completely leaves 0.3 of the contrast.
const COVERED: f64 = 0.15;

/// Corners of a tag with their covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct Corners {
    /// Where they are, px, in the order of [`crate::target`].
    pub pixels: [Vec2<f64>; CORNERS],
    /// Covariance of x and y of the four corners, px².
    pub covariance: SMatrix<f64, 8, 8>,
    /// Width of the blur of the most blurred edge, its standard deviation, px.
    pub blur_px: f64,
}

/// Why the edges of a tag are not fitted.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum EdgeError {
    /// An edge is outside of the picture, or outside of what the lens model describes.
    #[error("an edge of the tag leaves the picture")]
    Outside,
    /// Too few pixels along an edge.
    #[error("the tag is too small: {pixels} pixels along an edge, expected at least {MIN_PIXELS}")]
    Small {
        /// Pixels that could be used.
        pixels: usize,
    },
    /// No line with a dark and a light side.
    #[error("an edge of the tag has no contrast, or is not where the detector saw it")]
    NoEdge,
    /// Something covers a part of an edge.
    #[error("a part of the tag's edge is hidden")]
    Hidden,
    /// The family has no such tag.
    #[error("there is no tag of this number")]
    NoTag,
}

/// A pixel near an edge.
#[derive(Clone, Copy, Debug)]
struct Sample {
    /// Along the edge, −1 to 1.
    t: f64,
    /// Outwards from it, px.
    h: f64,
    grey: f64,
    /// Part of the black square that the neighbouring edges leave, g.
    left: f64,
    /// Light of the data cells, e.
    data: f64,
}

/// An edge between two corners, on which samples are measured.
#[derive(Clone, Copy, Debug)]
struct Baseline {
    middle: Vec2<f64>,
    along: Vec2<f64>,
    outward: Vec2<f64>,
    half_length: f64,
}

impl Baseline {
    fn new(from: &Vec2<f64>, to: &Vec2<f64>) -> Option<Self> {
        let half_length = (to - from).norm() / 2.0;
        let along = (to - from) / (2.0 * half_length);
        // Corners run so that the tag is on the left in a picture whose y points down.
        let usable = half_length > 1.0 && half_length.is_finite();
        usable.then(|| Self { middle: (from + to) / 2.0, along, outward: Vec2::new(-along.y, along.x), half_length })
    }

    fn coordinates(&self, point: &Vec2<f64>) -> (f64, f64) {
        let from_middle = point - self.middle;
        (from_middle.dot(&self.along) / self.half_length, from_middle.dot(&self.outward))
    }
}

/// An edge with its pixels and the values of its unknowns a, b, w, d₀, d₁, c₀, c₁.
#[derive(Clone, Debug)]
struct EdgeFit<'a> {
    samples: &'a [Sample],
    unknowns: SVector<f64, UNKNOWNS>,
    /// Length of a pixel across the edge, px; 0 where the blur includes it.
    pixel: f64,
}

/// How much of the dark side a pixel sees, with the derivatives by its distance from the edge and by the width of the blur.
struct DarkPart {
    part: f64,
    by_distance: f64,
    by_width: f64,
}

impl EdgeFit<'_> {
    /// What the model has at a sample less its grey level, and the derivative.
    fn residual(&self, sample: &Sample) -> (f64, SVector<f64, UNKNOWNS>) {
        let [a, b, w, d0, d1, c0, c1] = self.unknowns.into();
        let Sample { t, h, grey, left, data } = *sample;
        let dark = self.dark_part(h - a - b * t, w);
        let light = 1.0 - left * dark.part + data;
        let contrast = c0 + c1 * t;
        let (slope, by_width) = (contrast * left * dark.by_distance, -contrast * left * dark.by_width);
        let derivative = SVector::from([slope, slope * t, by_width, 1.0, t, light, light * t]);
        (d0 + d1 * t + contrast * light - grey, derivative)
    }

    /// At a distance from the edge, outwards, of a blur of this width without the pixel's own area.
    fn dark_part(&self, distance: f64, width: f64) -> DarkPart {
        let one = |distance: f64| {
            let z = distance / width;
            let density = (-z * z / 2.0).exp() / (width * (2.0 * PI).sqrt());
            DarkPart { part: normal(-z), by_distance: -density, by_width: z * density }
        };
        if self.pixel == 0.0 {
            return one(distance);
        }
        let mut mean = DarkPart { part: 0.0, by_distance: 0.0, by_width: 0.0 };
        for (at, weight) in ACROSS_PIXEL {
            let point = one(distance + at * self.pixel);
            mean.part += weight * point.part;
            mean.by_distance += weight * point.by_distance;
            mean.by_width += weight * point.by_width;
        }
        mean
    }
}

impl Problem for EdgeFit<'_> {
    type Size = U7;

    fn normal_equations(&self) -> Option<NormalEquations<U7>> {
        let (mut cost, mut gradient) = (0.0, SVector::<f64, UNKNOWNS>::zeros());
        let mut information = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
        for sample in self.samples {
            let (residual, derivative) = self.residual(sample);
            cost += residual * residual;
            gradient += derivative * residual;
            information.ger(1.0, &derivative, &derivative, 1.0);
        }
        // At its bound the width is no unknown: the picture is sharper than the model can be.
        if self.unknowns[WIDTH] <= MIN_WIDTH && gradient[WIDTH] > 0.0 {
            gradient[WIDTH] = 0.0;
            information.row_mut(WIDTH).fill(0.0);
            information.column_mut(WIDTH).fill(0.0);
            information[(WIDTH, WIDTH)] = 1.0;
        }
        Some(NormalEquations { cost, gradient, information })
    }

    fn moved(&self, step: &SVector<f64, UNKNOWNS>) -> Option<Self> {
        let mut unknowns = self.unknowns + step;
        unknowns[WIDTH] = unknowns[WIDTH].max(MIN_WIDTH);
        Some(Self { unknowns, ..*self })
    }
}

/// The normal distribution function Φ.
fn normal(z: f64) -> f64 {
    libm::erfc(-z / SQRT_2) / 2.0
}

/// The cells of a tag in the picture.
struct Pattern {
    cells: [[bool; CELLS]; CELLS],
    /// From the picture to cells: x along the rows from the upper left corner of the border, y down.
    to_cells: Mat3<f64>,
    /// Width of the blur, px.
    width: f64,
}

impl Pattern {
    fn new(cells: &[[bool; CELLS]; CELLS], corners: &[Vec2<f64>; CORNERS], width: f64) -> Option<Self> {
        let clockwise = [corners[3], corners[2], corners[1], corners[0]];
        let side = CELLS as f64;
        let to_cells = Mat3::from_diagonal(&[side, side, 1.0].into()) * of_unit_square(&clockwise).try_inverse()?;
        Some(Self { cells: *cells, to_cells, width })
    }

    /// The light of the white cells at a point of the picture, 0 to 1.
    fn light(&self, point: &Vec2<f64>) -> f64 {
        let homogeneous = self.to_cells * point.push(1.0);
        let at = homogeneous.xy() / homogeneous.z;
        let row = |k: usize| self.to_cells.fixed_view::<1, 2>(k, 0).transpose();
        let width = |axis: usize| self.width * ((row(axis) - row(2) * at[axis]) / homogeneous.z).norm();
        let (x_width, y_width) = (width(0), width(1));
        // The data are within the border: cells 1 to 7.
        let inside = |at: f64, width: f64| (1.0 - SIGHT * width..7.0 + SIGHT * width).contains(&at);
        if !inside(at.x, x_width) || !inside(at.y, y_width) {
            return 0.0;
        }
        let part = |from: usize, at: f64, width: f64| {
            let until = (from as f64 + 1.0 - at) / width;
            let since = (from as f64 - at) / width;
            if until < -SIGHT || since > SIGHT { 0.0 } else { normal(until) - normal(since) }
        };
        let columns: [f64; CELLS] = std::array::from_fn(|column| part(column, at.x, x_width));
        let mut light = 0.0;
        for (row, cells) in self.cells.iter().enumerate() {
            let of_row = part(row, at.y, y_width);
            if of_row > 0.0 {
                let white = cells.iter().zip(columns).filter(|(white, _)| **white).map(|(_, part)| part);
                light += of_row * white.sum::<f64>();
            }
        }
        light
    }
}

/// A fitted edge.
struct Edge {
    baseline: Baseline,
    /// a and b.
    offset: Vec2<f64>,
    /// Inverse of JᵀJ of a and b: their covariance for pixels with a variance of 1.
    covariance: Matrix2<f64>,
    width: f64,
    /// Sum of squares of what the fit leaves, and the number of degrees of freedom.
    left: f64,
    freedom: f64,
}

/// From pixels to the picture of a lens without distortion, and back.
struct Straightener<'a> {
    lens: Option<&'a Lens>,
}

impl Straightener<'_> {
    fn straight(&self, pixel: &Vec2<f64>) -> Option<Vec2<f64>> {
        let Some(lens) = self.lens else { return Some(*pixel) };
        let [fx, fy, cx, cy, ..]: [f64; PARAMETERS] = lens.parameters().into();
        lens.direction(pixel).map(|direction| Vec2::new(direction.x * fx + cx, direction.y * fy + cy))
    }

    /// The pixel of a point, and how it moves with the point.
    fn pixel(&self, straight: &Vec2<f64>) -> (Vec2<f64>, Matrix2<f64>) {
        let Some(lens) = self.lens else { return (*straight, Matrix2::identity()) };
        let [fx, fy, cx, cy, ..]: [f64; PARAMETERS] = lens.parameters().into();
        let projection = lens.project(&Vec2::new((straight.x - cx) / fx, (straight.y - cy) / fy));
        (projection.pixel, projection.by_direction * Matrix2::new(1.0 / fx, 0.0, 0.0, 1.0 / fy))
    }
}

/// Refines the corners of a detected tag; with a lens, as if it had no distortion.
///
/// # Errors
///
/// An edge cannot be fitted.
pub fn refine(
    image: &GreyImage,
    id: u16,
    detected: &[Vec2<f64>; CORNERS],
    lens: Option<&Lens>,
) -> Result<Corners, EdgeError> {
    let cells = cells(id).ok_or(EdgeError::NoTag)?;
    let straightener = Straightener { lens };
    let mut corners = *detected;
    for corner in &mut corners {
        *corner = straightener.straight(corner).ok_or(EdgeError::Outside)?;
    }
    let mut width = START_WIDTH;
    let mut edges = Vec::new();
    for _ in 0..MAX_PASSES {
        let pattern = Pattern::new(&cells, &corners, width).ok_or(EdgeError::NoEdge)?;
        edges.clear();
        for k in 0..CORNERS {
            edges.push(fit(image, &straightener, &corners, k, &pattern)?);
        }
        width = edges.iter().map(|edge| edge.width).fold(0.0, f64::max);
        let mut moved: f64 = 0.0;
        for (k, corner) in corners.iter_mut().enumerate() {
            let (found, ..) = crossing(&edges[(k + CORNERS - 1) % CORNERS], &edges[k]).ok_or(EdgeError::NoEdge)?;
            moved = moved.max((found - *corner).norm());
            *corner = found;
        }
        if moved < UNMOVED {
            break;
        }
    }
    let variance = edges.iter().map(|edge| edge.left).sum::<f64>() / edges.iter().map(|edge| edge.freedom).sum::<f64>();
    let mut pixels = [Vec2::zeros(); CORNERS];
    let mut of_offsets = SMatrix::<f64, 8, 8>::zeros();
    let mut by_offsets = SMatrix::<f64, 8, 8>::zeros();
    for (k, pixel) in pixels.iter_mut().enumerate() {
        let before = (k + CORNERS - 1) % CORNERS;
        let (corner, by_before, by_after) = crossing(&edges[before], &edges[k]).ok_or(EdgeError::NoEdge)?;
        let (at, by_corner) = straightener.pixel(&corner);
        *pixel = at;
        by_offsets.fixed_view_mut::<2, 2>(2 * k, 2 * before).copy_from(&(by_corner * by_before));
        by_offsets.fixed_view_mut::<2, 2>(2 * k, 2 * k).copy_from(&(by_corner * by_after));
        of_offsets.fixed_view_mut::<2, 2>(2 * k, 2 * k).copy_from(&(edges[k].covariance * variance));
    }
    Ok(Corners { pixels, covariance: by_offsets * of_offsets * by_offsets.transpose(), blur_px: width })
}

/// Fits the edge from corner `k` to the next.
fn fit(
    image: &GreyImage,
    straightener: &Straightener,
    corners: &[Vec2<f64>; CORNERS],
    k: usize,
    pattern: &Pattern,
) -> Result<Edge, EdgeError> {
    let width = pattern.width;
    let [before, from, to, after] = [k + CORNERS - 1, k, k + 1, k + 2].map(|k| corners[k % CORNERS]);
    let baseline = Baseline::new(&from, &to).ok_or(EdgeError::NoEdge)?;
    let length = 2.0 * baseline.half_length;
    // How far along the edge the neighbouring edges are seen, by the sine of the angles at the corners.
    let sine = |along: Vec2<f64>| along.normalize().dot(&baseline.outward).abs().max(0.2);
    let reach = REACH * width + 0.5;
    let [start, end] = [reach / sine(before - from), reach / sine(after - to)].map(|px| px / baseline.half_length);
    // The border and the margin are one cell wide.
    let depth = |along: Vec2<f64>| along.dot(&baseline.outward).abs();
    let cell = depth(before - from).min(depth(after - to)).min(length) / CELLS as f64;
    let band = (BAND_WIDTHS * width + 1.0).min(cell).max(MIN_BAND);
    let neighbours = [Baseline::new(&before, &from), Baseline::new(&to, &after)];
    let [Some(first), Some(second)] = neighbours else { return Err(EdgeError::NoEdge) };
    let mut samples = samples(image, straightener, &baseline, [-1.0 + start, 1.0 - end], band)?;
    for (sample, point) in &mut samples {
        let outside = |edge: &Baseline| edge.coordinates(point).1;
        sample.left = normal(-outside(&first) / width) * normal(-outside(&second) / width);
        sample.data = pattern.light(point);
    }
    let samples: Vec<Sample> = samples.into_iter().map(|(sample, _)| sample).collect();
    if samples.len() < MIN_PIXELS {
        return Err(EdgeError::Small { pixels: samples.len() });
    }
    let pixel = if width < SHARP { baseline.outward.abs().max() } else { 0.0 };
    let minimum = minimise(start_values(&samples, width, pixel), MAX_STEPS).ok_or(EdgeError::NoEdge)?;
    let [a, b, w, _, _, contrast, slope] = minimum.point.unknowns.into();
    let shift = a.abs() + b.abs();
    if !minimum.converged || contrast - slope.abs() < MIN_CONTRAST || shift > MAX_SHIFT.max(0.1 * length) {
        return Err(EdgeError::NoEdge);
    }
    if is_covered(&minimum.point, contrast) {
        return Err(EdgeError::Hidden);
    }
    let covariance = minimum.covariance().ok_or(EdgeError::NoEdge)?.fixed_view::<2, 2>(0, 0).into_owned();
    let (left, freedom) = (minimum.equations.cost, (samples.len() - UNKNOWNS) as f64);
    // The variance of a uniform distribution is a twelfth of its length, squared.
    let width = w.hypot(pixel / 12f64.sqrt());
    Ok(Edge { baseline, offset: Vec2::new(a, b), covariance, width, left, freedom })
}

/// The pixels within `band` of a baseline, between two places along it, with where they are.
fn samples(
    image: &GreyImage,
    straightener: &Straightener,
    baseline: &Baseline,
    along: [f64; 2],
    band: f64,
) -> Result<Vec<(Sample, Vec2<f64>)>, EdgeError> {
    let at = |t: f64| baseline.middle + baseline.along * (t * baseline.half_length);
    let (ends, middle) = (along.map(|t| straightener.pixel(&at(t)).0), straightener.pixel(&baseline.middle).0);
    // The edge is bent in the picture by at most as much as its middle, and a little for the change of scale.
    let bend = (middle - (ends[0] + ends[1]) / 2.0).norm();
    let reach = 1.2 * band + bend + 1.0;
    let range = |axis: usize, length: usize| {
        let (low, high) = (ends[0][axis].min(ends[1][axis]) - reach, ends[0][axis].max(ends[1][axis]) + reach);
        let inside = low.ceil() >= 0.0 && high.floor() <= (length - 1) as f64;
        inside.then(|| low.ceil() as usize..=high.floor() as usize).ok_or(EdgeError::Outside)
    };
    let (columns, rows) = (range(0, image.width())?, range(1, image.height())?);
    let chord = (ends[1] - ends[0]).normalize();
    let mut samples = Vec::new();
    for row in rows {
        for column in columns.clone() {
            let pixel = Vec2::new(column as f64, row as f64);
            if (pixel - ends[0]).perp(&chord).abs() > reach {
                continue;
            }
            let Some(straight) = straightener.straight(&pixel) else { continue };
            let (t, h) = baseline.coordinates(&straight);
            if h.abs() <= band && (along[0]..=along[1]).contains(&t) {
                let grey = f64::from(image.get(column, row).unwrap_or_default());
                samples.push((Sample { t, h, grey, left: 1.0, data: 0.0 }, straight));
            }
        }
    }
    Ok(samples)
}

/// Where the fit of an edge starts: on the baseline, between the mean grey levels of both sides.
fn start_values(samples: &[Sample], width: f64, pixel: f64) -> EdgeFit<'_> {
    let mean = |side: fn(f64) -> bool| {
        let greys = samples.iter().filter(|sample| side(sample.h)).map(|sample| sample.grey);
        let (sum, count) = greys.fold((0.0, 0.0), |(sum, count), grey| (sum + grey, count + 1.0));
        sum / f64::max(count, 1.0)
    };
    let (dark, light) = (mean(|h| h < -1.0), mean(|h| h > 1.0));
    let own_width = (width * width - pixel * pixel / 12.0).max(MIN_WIDTH * MIN_WIDTH).sqrt();
    EdgeFit { samples, unknowns: SVector::from([0.0, 0.0, own_width, dark, 0.0, light - dark, 0.0]), pixel }
}

/// Whether the grey levels of a part of the edge are not those of an edge.
fn is_covered(edge: &EdgeFit, contrast: f64) -> bool {
    let mut parts = [(0.0, 0.0); PARTS];
    for sample in edge.samples {
        let part = ((sample.t + 1.0) / 2.0 * PARTS as f64).clamp(0.0, PARTS as f64 - 1.0) as usize;
        let (residual, _) = edge.residual(sample);
        parts[part] = (parts[part].0 + residual * residual, parts[part].1 + 1.0);
    }
    let mut squares: Vec<f64> = parts.iter().filter(|part| part.1 >= 8.0).map(|part| part.0 / part.1).collect();
    squares.sort_by(f64::total_cmp);
    let (Some(worst), Some(middle)) = (squares.last(), squares.get(squares.len() / 2)) else { return false };
    // Noise is the same in all parts.
    worst.sqrt() > COVERED * contrast && *worst > 4.0 * middle
}

/// Where two edges cross, and how that moves with a and b of the first and of the second.
fn crossing(first: &Edge, second: &Edge) -> Option<(Vec2<f64>, Matrix2<f64>, Matrix2<f64>)> {
    let line = |Edge { baseline, offset, .. }: &Edge| {
        let point = baseline.middle + baseline.outward * offset.x;
        let normal = (baseline.outward - baseline.along * (offset.y / baseline.half_length)).normalize();
        (point, normal)
    };
    let ((p1, n1), (p2, n2)) = (line(first), line(second));
    let to_corner = Matrix2::from_rows(&[n1.transpose(), n2.transpose()]).try_inverse()?;
    let corner = to_corner * Vec2::new(n1.dot(&p1), n2.dot(&p2));
    let by_offset = |edge: &Edge, normal: &Vec2<f64>, column: usize| {
        let (t, _) = edge.baseline.coordinates(&corner);
        let outwards = edge.baseline.outward.dot(normal);
        to_corner.column(column) * SMatrix::<f64, 1, 2>::new(outwards, outwards * t)
    };
    Some((corner, by_offset(first, &n1, 0), by_offset(second, &n2, 1)))
}
