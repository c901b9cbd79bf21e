//! Pictures of printed tags through a lens, for tests and the simulator.
//!
//! Shares the codes of the tags and the names of the lens's numbers with the estimator, and no code: rays are traced from each
//! pixel to the sheets. A pixel is the mean over its area, blurred by a normal distribution before it is sampled, as optics do
//! (144 rays where a border is near); then come, in this order, motion, vignetting, noise, and rounding to 8 bits.
//!
//! Frames as everywhere: the camera looks along z, x to the right, y down; a sheet has x to the right, y up, z out of it.
//! Grey levels are linear in light.

use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};

use crate::family::{CELLS, cells};
use crate::grey::{GreyImage, GreyImageError};
use crate::target::{Tag, Target};

/// Rays of a pixel near a border, on the lattice of two Fibonacci numbers: no two are in one row or column, so that a border along
/// rows or columns also has 144 grey levels.
const RAYS: usize = 144;
const STRIDE: usize = 89;

/// Intervals of the table of quantiles.
const QUANTILES: usize = 1024;

/// Least and largest blur that is drawn, px.
const MIN_BLUR_PX: f64 = 1e-3;
const MAX_BLUR_PX: f64 = 20.0;

/// Steps of the fixed point from a pixel to its ray, and the change of a direction that ends it.
const MAX_STEPS: usize = 60;
const CONVERGED: f64 = 1e-12;

/// Grey levels of ink, paper and background: a print in the middle of the range.
const INK: f32 = 22.0;
const PAPER: f32 = 205.0;
const BACKGROUND: f32 = 110.0;

/// A camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// Pixels along a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Focal lengths, px.
    pub focal_px: [f64; 2],
    /// Principal point, px.
    pub centre_px: [f64; 2],
    /// k₁, k₂ of Brown's model.
    pub radial: [f64; 2],
    /// p₁, p₂ of Brown's model.
    pub tangential: [f64; 2],
    /// Standard deviation of the blur in addition to the pixel's area, px.
    pub blur_px: f64,
    /// Light lost at 45° from the principal point, as a part of that in the middle; elsewhere with the square of the tangent.
    pub vignetting: f64,
    /// Standard deviation of a pixel, grey levels.
    pub noise: f64,
}

impl Optics {
    /// A webcam of 1280 x 720 pixels, 71° across.
    pub fn webcam() -> Self {
        Self {
            width: 1280,
            height: 720,
            focal_px: [900.0, 902.0],
            centre_px: [644.0, 355.0],
            radial: [-0.12, 0.03],
            tangential: [6e-4, -4e-4],
            blur_px: 0.7,
            vignetting: 0.4,
            noise: 2.0,
        }
    }
}

/// A sheet with tags, in front of a background.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// Pose of the sheet in the frame of the camera.
    pub pose_camera_sheet: Pose<f64>,
    /// Half of its width and height, m.
    pub half_m: [f64; 2],
    /// Tags with their centres on it, m.
    pub tags: Vec<(Tag, [f64; 2])>,
}

impl Sheet {
    /// The calibration board with a margin as wide as the gap between its tags.
    pub fn board(target: &Target, pose_camera_board: Pose<f64>) -> Self {
        let tags: Vec<_> = target.board().map(|(tag, centre)| (tag, [centre.x, centre.y])).collect();
        let margin_m = tags.first().map_or(0.0, |(tag, _)| 2.0 * Target::margin_m(tag));
        let half_m = target.board_size_m().map(|side| side / 2.0 + margin_m);
        Self { pose_camera_sheet: pose_camera_board, half_m, tags }
    }

    /// A single tag with twice the margin that it needs.
    pub fn tag(tag: Tag, pose_camera_tag: Pose<f64>) -> Self {
        let half = tag.side_m / 2.0 + 2.0 * Target::margin_m(&tag);
        Self { pose_camera_sheet: pose_camera_tag, half_m: [half; 2], tags: vec![(tag, [0.0; 2])] }
    }
}

/// A rectangle or half-plane of one grey in the background, in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Its middle, as a direction (x, y, 1).
    pub middle: [f64; 2],
    /// Half of its sides, the same.
    pub half: [f64; 2],
    /// By how much it is turned, rad.
    pub angle_rad: f64,
    /// Its grey level.
    pub grey: f32,
}

/// What the camera sees.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// Sheets, of which the nearest along a ray is seen.
    pub sheets: Vec<Sheet>,
    /// Patches of the background, the last on top.
    pub patches: Vec<Patch>,
}

/// A tag with its middle on the sheet, m, and its cells.
type DrawnTag<'a> = (&'a Tag, [f64; 2], [[bool; CELLS]; CELLS]);

/// A sheet with what is computed once for all rays.
struct Plane<'a> {
    sheet: &'a Sheet,
    /// From a direction to homogeneous coordinates on the sheet; the last is one over the depth.
    on_sheet: Mat3<f64>,
    tags: Vec<DrawnTag<'a>>,
}

impl<'a> Plane<'a> {
    fn new(sheet: &'a Sheet) -> Option<Self> {
        let Pose { rotation, position } = sheet.pose_camera_sheet;
        let to_camera =
            Mat3::from_columns(&[rotation.column(0).into_owned(), rotation.column(1).into_owned(), position]);
        let tags = sheet.tags.iter().filter_map(|(tag, middle)| Some((tag, *middle, cells(tag.id)?)));
        Some(Self { sheet, on_sheet: to_camera.try_inverse()?, tags: tags.collect() })
    }

    /// Depth and grey level where a ray hits the sheet.
    fn hit(&self, direction: [f64; 2]) -> Option<(f64, f32)> {
        let at = self.on_sheet * Vec3::new(direction[0], direction[1], 1.0);
        let depth = 1.0 / at.z;
        let (x, y) = (at.x * depth, at.y * depth);
        if !(depth > 0.0 && x.abs() <= self.sheet.half_m[0] && y.abs() <= self.sheet.half_m[1]) {
            return None;
        }
        Some((depth, if self.is_ink(x, y) { INK } else { PAPER }))
    }

    fn is_ink(&self, x: f64, y: f64) -> bool {
        self.tags.iter().any(|(tag, middle, cells)| {
            let cell_m = tag.side_m / CELLS as f64;
            let column = ((x - middle[0] + tag.side_m / 2.0) / cell_m).floor();
            let row = ((middle[1] - y + tag.side_m / 2.0) / cell_m).floor();
            let inside = 0.0..CELLS as f64;
            inside.contains(&column) && inside.contains(&row) && !cells[row as usize][column as usize]
        })
    }
}

/// A camera with its rays.
pub struct Renderer {
    optics: Optics,
    /// Directions of the corners of all pixels, row by row, one more than pixels along each side.
    corners: Vec<[f64; 2]>,
    /// Quantiles of where a ray is from the middle of its pixel, px.
    quantiles: Vec<f64>,
}

impl Renderer {
    /// Computes the rays of a camera.
    pub fn new(optics: Optics) -> Self {
        let columns = optics.width + 1;
        let corner = |k: usize| ray(&optics, [(k % columns) as f64 - 0.5, (k / columns) as f64 - 0.5]);
        let corners = (0..columns * (optics.height + 1)).map(corner).collect();
        // The outer ones are finite.
        let part = |k: usize| (k as f64 / QUANTILES as f64).clamp(0.2 / QUANTILES as f64, 1.0 - 0.2 / QUANTILES as f64);
        let quantiles = (0..=QUANTILES).map(|k| across(part(k), optics.blur_px)).collect();
        Self { optics, corners, quantiles }
    }

    /// A picture of a scene in which nothing moves.
    ///
    /// # Errors
    ///
    /// The camera has no pixels, or too many.
    pub fn picture(&self, scene: &Scene, rng: &mut ChaCha8Rng) -> Result<GreyImage, GreyImageError> {
        self.picture_of_motion(std::slice::from_ref(scene), rng)
    }

    /// A picture during which each of the scenes was seen for the same part of the exposure.
    ///
    /// # Errors
    ///
    /// The camera has no pixels, or too many.
    pub fn picture_of_motion(&self, scenes: &[Scene], rng: &mut ChaCha8Rng) -> Result<GreyImage, GreyImageError> {
        self.exposed(&self.light(scenes), self.optics.noise, rng)
    }

    /// The light on each pixel, without noise, when each of the scenes is seen for the same part of the exposure; grey levels.
    pub fn light(&self, scenes: &[Scene]) -> Vec<f32> {
        let Optics { width, height, vignetting, centre_px, focal_px, .. } = self.optics;
        let mut light = vec![0.0f32; width * height];
        for scene in scenes {
            self.add_light(scene, 1.0 / scenes.len() as f32, &mut light);
        }
        for (k, light) in light.iter_mut().enumerate() {
            let x = ((k % width) as f64 - centre_px[0]) / focal_px[0];
            let y = ((k / width) as f64 - centre_px[1]) / focal_px[1];
            *light *= (1.0 - vignetting * (x * x + y * y)).max(0.0) as f32;
        }
        light
    }

    /// A picture of light, with a standard deviation of each pixel in grey levels.
    ///
    /// # Errors
    ///
    /// The camera has no pixels, or too many, or not as many as there are values of light.
    pub fn exposed(&self, light: &[f32], noise: f64, rng: &mut ChaCha8Rng) -> Result<GreyImage, GreyImageError> {
        // No noise where its deviation is not finite.
        let distribution = Normal::new(0.0, noise.abs() as f32).ok();
        let mut pixel = |light: &f32| {
            let noise = distribution.map_or(0.0, |noise| noise.sample(rng));
            (light + noise).round().clamp(0.0, 255.0) as u8
        };
        GreyImage::new(self.optics.width, self.optics.height, light.iter().map(&mut pixel).collect())
    }

    /// Adds the light of a scene, times `share`.
    fn add_light(&self, scene: &Scene, share: f32, light: &mut [f32]) {
        let planes: Vec<Plane> = scene.sheets.iter().filter_map(Plane::new).collect();
        let patches: Vec<TurnedPatch> = scene.patches.iter().map(TurnedPatch::new).collect();
        let grey = |direction| {
            let nearest = planes.iter().filter_map(|plane| plane.hit(direction)).min_by(|a, b| a.0.total_cmp(&b.0));
            nearest.map_or_else(|| background(&patches, direction), |(_, grey)| grey)
        };
        let columns = self.optics.width + 1;
        let at_corners: Vec<f32> = self.corners.iter().map(|corner| grey(*corner)).collect();
        let first = |k: usize| k / self.optics.width * columns + k % self.optics.width;
        let around = |first: usize| [first, first + 1, first + columns, first + columns + 1];
        let is_mixed = |k: usize| around(first(k)).iter().any(|corner| at_corners[*corner] != at_corners[first(k)]);
        let mixed: Vec<bool> = (0..light.len()).map(is_mixed).collect();
        let near = widened(&mixed, self.optics.width, self.optics.blur_px);
        for (k, light) in light.iter_mut().enumerate() {
            let own = first(k);
            let mean = match near[k] {
                true => self.mean(k, around(own).map(|corner| self.corners[corner]), grey),
                false => at_corners[own],
            };
            *light += share * mean;
        }
    }

    /// The mean of a function over the rays of pixel `k` between the directions of its four corners.
    ///
    /// Each pixel has the lattice of rays shifted by its own part of a period (the R2 sequence of M. Roberts): what the lattice is off
    /// by is then noise from pixel to pixel, and moves no edge.
    fn mean(&self, k: usize, [a, b, c, d]: [[f64; 2]; 4], grey: impl Fn([f64; 2]) -> f32) -> f32 {
        let shift = [0.754_877_666_246_693, 0.569_840_290_998_053].map(|part| (k as f64 * part).fract());
        let quantile = |part: f64| {
            let at = part * QUANTILES as f64;
            let below = (at as usize).min(QUANTILES - 1);
            let (low, high) = (self.quantiles[below], self.quantiles[below + 1]);
            low + (high - low) * (at - below as f64)
        };
        let ray = |ray: usize| {
            let part = |k: usize, axis: usize| ((k as f64 + 0.5) / RAYS as f64 + shift[axis]).fract();
            let (right, down) = (quantile(part(ray, 0)) + 0.5, quantile(part(ray * STRIDE % RAYS, 1)) + 0.5);
            let between = |axis: usize| {
                (a[axis] * (1.0 - right) + b[axis] * right) * (1.0 - down)
                    + (c[axis] * (1.0 - right) + d[axis] * right) * down
            };
            grey([between(0), between(1)])
        };
        (0..RAYS).map(ray).sum::<f32>() / RAYS as f32
    }
}

/// The quantile of a uniform distribution over a pixel plus a normal one, px: by halving, of its distribution function
/// σ (G((x + ½)/σ) − G((x − ½)/σ)) with G(z) = z Φ(z) + φ(z).
fn across(part: f64, deviation_px: f64) -> f64 {
    let deviation = deviation_px.clamp(MIN_BLUR_PX, MAX_BLUR_PX);
    let integral = |z: f64| {
        let density = (-z * z / 2.0).exp() / (2.0 * std::f64::consts::PI).sqrt();
        z * libm::erfc(-z / std::f64::consts::SQRT_2) / 2.0 + density
    };
    let below = |x: f64| deviation * (integral((x + 0.5) / deviation) - integral((x - 0.5) / deviation));
    let reach = 0.5 + 8.0 * deviation;
    let (mut low, mut high) = (-reach, reach);
    for _ in 0..50 {
        let middle = (low + high) / 2.0;
        if below(middle) < part { low = middle } else { high = middle }
    }
    (low + high) / 2.0
}

/// The pixels that are within sight of one that is set, by rows and then by columns.
fn widened(set: &[bool], width: usize, deviation_px: f64) -> Vec<bool> {
    let reach = (3.0 * deviation_px.clamp(MIN_BLUR_PX, MAX_BLUR_PX)).ceil() as usize;
    let mut rows = vec![false; set.len()];
    for (k, _) in set.iter().enumerate().filter(|(_, set)| **set) {
        let (start, column) = (k - k % width, k % width);
        rows[start + column.saturating_sub(reach)..=start + (column + reach).min(width - 1)].fill(true);
    }
    let mut both = vec![false; set.len()];
    for (k, _) in rows.iter().enumerate().filter(|(_, set)| **set) {
        let (row, column, last) = (k / width, k % width, set.len() / width - 1);
        (row.saturating_sub(reach)..=(row + reach).min(last)).for_each(|row| both[row * width + column] = true);
    }
    both
}

/// A patch with the sine and cosine of its angle, and its reach, squared.
struct TurnedPatch<'a> {
    patch: &'a Patch,
    sin_cos: (f64, f64),
    reach2: f64,
}

impl<'a> TurnedPatch<'a> {
    fn new(patch: &'a Patch) -> Self {
        let [width, height] = patch.half;
        Self { patch, sin_cos: patch.angle_rad.sin_cos(), reach2: width * width + height * height }
    }

    fn covers(&self, direction: [f64; 2]) -> bool {
        let Self { patch, sin_cos: (sin, cos), reach2 } = self;
        let (x, y) = (direction[0] - patch.middle[0], direction[1] - patch.middle[1]);
        x * x + y * y <= *reach2
            && (x * cos + y * sin).abs() <= patch.half[0]
            && (y * cos - x * sin).abs() <= patch.half[1]
    }
}

fn background(patches: &[TurnedPatch], direction: [f64; 2]) -> f32 {
    patches.iter().rev().find(|patch| patch.covers(direction)).map_or(BACKGROUND, |found| found.patch.grey)
}

/// The direction (x, y, 1) that is seen at a point of the picture: a fixed point, which converges for the lenses in use.
fn ray(optics: &Optics, at: [f64; 2]) -> [f64; 2] {
    let [k1, k2] = optics.radial;
    let [p1, p2] = optics.tangential;
    let seen = [0, 1].map(|axis| (at[axis] - optics.centre_px[axis]) / optics.focal_px[axis]);
    let [mut x, mut y] = seen;
    for _ in 0..MAX_STEPS {
        let r2 = x * x + y * y;
        let radial = 1.0 + k1 * r2 + k2 * r2 * r2;
        let shift = [2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y];
        let next = [(seen[0] - shift[0]) / radial, (seen[1] - shift[1]) / radial];
        let change = (next[0] - x).abs().max((next[1] - y).abs());
        [x, y] = next;
        if change < CONVERGED {
            break;
        }
    }
    [x, y]
}

#[cfg(test)]
mod tests {
    use darm_core::real::Vec3;
    use darm_core::se::Pose;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng as _;

    use super::{Optics, Renderer, Scene, Sheet};
    use crate::target::Tag;

    /// A tag of 80 mm at 0.4 m, seen with 500 px: 100 px wide, about the middle of the picture.
    #[test]
    fn a_tag_is_as_wide_as_its_distance_says() {
        let optics = Optics {
            width: 201,
            height: 201,
            focal_px: [500.0; 2],
            centre_px: [100.0; 2],
            radial: [0.0; 2],
            tangential: [0.0; 2],
            blur_px: 0.0,
            vignetting: 0.0,
            noise: 0.0,
        };
        let facing = Pose::new(&Vec3::new(std::f64::consts::PI, 0.0, 0.0), Vec3::new(0.0, 0.0, 0.4));
        let scene = Scene { sheets: vec![Sheet::tag(Tag { id: 3, side_m: 0.08 }, facing)], ..Scene::default() };
        let image = Renderer::new(optics).picture(&scene, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
        // The border is the outer cell: pixels 50.5 to 62.5 from the left are ink, those before are paper.
        let row: Vec<u8> = (45..60).map(|column| image.get(column, 100).unwrap()).collect();
        assert_eq!(row[..5], [205; 5]);
        assert_eq!(row[6..], [22; 9]);
        assert!((i32::from(row[5]) - 114).abs() <= 1, "half ink, half paper: {}", row[5]);
    }
}
