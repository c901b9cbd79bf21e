//! Inverse kinematics by a method of choice, with the error before every step, so that methods can be compared.
//!
//! Take [`Method::LevenbergMarquardt`]; the others are there to be learned from. [`configurations`] gives all
//! postures that reach a target, [`search`] holds the searches by populations of points, `memr` of `darm-papers` the tables that
//! they are known from.
//!
//! [`Robot::inverse`](crate::robot::Robot::inverse) fails of no target: its status says how the search ended, and its
//! positions are the nearest found.
//!
//! ```
//! use darm_core::{real::Vec3, se::Pose};
//! use darm_robot::ik::{Method, Options, Status};
//! use darm_robot::robot::planar::planar_arm;
//! let (arm, tip) = planar_arm(&[0.5, 0.3], &[[-3.0, 3.0]; 2]);
//! let (target, options) = (Pose::at(Vec3::new(0.5, 0.3, 0.0)), Options { orientation_rad: f64::INFINITY, ..Options::default() });
//! let slow = arm.inverse(Method::Transpose, &tip, &target, &[0.1, 0.2], &Options { steps: 500, ..options });
//! let fast = arm.inverse(Method::LevenbergMarquardt, &tip, &target, &[0.1, 0.2], &options);
//! assert_eq!((slow.unwrap().status, fast.unwrap().status), (Status::Reached, Status::Reached));
//! ```

pub mod arm;
pub mod configurations;
pub mod method;
mod nearest;
pub mod objective;
pub mod search;
mod step;
pub mod trials;

pub use darm_core::ik::{Options, Status};
pub use method::{Method, Residual};
