//! Bench experiments on the state machine.
