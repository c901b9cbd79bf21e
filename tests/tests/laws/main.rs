//! Laws that hold whatever the numbers are, and numbers that other programs computed.

mod documented;
mod dynamics_golden;
mod dynamics_laws;
mod identities;
