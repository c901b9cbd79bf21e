//! Each reading of a run is found, and a run that agrees has none.

use std::path::Path;

use super::*;
use darm_core::se::Twist;
use darm_measure::Sample;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Rows of a log.
const ROWS: usize = 120;

fn planar4() -> Arm {
    Arm::parse(Path::new("planar4.toml"), include_str!("../../../../../examples/planar4.toml")).unwrap()
}

/// Poses of random words, off by a millimetre, seen by a camera whose base is elsewhere.
fn run(arm: &Arm, rng: &mut ChaCha8Rng) -> Run {
    let camera = Pose::new(&Vec3::new(0.0, 0.0, 0.4), Vec3::new(0.3, -0.2, 0.0));
    let mut scratch = ArmScratch::default();
    let mut sample = |visit: usize| {
        let word = word_of((0..arm.n_actuators()).map(|_| rng.random_range(0..2))).unwrap();
        let mut off = Twist::zero();
        off.linear = Vec3::new(rng.random_range(-1e-3..1e-3), rng.random_range(-1e-3..1e-3), 0.0);
        let pose = arm.model.predict(&arm.working_condition(word, &[]), &mut scratch).unwrap();
        Sample {
            time_s: visit as f64,
            word,
            previous: None,
            servos_rad: Vec::new(),
            pose: camera * pose * Pose::exp(&off),
            supply: None,
            temperature_c: None,
            load_kg: None,
            strokes_s: Vec::new(),
            run: 0,
            visit: visit as u32,
            held_out: false,
        }
    };
    Run { samples: (0..ROWS).map(&mut sample).collect(), ..Run::default() }
}

fn with_words(run: &Run, change: impl Fn(usize, Word) -> Word) -> Run {
    let mut run = run.clone();
    let words: Vec<Word> = run.samples.iter().enumerate().map(|(row, sample)| change(row, sample.word)).collect();
    run.samples.iter_mut().zip(words).for_each(|(sample, word)| sample.word = word);
    run
}

fn read(arm: &Arm, run: &Run) -> Agreement {
    agreement(arm, run, &Progress::default()).unwrap()
}

fn found(arm: &Arm, run: &Run) -> Option<Misreading> {
    read(arm, run).other_reading().map(|other| other.misreading)
}

#[test]
fn a_log_that_agrees_has_no_other_reading() {
    let (arm, mut rng) = (planar4(), ChaCha8Rng::seed_from_u64(1));
    assert_eq!(read(&arm, &run(&arm, &mut rng)), Agreement::AsRead);
}

#[test]
fn readings_of_words_are_found_wherever_the_camera_is() {
    let (arm, mut rng) = (planar4(), ChaCha8Rng::seed_from_u64(2));
    let run = run(&arm, &mut rng);
    let word = |row: usize| run.samples[row.min(ROWS - 1)].word;
    let changed = |word: Word, digit: &dyn Fn(usize, u8) -> u8| {
        word_of(word.iter().enumerate().map(|(k, own)| digit(k, own))).unwrap()
    };
    let cases = [
        (with_words(&run, |row, _| word(row.saturating_sub(1))), Misreading::ShiftedWords { rows: 1 }),
        (with_words(&run, |_, word| changed(word, &|_, own| 1 - own)), Misreading::InvertedDigits),
        (with_words(&run, |_, word| changed(word, &|k, _| word.digit(11 - k))), Misreading::ReversedDigits),
        (
            with_words(&run, |_, word| changed(word, &|k, own| if k == 5 { 1 - own } else { own })),
            Misreading::InvertedActuator { actuator: 5 },
        ),
    ];
    for (run, expected) in cases {
        assert_eq!(found(&arm, &run), Some(expected));
    }
}

#[test]
fn labels_of_a_module_or_an_actuator_that_come_a_row_late_are_found() {
    let (arm, mut rng) = (planar4(), ChaCha8Rng::seed_from_u64(8));
    let run = run(&arm, &mut rng);
    for (actuators, rows) in [(vec![3, 4, 5], -1), (vec![7], 1)] {
        let late = with_words(&run, |row, word| {
            let other = run.samples[row.saturating_add_signed(rows).min(ROWS - 1)].word;
            let digit = |k| if actuators.contains(&k) { other.digit(k) } else { word.digit(k) };
            word_of((0..12).map(digit)).unwrap()
        });
        let expected = Misreading::ShiftedDigits { actuators, by: LabelStep::Row, later: -rows };
        assert_eq!(found(&arm, &late), Some(expected));
    }
}

#[test]
fn labels_of_a_module_that_come_a_word_late_are_found_where_words_are_measured_twice() {
    let (arm, mut rng) = (planar4(), ChaCha8Rng::seed_from_u64(10));
    let mut run = run(&arm, &mut rng);
    for row in (1..ROWS).step_by(2) {
        let earlier = run.samples[row - 1].clone();
        run.samples[row] = Sample { time_s: row as f64, ..earlier };
    }
    let late = with_words(&run, |row, word| {
        let before = run.samples[(row & !1).saturating_sub(2)].word;
        word_of((0..12).map(|k| if (3..6).contains(&k) { before.digit(k) } else { word.digit(k) })).unwrap()
    });
    let expected = Misreading::ShiftedDigits { actuators: vec![3, 4, 5], by: LabelStep::Word, later: 1 };
    assert_eq!(found(&arm, &late), Some(expected));
}

#[test]
fn a_camera_that_stands_anywhere_and_blunders_are_no_other_reading() {
    let (arm, mut rng) = (planar4(), ChaCha8Rng::seed_from_u64(9));
    for angle in [25.0f64, 60.0, 90.0, 180.0, -135.0] {
        let mut run = run(&arm, &mut rng);
        let camera = Pose::new(&Vec3::new(0.0, 0.0, angle.to_radians()), Vec3::new(3.0, -2.0, 0.0));
        run.samples.iter_mut().for_each(|sample| sample.pose = camera * sample.pose);
        run.samples[17].pose.position.x = 1e9;
        assert_eq!(read(&arm, &run), Agreement::AsRead, "{angle} deg");
    }
}

#[test]
fn a_lost_row_is_found_with_its_line() {
    let (arm, mut rng) = (planar4(), ChaCha8Rng::seed_from_u64(3));
    let run = run(&arm, &mut rng);
    let lost = with_words(&run, |row, word| match run.samples.get(row + 1) {
        Some(next) if row >= 70 => next.word,
        _ => word,
    });
    // Row 70 is in line 72; the words before it may agree by chance.
    match found(&arm, &lost) {
        Some(Misreading::WordsOutOfStep { line, rows: -1 }) => assert!((70..=74).contains(&line), "line {line}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_order_of_actuators_is_found() {
    let (arm, mut rng) = (planar4(), ChaCha8Rng::seed_from_u64(4));
    let run = run(&arm, &mut rng);
    let order = [0, 1, 2, 9, 4, 5, 3, 7, 8, 6, 10, 11];
    let rewired = with_words(&run, |_, word| word_of(order.iter().map(|&of| word.digit(of))).unwrap());
    assert_eq!(found(&arm, &rewired), Some(Misreading::ExchangedActuators { order: order.to_vec() }));
}

#[test]
fn readings_of_poses_are_found() {
    let (arm, mut rng) = (planar4(), ChaCha8Rng::seed_from_u64(5));
    let run = run(&arm, &mut rng);
    let with = |change: &dyn Fn(Pose<f64>) -> Pose<f64>| {
        let mut run = run.clone();
        run.samples.iter_mut().for_each(|sample| sample.pose = change(sample.pose));
        run
    };
    let turned = with(&|pose| Pose { rotation: pose.rotation.transpose(), position: pose.position });
    assert_eq!(found(&arm, &turned), Some(Misreading::InvertedAngles));
    let mirror = nalgebra::Matrix3::from_diagonal(&Vec3::new(1.0, -1.0, 1.0));
    let mirrored = with(&|pose| Pose { rotation: mirror * pose.rotation * mirror, position: mirror * pose.position });
    assert!(matches!(found(&arm, &mirrored), Some(Misreading::LeftHanded { .. })), "{:?}", found(&arm, &mirrored));
    let large = with(&|pose| Pose { rotation: pose.rotation, position: pose.position * 1.6 });
    match found(&arm, &large) {
        Some(Misreading::LengthScale { factor }) => assert!((factor / 1.6 - 1.0).abs() < 0.01, "{factor}"),
        other => panic!("{other:?}"),
    }
    let text = |run: &Run| found(&arm, run).map(|misreading| misreading.to_string());
    for (factor, says) in [(1e-3, "1000 times too small"), (1e3, "1000 times too large"), (25.4, "25 times too large")]
    {
        let sized = with(&|mut pose| {
            pose.position.x *= factor;
            pose
        });
        assert_eq!(text(&sized), Some(format!("x of the poses is {says}")));
    }
    let in_rad = with(&|pose| {
        let angle = rotation_log(&pose.rotation) / 1f64.to_degrees();
        Pose { rotation: rotation_exp(&angle), position: pose.position }
    });
    assert_eq!(text(&in_rad).as_deref(), Some("the angles of the poses are in rad, and read as deg"));
}

/// Divided by a thousand the error would be gone too, and so would what was measured.
#[test]
fn an_error_along_an_axis_that_the_arm_hardly_moves_along_is_no_unit() {
    let (arm, mut rng) = (planar4(), ChaCha8Rng::seed_from_u64(7));
    let (mut run, mut scratch) = (run(&arm, &mut rng), ArmScratch::default());
    let words = (0..1 << 12).map(|bits: u32| word_of((0..12).map(|k| (bits >> k & 1) as u8)).unwrap());
    let mut poses: Vec<(Word, Pose<f64>)> =
        words.map(|word| (word, arm.model.predict(&arm.working_condition(word, &[]), &mut scratch).unwrap())).collect();
    poses.sort_by(|a, b| a.1.position.y.total_cmp(&b.1.position.y));
    let alike = &poses[(poses.len() - ROWS) / 2..];
    for (sample, (word, pose)) in run.samples.iter_mut().zip(alike) {
        (sample.word, sample.pose) = (*word, *pose);
        sample.pose.position.y += rng.random_range(-0.5..0.5);
    }
    // A blunder.
    run.samples[5].pose.position.y += 100.0;
    assert_eq!(found(&arm, &run), None);
}

#[test]
fn words_of_another_table_hardly_agree() {
    let (arm, mut rng) = (planar4(), ChaCha8Rng::seed_from_u64(6));
    let [run, other] = [(); 2].map(|()| run(&arm, &mut rng));
    let mixed = with_words(&run, |row, _| other.samples[row].word);
    assert_eq!(read(&arm, &mixed), Agreement::Hardly(FEW));
}
