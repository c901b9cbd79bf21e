//! Firmware of discretely actuated arms: everything that has no chip in it.
#![no_std]
