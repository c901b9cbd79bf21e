//! Core of a control stack for discretely actuated arms.
#![no_std]
#![forbid(unsafe_code)]
