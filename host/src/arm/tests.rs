//! Round trips of the arm file, and what it says to files that are wrong.

use std::path::Path;

use super::*;

fn example(name: &str) -> Arm {
    Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples").join(name)).unwrap()
}

#[test]
fn what_is_written_reads_as_it_was() {
    for name in ["planar4.toml", "planar4-hybrid.toml"] {
        let arm = example(name);
        let again = Arm::parse(Path::new(name), &arm.to_toml()).unwrap();
        assert_eq!(again, arm);
        assert_eq!(again.hash(), arm.hash());
    }
}
