//! The diagnosis against true arms drawn by seed: right name, right place, no false alarm.
//!
//! A sample: `cargo xtask demo --sweep` and `cargo xtask blind` draw many.

use std::path::Path;
use std::time::Instant;

use darm_arm::arm::frames::{self, DesiredFrame, Weights};
use darm_arm::arm::{Arm, ArmScratch};
use darm_arm::synthesis::{self, synthesize};
use darm_core::se::Pose2;
use darm_diagnose::diagnosis::PoseOptions;
use darm_diagnose::diagnosis::diagnose;
use darm_diagnose::effect::Effect;
use darm_diagnose::measurement_plan::{self, PlanStep, plan};
use darm_diagnose::outcome::{Diagnosis, Verdict};
use darm_diagnose::truth::{Kind, Sealed, Truth};

/// The arm synthesized for the example's frames, and these frames.
fn arm(text: &str) -> (Arm, Vec<DesiredFrame>) {
    let base = Arm::parse(Path::new("arm.toml"), text).unwrap();
    let frames = include_str!("../../../../examples/planar4-frames.toml");
    let desired = frames::parse(Path::new("frames.toml"), frames, &base).unwrap();
    let found = synthesize(&base, &desired, &synthesis::Options::default()).unwrap();
    let desired = found.frames.into_iter().map(|reached| reached.frame).collect();
    (found.arm, desired)
}

const SEED: u64 = 0;

struct Case {
    diagnosis: Diagnosis,
    sealed: Sealed,
}

fn case((arm, desired): &(Arm, Vec<DesiredFrame>), steps: &[PlanStep], kind: Kind, seed: u64) -> Case {
    let truth = Truth::draw(arm, desired, seed, Some(kind)).unwrap();
    let run = truth.measure(steps, 0.0, seed).unwrap();
    let started = Instant::now();
    let diagnosis = diagnose(arm, &run, &PoseOptions { seed, ..PoseOptions::default() }).unwrap().diagnosis;
    let case = Case { diagnosis, sealed: truth.unseal().clone() };
    eprintln!("{} ({:.2} s)", case.line(), started.elapsed().as_secs_f64());
    case
}

impl Case {
    fn named(&self) -> bool {
        self.diagnosis.verdict == Verdict::EffectFound
            && self.diagnosis.effects.len() == 1
            && self.sealed.cause.is_some_and(|(law, _)| law == self.diagnosis.effects[0].law)
    }

    fn placed(&self) -> bool {
        let is_at_place = |found: &Effect| self.sealed.is_at_part(found.law, &found.site.place);
        self.named() && is_at_place(&self.diagnosis.effects[0])
    }

    fn ratio(&self) -> f64 {
        let after = self.diagnosis.error.after.held_out.as_ref().unwrap().norm.value;
        after / self.diagnosis.repeatability.as_ref().unwrap().norm.value
    }

    fn line(&self) -> String {
        let effects: Vec<String> = self.diagnosis.effects.iter().map(|e| format!("{} at {}", e.law, e.site)).collect();
        let alternatives: Vec<String> =
            self.diagnosis.alternatives.iter().map(|a| format!("{} at {}", a.law, a.site)).collect();
        let steps = self.diagnosis.selection_path.iter();
        let kept: Vec<String> =
            steps.filter(|r| r.kept).map(|r| format!("{} at {}", r.candidate.law, r.candidate.text)).collect();
        let sealed = &self.sealed;
        format!(
            "seed {}: {} at {} ({:.0} x): {} {effects:?}, alternatives {alternatives:?}, kept {kept:?}, after/repeatability {:.2}{}",
            sealed.seed,
            sealed.effect,
            sealed.place,
            sealed.times_scatter,
            self.diagnosis.verdict,
            self.ratio(),
            if self.placed() || sealed.is_nothing() && self.diagnosis.effects.is_empty() { "" } else { "  <-- WRONG" },
        )
    }
}

/// One true arm for each effect, and one without.
fn sample(drawn: &(Arm, Vec<DesiredFrame>), kinds: &[Kind]) {
    let steps = plan(&drawn.0, &measurement_plan::PlanOptions::default());
    for kind in kinds {
        let case = case(drawn, &steps, *kind, SEED);
        assert!(case.placed() && case.ratio() < 1.3, "{}", case.line());
    }
    let clean = case(drawn, &steps, Kind::Nothing, SEED);
    assert_eq!(clean.diagnosis.verdict, Verdict::NoEffect, "{}", clean.line());
}

/// Numbers of a file that are rounded, also where an instrument has no noise beside that: no effect is missing, and one is found.
#[test]
fn rounding_is_noise_and_depends_on_the_word() {
    let drawn = arm(include_str!("../../../../examples/planar4.toml"));
    let steps = plan(&drawn.0, &measurement_plan::PlanOptions::default());
    let rounded = |kind: Kind, position_m: f64, angle_deg: f64| {
        let truth = Truth::draw(&drawn.0, &drawn.1, SEED, Some(kind)).unwrap();
        let mut run = truth.measure(&steps, 0.0, SEED).unwrap();
        for sample in &mut run.samples {
            let round = |number: f64, step: f64| (number / step).round() * step;
            let [x, y] = [sample.pose.position.x, sample.pose.position.y].map(|m| round(m, position_m));
            let angle_deg = round(sample.pose.log().angular.z.to_degrees(), angle_deg);
            sample.pose = Pose2::new(x, y, angle_deg.to_radians()).into();
        }
        diagnose(&drawn.0, &run, &PoseOptions { seed: SEED, ..PoseOptions::default() }).unwrap().diagnosis
    };
    for step_m in [1e-3, 5e-4] {
        let clean = rounded(Kind::Nothing, step_m, 0.1);
        assert_eq!((clean.verdict, clean.effects.len()), (Verdict::NoEffect, 0), "{:?}", clean.plain);
    }
    let found = rounded(Kind::StrokeLoss, 1e-3, 0.1);
    assert_eq!((found.verdict, found.effects.len()), (Verdict::EffectFound, 1), "{:?}", found.plain);
}

/// Two platforms of six legs on one another, 0.6 m each, and the frames of a few words.
fn spatial_arm() -> (Arm, Vec<DesiredFrame>) {
    let mut text = String::from("format = 2\nname = \"spatial\"\n[conditions]\ngravity_m_s2 = [0.0, 0.0, -9.81]\n");
    text += "[tool]\nmass_kg = 2.0\n";
    for _ in 0..2 {
        text += "[[stage]]\nkind = \"spatial-platform\"\nmass_kg = 3.0\n";
        text += "home = { position_m = [0.0, 0.0, 0.6], rotation_deg = [0.0, 0.0, 0.0] }\n";
        for leg in 0..6 {
            let on_circle =
                |radius: f64, degrees: f64| [radius * degrees.to_radians().cos(), radius * degrees.to_radians().sin()];
            let (pair, side) = (120.0 * f64::from(leg / 2), if leg % 2 == 0 { -1.0 } else { 1.0 });
            let ([bx, by], [tx, ty]) = (on_circle(0.5, pair + 15.0 * side), on_circle(0.35, pair + 45.0 * side));
            let length = ((tx - bx).powi(2) + (ty - by).powi(2) + 0.36).sqrt();
            text += &format!("[[stage.leg]]\nbase_m = [{bx}, {by}, 0.0]\ntop_m = [{tx}, {ty}, 0.0]\n");
            text += &format!("length_m = [{length}, {}]\n", 1.25 * length);
        }
    }
    let arm = Arm::parse(Path::new("spatial.toml"), &text).unwrap();
    let frame = |text: &&str| {
        let word = text.parse().unwrap();
        let pose = arm.model.chain.pose_base_tool(&word, &[], &mut ArmScratch::default()).unwrap();
        DesiredFrame {
            name: String::new(),
            word,
            previous: arm.rest(),
            servos_rad: vec![],
            pose_base_tool: pose,
            weights: Weights::default(),
        }
    };
    let frames = ["000000000000", "111111000000", "000000111111", "010101101010"].iter().map(frame).collect();
    (arm, frames)
}

#[test]
fn spatial() {
    sample(&spatial_arm(), &[Kind::StrokeLoss, Kind::GravitySag]);
}

#[test]
fn planar_arm() {
    sample(&arm(include_str!("../../../../examples/planar4.toml")), &Kind::EFFECTS);
}

#[test]
fn hybrid_arm() {
    sample(&arm(include_str!("../../../../examples/planar4-hybrid.toml")), &[Kind::StrokeLoss, Kind::SupplyStroke]);
}
