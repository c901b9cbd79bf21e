//! Host tools of discretely actuated arms.

pub mod arm;
pub mod clock;
pub mod diagnose;
pub mod link;
pub mod measurement;
pub mod plant;
pub mod programme;
pub mod qemu;
