//! Every module of an answer can be assembled, and every answer keeps its bounds.

use darm_core::actuator::Stage;

use super::*;

fn frame(arm: &Arm, word: &str, [x, y, deg]: [f64; 3]) -> DesiredFrame {
    let pose = Pose2 { angle_rad: f64::to_radians(deg), position: [x, y].into() };
    DesiredFrame { pose_base_tool: pose.into(), ..own_frames(arm, &[word]).remove(0) }
}

/// A valid arm reaches these frames; the stops that they do not use once stayed where word 0…0 could not be assembled, so that the
/// answer was refused when it was written.
#[test]
fn stops_that_no_frame_uses_leave_every_module_a_pose() {
    let arm = planar4();
    let desired = [
        frame(&arm, "111010001011", [0.960_324_991_190_547_8, 6.839_376_250_552_76, 30.117_311_326_820_186]),
        frame(&arm, "101010110100", [2.059_707_529_138_661_3, 7.123_469_471_349_936, -30.117_311_326_820_225]),
    ];
    let bounds = Bounds { stroke: 5e-3, ..Bounds::default() };
    let found = synthesize(&arm, &desired, &Options { bounds, ..Options::default() }).unwrap();
    assert_eq!((found.status, found.kept), (Status::Reached, true));
    assert_eq!(without_pose(&found.arm), []);
    assert!(Arm::parse(Path::new("new.toml"), &found.arm.to_toml()).is_ok());
}

#[test]
fn what_lies_out_of_reach_breaks_no_bound() {
    let arm = planar4();
    let desired = [frame(&arm, "000111000111", [5.625, 44.358_969_087_381_34, 0.0])];
    for stroke in [5e-3, 20e-3] {
        let bounds = Bounds { stroke, ..Bounds::default() };
        let found = synthesize(&arm, &desired, &Options { bounds, ..Options::default() }).unwrap();
        assert_eq!((found.status, found.kept), (Status::Closest, true), "{stroke}");
    }
}

/// Frames of three words, moved out from the base by 1 to 4: within reach, at its edge and far outside.
fn moved_out(arm: &Arm, seed: u64) -> Vec<DesiredFrame> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let words: Vec<String> = (0..3).map(|_| format!("{:012b}", rng.random_range(0..1 << 12))).collect();
    let factor = rng.random_range(1.0..4.0);
    let mut frames = own_frames(arm, &words.iter().map(String::as_str).collect::<Vec<_>>());
    frames.iter_mut().for_each(|frame| frame.pose_base_tool.position *= factor);
    frames
}

/// Of 40 such draws 12 had an answer without a pose at rest, so that it could not be written, when the words were no constraint of
/// the search.
#[test]
fn frames_that_move_out_leave_every_word_a_pose() {
    let arm = planar4();
    let mut closest = 0;
    for seed in 0..6 {
        let bounds = Bounds { stroke: 5e-3, ..Bounds::default() };
        let options = Options { bounds, starts: 12, ..Options::default() };
        let found = synthesize(&arm, &moved_out(&arm, seed), &options).unwrap();
        assert!(found.kept, "seed {seed}");
        assert_eq!(without_pose(&found.arm), [], "seed {seed}");
        assert!(Arm::parse(Path::new("new.toml"), &found.arm.to_toml()).is_ok(), "seed {seed}");
        closest += usize::from(found.status == Status::Closest);
    }
    assert!((2..5).contains(&closest), "{closest}");
}

/// Words that no table uses may be lost, which lets an arm come nearer in some draws, the second of these; what is lost is named.
#[test]
fn fewer_words_lead_nearer() {
    let arm = planar4();
    let bounds = Bounds { stroke: 5e-3, ..Bounds::default() };
    let mut nearer = 0;
    for seed in [3, 11, 16] {
        let desired = moved_out(&arm, seed);
        let with =
            |words| synthesize(&arm, &desired, &Options { bounds, words, starts: 4, ..Options::default() }).unwrap();
        let (all, few) = (with(NeededWords::All), with(NeededWords::These(Vec::new())));
        assert!(assembled_share(&all.arm) >= assembled_share(&few.arm), "seed {seed}");
        assert!(Arm::parse(Path::new("new.toml"), &few.arm.to_toml()).is_ok(), "seed {seed}");
        nearer += usize::from(few.error_m2() < 0.9 * all.error_m2());
        let mut scratch = ArmScratch::default();
        let has_pose = |number: &u32| {
            let word = format!("{number:012b}").parse().unwrap();
            few.arm.model.predict(&few.arm.model.working(word, few.arm.rest(), &[]), &mut scratch).is_ok()
        };
        let assembled = (0..1 << 12).filter(has_pose).count() as f64 / 4096.0;
        assert!((assembled_share(&few.arm) - assembled).abs() < 1e-12, "seed {seed}: {assembled}");
    }
    assert!(nearer > 0, "no word is worth anything");
}

#[test]
fn the_nearest_singular_posture_is_that_of_the_least_determinant() {
    let mut arm = planar4();
    let Stage::Planar(platform) = &mut arm.model.chain.stages[2] else { panic!("planar4 has planar modules") };
    platform.legs[1].length_m[1] = 2.0;
    let nearest = nearest_singular(&arm).unwrap();
    assert_eq!((nearest.stage, digits(&nearest.setting)), (2, "111".to_owned()));
    let mut scratch = ArmScratch::default();
    arm.model.chain.pose_base_tool(&"000000111000".parse().unwrap(), &[], &mut scratch).unwrap();
    let Stage::Planar(platform) = &arm.model.chain.stages[2] else { panic!("planar4 has planar modules") };
    assert!((platform.determinant(&scratch.stages[2]).abs() - nearest.determinant).abs() < 1e-12);
}
