//! What the command line shares with the evaluation: reports as HTML.

pub mod report;
