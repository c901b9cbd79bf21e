//! Every module of an answer can be assembled, and every answer keeps its bounds.

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
