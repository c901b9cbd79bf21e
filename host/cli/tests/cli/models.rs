//! Models: how they are synthesised.

use super::{Home, example, text};

#[test]
fn the_papers_method_is_judged_by_its_own_accuracy() {
    let home = Home::new();
    let (arm, frames) = (example("planar4.toml"), example("planar4-frames.toml"));
    home.succeeds(&format!("synth {arm} {frames} -o paper.toml --method paper"));
    let few = home.darm(&format!("synth {arm} {frames} -o few.toml --method paper --steps 5"));
    assert!(text(&few.stderr).contains("met are 1e-5 m and 1e-5 rad"), "{}", text(&few.stderr));
}
