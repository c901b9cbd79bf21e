//! In place of a board: emulators of its chip, the firmware in this process, and a simulated arm on its pins.
//!
//! ```text
//!  qemu, pico   the image of a board in an emulator, in real time ─┐
//!  in_process   the firmware's library in virtual time ────────────┴─► follow, plant: coils, actuators, switches, servos
//! ```

pub mod follow;
pub mod in_process;
pub mod pico;
pub mod plant;
pub mod qemu;
