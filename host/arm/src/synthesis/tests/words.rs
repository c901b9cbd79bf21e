//! Words that are chosen, words without a failed actuator, and stops of few actuators.

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

/// An arm with strokes that are wrong meets its frames again by the stops of those actuators, and of no other.
#[test]
fn stops_of_few_actuators_are_turned_where_they_suffice() {
    let arm = planar4();
    let desired = own_frames(&arm, &WORDS);
    let turned = |offsets: &[u8], other: Option<u8>| {
        let mut corrected = arm.clone();
        for &actuator in offsets {
            let offset = Effect::LengthOffset { actuator, offset_m: 2e-3 };
            corrected.model.effects.push(offset).unwrap();
        }
        if let Some(actuator) = other {
            let stop = Parameter::Stop { actuator, state: 1 };
            let length_m = corrected.model.chain.get(stop).unwrap();
            corrected.model.chain.set(stop, length_m + 2e-3).unwrap();
        }
        let found = synthesize_by_few(&corrected, &desired, &Options::default()).unwrap();
        assert_eq!(found.status, Status::Reached);
        found.stops_turned(&corrected)
    };
    // An offset is of both stops of an actuator.
    assert_eq!([turned(&[4], None), turned(&[1, 4], None)], [2, 4]);
    // The effect explains nothing of what another actuator does wrong.
    assert!(turned(&[], Some(4)) > 2);
    assert!(turned(&[1], Some(4)) > 4);
}
