//! Set-up of a machine, and the firmware's image: what the tests and the measurements begin with. What is published.

pub mod image;
pub mod package;
pub mod setup;
pub mod shipped;
pub mod step;
