//! Words that are chosen, and words without a failed actuator.

use super::*;

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
fn chosen_words_meet_frames_that_complete_modules_could_not() {
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
    let dead = StuckActuator { actuator: 4, state: 0 };
    let (found, cost) = repair(&arm, &desired, dead, &Options::default()).unwrap();
    assert_eq!((found.status, cost.frames_met), (Status::Reached, 5));
    assert!(found.frames.iter().all(|reached| reached.frame.word.digit(4) == 0));
    assert!(cost.stops_turned > 0 && cost.alteration_m > 0.0 && cost.words_left == 0.5);
}
