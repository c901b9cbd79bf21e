//! The diagnosis as a caller sees it: true arms drawn by seed, files in and out.

mod diagnosis;
mod files;
