//! Host tools of discretely actuated arms: from an arm file to words on a board, and from measured poses back to the arm.

pub mod arm;
pub mod board_profile;
pub mod client;
pub mod clock;
pub mod dh;
pub mod diagnose;
pub mod draw;
pub mod grasp;
pub mod identify;
pub mod ik;
pub mod in_process;
pub mod link;
pub mod measurement;
pub mod migrate;
pub mod motion;
pub mod plan;
pub mod plant;
pub mod programme;
pub mod qemu;
pub mod reach;
pub mod report;
pub mod robot;
pub mod stops;
pub mod synthesis;
pub mod urdf;
pub mod wired_arm;
