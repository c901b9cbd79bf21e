//! Firmware of discretely actuated arms: everything that has no chip in it.
#![cfg_attr(not(test), no_std)]
#![cfg_attr(not(test), deny(clippy::indexing_slicing, clippy::arithmetic_side_effects, clippy::unwrap_used))]

pub mod app;
pub mod clock;
pub mod control;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod cortex;
pub mod crash;
pub mod dispatch;
pub mod hardware;
mod inputs;
pub mod kept;
pub mod life;
pub mod load;
pub mod log;
pub mod pipe;
pub mod port;
pub mod rescue;
pub mod ring;
mod scan;
pub mod servo;
pub mod solenoid;
pub mod sparse_flash;
pub mod stack;
pub mod store;
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod systick;
pub mod text;
pub mod tick;
mod wear;

#[cfg(test)]
mod tests;
