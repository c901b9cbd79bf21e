//! Core of a control stack for discretely actuated arms: the same source on the chip and on the host.
//!
//! `no_std`, no heap, no panic on input. Modules, lowest first; imports run downward only:
//!
//! | module        | holds                                                                                     |
//! |---------------|-------------------------------------------------------------------------------------------|
//! | [`real`]      | the scalar of all kinematics, and its vectors                                             |
//! | [`trig`]      | sine, cosine, arc tangent and root, fast on the chip                                       |
//! | [`se`]        | rigid motions: poses, twists, wrenches                                                    |
//! | [`actuator`]  | one stage of an arm: platform with discrete legs, discrete joint, servo joint, link       |
//! | [`chain`]     | the stages of an arm: the pose of its tool, and how it moves with each parameter         |
//! | [`tree`]      | trees of joints on a fixed or floating base: where links stand, Jacobians                 |
//! | [`dynamics`]  | torques of a motion, mass matrix, gravity, centre of mass, regressor                      |
//! | [`ik`]        | joint positions that bring a tool to a pose                                               |
//! | [`nearest`]   | frame look-ups of modules, a beam search for a near word in bounded memory                |
//! | [`odometry`]  | differential drive: from wheel encoders to a pose and its covariance                      |
//! | [`effect`]    | the physical effects that move an arm off its ideal geometry: their names, values, equations |
//! | [`model`]     | geometry, masses and effects under one number: where the tool is under given conditions   |
//! | [`units`]     | what travels or is easily swapped: time, words, identities                                |
//! | [`output`]    | how coils, switches and servos are wired, and the limits that no sender can exceed         |
//! | [`duty`]      | how long current has flowed through each output                                            |
//! | [`profile`]   | what is wired to one board, and the limits that no table can exceed                        |
//! | [`table`]     | a program of timed rows, valid by construction                                            |
//! | [`sequencer`] | the state machine `step(now, seen) -> outputs` that runs a table                          |
//! | [`wire`]      | the protocol between host and board                                                       |
//!
//! SI units and radians; time in microseconds on the board's clock.
#![no_std]
#![forbid(unsafe_code)]

pub mod actuator;
#[cfg(test)]
mod arms;
pub mod chain;
pub mod duty;
pub mod dynamics;
pub mod effect;
pub mod ik;
pub mod model;
pub mod nearest;
pub mod odometry;
pub mod output;
pub mod profile;
pub mod real;
pub mod se;
pub mod sequencer;
pub mod table;
pub mod tree;
pub mod trig;
pub mod units;
pub mod wire;
