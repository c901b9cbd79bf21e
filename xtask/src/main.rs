//! Set-up, demo, tests and measurements of the workspace.
fn main() {}
