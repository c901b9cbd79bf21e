//! Host tools of discretely actuated arms.

pub mod arm;
pub mod plan;
pub mod reach;
pub mod stops;
pub mod synthesis;
