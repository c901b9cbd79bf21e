//! The methods of the papers that the command line and the evaluation repeat: hands, identification, motion mapping, MEMR,
//! and the examples of the synthesis.

pub mod convergence;
mod convex_hull;
pub mod grasp;
pub mod identify;
pub mod lecture;
pub mod memr;
pub mod motion;
pub mod synthesis;
