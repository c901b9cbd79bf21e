//! Recordings as other programs write them: dialects, golden files, damaged files.

mod dialects;
mod golden;
mod hostile;
