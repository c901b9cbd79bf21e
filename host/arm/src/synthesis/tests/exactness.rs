//! Frames within reach are met exactly, by the least alteration.

use super::*;

#[test]
fn frames_of_the_arm_itself_change_nothing() {
    let arm = planar4();
    let found = synthesize(&arm, &own_frames(&arm, &WORDS), &Options::default()).unwrap();
    assert_eq!(found.status, Status::Reached);
    assert!(found.alteration_m < 1e-12, "{}", found.alteration_m);
}

#[test]
fn two_hundred_draws_are_all_exact() {
    let arm = planar4();
    let mut worst: f64 = 0.0;
    for seed in 0..200 {
        let desired = moved(own_frames(&arm, &WORDS), 0.1, seed);
        let found = synthesize(&arm, &desired, &Options::default()).unwrap();
        assert_eq!(found.status, Status::Reached, "seed {seed}");
        assert_eq!(found.case.kind, CaseKind::Sufficient, "seed {seed}");
        worst = found.frames.iter().fold(worst, |worst, frame| worst.max(frame.error_m).max(frame.error_rad));
    }
    assert!(worst < 1e-13, "{worst}");
}

#[test]
fn moving_base_and_frames_together_changes_nothing() {
    let arm = planar4();
    let desired = moved(own_frames(&arm, &WORDS), 0.1, 7);
    let by = Pose::from(Pose2::new(0.7, -0.3, 1.1));
    let mut elsewhere = arm.clone();
    elsewhere.model.chain.mount = by * arm.model.chain.mount;
    let carried: Vec<_> = desired
        .iter()
        .map(|frame| DesiredFrame { pose_base_tool: by * frame.pose_base_tool, ..frame.clone() })
        .collect();
    let here = synthesize(&arm, &desired, &Options::default()).unwrap();
    let there = synthesize(&elsewhere, &carried, &Options::default()).unwrap();
    for stop in stops(&arm) {
        let (here, there) = (here.arm.model.chain.get(stop).unwrap(), there.arm.model.chain.get(stop).unwrap());
        assert!((here - there).abs() < 1e-12, "{stop:?}: {here} {there}");
    }
}

#[test]
fn fewer_frames_alter_less_and_more_are_met_as_well_as_can_be() {
    let arm = planar4();
    let mut words = WORDS.to_vec();
    words.push("111111000000");
    let desired = moved(own_frames(&arm, &words), 0.05, 3);
    let [few, all, many] = [3, 5, 6].map(|count| synthesize(&arm, &desired[..count], &Options::default()).unwrap());
    assert_eq!(few.case.rank, 9);
    assert_eq!((all.case.kind, all.case.rank, all.case.max_rank), (CaseKind::Sufficient, 15, 15));
    assert_eq!((many.case.kind, many.case.equations), (CaseKind::Insufficient, 18));
    assert_eq!([few.status, all.status, many.status], [Status::Reached, Status::Reached, Status::Closest]);
    assert!(few.alteration_m < all.alteration_m);
    let misses: f64 = many.frames.iter().map(|frame| frame.error_m.powi(2)).sum();
    let before: f64 = many.frames.iter().map(|frame| frame.error_before_m.powi(2)).sum();
    assert!(misses < 0.25 * before, "{misses} {before}");
}

#[test]
fn effects_and_servos_are_taken_into_account() {
    let mut arm = example("planar4-hybrid.toml");
    let effects: [Effect<f64>; 3] = [
        Effect::StrokeLoss { actuator: 4, state: 1, loss_m: 5e-3 },
        Effect::GravitySag { at: Place::Arm, compliance_m_per_n: 2e-5 },
        Effect::Play { at: Place::Arm, width_m: 2e-3 },
    ];
    arm.model.effects.extend(effects);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let desired = frames::read(&folder.join("planar4-frames.toml"), &arm).unwrap();
    let found = synthesize(&arm, &desired, &Options::default()).unwrap();
    assert_eq!(found.status, Status::Reached);
    for reached in &found.frames {
        let frame = &reached.frame;
        let condition = found.arm.model.working(frame.word, frame.previous, &frame.servos_rad);
        let pose = found.arm.model.predict(&condition, &mut ArmScratch::default()).unwrap();
        assert!(pose.distance(&reached.frame.pose_base_tool, 1.0) < 1e-13);
        assert!(reached.frame.servos_rad[0].abs() <= 60f64.to_radians() && reached.frame.servos_rad[0] != 0.0);
    }
}

#[test]
fn frames_of_an_arm_in_space_change_nothing_and_move_with_its_base() {
    for name in ["spatial3.toml", "serial12.toml"] {
        let arm = example(name);
        let n = arm.n_actuators();
        let words: Vec<String> = [0, n / 3, n / 2].iter().map(|&k| "1".repeat(k) + &"0".repeat(n - k)).collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let own = own_frames(&arm, &words);
        let found = synthesize(&arm, &own, &Options::default()).unwrap();
        assert!(found.status == Status::Reached && found.alteration_m < 1e-12, "{name}: {}", found.alteration_m);
        let by = Pose::exp(&darm_core::se::Twist { angular: [0.3, -0.7, 1.1].into(), linear: [0.5, 0.2, -0.4].into() });
        let nudge =
            Pose::exp(&darm_core::se::Twist { angular: [0.0, 0.02, 0.01].into(), linear: [0.01, 0.0, 0.02].into() });
        let mut elsewhere = arm.clone();
        elsewhere.model.chain.mount = by * arm.model.chain.mount;
        let carried = |by: Pose<f64>| -> Vec<DesiredFrame> {
            own.iter()
                .map(|frame| DesiredFrame { pose_base_tool: by * frame.pose_base_tool * nudge, ..frame.clone() })
                .collect()
        };
        let here = synthesize(&arm, &carried(Pose::identity()), &Options::default()).unwrap();
        let there = synthesize(&elsewhere, &carried(by), &Options::default()).unwrap();
        for (here, there) in Problem::values(&here.arm).iter().zip(Problem::values(&there.arm)) {
            assert!((here - there).abs() < 1e-8, "{name}: {here} {there}");
        }
    }
}

#[test]
fn far_frames_are_met_by_way_of_the_platforms_poses() {
    let arm = planar4();
    let wide = Bounds { shortest: 1e-3, ..Bounds::none() };
    let exact = |method| {
        let options = Options { method, bounds: wide, starts: 64, ..Options::default() };
        let reached = |seed: &u64| {
            let found = synthesize(&arm, &moved(own_frames(&arm, &WORDS), 0.8, *seed), &options).unwrap();
            found.status == Status::Reached && found.kept
        };
        (0..6).filter(reached).count()
    };
    let (plain, ours) = (exact(Method::Plain), exact(Method::Newton));
    assert!(ours == 6 && plain < 6, "{ours} {plain}");
}
