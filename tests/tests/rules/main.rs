//! Rules of the code and the texts that a program can check.

mod dialect;
mod imports;
mod tidy;
