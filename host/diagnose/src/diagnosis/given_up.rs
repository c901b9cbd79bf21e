//! A diagnosis that is given up ends at once, wherever it is: at each of its checks, whatever is measured.

use std::path::Path;

use super::signal_tests::{cylinder, model};
use super::*;
use crate::progress::Progress;

/// How many checks of a diagnosis are tried, evenly over all of them.
const TRIED: usize = 25;

/// Gives a diagnosis up at many of its checks. It ends with the error, and begins no other piece of work than those that run
/// beside each other.
#[track_caller]
fn ends_at_its_checks(min_checks: usize, diagnose: impl Fn(&Progress) -> Result<(), DiagnoseError>) {
    let complete = Progress::default();
    diagnose(&complete).unwrap();
    let all = complete.n_checks();
    assert!(all >= min_checks, "{all} checks in all of its work");
    let at_once = 8 * rayon::current_num_threads();
    for n in (1..=all).step_by((all / TRIED).max(1)) {
        let progress = Progress::until_check(n);
        let ended = diagnose(&progress);
        assert!(matches!(ended, Err(DiagnoseError::Cancelled(_))), "check {n} of {all}: {ended:?}");
        let more = progress.n_checks() - n;
        assert!(more <= at_once, "{more} checks after that with number {n} of {all}");
    }
}

/// A cylinder: each search has its rounds of weights, candidates, eliminations and a judgement.
#[test]
fn a_diagnosis_of_signals_ends_at_each_of_its_checks() {
    let (model, table) = (model("cylinder.toml"), cylinder(|x, v, p| 0.4 * v + 3.0 + 0.01 * x * p));
    ends_at_its_checks(500, |progress| {
        let options = SignalOptions { progress: progress.clone(), ..SignalOptions::default() };
        diagnose_table(&model, &table, &options).map(|_| ())
    });
}

/// An arm, whose words are read in other ways first.
#[test]
fn a_diagnosis_of_tool_poses_ends_at_each_of_its_checks() {
    let arm = Arm::parse(Path::new("planar4.toml"), include_str!("../../../../examples/planar4.toml")).unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4-run.csv");
    let (run, _) = darm_measure::poses::read(&path, &Names::new(), &darm_measure::poses::Which::default()).unwrap();
    ends_at_its_checks(200, |progress| {
        let options = PoseOptions { progress: progress.clone(), ..PoseOptions::default() };
        diagnose(&arm, &run, &options).map(|_| ())
    });
}
