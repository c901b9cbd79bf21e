//! Lens of a camera: from directions to pixels and back.
//!
//! # Model
//!
//! A direction (x, y, 1) in the frame of the camera (x to the right, y down, z forward) is seen at the pixel (u, v):
//!
//! ```text
//! r² = x² + y²,   s = 1 + k₁ r² + k₂ r⁴
//! u = f_x (x s + 2 p₁ x y + p₂ (r² + 2 x²)) + c_x
//! v = f_y (y s + p₁ (r² + 2 y²) + 2 p₂ x y) + c_y
//! ```
//!
//! | symbol   | field           | unit | meaning                                              |
//! |----------|-----------------|------|------------------------------------------------------|
//! | f_x, f_y | `focal_px`      | px   | focal length, along rows and columns                 |
//! | c_x, c_y | `centre_px`     | px   | principal point; (0, 0) is the centre of pixel 0, 0  |
//! | k₁, k₂   | `radial`        | 1    | radial distortion                                    |
//! | p₁, p₂   | `tangential`    | 1    | tangential distortion                                |
//!
//! Valid as far from the axis as the radius in the image grows with r: webcams and lenses up to about 90° across. It is
//! OpenCV's model with k₃ = 0: views of such lenses do not determine k₃ in addition to k₁ and k₂.
//! Source: D. C. Brown, Photogrammetric Engineering 37 (1971) 855.

use darm_core::real::{Vec2, Vec3};
use nalgebra::{Matrix2, Matrix2x3, SMatrix, SVector};

/// Number of the parameters of a lens.
pub const PARAMETERS: usize = 8;

/// Names of the parameters, in their order in vectors and covariances.
pub const NAMES: [&str; PARAMETERS] = ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"];

/// Steps of Newton's method from a pixel to its direction: within the model's validity three are usual.
const MAX_STEPS: usize = 20;

/// A direction is found when it is seen this close to its pixel, in focal lengths: 1e-6 px of a camera with 1 000 px.
const FOUND: f64 = 1e-9;

/// Focal length, principal point and distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    focal_px: [f64; 2],
    centre_px: [f64; 2],
    radial: [f64; 2],
    tangential: [f64; 2],
}

/// The numbers are no lens.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("parameter {name} of the lens is {value}, expected {expected}")]
pub struct LensError {
    /// The first parameter that is wrong.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// What it has to be.
    pub expected: &'static str,
}

/// A pixel with how it changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// Where it is seen, px.
    pub pixel: Vec2<f64>,
    /// Its derivative by the direction (x, y).
    pub by_direction: Matrix2<f64>,
    /// Its derivative by the parameters, in the order of [`NAMES`].
    pub by_lens: SMatrix<f64, 2, PARAMETERS>,
}

impl Lens {
    /// The lens with these parameters, in the order of [`NAMES`].
    ///
    /// # Errors
    ///
    /// A number is not finite, or a focal length is not positive.
    pub fn new(parameters: &SVector<f64, PARAMETERS>) -> Result<Self, LensError> {
        let named = || NAMES.iter().zip(parameters.iter());
        let wrong = |(name, value): (&&'static str, &f64), expected| LensError { name, value: *value, expected };
        if let Some(found) = named().find(|(_, value)| !value.is_finite()) {
            return Err(wrong(found, "a finite number"));
        }
        if let Some(found) = named().take(2).find(|(_, value)| **value <= 0.0) {
            return Err(wrong(found, "more than 0 px"));
        }
        let [fx, fy, cx, cy, k1, k2, p1, p2] = (*parameters).into();
        Ok(Self { focal_px: [fx, fy], centre_px: [cx, cy], radial: [k1, k2], tangential: [p1, p2] })
    }

    /// Its parameters, in the order of [`NAMES`].
    pub fn parameters(&self) -> SVector<f64, PARAMETERS> {
        let Self { focal_px: [fx, fy], centre_px: [cx, cy], radial: [k1, k2], tangential: [p1, p2] } = *self;
        SVector::from([fx, fy, cx, cy, k1, k2, p1, p2])
    }

    /// Where the direction (x, y, 1) is seen, with the derivatives.
    pub fn project(&self, direction: &Vec2<f64>) -> Projection {
        let (x, y) = (direction.x, direction.y);
        let Self { focal_px: [fx, fy], centre_px: [cx, cy], radial: [k1, k2], tangential: [p1, p2] } = *self;
        let r2 = x * x + y * y;
        let scale = 1.0 + r2 * (k1 + r2 * k2);
        let by_r2 = k1 + 2.0 * k2 * r2;
        let dx = x * scale + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
        let dy = y * scale + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
        let cross = 2.0 * (by_r2 * x * y + p1 * x + p2 * y);
        let by_direction = Matrix2::new(
            fx * (scale + 2.0 * by_r2 * x * x + 2.0 * p1 * y + 6.0 * p2 * x),
            fx * cross,
            fy * cross,
            fy * (scale + 2.0 * by_r2 * y * y + 6.0 * p1 * y + 2.0 * p2 * x),
        );
        let (u_by_p1, u_by_p2) = (2.0 * x * y, r2 + 2.0 * x * x);
        let (v_by_p1, v_by_p2) = (r2 + 2.0 * y * y, 2.0 * x * y);
        #[rustfmt::skip]
        let by_lens = SMatrix::from_row_slice(&[
            dx, 0.0, 1.0, 0.0, fx * x * r2, fx * x * r2 * r2, fx * u_by_p1, fx * u_by_p2,
            0.0, dy, 0.0, 1.0, fy * y * r2, fy * y * r2 * r2, fy * v_by_p1, fy * v_by_p2,
        ]);
        Projection { pixel: Vec2::new(fx * dx + cx, fy * dy + cy), by_direction, by_lens }
    }

    /// Where a point in front of the camera is seen, m; with the derivative by the point. `None` of a point that is not in front.
    pub fn project_point(&self, point: &Vec3<f64>) -> Option<(Projection, Matrix2x3<f64>)> {
        if point.z <= 0.0 || !point.z.is_finite() {
            return None;
        }
        let direction = Vec2::new(point.x, point.y) / point.z;
        let projection = self.project(&direction);
        let by_point = Matrix2x3::new(1.0, 0.0, -direction.x, 0.0, 1.0, -direction.y) / point.z;
        Some((projection, projection.by_direction * by_point))
    }

    /// The direction (x, y, 1) that is seen at a pixel, by Newton's method; `None` where the model has none.
    pub fn direction(&self, pixel: &Vec2<f64>) -> Option<Vec2<f64>> {
        let Self { focal_px: [fx, fy], centre_px: [cx, cy], .. } = *self;
        let mut direction = Vec2::new((pixel.x - cx) / fx, (pixel.y - cy) / fy);
        for _ in 0..MAX_STEPS {
            let Projection { pixel: seen, by_direction, .. } = self.project(&direction);
            let error = seen - pixel;
            // Beyond the radius where the image folds back the determinant is negative: another branch of the model.
            if by_direction.determinant() <= 0.0 {
                return None;
            }
            if (error.x / fx).abs().max((error.y / fy).abs()) < FOUND {
                return Some(direction);
            }
            direction -= by_direction.try_inverse()? * error;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use darm_core::real::Vec2;
    use nalgebra::SVector;
    use proptest::prelude::{ProptestConfig, prop_assert, proptest};

    use super::Lens;

    fn webcam() -> Lens {
        Lens::new(&SVector::from([900.0, 905.0, 640.0, 350.0, -0.25, 0.08, 1e-3, -5e-4])).unwrap()
    }

    #[test]
    fn a_focal_length_is_positive() {
        let mut parameters = webcam().parameters();
        parameters[1] = -1.0;
        assert_eq!(Lens::new(&parameters).unwrap_err().name, "fy");
        parameters[4] = f64::NAN;
        assert_eq!(Lens::new(&parameters).unwrap_err().name, "k1");
    }

    #[test]
    fn no_direction_beyond_the_fold_of_the_model() {
        assert_eq!(webcam().direction(&Vec2::new(1e5, 1e5)), None);
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]

        #[test]
        fn a_direction_is_found_from_its_pixel(x in -0.7f64..0.7, y in -0.4f64..0.4) {
            let direction = Vec2::new(x, y);
            let found = webcam().direction(&webcam().project(&direction).pixel).unwrap();
            prop_assert!((found - direction).norm() < 1e-8);
        }

        /// Central differences with steps of 1e-6: their error is about 1e-10 of the value.
        #[test]
        fn derivatives_are_those_of_differences(x in -0.7f64..0.7, y in -0.4f64..0.4) {
            let (direction, parameters, step) = (Vec2::new(x, y), webcam().parameters(), 1e-6);
            let projection = webcam().project(&direction);
            for axis in 0..2 {
                let mut moved = Vec2::zeros();
                moved[axis] = step;
                let change = webcam().project(&(direction + moved)).pixel - webcam().project(&(direction - moved)).pixel;
                prop_assert!((change / (2.0 * step) - projection.by_direction.column(axis)).norm() < 1e-4);
            }
            for k in 0..8 {
                let seen = |sign: f64| {
                    let mut parameters = parameters;
                    parameters[k] += sign * step;
                    Lens::new(&parameters).unwrap().project(&direction).pixel
                };
                let change = (seen(1.0) - seen(-1.0)) / (2.0 * step);
                prop_assert!((change - projection.by_lens.column(k)).norm() < 1e-4);
            }
        }
    }
}
