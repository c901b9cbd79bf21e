//! The method of the paper, and its examples.

use super::*;

#[test]
fn the_papers_error_falls_with_the_square_of_its_steps() {
    let arm = planar4();
    let desired = moved(own_frames(&arm, &WORDS), 0.1, 1);
    let worst = |scheme| {
        let options = Options { method: Method::Paper(scheme), ..Options::default() };
        let found = synthesize(&arm, &desired, &options).unwrap();
        found.frames.iter().fold(0.0, |worst: f64, frame| worst.max(frame.error_m))
    };
    let (coarse, fine) = (worst(Scheme::of(20)), worst(Scheme::of(80)));
    assert!(fine < coarse / 10.0 && coarse < 1e-3, "{coarse} {fine}");
    // Without the actual frame the errors of all steps add up: by the steps alone.
    let [coarse, fine] = [20, 80].map(|steps| worst(Scheme { feedback: Feedback::Interpolated, ..Scheme::of(steps) }));
    assert!(fine > coarse / 6.0 && fine < coarse / 3.0, "{coarse} {fine}");
}

#[test]
fn the_papers_method_is_judged_by_its_own_accuracy() {
    let arm = planar4();
    let (desired, options) = task("planar4-frames.toml", &arm);
    let status = |steps| {
        let method = Method::Paper(Scheme::of(steps));
        synthesize(&arm, &desired, &Options { method, ..options.clone() }).unwrap().status
    };
    assert_eq!((status(10), status(100)), (Status::Closest, Status::Reached));
}

#[test]
fn the_papers_examples_are_met_and_their_cases_named() {
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
    assert_eq!(found.case.complete_modules, Some(CompleteModules { modules: 3, states: 2, frames: 4 }));
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
