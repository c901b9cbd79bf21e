//! Bounds hold, and what they prevent is named.

use super::*;

#[test]
fn legs_stay_physical() {
    let arm = planar4();
    let options = Options { starts: 64, ..Options::default() };
    for seed in 0..20 {
        let found = synthesize(&arm, &moved(own_frames(&arm, &WORDS), 0.3, seed), &options).unwrap();
        let length = |actuator, state| found.arm.model.chain.get(Parameter::Stop { actuator, state }).unwrap();
        for actuator in 0..12 {
            let (short, long) = (length(actuator, 0), length(actuator, 1));
            assert!(short >= 0.5 - 1e-9 && long >= short, "seed {seed}: {short} {long}");
        }
        Arm::parse(Path::new("synthesised.toml"), &found.arm.to_toml()).unwrap();
    }
}

#[test]
fn what_is_out_of_reach_gives_the_nearest() {
    let arm = planar4();
    let mut desired = own_frames(&arm, &WORDS);
    desired[2].pose_base_tool.position.x += 40.0;
    let found = synthesize(&arm, &desired, &Options { starts: 2, ..Options::default() }).unwrap();
    assert!(found.status == Status::Closest && found.kept);
    assert!(found.frames.iter().all(|frame| frame.error_m.is_finite() && frame.error_rad.is_finite()));
    assert!(found.error_m2() < 40f64.powi(2));
    assert!(found.obstacle.is_some());
}

#[test]
fn bounds_of_single_actuators_hold() {
    let arm = planar4();
    let desired = moved(own_frames(&arm, &WORDS), 0.05, 5);
    let free = synthesize(&arm, &desired[..3], &Options::default()).unwrap();
    let stop = Parameter::Stop { actuator: 4, state: 1 };
    let most = free.arm.model.chain.get(stop).unwrap() - 0.01;
    let range = StopRange { value: (0.5, most), stroke: (0.1, 0.9), ..StopRange::any(4) };
    let options = Options { ranges: vec![range], ..Options::default() };
    let found = synthesize(&arm, &desired[..3], &options).unwrap();
    assert!(found.status == Status::Reached && found.kept);
    assert!(found.arm.model.chain.get(stop).unwrap() <= most + 1e-9);
    assert!(found.alteration_m > free.alteration_m);
}

#[test]
fn the_bounds_that_keep_the_arm_from_the_frames_are_named() {
    let arm = planar4();
    let desired = moved(own_frames(&arm, &WORDS), 0.3, 5);
    let bounds = Bounds { shortest: 1.0, longest: 1.0, ..Bounds::default() };
    let found = synthesize(&arm, &desired, &Options { starts: 1, bounds, ..Options::default() }).unwrap();
    let Some(Infeasibility::Bounds(held)) = &found.obstacle else { panic!("{:?}", found.obstacle) };
    assert!(held.iter().all(|name| name.starts_with("module ")), "{held:?}");
    let met = synthesize(&arm, &own_frames(&arm, &WORDS), &Options::default()).unwrap();
    assert_eq!(met.obstacle, None);
}

/// Five words that leave actuators idle: without a stroke to keep, some search ends with equal stops.
#[test]
fn a_least_stroke_is_kept() {
    let arm = planar4();
    let mut dead = 0;
    let options = Options { starts: 8, ..Options::default() };
    for seed in 0..20 {
        let desired = moved(own_frames(&arm, &WORDS), 0.3, seed);
        let found = synthesize(&arm, &desired, &options).unwrap();
        dead += equal_stops(&found.arm).len();
        let ranges = min_strokes(&arm, &desired, &[], MinStroke::of_all(5e-3));
        let found = synthesize(&arm, &desired, &Options { ranges, ..options.clone() }).unwrap();
        assert_eq!(equal_stops(&found.arm), [0; 0], "seed {seed}");
    }
    assert!(dead > 0, "no case has equal stops");
}
