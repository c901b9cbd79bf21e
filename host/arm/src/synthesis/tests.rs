//! Laws of the synthesis.

use std::path::Path;

use super::*;
use crate::arm::ArmScratch;
use darm_core::chain::Parameter;
use darm_core::effect::gravity_sag::GravitySag;
use darm_core::effect::play::Play;
use darm_core::effect::stroke_loss::StrokeLoss;
use darm_core::effect::{Effect, Place};
use darm_core::se::Pose2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const WORDS: [&str; 5] = ["111000000000", "000111000000", "000000111000", "000000000111", "000000000000"];

fn example(name: &str) -> Arm {
    Arm::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)).unwrap()
}

fn planar4() -> Arm {
    example("planar4.toml")
}

fn stops(arm: &Arm) -> impl Iterator<Item = Parameter> {
    let states = |actuator| 0..arm.model.chain.n_states(usize::from(actuator)) as u8;
    (0..arm.n_actuators() as u8)
        .flat_map(move |actuator| states(actuator).map(move |state| Parameter::Stop { actuator, state }))
}

/// The arm's own frames for these words.
fn own_frames(arm: &Arm, words: &[&str]) -> Vec<DesiredFrame> {
    let mut scratch = ArmScratch::default();
    let servos_rad = vec![0.0; arm.n_servos()];
    let mut frame = |text: &&str| {
        let word = text.parse().unwrap();
        let pose_base_tool = arm.model.chain.pose_base_tool(&word, &servos_rad, &mut scratch).unwrap();
        DesiredFrame {
            name: text.to_string(),
            word,
            previous: arm.rest(),
            servos_rad: servos_rad.clone(),
            pose_base_tool,
            weights: Default::default(),
        }
    };
    words.iter().map(&mut frame).collect()
}

/// Every frame moved in its own coordinates by v within ±s m and ±s/2 rad.
fn moved(mut frames: Vec<DesiredFrame>, s: f64, seed: u64) -> Vec<DesiredFrame> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for frame in &mut frames {
        let mut within = |most: f64| rng.random_range(-most..most);
        let by = Pose2::exp(&nalgebra::Vector3::new(within(s / 2.0), within(s), within(s)));
        frame.pose_base_tool = frame.pose_base_tool * Pose::from(by);
    }
    frames
}

/// How far anchors of a hidden arm stand off, m.
const ANCHOR_M: f64 = 0.1;

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
fn legs_stay_physical() {
    let arm = planar4();
    for seed in 0..20 {
        let found = synthesize(&arm, &moved(own_frames(&arm, &WORDS), 0.3, seed), &Options::default()).unwrap();
        let length = |actuator, state| found.arm.model.chain.get(Parameter::Stop { actuator, state }).unwrap();
        for actuator in 0..12 {
            let (short, long) = (length(actuator, 0), length(actuator, 1));
            assert!(short >= 0.5 - 1e-9 && long >= short - 1e-9, "seed {seed}: {short} {long}");
        }
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
    assert_eq!((all.case.kind, all.case.rank, all.case.most), (CaseKind::Sufficient, 15, 15));
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
        StrokeLoss { actuator: 4, state: 1, loss_m: 5e-3 }.into(),
        GravitySag { at: Place::Arm, compliance_m_per_n: 2e-5 }.into(),
        Play { at: Place::Arm, width_m: 2e-3 }.into(),
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
fn the_papers_error_falls_with_the_square_of_its_steps() {
    let arm = planar4();
    let desired = moved(own_frames(&arm, &WORDS), 0.1, 1);
    let worst = |steps| {
        let options = Options { method: Method::Paper { steps, regularisation: 1e-3 }, ..Options::default() };
        let found = synthesize(&arm, &desired, &options).unwrap();
        found.frames.iter().fold(0.0, |worst: f64, frame| worst.max(frame.error_m))
    };
    let (coarse, fine) = (worst(20), worst(80));
    assert!(fine < coarse / 10.0 && coarse < 1e-3, "{coarse} {fine}");
}

/// Frames that are given in `examples/`, and the bounds beside them.
fn task(name: &str, arm: &Arm) -> (Vec<DesiredFrame>, Options) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name);
    let task = frames::read_task(&path, arm).unwrap();
    (task.frames, Options { ranges: task.ranges, ..Options::default() })
}

#[test]
fn the_papers_examples_are_met_and_their_cases_are_told() {
    let examples = [
        ("platform3", "platform3-frames", CaseKind::Sufficient),
        ("platform3", "platform3-all", CaseKind::Insufficient),
        ("serial2", "serial2-frames", CaseKind::Sufficient),
        ("spatial3", "spatial3-sufficient", CaseKind::Sufficient),
        ("spatial3", "spatial3-redundant", CaseKind::Redundant),
        ("serial12", "serial12-frames", CaseKind::Sufficient),
        ("hybrid6", "hybrid6-frames", CaseKind::Sufficient),
    ];
    for (arm, frames, kind) in examples {
        let arm = example(&format!("{arm}.toml"));
        let (desired, options) = task(&format!("{frames}.toml"), &arm);
        let found = synthesize(&arm, &desired, &options).unwrap();
        assert_eq!((found.status, found.case.kind), (Status::Reached, kind), "{frames}: {}", found.case);
        assert!(found.kept, "{frames}");
        let worst = found.frames.iter().fold(0.0, |worst: f64, frame| worst.max(frame.error_m));
        assert!(worst < 1e-12, "{frames}: {worst}");
    }
}

#[test]
fn one_frame_too_many_is_explained() {
    let arm = example("spatial3.toml");
    let (desired, options) = task("spatial3-insufficient.toml", &arm);
    let found = synthesize(&arm, &desired, &options).unwrap();
    assert_eq!((found.status, found.case.kind), (Status::Closest, CaseKind::Insufficient));
    assert_eq!(found.case.whole_modules, Some(WholeModules { modules: 3, states: 2, frames: 4 }));
    assert_eq!(found.case.bound, [BoundFrame { index: 4, equations: 6, open: 0 }]);
    let text = found.case.to_string();
    assert!(text.contains("(2 - 1) x 3 + 1 = 4 frames"), "{text}");
}

#[test]
fn legs_have_the_lengths_of_the_word_at_the_synthesised_pose() {
    for (arm, frames) in [("planar4", "planar4-frames"), ("spatial3", "spatial3-sufficient")] {
        let arm = example(&format!("{arm}.toml"));
        let (desired, options) = task(&format!("{frames}.toml"), &arm);
        let made = synthesize(&arm, &desired, &options).unwrap().arm.model.chain;
        let mut scratch = ArmScratch::default();
        for frame in &desired {
            made.pose_base_tool(&frame.word, &[], &mut scratch).unwrap();
            for (actuator, (stage, leg)) in made.actuators().enumerate() {
                let of = made.stages[stage].leg(leg).unwrap();
                let length = (scratch.stages[stage] * of.top - of.base).norm();
                let state = frame.word.digit(actuator);
                assert!((length - of.length_m[usize::from(state)]).abs() < 1e-12, "{frames} {actuator}");
            }
        }
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
        let options = Options { method, bounds: wide, ..Options::default() };
        let reached = |seed: &u64| {
            let found = synthesize(&arm, &moved(own_frames(&arm, &WORDS), 0.8, *seed), &options).unwrap();
            found.status == Status::Reached && found.kept
        };
        (0..20).filter(reached).count()
    };
    let (plain, ours) = (exact(Method::Plain), exact(Method::Newton));
    assert!(ours == 20 && plain < 20, "{ours} {plain}");
}

#[test]
fn what_is_out_of_reach_gives_the_nearest() {
    let arm = planar4();
    let mut desired = own_frames(&arm, &WORDS);
    desired[2].pose_base_tool.position.x += 40.0;
    let found = synthesize(&arm, &desired, &Options { starts: 2, ..Options::default() }).unwrap();
    assert!(found.status == Status::Closest && found.kept);
    assert!(found.frames.iter().all(|frame| frame.error_m.is_finite() && frame.error_rad.is_finite()));
    assert!(found.lacking_m2() < 40f64.powi(2));
    assert!(found.obstacle.is_some());
}

#[test]
fn bounds_of_single_actuators_hold() {
    let arm = planar4();
    let desired = moved(own_frames(&arm, &WORDS), 0.05, 5);
    let free = synthesize(&arm, &desired[..3], &Options::default()).unwrap();
    let stop = Parameter::Stop { actuator: 4, state: 1 };
    let most = free.arm.model.chain.get(stop).unwrap() - 0.01;
    let range = StopRange { actuator: 4, value: (0.5, most), stroke: (0.1, 0.9) };
    let options = Options { ranges: vec![range], ..Options::default() };
    let found = synthesize(&arm, &desired[..3], &options).unwrap();
    assert!(found.status == Status::Reached && found.kept);
    assert!(found.arm.model.chain.get(stop).unwrap() <= most + 1e-9);
    assert!(found.alteration_m > free.alteration_m);
}

#[test]
fn frames_without_words_are_given_some() {
    let arm = planar4();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4-poses.toml");
    let error = frames::read_task(&path, &arm).unwrap_err().to_string();
    assert!(error.contains("the frame has no word"), "{error}");
    let task = frames::read_task_without_words(&path, &arm).unwrap();
    let found = choose_words(&arm, &task.frames, &Options::default(), &|_| true).unwrap();
    assert_eq!(found.status, Status::Reached);
}

#[test]
fn what_keeps_the_nearest_from_the_frames_is_told() {
    let arm = planar4();
    let desired = moved(own_frames(&arm, &WORDS), 0.3, 5);
    let bounds = Bounds { shortest: 1.0, longest: 1.0, ..Bounds::default() };
    let found = synthesize(&arm, &desired, &Options { starts: 1, bounds, ..Options::default() }).unwrap();
    let Some(Obstacle::Bounds(held)) = &found.obstacle else { panic!("{:?}", found.obstacle) };
    assert!(held.iter().all(|name| name.starts_with("module ")), "{held:?}");
    let met = synthesize(&arm, &own_frames(&arm, &WORDS), &Options::default()).unwrap();
    assert_eq!(met.obstacle, None);
}

#[test]
fn chosen_words_meet_frames_that_no_whole_modules_could() {
    let arm = planar4();
    let words = ["010110011101", "000111000000", "101010101010", "111000000111", "001001001001", "110110110110"];
    let desired = moved(own_frames(&arm, &words), 0.1, 2);
    let found = choose_words(&arm, &desired, &Options::default(), &|_| true).unwrap();
    assert!(found.status == Status::Reached && found.kept);
    let mut words: Vec<_> = found.frames.iter().map(|reached| reached.frame.word).collect();
    words.sort_unstable();
    words.dedup();
    assert_eq!(words.len(), 6);
}

#[test]
fn a_dead_actuator_is_worked_around() {
    let arm = planar4();
    let desired = moved(own_frames(&arm, &WORDS), 0.05, 5);
    let dead = Dead { actuator: 4, state: 0 };
    let (found, cost) = repair(&arm, &desired, dead, &Options::default()).unwrap();
    assert_eq!((found.status, cost.frames_met), (Status::Reached, 5));
    assert!(found.frames.iter().all(|reached| reached.frame.word.digit(4) == 0));
    assert!(cost.stops_turned > 0 && cost.alteration_m > 0.0 && cost.words_left == 0.5);
}

#[test]
fn expected_errors_agree_with_drawn_arms_and_fall() {
    let arm = planar4();
    let desired = moved(own_frames(&arm, &WORDS), 0.05, 5);
    let tolerance = Tolerance { stop_m: 5e-5, stop_rad: 5e-5, anchor_m: 1e-4, worth_m: 3.0 };
    let found = synthesize(&arm, &desired, &Options::default()).unwrap();
    let calm = |worth_m| {
        let calm = least_sensitive(&arm, &found, &Tolerance { worth_m, ..tolerance }, &Options::default()).unwrap();
        assert!(calm.status == Status::Reached && calm.kept);
        calm
    };
    let (near, far) = (calm(3.0), calm(100.0));
    let sum = |found: &Synthesis| {
        let expected = expected(&found.arm, &desired, &tolerance, 1);
        for frame in &expected {
            assert!((frame.sampled_m / frame.linear_m - 1.0).abs() < 0.15, "{frame:?}");
            assert!((frame.sampled_rad / frame.linear_rad - 1.0).abs() < 0.15, "{frame:?}");
        }
        expected.iter().map(|frame| frame.linear_m.powi(2) + (0.5 * frame.linear_rad).powi(2)).sum::<f64>()
    };
    assert!(sum(&far) < sum(&near) && sum(&near) < sum(&found));
    assert!(found.alteration_m < near.alteration_m && near.alteration_m < far.alteration_m);
}

#[test]
fn legs_are_bought_from_a_list() {
    let arm = planar4();
    let desired = moved(own_frames(&arm, &WORDS), 0.05, 5);
    let part = |part: &str, stroke_mm, retracted_mm, price| Part {
        part: part.into(),
        stroke_mm,
        retracted_mm,
        force_n: 5000.0,
        price,
    };
    let parts = [part("A", 400.0, 900.0, 30.0), part("B", 600.0, 800.0, 60.0), part("C", 700.0, 1200.0, 80.0)];
    let (found, bought) = buy(&arm, &desired, &parts, &Options::default()).unwrap();
    assert!(found.status == Status::Reached && found.kept && bought.len() == 12);
    for bought in &bought {
        assert!(
            bought.lengths_m.0 <= bought.stops_m.0 + 1e-9 && bought.stops_m.1 <= bought.lengths_m.1 + 1e-9,
            "{bought:?}"
        );
    }
    let weak = [Part { force_n: 0.1, ..part("D", 900.0, 500.0, 1.0) }];
    let error = buy(&arm, &desired, &weak, &Options::default()).unwrap_err().to_string();
    assert!(error.contains("more than any part of the list"), "{error}");
}

#[test]
fn anchors_move_where_stops_do_not_suffice() {
    let arm = planar4();
    // An arm whose anchors stand elsewhere, with stops within the parts: they can serve.
    let mut hidden = arm.clone();
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for stage in &mut hidden.model.chain.stages {
        for leg in 0..3 {
            let leg = stage.leg_mut(leg).unwrap();
            let (short, long) = (leg.length_m[0] + 0.03, leg.length_m[1] - 0.03);
            (leg.length_m[0], leg.length_m[1]) = (short, long);
            let mut off = || rng.random_range(-ANCHOR_M..ANCHOR_M);
            (leg.base.x, leg.base.y, leg.top.x, leg.top.y) =
                (leg.base.x + off(), leg.base.y + off(), leg.top.x + off(), leg.top.y + off());
        }
    }
    let desired = own_frames(&hidden, &WORDS);
    let part = |part: &str, stroke_mm, retracted_mm| Part {
        part: part.into(),
        stroke_mm,
        retracted_mm,
        force_n: 5000.0,
        price: 1.0,
    };
    let parts = [part("A", 250.0, 1000.0), part("B", 353.6, 1414.2)];
    let with = |anchor_m| Options { bounds: Bounds { anchor_m, ..Bounds::default() }, starts: 2, ..Options::default() };
    let (found, _) = buy(&arm, &desired, &parts, &with(0.0)).unwrap();
    assert_eq!((found.status, found.anchors_moved_m), (Status::Closest, 0.0));
    let (found, bought) = buy(&arm, &desired, &parts, &with(2.0 * ANCHOR_M)).unwrap();
    assert!(found.status == Status::Reached && found.kept, "{:?}", found.obstacle);
    assert!(found.anchors_moved_m > 1e-3 && found.anchors_moved_m < 2.0 * ANCHOR_M + 1e-9, "{}", found.anchors_moved_m);
    for Bought { lengths_m, stops_m, .. } in &bought {
        assert!(lengths_m.0 <= stops_m.0 + 1e-9 && stops_m.1 <= lengths_m.1 + 1e-9, "{lengths_m:?} {stops_m:?}");
    }
    let (here, there) = (&arm.model.chain.stages[0], &found.arm.model.chain.stages[0]);
    assert!((0..3).all(|leg| here.leg(leg).unwrap().base.z == there.leg(leg).unwrap().base.z));
    // Where stops suffice, anchors stay.
    let found = synthesize(&arm, &moved(own_frames(&arm, &WORDS), 0.1, 5), &with(ANCHOR_M)).unwrap();
    assert_eq!((found.status, found.anchors_moved_m), (Status::Reached, 0.0));
}

#[test]
fn what_cannot_be_started_from_is_told_by_module_and_word() {
    let mut arm = planar4();
    let mut desired = own_frames(&arm, &WORDS);
    arm.model.chain.set(Parameter::Stop { actuator: 4, state: 1 }, 0.1).unwrap();
    let error = synthesize(&arm, &desired, &Options::default()).unwrap_err().to_string();
    assert!(error.starts_with("000111000000: module 2 has no pose for the word 000111000000: the "), "{error}");
    desired[1].word = desired[0].word;
    let error = synthesize(&arm, &desired, &Options::default()).unwrap_err().to_string();
    assert_eq!(
        error,
        "000111000000: the word 111000000000 serves 111000000000 already; one word reaches one frame, give another word"
    );
}

#[test]
fn weights_and_bounds_are_read_and_told_where_they_are_wrong() {
    let arm = planar4();
    let head = "format = 1\n[[frame]]\nword = \"000000000000\"\npose = { position_m = [0.0, 4.0], angle_deg = 0.0 }\n";
    let read = |more: &str| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.toml");
        std::fs::write(&path, format!("{head}{more}")).unwrap();
        frames::read_task(&path, &arm).map_err(|error| error.to_string())
    };
    let task = read("orientation = \"free\"\nposition_weight = 2.0\n[[bound]]\nactuator = 4\nleast_m = 1.2\n").unwrap();
    let weights = task.frames[0].weights;
    assert_eq!((weights.position, weights.orientation), (2.0, 0.0));
    assert_eq!((task.ranges[0].actuator, task.ranges[0].value), (4, (1.2, f64::INFINITY)));
    let again = frames::parse(Path::new("frames.toml"), &frames::to_toml(&task.frames), &arm).unwrap();
    assert_eq!(again, task.frames);
    for (more, told) in [
        ("position_weight = 0.0\n", "the weight is 0"),
        ("[[bound]]\nactuator = 12\nleast_m = 1.0\n", "there is no actuator 12; give 0 to 11"),
        ("[[bound]]\nactuator = 4\nleast_deg = 1.0\n", "bounds of module 2, diagonal leg are in m"),
        ("[[bound]]\nactuator = 4\nleast_m = 2.0\nmost_m = 1.0\n", "is above the most"),
    ] {
        let error = read(more).unwrap_err();
        assert!(error.contains(told), "{error}");
    }
}
