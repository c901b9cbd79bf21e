//! Host tools of discretely actuated arms.

pub mod arm;
pub mod client;
pub mod clock;
pub mod link;
pub mod measurement;
pub mod plan;
pub mod plant;
pub mod qemu;
pub mod synthesis;
