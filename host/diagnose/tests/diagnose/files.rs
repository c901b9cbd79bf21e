//! Files in, diagnosis and corrected model out; how far it is, and giving it up.

use std::path::{Path, PathBuf};
use std::time::Duration;

use darm_diagnose::correction::Keep;
use darm_diagnose::diagnosis::SignalOptions;
use darm_diagnose::error::{DiagnoseError, sentence};
use darm_diagnose::files::{FileDiagnosis, FileOptions, Files, FilesError, Subject};
use darm_diagnose::outcome::Verdict;
use darm_diagnose::progress::{Progress, Stage};

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)
}

fn diagnose(model: &Path, data: &Path, progress: &Progress) -> Result<FileDiagnosis, FilesError> {
    let rows = SignalOptions { seed: 1, progress: progress.clone(), ..SignalOptions::default() };
    Files { model: model.into(), data: data.into() }
        .diagnose(Subject::read(model)?, &FileOptions { rows, ..FileOptions::default() })
}

#[test]
fn the_corrected_model_of_files_explains_the_same_measurements() {
    let progress = Progress::default();
    let (model, data) = (example("planar4.toml"), example("planar4-run.csv"));
    let found = diagnose(&model, &data, &progress).unwrap();
    assert_eq!(found.diagnosis.verdict, Verdict::EffectFound);
    assert_eq!(progress.stage(), Stage::Judge);
    assert!(progress.n_tried() >= found.diagnosis.selection_path.iter().filter(|tried| !tried.refined).count());
    let folder = tempfile::tempdir().unwrap();
    let next = folder.path().join("next.toml");
    let number = found.write_corrected(&next, Keep::Effects).unwrap();
    assert_eq!(number, Some(u64::from(found.arm().unwrap().model.number) + 1));
    let again = diagnose(&next, &data, &Progress::default()).unwrap();
    assert_eq!(again.diagnosis.verdict, Verdict::NoEffect);
    assert_eq!(again.write_corrected(&folder.path().join("third.toml"), Keep::Effects).unwrap(), None);
}

#[test]
fn a_diagnosis_that_is_given_up_has_no_result() {
    let (model, data) = (example("tx40.toml"), example("tx40-motion.csv.gz"));
    let progress = Progress::default();
    let ended = std::thread::scope(|scope| {
        let running = scope.spawn(|| diagnose(&model, &data, &progress));
        while progress.stage() != Stage::Select && !running.is_finished() {
            std::thread::sleep(Duration::from_millis(1));
        }
        progress.cancel();
        running.join().unwrap()
    });
    assert!(matches!(ended, Err(FilesError::Diagnose { source: DiagnoseError::Cancelled(_), .. })), "{ended:?}");
    // How soon is tested in checks, not in seconds: `host/diagnose/src/diagnosis/given_up.rs`.
    assert!(progress.n_tried() < 2000, "the search went on: {} models", progress.n_tried());
}

#[test]
fn errors_name_file_and_line() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(example("planar4-run.csv")).unwrap();
    let line = 1 + text.lines().position(|line| !line.starts_with('#')).unwrap() + 1;
    let broken: Vec<String> = text
        .lines()
        .enumerate()
        .map(|(k, row)| if k + 1 == line { row.replace(',', ",x") } else { row.into() })
        .collect();
    let data = folder.path().join("run.csv");
    std::fs::write(&data, broken.join("\n") + "\n").unwrap();
    let error = diagnose(&example("planar4.toml"), &data, &Progress::default()).unwrap_err();
    let text = sentence(&error);
    assert!(text.starts_with(&format!("{}:{line}:", data.display())), "{text}");
    let missing = diagnose(&folder.path().join("none.toml"), &data, &Progress::default()).unwrap_err();
    assert!(sentence(&missing).starts_with(&folder.path().join("none.toml").display().to_string()));
}
