//! A report of a small calibration loop: the page is complete, and the JSON has the same numbers.

use std::path::Path;

use super::*;
use darm_arm::arm::frames;
use darm_arm::synthesis::{self, synthesize};
use darm_diagnose::diagnosis::PoseOptions;
use darm_diagnose::diagnosis::diagnose;
use darm_diagnose::measurement_plan::{self, plan};
use darm_diagnose::truth::{Kind, Truth};

/// A report on an arm with a stroke loss; the board's figures are invented.
fn report() -> LoopReport {
    let base = Arm::parse(Path::new("planar4.toml"), include_str!("../../../../examples/planar4.toml")).unwrap();
    let text = include_str!("../../../../examples/planar4-frames.toml");
    let desired = frames::parse(Path::new("frames.toml"), text, &base).unwrap();
    let found = synthesize(&base, &desired, &synthesis::Options::default()).unwrap();
    let truth = Truth::draw(&found.arm, &desired, 4, Some(Kind::StrokeLoss)).unwrap();
    let steps = plan(&found.arm, &measurement_plan::PlanOptions::default());
    let run = truth.measure(&steps, 0.0, 4).unwrap();
    let diagnosis = diagnose(&found.arm, &run, &PoseOptions::default()).unwrap().diagnosis;
    let closed = |frame: &frames::DesiredFrame| ClosedFrame {
        name: frame.name.clone(),
        word_before: frame.word.to_string(),
        word_after: frame.word.to_string(),
        before_m: 6e-3,
        after_m: 0.3e-3,
    };
    LoopReport {
        arm: base.name.clone(),
        seed: 4,
        version: env!("CARGO_PKG_VERSION").into(),
        board: "no board".into(),
        time_s: 61.0,
        synthesis: Some(synthesis_figures(&found)),
        plan: PlanFigures {
            words: 96,
            held_out: 24,
            visits: 3,
            repeats: steps.iter().filter(|step| step.repeat).count(),
            rows: run.samples.len(),
            table_rows: 700,
            time_s: 90.0,
        },
        diagnosis,
        truth: Some(truth.unseal().clone()),
        stops: vec![StopFigure {
            name: "module 4, left leg, stop of digit 1".into(),
            from_m: 1.25,
            to_m: 1.253,
            turn: "3.000 mm out".into(),
        }],
        closures: vec![Closure {
            name: "stops adjusted".into(),
            note: "Synthesis is repeated with the effect, and the stops are adjusted.".into(),
            frames: desired.iter().map(closed).collect(),
            before_m: 6e-3,
            after_m: 0.3e-3,
            goal_m: 1.2e-3,
        }],
        drawing: Drawing::of(&base, &found.arm, &desired),
    }
}

fn synthesis_figures(found: &synthesis::Synthesis) -> SynthesisFigures {
    let frame = |reached: &synthesis::Reached| FrameFigure {
        name: reached.frame.name.clone(),
        word: reached.frame.word.to_string(),
        before_m: reached.error_before_m,
        error_m: reached.error_m,
        error_rad: reached.error_rad,
    };
    SynthesisFigures {
        case: "sufficient".into(),
        iterations: found.iterations,
        time_s: found.time.as_secs_f64(),
        alteration_m: found.alteration_m,
        frames: found.frames.iter().map(frame).collect(),
        paper: PAPER,
        paper_method: None,
    }
}

#[test]
fn page_and_json_have_the_same_numbers() {
    let report = report();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("run.csv"), "abc").unwrap();
    report.write(folder.path()).unwrap();
    if let Some(kept) = std::env::var_os("DARM_REPORT") {
        report.write(Path::new(&kept)).unwrap();
    }
    let page = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
    let json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("report.json")).unwrap()).unwrap();
    assert_eq!(report.named_rightly(), Some(true));
    assert_eq!(json["diagnosis"]["verdict"], "effect-found");
    assert_eq!(json["diagnosis"]["effects"][0]["law"], "stroke-loss");
    let after_mm = json["diagnosis"]["error"]["after"]["held_out"]["norm"]["value"].as_f64().unwrap() * 1e3;
    assert!(page.contains(&format!("{after_mm:.3} mm")), "{after_mm}");
    assert_eq!(page.matches("<svg").count(), page.matches("</svg>").count());
    assert!(!page.contains("http://") || page.matches("http://").count() == page.matches("http://www.w3.org").count());
    assert_eq!(json["drawing"]["frames"].as_array().unwrap().len(), 5);
    assert!(page.contains("ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"), "digest of run.csv");
    assert_eq!(page.matches("class=\"number\"").count(), 5 * 12, "each leg of each drawing has its number");
    assert!(page.contains("<title>actuator 3: module 2, left leg, output 3</title>"), "and its name and output");
}

#[test]
fn the_table_names_the_effect() {
    let text = table(&report());
    assert!(
        text.contains("effect-found") && text.contains("named correctly") && text.contains("stops adjusted"),
        "{text}"
    );
}
