//! Each verdict where it is due. What is measured here is made by the laws themselves, with noise by seed.

use std::path::Path;

use darm_core::effect::Frame;
use darm_core::effect::law_name::LawName;
use darm_core::effect::{Effect, Place};
use darm_core::model::Condition;
use darm_core::real::Vec3;
use darm_core::se::{Pose, Twist};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::correction::Keep;
use crate::linearise::arm_candidates as candidate;
use crate::measurement_plan::{self, plan};
use crate::outcome::Verdict;
use crate::select::significance::quantile_975;
use darm_measure::Sample;

fn arm() -> Arm {
    Arm::parse(Path::new("planar4.toml"), include_str!("../../../../examples/planar4.toml")).unwrap()
}

fn stroke_loss() -> Effect<f64> {
    Effect::StrokeLoss { actuator: 4, state: 1, loss_m: 3e-3 }
}

fn thermal_growth() -> Effect<f64> {
    Effect::ThermalGrowth { at: Place::Module(2), expansion_per_k: 1e-4 }
}

/// The supply (Pa) and temperature (K) at a time, s.
type Surroundings = fn(f64) -> (f64, f64);

fn changing(time_s: f64) -> (f64, f64) {
    (5.5e5 + 1e4 * (time_s / 7.0).sin(), 303.0 + 5.0 * (time_s / 40.0).sin())
}

/// A measurement plan played on `arm` with these effects, 0.2 mm and 0.02° of noise.
fn measured(arm: &Arm, effects: &[Effect<f64>], surroundings: Surroundings) -> Run {
    carrying(arm, effects, surroundings, |_| None)
}

/// The same with a tool that carries so much, kg, in each visit.
fn carrying(arm: &Arm, effects: &[Effect<f64>], surroundings: Surroundings, load_kg: fn(usize) -> Option<f64>) -> Run {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut model = arm.model.clone();
    model.effects.extend(effects.iter().copied());
    let mut scratch = ArmScratch::default();
    let steps = plan(arm, &measurement_plan::PlanOptions { words: 64, ..measurement_plan::PlanOptions::default() });
    let mut sample = |(visit, step): (usize, &measurement_plan::PlanStep)| {
        let time_s = 0.3 * visit as f64;
        let (supply, temperature_k) = surroundings(time_s);
        let previous = Some(step.previous);
        let condition = Condition {
            previous,
            supply,
            temperature_k,
            time_s: Some(time_s),
            load_kg: load_kg(visit).unwrap_or(0.0),
            ..model.nominal(step.word, &[])
        };
        let pose = model.predict(&condition, &mut scratch).unwrap();
        let mut normal = |scale: f64| scale * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, &mut rng);
        let linear = Vec3::new(normal(2e-4), normal(2e-4), 0.0);
        let noise = Twist { angular: Vec3::new(0.0, 0.0, normal(3.5e-4)), linear };
        Sample {
            time_s,
            word: step.word,
            previous,
            servos_rad: Vec::new(),
            pose: pose * Pose::exp(&noise),
            supply: Some(supply),
            temperature_c: Some(temperature_k - 273.15),
            load_kg: load_kg(visit),
            strokes_s: Vec::new(),
            run: 0,
            visit: visit as u32,
            held_out: step.held_out,
        }
    };
    Run { samples: steps.iter().enumerate().map(&mut sample).collect(), ..Run::default() }
}

fn laws(diagnosis: &Diagnosis) -> Vec<&str> {
    diagnosis.effects.iter().map(|effect| effect.law.as_str()).collect()
}

#[test]
fn the_value_lies_in_its_interval_and_the_model_is_corrected() {
    let arm = arm();
    let run = measured(&arm, &[stroke_loss()], changing);
    let Outcome { diagnosis, correction } = diagnose(&arm, &run, &PoseOptions::default()).unwrap();
    let [found] = &diagnosis.effects[..] else { panic!("{:?}", diagnosis.plain) };
    assert_eq!((found.law.as_str(), &found.site.code[..]), ("stroke-loss", "actuator 4, state 1"));
    let value = &found.values[0];
    let [low, high] = value.ci95.unwrap();
    assert!(low < 3e-3 && 3e-3 < high, "{value:?}");
    assert!(high - low < 1e-4, "{value:?}");
    let corrected = correction.corrected(&arm, &run, Keep::Effects).unwrap();
    assert_eq!(corrected.model.number, arm.model.number + 1);
    let again = diagnose(&corrected, &run, &PoseOptions::default()).unwrap().diagnosis;
    assert_eq!(again.verdict, Verdict::NoEffect);
}

/// A stroke that differs from run to run: the mean of six is off by their scatter over the root of six, however many words each has.
#[test]
fn an_interval_counts_runs_and_not_words_where_these_differ() {
    let arm = arm();
    // Of mean zero and unit standard deviation.
    let differs = [-1.3, 0.7, 1.1, -0.4, -0.9, 0.8];
    let (mean_m, scatter_m) = (3e-3, 1.5e-4);
    let run_of = |(number, differs): (usize, &f64)| {
        let effect = Effect::StrokeLoss { actuator: 4, state: 1, loss_m: mean_m + scatter_m * differs };
        let samples = measured(&arm, &[effect], changing).samples.into_iter();
        samples.map(move |sample| Sample { run: number as u32, ..sample })
    };
    let run = Run { samples: differs.iter().enumerate().flat_map(run_of).collect(), ..Run::default() };
    let found = diagnose(&arm, &run, &PoseOptions::default()).unwrap().diagnosis;
    let [low, high] = found.effects[0].values[0].ci95.unwrap();
    let expected_m = quantile_975(5) * scatter_m / 6f64.sqrt();
    assert!((high - low) / 2.0 > 0.8 * expected_m && low < mean_m && mean_m < high, "{low} {high} {expected_m}");
}

#[test]
fn a_sag_under_loads_that_change_is_found_by_the_column_of_loads_alone() {
    let arm = arm();
    let sag: Effect<f64> = Effect::GravitySag { at: Place::Arm, compliance_m_per_n: 2e-6 };
    let mut run = carrying(&arm, &[sag], changing, |visit| Some(((visit / 15) % 3) as f64));
    let Outcome { diagnosis, .. } = diagnose(&arm, &run, &PoseOptions::default()).unwrap();
    let [found] = &diagnosis.effects[..] else { panic!("{:?}", diagnosis.plain) };
    assert_eq!((found.law.as_str(), &found.site.code[..]), ("gravity-sag", "arm"));
    let [low, high] = found.values[0].ci95.unwrap();
    assert!(low < 2e-6 && 2e-6 < high, "{found:?}");
    let error_m = |diagnosis: &Diagnosis| diagnosis.error.after.held_out_or_train().norm.value;
    assert!(error_m(&diagnosis) < 4e-4);
    // Without the column one compliance has to serve for all loads.
    run.samples.iter_mut().for_each(|sample| sample.load_kg = None);
    let without = diagnose(&arm, &run, &PoseOptions::default()).unwrap().diagnosis;
    assert!(error_m(&without) > 1.5 * error_m(&diagnosis), "{:?}", without.plain);
}

#[test]
fn a_base_that_is_moved_at_a_moment_is_found_with_that_moment() {
    let arm = arm();
    let step: Effect<f64> = Effect::BaseStep { since_s: 40.0, values: [0.0, 0.0, 1e-3, 2e-3, -1e-3, 0.0] };
    let run = measured(&arm, &[step], changing);
    let Outcome { diagnosis, correction } = diagnose(&arm, &run, &PoseOptions::default()).unwrap();
    let [found] = &diagnosis.effects[..] else { panic!("{:?}", diagnosis.plain) };
    assert_eq!((found.law.as_str(), &found.site.code[..]), ("base-step", "base"));
    let Effect::BaseStep { since_s, .. } = correction.best_effects[0] else { panic!("{:?}", correction.best_effects) };
    // Rows are 0.3 s apart.
    assert!((39.7..=40.3).contains(&since_s), "{step:?}");
}

#[test]
fn two_effects_are_both_found() {
    let run = measured(&arm(), &[stroke_loss(), thermal_growth()], changing);
    let diagnosis = diagnose(&arm(), &run, &PoseOptions::default()).unwrap().diagnosis;
    let mut laws = laws(&diagnosis);
    laws.sort();
    assert_eq!(laws, ["stroke-loss", "thermal-growth"], "{:?}", diagnosis.plain);
}

#[test]
fn what_cannot_be_told_apart_is_not_named() {
    // Under a supply that never changes, a stroke that follows it is a stroke that is too short.
    let run = measured(&arm(), &[stroke_loss()], |time_s| (5.4e5, changing(time_s).1));
    let diagnosis = diagnose(&arm(), &run, &PoseOptions::default()).unwrap().diagnosis;
    assert_eq!((diagnosis.verdict, diagnosis.effects.len()), (Verdict::NotIdentifiable, 0), "{:?}", diagnosis.plain);
    let mut names: Vec<&str> = diagnosis.alternatives.iter().map(|other| other.law.as_str()).collect();
    names.sort();
    assert_eq!(names, ["stroke-loss", "supply-stroke"]);
    assert!(diagnosis.alternatives.iter().all(|other| other.site.code.starts_with("actuator 4")));
    let next = diagnosis.next_measurement.unwrap();
    assert!(next.conditions.is_some_and(|conditions| conditions.contains("supply")) && next.words.len() >= 12);
    assert!(diagnosis.plain[2].starts_with("Measure next at a supply of"), "{:?}", diagnosis.plain);
}

#[test]
fn a_drift_that_no_law_knows_is_not_given_a_name() {
    let mut run = measured(&arm(), &[], changing);
    for sample in &mut run.samples {
        sample.pose.position.x += 4e-3 * (sample.time_s / 20.0).sin();
    }
    let diagnosis = diagnose(&arm(), &run, &PoseOptions::default()).unwrap().diagnosis;
    assert_eq!(
        (diagnosis.verdict, diagnosis.effects.len()),
        (Verdict::UnexplainedStructure, 0),
        "{:?}",
        diagnosis.plain
    );
    assert!(diagnosis.structure.unwrap().beyond_noise);
}

#[test]
fn what_no_law_explains_is_kept_as_fitted_terms() {
    // A bracket of two metals, a cable between two legs: neither is any law's. What it shifts is reported in mm by the row.
    let bracket = |sample: &Sample| 3.0 * ((sample.temperature_c.unwrap() - 32.35) / 2.5).powi(2);
    let cable = |sample: &Sample| if sample.word.digit(2) == 1 && sample.word.digit(9) == 1 { 4.0 } else { 0.0 };
    for shift_mm in [&bracket as &dyn Fn(&Sample) -> f64, &cable] {
        let mut run = measured(&arm(), &[], changing);
        run.samples.iter_mut().for_each(|sample| sample.pose.position.x += 1e-3 * shift_mm(sample));
        let Outcome { diagnosis, correction } = diagnose(&arm(), &run, &PoseOptions::default()).unwrap();
        assert_eq!(diagnosis.verdict, Verdict::UnexplainedStructure, "{:?}", diagnosis.plain);
        assert_eq!(correction.corrected(&arm(), &run, Keep::Effects), None);
        let term = &diagnosis.remaining.depends_on[0];
        assert_eq!((term.axis.as_deref(), term.frame), (Some("x"), Some(Frame::Base)));
        assert!(term.held_out_gain.as_ref().unwrap().value > 0.3e-3, "{:?} {:?}", diagnosis.plain, diagnosis.remaining);
        let kept = correction.corrected(&arm(), &run, Keep::EffectsAndTerms).unwrap();
        assert!(kept.model.effects.iter().any(|effect| effect.name() == LawName::FittedTerm));
        let again = diagnose(&kept, &run, &PoseOptions::default()).unwrap().diagnosis;
        assert_eq!(again.verdict, Verdict::NoEffect, "{:?} {:?}", again.plain, kept.model.effects);
        let read = Arm::parse(Path::new("kept.toml"), &kept.to_toml()).unwrap();
        assert_eq!(read.model.effects, kept.model.effects);
    }
}

/// From 45° on the base came out millimetres off beside an error after it of some noise; from 60° on a fifth of its place.
#[test]
fn a_camera_that_is_turned_by_any_angle_and_far_away_hides_nothing() {
    let arm = arm();
    let mut run = measured(&arm, &[stroke_loss()], changing);
    let camera = Pose::new(&Vec3::new(0.0, 0.0, 100f64.to_radians()), Vec3::new(1.0, -2.5, 0.0));
    run.samples.iter_mut().for_each(|sample| sample.pose = camera * sample.pose);
    let diagnosis = diagnose(&arm, &run, &PoseOptions::default()).unwrap().diagnosis;
    assert_eq!((diagnosis.verdict, laws(&diagnosis)), (Verdict::EffectFound, vec!["base-offset", "stroke-loss"]));
    let value = |name: &str| diagnosis.effects[0].values.iter().find(|value| value.name == name).unwrap().value;
    // 0.2 mm and 0.02° of noise, of more than a hundred visits two metres away.
    let off = [value("turn_z") - 100f64.to_radians(), value("x") - 1.0, value("y") + 2.5].map(f64::abs);
    assert!(off[0] < 3e-4 && off[1] < 6e-4 && off[2] < 6e-4, "off by {off:?}");
}

#[test]
fn rows_that_are_far_off_are_listed_and_change_nothing() {
    let mut run = measured(&arm(), &[stroke_loss()], changing);
    let wrong: Vec<usize> = run.training().map(|(index, _)| index).step_by(60).collect();
    for &index in &wrong {
        run.samples[index].pose.position.y += 0.05;
    }
    let diagnosis = diagnose(&arm(), &run, &PoseOptions::default()).unwrap().diagnosis;
    assert_eq!(laws(&diagnosis), ["stroke-loss"]);
    let lines: Vec<usize> = diagnosis.outliers.iter().map(|outlier| outlier.line).collect();
    assert!(wrong.iter().all(|index| lines.contains(&(index + 2))) && lines.len() <= wrong.len() + 1, "{lines:?}");
}

#[test]
fn rows_of_which_many_are_far_off_are_no_clean_log() {
    let mut run = measured(&arm(), &[], changing);
    let wrong: Vec<usize> = run.training().map(|(index, _)| index).step_by(6).collect();
    for &index in &wrong {
        run.samples[index].pose.position.y += 0.05;
    }
    let diagnosis = diagnose(&arm(), &run, &PoseOptions::default()).unwrap().diagnosis;
    assert_eq!(diagnosis.verdict, Verdict::UnexplainedStructure, "{:?}", diagnosis.plain);
    assert!(diagnosis.plain.iter().any(|sentence| sentence.contains("not isolated outliers")), "{:?}", diagnosis.plain);
}

#[test]
fn a_camera_that_sees_one_way_longer_than_the_other_is_no_moved_base() {
    let mut run = measured(&arm(), &[], changing);
    run.samples.retain(|sample| sample.previous != Some(sample.word));
    for sample in &mut run.samples {
        sample.pose.position.y *= 1.01;
    }
    let diagnosis = diagnose(&arm(), &run, &PoseOptions::default()).unwrap().diagnosis;
    assert!(diagnosis.verdict != Verdict::EffectFound, "{:?} {:?}", diagnosis.plain, diagnosis.remaining);
    let on_place = diagnosis.remaining.depends_on.iter().any(|on| on.variable == "position of the tool");
    assert!(on_place, "{:?}", diagnosis.plain);
}

#[test]
fn without_repeats_there_is_no_repeatability_but_a_diagnosis() {
    let mut run = measured(&arm(), &[stroke_loss()], changing);
    run.samples.retain(|sample| sample.previous != Some(sample.word));
    let diagnosis = diagnose(&arm(), &run, &PoseOptions::default()).unwrap().diagnosis;
    let reported = (diagnosis.repeatability.is_none(), laws(&diagnosis));
    assert_eq!(reported, (true, vec!["stroke-loss"]), "{:?}", diagnosis.plain);
}

#[test]
fn the_same_run_gives_the_same_numbers() {
    let run = measured(&arm(), &[thermal_growth()], changing);
    let reported =
        || serde_json::to_string(&diagnose(&arm(), &run, &PoseOptions::default()).unwrap().diagnosis).unwrap();
    assert_eq!(reported(), reported());
}

#[test]
fn a_run_that_says_too_little_or_does_not_fit_is_refused() {
    let mut run = measured(&arm(), &[], changing);
    let few: std::collections::BTreeSet<_> = run.samples.iter().take(10).map(|sample| sample.word).collect();
    let little =
        Run { samples: run.samples.iter().filter(|s| few.contains(&s.word)).cloned().collect(), ..Run::default() };
    assert!(matches!(diagnose(&arm(), &little, &PoseOptions::default()), Err(DiagnoseError::TooFewWords { .. })));
    run.samples[3].word = "0101".parse().unwrap();
    let error = diagnose(&arm(), &run, &PoseOptions::default()).unwrap_err();
    assert_eq!((error.line(), error.to_string()), (Some(5), "the word has 4 digits, the arm has 12 actuators".into()));
}

#[test]
fn every_law_is_a_candidate() {
    let names: std::collections::BTreeSet<_> = candidate::all(&arm().model).iter().map(|e| e.name()).collect();
    // All but the zero of a servo, which this arm has not.
    assert_eq!(names.len(), 18);
    let supply = Effect::SupplyStroke { at: Place::Arm, gain: 0.1 };
    assert!(candidate::all(&arm().model).iter().any(|effect| candidate::same(effect, &supply)));
}

/// All that a diagnosis names, says or tried.
fn mentioned(diagnosis: &Diagnosis) -> String {
    let steps = diagnosis.selection_path.iter().map(|step| format!("{} {}\n", step.candidate.law, step.candidate.text));
    let others = diagnosis.alternatives.iter().map(|other| format!("{} {}\n", other.law, other.site));
    steps
        .chain(others)
        .chain(diagnosis.effects.iter().map(|effect| format!("{} {}\n", effect.law, effect.site)))
        .collect()
}

fn rejecting(texts: &[&str]) -> PoseOptions {
    PoseOptions { rejected: texts.iter().map(|text| text.parse().unwrap()).collect(), ..PoseOptions::default() }
}

#[test]
fn an_effect_that_is_rejected_is_no_candidate_anywhere() {
    let (arm, run) = (arm(), measured(&arm(), &[stroke_loss()], changing));
    let options =
        rejecting(&["stroke-loss, module 2, diagonal leg: measured with a gauge", "supply-stroke at actuator 4: why"]);
    let Outcome { diagnosis, correction } = diagnose(&arm, &run, &options).unwrap();
    let mentioned = mentioned(&diagnosis);
    assert!(mentioned.contains("stroke-loss actuator 3, state 1\n"), "{mentioned}");
    for absent in
        ["stroke-loss actuator 4", "supply-stroke actuator 4", "supply-stroke module 1\n", "supply-stroke arm"]
    {
        assert!(!mentioned.contains(absent), "{absent}");
    }
    assert!(mentioned.contains("supply-stroke module 2\n"), "{mentioned}");
    let is_out = |effect: &Effect<f64>| candidate::same(effect, &stroke_loss());
    assert!(!correction.best_effects.iter().any(is_out));
    assert_eq!(diagnosis.rejected, options.rejected);
    let last = "stroke-loss, module 2, diagonal leg: measured with a gauge; supply-stroke, actuator 4: why.";
    assert!(diagnosis.plain.last().unwrap().ends_with(last), "{:?}", diagnosis.plain);
}

#[test]
fn no_fitted_term_replaces_an_effect_that_is_rejected() {
    let arm = arm();
    let growth: Effect<f64> = Effect::ThermalGrowth { at: Place::Arm, expansion_per_k: 1e-4 };
    let run = measured(&arm, &[growth], |time_s| (5.5e5, 293.15 + 10.0 * (time_s / 9.0).sin()));
    let all = candidate::all(&arm.model);
    let is_tried = |law: &&LawName| all.iter().any(|effect| effect.name() == **law);
    let texts: Vec<String> = LawName::ALL.iter().filter(is_tried).map(|law| format!("{law}: excluded")).collect();
    let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
    let Outcome { diagnosis, correction } = diagnose(&arm, &run, &rejecting(&texts)).unwrap();
    let depends_on = &diagnosis.remaining.depends_on;
    assert!(depends_on.iter().any(|one| one.variable.contains("temperature")), "{depends_on:?}");
    let terms = correction.with_terms.map_or(Vec::new(), |with| with.effects);
    let along_temperature = |effect: &&Effect<f64>| candidate::place_code(effect).contains("temperature");
    assert_eq!(terms.iter().filter(along_temperature).count(), 0, "{terms:?}");
}

#[test]
fn a_rejection_of_nothing_says_what_there_is() {
    let (arm, run) = (arm(), measured(&arm(), &[], changing));
    let refusal = |arm: &Arm, text: &str| diagnose(arm, &run, &rejecting(&[text])).unwrap_err().to_string();
    assert!(refusal(&arm, "sag: why").starts_with("no law sag here; there are anchor-offset, base-drift, "));
    let place = refusal(&arm, "joint-offset, actuator 4: why");
    assert!(place.starts_with("no law joint-offset here; there are anchor-offset"), "{place}");
    let place = refusal(&arm, "stroke-loss, actuator 12: why");
    assert!(
        place.starts_with(
            "no stroke-loss at actuator 12 here; it is tried at actuator 0, state 0; actuator 0, state 1;"
        )
    );
    let mut known = arm.clone();
    known.model.effects.push(stroke_loss()).unwrap();
    assert_eq!(
        refusal(&known, "stroke-loss, actuator 4: why"),
        "the model has stroke-loss at actuator 4, state 1, which is rejected: remove it from the model's file first"
    );
}

#[test]
fn temperatures_in_fahrenheit_are_a_reading_and_growth_by_them_is_no_effect() {
    let arm = arm();
    let mut run = measured(&arm, &[Effect::ThermalGrowth { at: Place::Arm, expansion_per_k: 1e-4 }], |time_s| {
        (6e5, 298.0 + 5.0 * (time_s / 40.0).sin())
    });
    let verdict = |run: &Run| diagnose(&arm, run, &PoseOptions::default()).unwrap().diagnosis;
    assert_eq!(laws(&verdict(&run)), ["thermal-growth"]);
    run.samples.iter_mut().for_each(|sample| sample.temperature_c = sample.temperature_c.map(|c| 1.8 * c + 32.0));
    let read = verdict(&run);
    assert_eq!(read.verdict, Verdict::WrongModelOrLog, "{:?}", read.plain);
    assert_eq!(read.other_reading.map(|other| other.misreading), Some(Misreading::Fahrenheit));
    assert!(read.effects.is_empty());
}
