//! The Puma 560 by its published table and masses: an arm of six joints to try things on.
//!
//! ```
//! use darm_core::dynamics::inverse_dynamics;
//! use darm_core::tree::puma560::{self, SAMPLE};
//! let (arm, tool) = puma560::arm::<f64>().unwrap();
//! assert!((arm.pose(&tool, &SAMPLE.q).position - SAMPLE.tool()).norm() < 1e-11);
//! let torques = inverse_dynamics(&arm, &SAMPLE.q, &SAMPLE.qd, &SAMPLE.qdd, None);
//! assert!(torques.iter().zip(&SAMPLE.torque).all(|(ours, theirs)| (ours - theirs).abs() < 1e-9));
//! ```
//!
//! Source: B. Armstrong, O. Khatib, J. Burdick, The explicit dynamic model and inertial parameters of the PUMA 560 arm,
//! ICRA 1986, as the Robotics Toolbox has them. The motors' own inertia and friction are not in them.

use super::dh::{Row, standard};
use super::{Inertia, LinkFrame, Tree, TreeError};
use crate::actuator::JointKind;
use crate::real::{Mat3, Real, Vec3, real};

const DEG: f64 = core::f64::consts::PI / 180.0;
/// Lowest and highest position of each joint, rad.
pub const LIMITS_RAD: [[f64; 2]; 6] = [
    [-160.0 * DEG, 160.0 * DEG],
    [-45.0 * DEG, 225.0 * DEG],
    [-225.0 * DEG, 45.0 * DEG],
    [-110.0 * DEG, 170.0 * DEG],
    [-100.0 * DEG, 100.0 * DEG],
    [-266.0 * DEG, 266.0 * DEG],
];

const QUARTER: f64 = core::f64::consts::FRAC_PI_2;
/// d, a (m) and α (rad) of each row of the standard table.
const TABLE: [[f64; 3]; 6] = [
    [0.67183, 0.0, QUARTER],
    [0.0, 0.4318, 0.0],
    [0.15005, 0.0203, -QUARTER],
    [0.4318, 0.0, QUARTER],
    [0.0, 0.0, -QUARTER],
    [0.0, 0.0, 0.0],
];
/// Mass (kg), centre of mass (m), moments of inertia about it (I_xx, I_yy, I_zz, kg·m²), in the frame of the row.
const LINKS: [[f64; 7]; 6] = [
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.35, 0.0],
    [17.4, -0.3638, 0.006, 0.2275, 0.13, 0.524, 0.539],
    [4.8, -0.0203, -0.0141, 0.07, 0.066, 0.086, 0.0125],
    [0.82, 0.0, 0.019, 0.0, 0.0018, 0.0013, 0.0018],
    [0.34, 0.0, 0.0, 0.0, 0.0003, 0.0004, 0.0003],
    [0.09, 0.0, 0.0, 0.032, 0.00015, 0.00015, 0.00004],
];

/// A motion of the arm and what belongs to it, by Pinocchio 4.1.0: the same numbers for the host and the chip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Positions, rad.
    pub q: [f64; 6],
    /// Velocities, rad/s.
    pub qd: [f64; 6],
    /// Accelerations, rad/s².
    pub qdd: [f64; 6],
    /// Position of the tool in the base, m.
    pub tool_m: [f64; 3],
    /// Torques of the motion, N·m.
    pub torque: [f64; 6],
}

/// One motion.
pub const SAMPLE: Sample = Sample {
    q: [
        -0.137_824_680_194,
        -0.739_714_949_519,
        -1.469_622_289_36,
        -1.203_235_939_688,
        -1.113_500_492_61,
        0.578_449_274_093,
    ],
    qd: [
        0.131_050_907_307,
        0.375_543_438_234,
        1.819_063_896_503,
        1.964_176_071_082,
        -0.693_323_770_813,
        -1.189_518_669_128,
    ],
    qdd: [
        -2.112_184_963_96,
        2.298_417_056_772,
        1.152_372_707_182,
        -4.014_914_090_461,
        2.723_575_508_38,
        4.229_016_290_623,
    ],
    tool_m: [0.626_762_338_803, -0.238_420_991_719, 0.107_099_801_135],
    torque: [
        -5.466_905_110_841,
        41.266_900_101_885,
        8.822_441_088_356,
        -0.029_829_290_373,
        -0.012_971_142_097,
        0.000_174_972_18,
    ],
};

/// What the tool's position may be off in `f32`, m: a dozen roundings of the reach.
pub const NEAR_M: f64 = 2e-6;
/// What the torques may be off in `f32`, N·m: as many of the largest term, 60 N·m, and each term has several factors.
pub const NEAR_NM: f64 = 5e-5;

impl Sample {
    /// Position of the tool in the base, m.
    pub fn tool(&self) -> Vec3<f64> {
        Vec3::from(self.tool_m)
    }
}

/// The arm with z up, and its tool: the frame of the last row.
///
/// # Errors
///
/// As [`standard`]; six joints are not too many.
pub fn arm<T: Real>() -> Result<(Tree<T, 6>, LinkFrame<T>), TreeError> {
    let mut links = LINKS.iter();
    let rows = TABLE.map(|[d, a, alpha]| {
        let [mass, x, y, z, xx, yy, zz] = links.next().copied().unwrap_or_default();
        Row {
            kind: JointKind::Revolute,
            theta_rad: T::zero(),
            d_m: real(d),
            a_m: real(a),
            alpha_rad: real(alpha),
            inertia: Inertia {
                mass: real(mass),
                com: Vec3::new(real(x), real(y), real(z)),
                about_com: Mat3::from_diagonal(&Vec3::new(real(xx), real(yy), real(zz))),
            },
        }
    });
    let (tree, far_end) = standard(&rows, Vec3::new(T::zero(), T::zero(), real(-9.81)))?;
    let tool = tree.frame(5, &far_end);
    Ok((tree, tool))
}
