//! First guess of a calibration: focal lengths and principal point from homographies of a plane, then the poses of the plane.
//!
//! Each homography H = (h₁ h₂ h₃) of a view gives two equations for ω = K⁻ᵀ K⁻¹: h₁ᵀ ω h₂ = 0 and h₁ᵀ ω h₁ = h₂ᵀ ω h₂. Skew is
//! taken as zero, so ω has five entries up to scale.
//!
//! Source: Z. Zhang, IEEE PAMI 22 (2000) 1330.

use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;
use nalgebra::{SVector, SymmetricEigen, U5};

use crate::lens::Lens;

/// Focal length of the guess where views do not give one, in widths of the picture: that of most webcams, 53° across.
const USUAL_FOCAL: f64 = 1.0;

/// Focal lengths, in widths of the picture, outside of which the equations were misled, by distortion or by views that are all
/// alike.
const PLAUSIBLE: [f64; 2] = [0.3, 5.0];

/// A lens without distortion from homographies from the board, m, to pixels of a picture.
pub fn first_lens(homographies: &[Mat3<f64>], width: usize, height: usize) -> Option<Lens> {
    let (width, height) = (width as f64, height as f64);
    let to_unit = Mat3::new(1.0, 0.0, -width / 2.0, 0.0, 1.0, -height / 2.0, 0.0, 0.0, width);
    let solved = solve(homographies.iter().map(|h| to_unit * h)).filter(|[fx, fy, cx, cy]| {
        let plausible = PLAUSIBLE[0]..PLAUSIBLE[1];
        plausible.contains(fx) && plausible.contains(fy) && cx.abs() < 0.5 && cy.abs() < 0.5
    });
    let [fx, fy, cx, cy] = solved.unwrap_or([USUAL_FOCAL, USUAL_FOCAL, 0.0, 0.0]).map(|units| units * width);
    Lens::new(&SVector::from([fx, fy, cx + width / 2.0, cy + height / 2.0, 0.0, 0.0, 0.0, 0.0])).ok()
}

/// Focal lengths and principal point.
fn solve(homographies: impl Iterator<Item = Mat3<f64>>) -> Option<[f64; 4]> {
    let mut products = nalgebra::OMatrix::<f64, U5, U5>::zeros();
    for h in homographies {
        let h = h / h.norm();
        // The coefficients of ω₁₁, ω₂₂, ω₁₃, ω₂₃, ω₃₃ in hᵢᵀ ω hⱼ.
        let row = |i: usize, j: usize| {
            let (a, b) = (h.column(i), h.column(j));
            let cross = |k: usize| a[k] * b[2] + a[2] * b[k];
            SVector::<f64, 5>::from([a[0] * b[0], a[1] * b[1], cross(0), cross(1), a[2] * b[2]])
        };
        for row in [row(0, 1), row(0, 0) - row(1, 1)] {
            products += row * row.transpose();
        }
    }
    let eigen = SymmetricEigen::try_new(products, f64::EPSILON, 0)?;
    let [w11, w22, w13, w23, w33] = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned().into();
    let (cx, cy) = (-w13 / w11, -w23 / w22);
    let scale = w33 - w13 * w13 / w11 - w23 * w23 / w22;
    let focal = [(scale / w11).sqrt(), (scale / w22).sqrt(), cx, cy];
    focal.iter().all(|number| number.is_finite()).then_some(focal)
}

/// The pose of the board in the camera from its homography to directions; `None` behind the camera.
pub fn board_pose(to_directions: &Mat3<f64>) -> Option<Pose<f64>> {
    let [h1, h2, h3]: [Vec3<f64>; 3] = [0, 1, 2].map(|k| to_directions.column(k).into_owned());
    // In front of the camera z is positive.
    let scale = 2.0 / (h1.norm() + h2.norm()) * h3.z.signum();
    let (x, y) = (h1 * scale, h2 * scale);
    let svd = Mat3::from_columns(&[x, y, x.cross(&y)]).svd(true, true);
    let rotation = svd.u? * svd.v_t?;
    let pose = Pose { rotation, position: h3 * scale };
    (pose.position.z > 0.0 && rotation.determinant() > 0.0).then_some(pose)
}

#[cfg(test)]
mod tests {
    use darm_core::real::{Mat3, Vec3};
    use darm_core::se::Pose;

    use super::{board_pose, first_lens};

    fn homography(k: &Mat3<f64>, pose: &Pose<f64>) -> Mat3<f64> {
        let rotation = pose.rotation;
        k * Mat3::from_columns(&[rotation.column(0).into_owned(), rotation.column(1).into_owned(), pose.position])
    }

    #[test]
    fn views_without_noise_give_the_lens_and_their_poses() {
        let k = Mat3::new(900.0, 0.0, 600.0, 0.0, 910.0, 380.0, 0.0, 0.0, 1.0);
        let poses = [[3.0, 0.2, 0.1], [2.8, -0.3, 0.4], [3.1, 0.4, -0.5]]
            .map(|[x, y, z]| Pose::new(&Vec3::new(x, y, z), Vec3::new(0.05, -0.02, 0.6)));
        let homographies = poses.map(|pose| homography(&k, &pose));
        let lens = first_lens(&homographies, 1280, 720).unwrap();
        let [fx, fy, cx, cy, ..]: [f64; 8] = lens.parameters().into();
        assert!((Mat3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0) - k).abs().max() < 1e-6);
        let found = board_pose(&homography(&Mat3::identity(), &poses[0])).unwrap();
        assert!(found.distance(&poses[0], 1.0) < 1e-9);
    }

    #[test]
    fn views_that_give_no_lens_give_the_usual_one() {
        let lens = first_lens(&[Mat3::identity()], 1000, 500).unwrap();
        assert_eq!(lens.parameters()[0], 1000.0);
    }
}
