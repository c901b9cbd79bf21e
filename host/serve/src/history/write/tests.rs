//! Runs, tables, models and diagnoses as they are written.

use serde_json::Value;

use super::{DiagnosisEntry, ModelEntry, Seen};
use crate::history::{History, Kind};
use crate::view::EventView;

fn event(number: u32, at_s: f64, kind: &'static str) -> EventView {
    EventView { number, at_s, kind, text: format!("{kind} {number}") }
}

fn see(history: &History, boots: u32, events: &[EventView]) {
    history.see(&seen(boots, events)).unwrap();
}

fn seen(boots: u32, events: &[EventView]) -> Seen<'_> {
    Seen {
        board: "pico",
        device: "d",
        boots,
        table: Some("t"),
        table_from: 0,
        is_idle: false,
        model: None,
        profile: None,
        board_now_s: 10.0,
        now_ms: 1_000_000,
        events,
    }
}

fn runs(history: &History) -> Vec<(String, i64, i64)> {
    let number = |entry: &Value, name: &str| entry[name].as_i64().unwrap_or(-1);
    let run = |entry: &Value| {
        (entry["outcome"].as_str().unwrap().to_owned(), number(entry, "rows"), number(entry, "ended_ms"))
    };
    history.entries(Kind::Runs, None).unwrap().iter().map(run).collect()
}

fn history() -> (tempfile::TempDir, History) {
    let folder = tempfile::tempdir().unwrap();
    let history = History::open(&folder.path().join("history.sqlite3")).unwrap();
    (folder, history)
}

#[test]
fn a_run_is_recorded_once_however_often_its_events_are_read() {
    let (_folder, history) = history();
    let events = [event(3, 4.0, "started"), event(4, 4.5, "row"), event(5, 5.0, "row"), event(6, 6.0, "finished")];
    see(&history, 1, &events[..2]);
    assert_eq!(runs(&history), [("running".into(), 1, -1)]);
    for _ in 0..2 {
        see(&history, 1, &events);
        assert_eq!(runs(&history), [("finished".into(), 2, 996_000)]);
    }
    assert_eq!(history.events(1).unwrap().len(), 4);
    // A board without a memory counts from the beginning; the time differs.
    see(&history, 1, &[event(3, 4.000_001, "started"), event(4, 4.2, "stopped")]);
    assert_eq!(runs(&history).len(), 2);
}

#[test]
fn a_run_from_before_the_table_was_seen_is_of_no_known_table() {
    let (_folder, history) = history();
    let events = [event(3, 4.0, "started"), event(4, 6.0, "finished"), event(5, 7.0, "started")];
    history.see(&Seen { table_from: 5, ..seen(1, &events) }).unwrap();
    let runs = history.entries(Kind::Runs, None).unwrap();
    let tables: Vec<&Value> = runs.iter().map(|run| &run["table"]).collect();
    assert_eq!(tables, [&Value::from("t"), &Value::Null]);
}

#[test]
fn a_run_has_ended_where_a_board_that_starts_anew_is_idle() {
    let (_folder, history) = history();
    see(&history, 1, &[event(3, 4.0, "started"), event(4, 4.5, "row")]);
    // A simulator that was killed counts its starts from one again.
    history.see(&Seen { is_idle: true, ..seen(1, &[]) }).unwrap();
    assert_eq!(runs(&history), [("unknown".into(), 1, -1)]);
}

#[test]
fn the_end_of_a_run_that_nobody_saw_is_not_made_up() {
    let (_folder, history) = history();
    see(&history, 1, &[event(3, 4.0, "started"), event(4, 4.5, "row")]);
    see(&history, 1, &[event(20, 8.0, "started")]);
    see(&history, 2, &[event(0, 0.0, "booted")]);
    assert!(runs(&history).iter().all(|(outcome, ..)| outcome == "unknown"), "{:?}", runs(&history));
    // The end of an unknown run, or of none, belongs to no run.
    see(&history, 2, &[event(1, 1.0, "stopped"), event(2, 1.0, "finished")]);
    assert_eq!(runs(&history).len(), 2);
}

#[test]
fn an_end_is_found_without_the_beginning_of_its_run() {
    let (_folder, history) = history();
    see(&history, 1, &[event(3, 4.0, "started")]);
    see(&history, 1, &[event(40, 8.0, "row"), event(41, 9.0, "fault")]);
    assert_eq!(runs(&history), [("fault".into(), 1, 999_000)]);
}

#[test]
fn the_corrected_model_knows_its_parent() {
    let (_folder, history) = history();
    let model = |digest, parent| ModelEntry { digest, name: "arm.toml", number: Some(1), parent, file: "text" };
    // Seen before as the arm of the server: the parent is added.
    history.add_model(&model("b", None), 1).unwrap();
    let entry = DiagnosisEntry {
        model: model("a", None),
        corrected: Some(model("b", Some("a"))),
        data_name: "run.csv",
        data_digest: "d",
        verdict: "effect-found",
        summary: "A stroke.",
        report: "{}",
        result: Some("{\"html\":\"\"}"),
    };
    history.add_diagnosis(&entry, 2).unwrap();
    history.add_model(&model("b", Some("b")), 3).unwrap();
    let models = history.entries(Kind::Models, None).unwrap();
    let parent = |digest: &str| models.iter().find(|entry| entry["digest"] == digest).map(|entry| &entry["parent"]);
    assert_eq!((models.len(), parent("b")), (2, Some(&"a".into())));
    assert_eq!(history.entries(Kind::Diagnoses, None).unwrap()[0]["corrected"], "b");
    assert_eq!(history.result(1).unwrap().as_deref(), entry.result);
    let large = "x".repeat(super::MAX_RESULT + 1);
    history.add_diagnosis(&DiagnosisEntry { result: Some(&large), ..entry }, 3).unwrap();
    assert_eq!((history.result(2).unwrap(), history.report(2).unwrap().as_deref()), (None, Some("{}")));
    // A model that is seen again keeps the name that a person gave it.
    assert!(history.set_label(Kind::Models, "b", Some("after the bench")).unwrap());
    history.add_model(&model("b", None), 4).unwrap();
    let models = history.entries(Kind::Models, None).unwrap();
    assert!(models.iter().any(|entry| entry["digest"] == "b" && entry["label"] == "after the bench"));
    assert!(!history.set_label(Kind::Models, "c", Some("x")).unwrap());
    assert!(!history.set_label(Kind::Diagnoses, "1 OR 1=1", Some("x")).unwrap());
}
