//! Whole-system deterministic simulation: the real client, a lossy line, the firmware's library on fake pins, a simulated
//! arm and a hostile sender, on one virtual clock and one seed, with two judges that share no code with what they judge.
//!
//! See `docs/simulation.md`.

pub mod answers;
pub mod arm;
pub mod host;
pub mod hostile;
pub mod judge;
pub mod markdown;
pub mod mutants;
pub mod panics;
pub mod run;
pub mod script;
pub mod second_acts;
pub mod second_host;
pub mod seeds;
pub mod shrink;
pub mod summary;
pub mod trace;
pub mod words;
pub mod world;
