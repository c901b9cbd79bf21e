//! Diagnoses of real measurements, and of files that are none.

use std::collections::BTreeMap;
use std::path::Path;

use darm_robot::robot::Motion;
use darm_robot::source::Source;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::correction::Keep;
use crate::effect::LawName;
use crate::linearise::linearise;
use crate::linearise::model::Predictor;
use crate::model_file::ModelFile;
use crate::outcome::{ErrorFigure, Errors, RepeatedIn, Verdict};
use crate::prepare::groups::Groups;
use crate::prepare::signals::Prepared;
use crate::select::problem::{Neighbours as _, Trial};
use crate::select::signals::Signals;
use crate::select::signals::factored::{Factored, judged};
use crate::select::significance::quantile_975;
use darm_measure::FindingKind;

fn options(hold_out: HoldOut, keep: Option<&str>, always: &[&str]) -> SignalOptions {
    let keep = keep.map(|text| text.parse().unwrap());
    let preparation = Preparation { keep, hold_out, ..Preparation::default() };
    let always = always.iter().map(ToString::to_string).collect();
    SignalOptions { preparation, always, seed: 1, ..SignalOptions::default() }
}

fn measured(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/measured").join(name)
}

pub(super) fn model(name: &str) -> Model {
    Model::read(&measured(name))
}

fn held_out(errors: &Errors) -> &ErrorFigure {
    errors.held_out.as_ref().unwrap()
}

#[test]
fn the_nominal_torques_of_a_real_arm_are_those_that_another_program_gives() {
    let how = options(HoldOut::Column("heldout".into()), None, &[]).preparation;
    let (table, _) = Table::read(&measured("tx40_joint_200hz.csv.gz"), &Names::new()).unwrap();
    let experiment = linearise(&model("tx40.urdf"), &Prepared::new(table, &how, None).unwrap()).unwrap();
    for (axis, expected) in [30.7, 21.4, 12.7, 6.48, 9.02, 5.47].into_iter().enumerate() {
        let held_out = experiment.rows.iter().enumerate().filter(|(_, row)| row.held_out);
        let squares: Vec<f64> = held_out.map(|(k, _)| experiment.residuals[k * 6 + axis].powi(2)).collect();
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!((rms / expected - 1.0).abs() < 5e-3, "joint {}: {rms}", axis + 1);
    }
}

fn finger() -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/finger.xml");
    let lock = BTreeMap::from([("tip".to_string(), 0.3)]);
    Model::of_source(&Source::read::<String>(&path).unwrap(), &(&lock).into()).unwrap()
}

/// A motion of the finger, of 200 rows in each run; `measured` makes the torques of a run and its speeds of those that the model predicts.
fn finger_table(model: &Model, n_runs: u32, mut measured: impl FnMut(usize, [f64; 2], &mut [f64])) -> Table {
    let Predictor::Any(robot) = &model.what else { panic!("no robot") };
    let mut text = "time_s,run,q1_rad,q2_rad,v1,v2,a1,a2,tau1_nm,tau2_nm\n".to_string();
    for row in 0..200 * n_runs {
        let (t, run) = (0.01 * f64::from(row), row / 200);
        let [q, v, a] =
            [[t.sin(), (2.0 * t).cos()], [t.cos(), -2.0 * (2.0 * t).sin()], [-t.sin(), -4.0 * (2.0 * t).cos()]];
        let mut torque = robot.dynamics(&Motion { state: [&q, &v, &a], load: None }).unwrap().torque;
        measured(run as usize, v, &mut torque);
        let numbers = [vec![t, f64::from(run)], q.to_vec(), v.to_vec(), a.to_vec(), torque].concat();
        text += &(numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(",") + "\n");
    }
    Table::read_text(Path::new("finger.csv"), text.as_bytes(), &Names::new()).unwrap().0
}

#[test]
fn the_rotors_of_an_mjcf_are_in_its_torques() {
    let model = finger();
    let Predictor::Any(robot) = &model.what else { panic!("no robot") };
    assert!(robot.joints.iter().all(|joint| joint.armature == 1e-5));
    let table = finger_table(&model, 1, |_, _, _| {});
    let experiment = linearise(&model, &Prepared::new(table, &Preparation::default(), None).unwrap()).unwrap();
    let largest = experiment.residuals.iter().fold(0.0f64, |largest, r| largest.max(r.abs()));
    assert!(largest < 1e-12, "{largest}");
}

#[test]
fn moving_a_plate_does_what_its_columns_say() {
    let how = options(HoldOut::Column("heldout".into()), None, &[]).preparation;
    let (table, _) = Table::read(&measured("human_wholebody_30hz.csv.gz"), &Names::new()).unwrap();
    let numbers = |name: &str| table.quantity(name).unwrap().numbers.clone();
    let [fx, fy, fz] = ["Fx", "Fy", "Fz"].map(numbers);
    // Of a plate at d moments are M − d×F.
    let d = [0.02, -0.03, 0.05];
    let mut moved = table.clone();
    for column in &mut moved.columns {
        let arm = |row: usize| match &column.name[..] {
            "Mx" => d[1] * fz[row] - d[2] * fy[row],
            "My" => d[2] * fx[row] - d[0] * fz[row],
            "Mz" => d[0] * fy[row] - d[1] * fx[row],
            _ => 0.0,
        };
        let arms: Vec<f64> = (0..column.numbers.len()).map(arm).collect();
        column.numbers.iter_mut().zip(arms).for_each(|(number, arm)| *number -= arm);
    }
    let [before, after] = [table, moved]
        .map(|table| linearise(&model("human.urdf"), &Prepared::new(table, &how, None).unwrap()).unwrap());
    let frame = after.candidates.iter().find(|candidate| candidate.law == LawName::SensorFrame).unwrap();
    for (row, fz) in fz.iter().enumerate() {
        for axis in 0..2 {
            let at = 6 * row + axis;
            let column: f64 = frame.values.iter().zip(d).map(|(value, d)| value.column[at] * d).sum();
            // The centre of pressure multiplies the predicted force, the column the measured one.
            let expected = before.residuals[at] - column * before.residuals[6 * row + 4] / fz;
            assert!((after.residuals[at] + column - expected).abs() < 1e-12, "{row} {axis}");
        }
    }
}

#[test]
fn friction_of_a_real_cylinder_is_found_and_told_at_a_pressure_that_no_fit_saw() {
    let options = options(HoldOut::Where("set_bar = 5".parse().unwrap()), Some("seal = NAP310"), &[]);
    let data = measured("cylinder_friction_20hz.csv.gz");
    let found = diagnose_file(&model("cylinder.toml"), &data, &Names::new(), &options).unwrap().diagnosis;
    assert!((held_out(&found.error.before).norm.value - 6.78).abs() < 0.01);
    assert!(held_out(&found.error.after).norm.value < 0.87, "{:?}", found.plain);
    assert!(found.effects.iter().any(|effect| effect.law.as_str().contains("friction")));
}

/// A cylinder's table with a law in its force and noise that follows no pattern.
pub(super) fn cylinder(force: impl Fn(f64, f64, f64) -> f64) -> Table {
    cylinder_at(|t| 20.0 * (0.5 * t).sin(), force)
}

/// The same along another motion, mm.
fn cylinder_at(position: impl Fn(f64) -> f64, force: impl Fn(f64, f64, f64) -> f64) -> Table {
    let mut text = "t_s,x_mm,p_bar,F_N\n".to_string();
    let mut noise = 1u64;
    for k in 0..1200 {
        noise = noise.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let (t, chance) = (f64::from(k) * 0.05, (noise >> 40) as f64 / f64::from(1 << 24) - 0.5);
        let (x, v) = (position(t), (position(t + 1e-4) - position(t - 1e-4)) / 2e-4);
        let p = 3.0 + (0.11 * t).sin();
        let f = p * 1e5 * std::f64::consts::FRAC_PI_4 * 0.025f64.powi(2) + force(x, v, p) + chance;
        text += &format!("{t:.3},{x:.5},{p:.5},{f:.5}\n");
    }
    Table::read_text(Path::new("a.csv"), text.as_bytes(), &Names::new()).unwrap().0
}

#[test]
fn nothing_is_named_where_nothing_is_missing_and_an_offset_where_one_is() {
    let options = options(HoldOut::Own, None, &[]);
    let clean = diagnose_table(&model("cylinder.toml"), &cylinder(|_, _, _| 0.0), &options).unwrap().diagnosis;
    assert_eq!((clean.verdict, clean.effects.len()), (Verdict::NoEffect, 0), "{:?}", clean.plain);
    let offset = diagnose_table(&model("cylinder.toml"), &cylinder(|_, _, _| 5.0), &options).unwrap().diagnosis;
    let [found] = &offset.effects[..] else { panic!("{:?}", offset.plain) };
    let [low, high] = found.values[0].ci95.unwrap();
    assert!(
        found.law == LawName::Offset && low < -5.0 + 0.1 && high > -5.0 - 0.1 || low < 5.1 && high > 4.9,
        "{found:?}"
    );
}

#[test]
fn a_model_with_what_was_found_predicts_as_told_and_lacks_nothing() {
    let (table, how) = (cylinder(|_, v, _| 0.4 * v + 3.0), options(HoldOut::Last(0.3), None, &[]));
    let Outcome { diagnosis: first, correction } = diagnose_table(&model("cylinder.toml"), &table, &how).unwrap();
    assert_eq!(first.verdict, Verdict::EffectFound, "{:?}", first.plain);
    let output = tempfile::NamedTempFile::with_suffix(".toml").unwrap();
    let file = ModelFile::read(&measured("cylinder.toml"), first.kind).unwrap();
    correction.corrected(&file, &first, Keep::Effects).unwrap().write(output.path()).unwrap();
    let second = diagnose_table(&Model::read(output.path()), &table, &how).unwrap().diagnosis;
    let (reported, predicted) = (held_out(&first.error.after).norm.value, held_out(&second.error.before).norm.value);
    assert!((reported / predicted - 1.0).abs() < 1e-9, "{reported} {predicted}");
    assert_eq!((second.verdict, second.effects.len()), (Verdict::NoEffect, 0), "{:?}", second.plain);
}

/// Rates carry one wrong position into the rows around it, whether fits see them or not.
#[test]
fn one_position_that_is_zero_changes_nothing_and_is_listed() {
    let motion = |t: f64| 20.0 * (0.5 * t).sin() + 30.0;
    let found = |bad_s: f64| {
        let position = |t: f64| if (t - bad_s).abs() < 1e-6 { 0.0 } else { motion(t) };
        let table = cylinder_at(position, |_, v, _| 0.4 * v);
        diagnose_table(&model("cylinder.toml"), &table, &options(HoldOut::Own, None, &[])).unwrap().diagnosis
    };
    let clean = found(-1.0);
    for row in [500, 850] {
        let damaged = found(0.05 * f64::from(row));
        let named = |of: &Diagnosis| of.effects.iter().map(|effect| effect.law).collect::<Vec<_>>();
        assert_eq!((damaged.verdict, named(&damaged)), (clean.verdict, named(&clean)), "{:?}", damaged.plain);
        let note = damaged.findings.iter().find(|finding| finding.kind == FindingKind::FarOffNeighbours).unwrap();
        assert_eq!(note.line, Some(row as usize + 2), "{note:?}");
    }
}

#[test]
fn what_no_law_explains_is_told_by_its_channel_and_may_be_kept() {
    let table = cylinder(|x, _, _| 6.0 * (0.785 * x).cos());
    let how = options(HoldOut::Own, None, &[]);
    let Outcome { diagnosis: first, correction } = diagnose_table(&model("cylinder.toml"), &table, &how).unwrap();
    assert_eq!((first.verdict, first.effects.len()), (Verdict::UnexplainedStructure, 0), "{:?}", first.plain);
    let term = &first.remaining.depends_on[0];
    assert!(term.variable.starts_with("position") && term.share > 0.9, "{term:?}");
    assert!(term.held_out_gain.as_ref().unwrap().value > 2.0, "{term:?}");
    let output = tempfile::NamedTempFile::with_suffix(".toml").unwrap();
    let file = ModelFile::read(&measured("cylinder.toml"), first.kind).unwrap();
    assert_eq!(correction.corrected(&file, &first, Keep::Effects), None);
    correction.corrected(&file, &first, Keep::EffectsAndTerms).unwrap().write(output.path()).unwrap();
    let second = diagnose_table(&Model::read(output.path()), &table, &how).unwrap().diagnosis;
    // Noise is even over 1 N: 0.29 N.
    assert!(held_out(&first.error.before).norm.value > 3.0 && held_out(&second.error.before).norm.value < 0.35);
}

#[test]
fn what_cannot_be_told_apart_is_not_named_and_the_rows_that_would_are_proposed() {
    // All rows at one speed each way: an offset against speed and one against friction differ nowhere.
    let (table, how) = (
        cylinder_at(|t| 20.0 * (2.0 * (0.05 * t).fract() - 1.0).abs(), |_, v, _| 0.5 * v),
        options(HoldOut::Own, None, &[]),
    );
    let found = diagnose_table(&model("cylinder.toml"), &table, &how).unwrap().diagnosis;
    assert_eq!(found.verdict, Verdict::NotIdentifiable, "{:?}", found.plain);
    assert!(found.alternatives.len() > 1 && found.next_measurement.is_some());
}

#[test]
fn models_with_more_and_with_fewer_effects_follow_from_one_that_is_factorised() {
    let table = cylinder(|x, v, p| 0.4 * v + 3.0 + 0.01 * x * p);
    let prepared = Prepared::new(table, &options(HoldOut::Last(0.3), None, &[]).preparation, None).unwrap();
    let experiment = linearise(&model("cylinder.toml"), &prepared).unwrap();
    let groups = Groups::new(&experiment.rows);
    let problem = Signals::new(experiment, groups);
    let base = problem.reweight_until_converged(problem.start(vec![0, 4, 20])).unwrap();
    let weighted = problem.under(&base);
    let same = |a: &Trial<Signals>, b: &Trial<Signals>| {
        assert_eq!(a.fit.active, b.fit.active);
        assert!((weighted.gain(a, b) / a.error).abs() < 1e-4, "{:?}: {:?} {:?}", a.fit.active, a.error, b.error);
        let apart = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-5 * (a.abs() + b.abs()) + 1e-9;
        assert!(a.fit.values.iter().zip(&b.fit.values).all(apart), "{:?}", a.fit.active);
    };
    let more = problem.neighbours(&base).unwrap().with_one_more().unwrap();
    assert!(more.len() > 20);
    for trial in &more {
        same(trial, &judged(weighted, trial.fit.active.clone(), trial.effect).unwrap());
    }
    let factored = Factored::new(weighted, vec![0, 4, 20, 7]).unwrap();
    for dropped in [&[4][..], &[0, 7], &[20, 0, 4, 7]] {
        let without = factored.without(dropped).unwrap();
        same(&without, &judged(weighted, without.fit.active.clone(), None).unwrap());
    }
}

#[test]
fn of_very_many_rows_one_in_several_is_looked_at_and_that_is_told() {
    let rows: String = (0..25_000).map(|k| format!("{},{},2,98\n", f64::from(k) * 1e-3, k % 20)).collect();
    let table = Table::read_text(Path::new("a.csv"), format!("t_s,x_mm,p_bar,F_N\n{rows}").as_bytes(), &Names::new());
    let prepared = Prepared::new(table.unwrap().0, &options(HoldOut::Own, None, &[]).preparation, None).unwrap();
    assert!((8_000..=10_000).contains(&prepared.rows.len()), "{}", prepared.rows.len());
    assert!(
        prepared
            .findings
            .iter()
            .any(|finding| finding.kind == FindingKind::Decimated && finding.text.starts_with("decimated by 3"))
    );
}

#[test]
fn repeatability_is_the_scatter_of_rows_under_the_same_conditions() {
    // Two targets, each with the same two readings 2 counts apart again and again: 1 about the mean, less what that takes. A
    // quarter of the rows is held out.
    let rows: String =
        (0..200).map(|k| format!("{k},{},{}\n", 100 * (k / 2 % 2), 100 * (k / 2 % 2) + 2 * (k % 2))).collect();
    let table = Table::read_text(
        Path::new("a.csv"),
        format!("t_s,target_count,position_count\n{rows}").as_bytes(),
        &Names::new(),
    );
    let found = diagnose_table(&Predictor::Servo.into(), &table.unwrap().0, &options(HoldOut::Own, None, &[]))
        .unwrap()
        .diagnosis;
    let reported = found.repeatability.unwrap();
    assert!(
        (reported.norm.value - (152.0f64 / 150.0).sqrt()).abs() < 1e-9
            && reported.norm.unit == "count"
            && reported.dof == 150,
        "{reported:?}"
    );
    let moving = diagnose_table(&model("cylinder.toml"), &cylinder(|_, _, _| 0.0), &options(HoldOut::Own, None, &[]));
    assert_eq!(moving.unwrap().diagnosis.repeatability.unwrap().repeated_in, RepeatedIn::Neighbours);
}

#[test]
fn the_same_table_gives_the_same_numbers() {
    let (table, options) = (cylinder(|_, v, _| 0.3 * v), options(HoldOut::Last(0.3), None, &[]));
    let reported = || {
        serde_json::to_string(&diagnose_table(&model("cylinder.toml"), &table, &options).unwrap().diagnosis).unwrap()
    };
    assert_eq!(reported(), reported());
}

#[test]
fn damaged_files_are_told_and_nothing_panics() {
    let rows = |n: usize, row: &dyn Fn(usize) -> String| (0..n).map(row).collect::<Vec<_>>().join("\n");
    let good = rows(200, &|k| format!("{},{},{},{}", k as f64 * 0.1, (k % 20) as f64, 2.0, 98.0 + (k % 7) as f64));
    let head = "t_s,x_mm,p_bar,F_N\n";
    let damaged: Vec<String> = vec![
        String::new(),
        "\n".into(),
        head.into(),
        "t_s,x_mm,p_bar\n1,2,3\n".into(),
        "a,b\n1,2\n".into(),
        format!("{head}1,2,3\n"),
        format!("{head}1,2,3,4,5\n"),
        format!("{head}1,2,3,4\n"),
        format!("{head}{}", rows(200, &|_| "nan,nan,nan,nan".into())),
        format!("{head}{}", rows(200, &|k| format!("{k},{k},inf,1"))),
        format!("{head}{}", rows(200, &|_| "x,y,z,w".into())),
        format!("{head}{}", rows(200, &|_| "1,1,1,1".into())),
        format!("{head}{}", rows(200, &|_| "0,0,0,0".into())),
        format!("{head}{}", rows(200, &|k| format!("{},1,2,98", 200 - k))),
        format!("{head}{}", rows(200, &|k| format!("{},{k},2,98", k % 2))),
        format!("{head}{}", rows(200, &|k| format!("{k},{k},2,1e308"))),
        format!("{head}{}", rows(200, &|k| format!("{k},{k},1e300,1e300"))),
        format!("{head}{}", rows(200, &|k| format!("{k},1e-320,{k},1e-320"))),
        format!("{head}{good}\n,,,"),
        format!("{head}{good}\n1,2,3"),
        format!("{head}# only a comment"),
        format!("{head}{}", rows(5, &|k| format!("{k},{k},{k},{k}"))),
        format!("t_s,x_mm,p_bar,F_N,run\n{}", rows(200, &|k| format!("{k},{k},2,98,{k}"))),
        format!("t_s,x_mm,p_bar,F_N,held_out\n{}", rows(200, &|k| format!("{k},{k},2,98,1"))),
        format!("t_s,x_mm,p_bar,F_N,held_out\n{}", rows(200, &|k| format!("{k},{k},2,98,maybe"))),
        format!("t_s,x_mm,p_bar,F_N,F_N\n{}", rows(200, &|k| format!("{k},{k},2,98,97"))),
        format!("t_ms,x_m,p_pa,F_N\n{good}"),
        format!("{head}{good}\n\u{0}\u{0},1,1,1"),
        "\u{feff}t_s;x_mm;p_bar;F_N\n1;2;3;4\n".into(),
        format!("{head}{}", "9".repeat(5000)),
        format!("{head}\"1,2,3,4\n5,6,7,8\n"),
    ];
    for (number, text) in damaged.iter().enumerate() {
        for model in [&model("cylinder.toml"), &model("tx40.urdf"), &model("panda.toml"), &Predictor::Servo.into()] {
            let Ok((table, _)) = Table::read_text(Path::new("a.csv"), text.as_bytes(), &Names::new()) else { continue };
            if let Err(error) = diagnose_table(model, &table, &options(HoldOut::Own, None, &[])) {
                assert!(error.to_string().len() > 20, "{number}: {error}");
            }
        }
    }
}

#[test]
fn a_law_that_is_rejected_returns_neither_as_an_effect_nor_as_a_fitted_term() {
    let table = cylinder(|_, v, _| 6.0 * v / v.hypot(1.0));
    let model = Model::from(Predictor::Cylinder { bore_m: 0.025 });
    let run = |rejected: &[&str]| {
        let rejected = rejected.iter().map(|text| text.parse().unwrap()).collect();
        diagnose_table(&model, &table, &SignalOptions { rejected, ..options(HoldOut::Own, None, &[]) })
    };
    let found = run(&[]).unwrap();
    assert_eq!(found.diagnosis.effects[0].law, LawName::CoulombFriction, "{:?}", found.diagnosis.plain);
    let frictions: Vec<String> = LawName::ALL
        .iter()
        .filter(|law| found.diagnosis.selection_path.iter().any(|step| step.candidate.law == **law))
        .map(|law| format!("{law}: the seal was removed"))
        .collect();
    let all: Vec<&str> = frictions.iter().map(String::as_str).collect();
    let Outcome { diagnosis, correction } = run(&all).unwrap();
    assert_eq!((diagnosis.effects.len(), diagnosis.alternatives.len(), diagnosis.selection_path.len()), (0, 0, 0));
    let along = &diagnosis.remaining.depends_on;
    assert!(along.iter().any(|one| one.variable.contains("velocity")), "{along:?}");
    assert!(!correction.terms.iter().any(|term| term.along.as_ref().is_some_and(|along| along.contains("velocity"))));
    let error = run(&["backlash: why"]).unwrap_err().to_string();
    assert!(
        error.starts_with("no law backlash here; there are area-along-stroke, coulomb-friction, delay, "),
        "{error}"
    );
}

/// A viscous friction that differs from run to run: the mean of eight of them is off by their scatter over the root of eight, however
/// many rows each has.
#[test]
fn an_interval_counts_runs_and_not_rows_where_these_differ() {
    let model = finger();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    // Of mean zero and unit standard deviation.
    let differs = [-1.4, 0.6, 1.1, -0.2, -0.9, 1.3, 0.3, -0.8];
    let (mean, scatter) = (2e-3, 4e-4);
    let table = finger_table(&model, 8, |run, speeds, torque| {
        torque[0] += (mean + scatter * differs[run]) * speeds[0];
        torque.iter_mut().for_each(|torque| *torque += 1e-5 * rng.random_range(-1.0..1.0));
    });
    let found = diagnose_table(&model, &table, &SignalOptions::default()).unwrap();
    let [low, high] = found.diagnosis.effects[0].values[0].ci95.unwrap();
    let expected = quantile_975(7) * scatter / 8f64.sqrt();
    assert!((high - low) / 2.0 > 0.8 * expected && low < mean && mean < high, "{low} {high} {expected}");
}
