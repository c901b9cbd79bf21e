//! Boards: how they are reached, stopped and asked, the emulator with a simulated arm on its pins, and the firmware in a process.

pub mod bringup;
pub mod client;
pub mod clock;
pub mod follow;
pub mod in_process;
pub mod link;
pub mod pico;
pub mod plant;
pub mod qemu;
pub mod strokes;
