//! Models: how they are synthesised.

use super::{Home, example, text};

#[test]
fn a_synthesis_keeps_a_least_stroke_and_names_equal_stops() {
    let home = Home::new();
    let (arm, frames) = (example("planar4.toml"), example("planar4-frames.toml"));
    home.succeeds(&format!("synth {arm} {frames} -o paper.toml --method paper"));
    let few = home.darm(&format!("synth {arm} {frames} -o few.toml --method paper --steps 5"));
    assert!(text(&few.stderr).contains("met are 1e-5 m and 1e-5 rad"), "{}", text(&few.stderr));
    let text_of = std::fs::read_to_string(&arm).unwrap();
    home.write("dead.toml", &text_of.replacen("length_m = [1.0, 1.25]", "length_m = [1.0, 1.0]", 1));
    home.write(
        "one.toml",
        "format = 1\n[[frame]]\nword = \"000,000,000,000\"\npose = { position_m = [0.0, 4.0], angle_deg = 0.0 }\n",
    );
    let kept = home.darm("synth dead.toml one.toml -o kept.toml");
    assert!(kept.status.success() && !text(&kept.stderr).contains("warning"), "{}", text(&kept.stderr));
    let dead = home.darm("synth dead.toml one.toml -o still.toml --least-stroke 0");
    let warning = "warning: actuator 0 (module 1, left leg) has equal stops: it does not move; increase --least-stroke";
    assert!(text(&dead.stderr).contains(warning), "{}", text(&dead.stderr));
}
