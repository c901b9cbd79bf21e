//! Tasks that are refused.

use super::*;

#[test]
fn a_word_without_a_pose_is_reported_with_its_module() {
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
fn weights_and_bounds_are_read_and_refused_at_their_place() {
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
    for (more, reported) in [
        ("position_weight = 0.0\n", "the weight is 0"),
        ("[[bound]]\nactuator = 12\nleast_m = 1.0\n", "there is no actuator 12; give 0 to 11"),
        ("[[bound]]\nactuator = 4\nleast_deg = 1.0\n", "bounds of module 2, diagonal leg are in m"),
        ("[[bound]]\nactuator = 4\nleast_m = 2.0\nmost_m = 1.0\n", "is above the most"),
    ] {
        let error = read(more).unwrap_err();
        assert!(error.contains(reported), "{error}");
    }
}
