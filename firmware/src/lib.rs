//! Firmware of discretely actuated arms: everything that has no chip in it.
#![cfg_attr(not(test), no_std)]

#[cfg(feature = "chip")]
pub mod board;
pub mod pipe;
pub mod solenoid;
pub mod store;
