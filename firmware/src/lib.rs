//! Firmware of discretely actuated arms: everything that has no chip in it.
#![cfg_attr(not(test), no_std)]
#![cfg_attr(not(test), deny(clippy::indexing_slicing, clippy::arithmetic_side_effects, clippy::unwrap_used))]

pub mod app;
#[cfg(feature = "chip")]
#[allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    reason = "addresses and registers; what of it can panic in the image is checked there"
)]
pub mod board;
pub mod clock;
pub mod control;
pub mod dispatch;
pub mod ecc;
pub mod life;
pub mod log;
pub mod nearest;
pub mod pipe;
pub mod port;
pub mod rescue;
pub mod ring;
mod scan;
pub mod servo;
pub mod solenoid;
pub mod store;
pub mod text;

#[cfg(test)]
mod tests;
