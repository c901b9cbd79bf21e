//! Boards: how they are reached, stopped and asked, and how a new arm is brought up.

pub mod bringup;
pub mod client;
pub mod clock;
pub mod link;
pub mod strokes;
