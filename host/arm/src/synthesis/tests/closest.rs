//! Frames that cannot be met together: the closest geometry, beside another program and by its own law.

use super::*;

/// One planar module with legs of two states, m: left, diagonal, right.
fn one_module(half_m: f64, leg_m: [f64; 2], diagonal_m: [f64; 2]) -> Arm {
    let leg = |base: f64, top: f64, length_m: [f64; 2]| {
        format!("[[stage.leg]]\nbase_m = [{base:?}, 0]\ntop_m = [{top:?}, 0]\nlength_m = {length_m:?}\n")
    };
    let text = format!(
        "format = 2\nname = \"one module\"\nlength_scale_m = 0.5\n[tool]\npose = {{ position_m = [0.0, 0.0] }}\n[[stage]]\nkind = \
         \"planar-platform\"\nhome = {{ position_m = [0.0, {:?}], angle_deg = 0.0 }}\n{}{}{}",
        leg_m[0],
        leg(-half_m, -half_m, leg_m),
        leg(-half_m, half_m, diagonal_m),
        leg(half_m, half_m, leg_m)
    );
    Arm::parse(Path::new("one.toml"), &text).unwrap()
}

fn frames(arm: &Arm, desired: &[(&str, [f64; 3])]) -> Vec<DesiredFrame> {
    let words: Vec<&str> = desired.iter().map(|(word, _)| *word).collect();
    let at = |(frame, (_, [x, y, deg])): (DesiredFrame, &(&str, [f64; 3]))| DesiredFrame {
        pose_base_tool: Pose2 { angle_rad: deg.to_radians(), position: [*x, *y].into() }.into(),
        ..frame
    };
    own_frames(arm, &words).into_iter().zip(desired).map(at).collect()
}

/// Least sums of squares by `scipy.optimize.least_squares` from 14 starts each, strokes and lengths within the default bounds.
#[test]
fn no_other_program_finds_a_closer_geometry() {
    let two = one_module(
        0.18095064444724457,
        [0.6396355872647228, 0.7675627047176673],
        [0.734919197870745, 0.881903037444894],
    );
    let two_frames = [
        ("110", [0.4353103283275085, 0.5034146577010314, -8.649990601401926]),
        ("111", [-0.04036328038017192, 0.6475078388347524, -3.85778288483983]),
    ];
    let three =
        one_module(0.366345591203895, [1.15405177375832, 1.384862128509984], [1.366993732718936, 1.6403924792627234]);
    let three_frames = [
        ("111", [0.02262310733236822, 1.2364997688717845, -10.71787082317507]),
        ("000", [0.11962969445770533, 1.2746179239923308, 16.108623319274876]),
        ("100", [-0.214093821464039, 1.114205602628276, -13.420097945727537]),
    ];
    let cases = [(two, &two_frames[..], 0.19542992810993448), (three, &three_frames[..], 0.3123110516297619)];
    for (arm, desired, least) in cases {
        let bounds = Bounds { stroke: 5e-3, ..Bounds::default() };
        let found = synthesize(&arm, &frames(&arm, desired), &Options { bounds, ..Options::default() }).unwrap();
        assert!((found.error_m2().sqrt() - least).abs() < 1e-9, "{} {least}", found.error_m2().sqrt());
    }
}

#[test]
fn no_small_change_brings_the_closest_geometry_nearer() {
    let arm = planar4();
    let mut words = WORDS.to_vec();
    words.push("111111000000");
    let desired = moved(own_frames(&arm, &words), 0.05, 3);
    let found = synthesize(&arm, &desired, &Options { bounds: Bounds::none(), ..Options::default() }).unwrap();
    assert_eq!(found.status, Status::Closest);
    for stop in stops(&arm) {
        for change in [-1e-4, 1e-4] {
            let mut other = found.arm.clone();
            let value = other.model.chain.get(stop).unwrap() + change;
            other.model.chain.set(stop, value).unwrap();
            let poses = own_frames(&other, &words);
            let other_m2: f64 = poses
                .iter()
                .zip(&desired)
                .map(|(pose, desired)| {
                    pose.pose_base_tool.distance(&desired.pose_base_tool, arm.length_scale_m).powi(2)
                })
                .sum();
            assert!(other_m2 > found.error_m2() - 1e-12, "{stop:?} {change}: {other_m2} {}", found.error_m2());
        }
    }
}

/// Frames of a random arm moved out. Where every word needs a pose, the nearest arms lie along the edge of what can be assembled:
/// `scipy.optimize.minimize` by SLSQP finds 3.0074 m from 12 starts, with the same bounds and a margin of 0.02 m from that edge.
#[test]
fn no_other_program_finds_a_closer_geometry_with_a_pose_for_every_word() {
    let arm = planar4();
    let desired = [
        ("111010111010", [4.414112930669665, 10.69717168212194, 2.544443745170814e-14]),
        ("110101000011", [3.8978871147226033, 10.81646863049973, -3.1805546814635168e-15]),
        ("111011001101", [-2.1555253429386347, 10.97105811751038, 30.11731132682025]),
    ];
    let bounds = Bounds { stroke: 5e-3, ..Bounds::default() };
    let found = synthesize(&arm, &frames(&arm, &desired), &Options { bounds, ..Options::default() }).unwrap();
    assert!(found.error_m2().sqrt() < 3.0075, "{}", found.error_m2().sqrt());
    assert!(crate::synthesis::assembly::without_pose(&found.arm).is_empty());
}
