//! Rules of this workspace that a program can check.
#[test]
fn placeholder() {}
