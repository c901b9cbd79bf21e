//! Set-up of a machine, and the firmware's image: what the tests and the measurements begin with.

pub mod image;
pub mod setup;
pub mod step;
