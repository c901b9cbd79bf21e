//! Rules of the code and the texts that a program can check.
//!
//! A separate package without the product below it: after a change of the core it need not be built to check a rule.

mod dialect;
mod imports;
mod tidy;
