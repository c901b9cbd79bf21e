//! A page makes a table, records it and finds the measurement. In place of `darm record` runs a script, as `board.rs` says.

use serde_json::{Value, json};

use super::board::{Bench, Page};
use super::http::{Answer, request};

fn planned(bench: &Bench, body: &Value) -> Value {
    let made = bench.post("/api/plan", &[], body);
    assert_eq!(made.status, 200, "{}", made.json());
    made.json()
}

fn record(page: &Page<'_>, digest: &Value, name: &str) -> Answer {
    page.order("/api/record", &json!({ "table": digest, "name": name }))
}

fn recorded(bench: &Bench) -> Value {
    bench.live(|live| live["recordings"]["last"]["is_running"] == false)["recordings"]["last"].clone()
}

#[test]
fn a_page_makes_a_table_of_words_or_of_a_measurement_plan() {
    let bench = Bench::start("planar4.toml");
    let made = planned(&bench, &json!({"of": "words", "words": ["000010000000", "111000000000"], "dwell_s": 0.5}));
    assert_eq!((made["n_visits"].as_u64(), made["name"].as_str()), (Some(2), Some("words.darm")));
    let program = bench.get("/api/program");
    assert_eq!((&program["digest"], &program["origin"]["visits_name"]), (&made["digest"], &json!("words.visits.csv")));
    let refused = bench.post("/api/plan", &[], &json!({"of": "words", "words": ["0000"], "dwell_s": null}));
    assert!(refused.status == 409 && refused.json()["refused"]["text"].as_str().unwrap().starts_with("0000: "));
    for words in [vec![], vec!["000010000000"; 5000]] {
        assert_eq!(bench.post("/api/plan", &[], &json!({"of": "words", "words": words, "dwell_s": null})).status, 422);
    }
    assert!(planned(&bench, &json!({"of": "plan"}))["n_visits"].as_u64() > Some(20));
}

#[test]
fn a_recording_needs_control_a_free_plain_name_and_the_table_that_is_shown() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let made = planned(&bench, &json!({"of": "words", "words": ["000010000000"], "dwell_s": 0.5}));
    let digest = &made["digest"];
    assert_eq!(bench.post("/api/record", &[], &json!({"table": digest, "name": "run-1"})).status, 409);
    let page = bench.page_in_control();
    for name in ["", "../run", "a/b", "a.csv", "run 1"] {
        assert_eq!(record(&page, digest, name).status, 422, "{name}");
    }
    assert_eq!(record(&page, &json!("0".repeat(64)), "run-1").status, 422);
    assert_eq!(record(&page, digest, "run-1").status, 200);
    let last = recorded(&bench);
    assert_eq!((last["text"].as_str(), last["is_complete"].as_bool()), (Some("3 of 3 visits measured"), Some(true)));
    let again = record(&page, digest, "run-1");
    assert!(again.status == 409 && again.json()["refused"]["text"].as_str().unwrap().contains("exists"));
    assert_eq!(bench.get("/api/data")[0]["name"], "run-1.csv");
    let read = request(bench.address(), "GET", "/api/data/run-1.csv", &[], b"");
    let visits = request(bench.address(), "GET", "/api/program/visits", &[], b"");
    assert_eq!((read.status, &read.body), (200, &visits.body));
    for path in ["run-1.darm", "run-1.visits.csv", "..%2Fhistory.sqlite3", "%2Fetc%2Fpasswd", "run-2.csv"] {
        let refused = request(bench.address(), "GET", &format!("/api/data/{path}"), &[], b"");
        assert!(refused.status == 422 || refused.status == 404, "{path}: {}", refused.status);
    }
    assert_eq!(record(&page, digest, "lost-1").status, 200);
    let last = bench.live(|live| live["recordings"]["last"]["is_complete"] == false)["recordings"]["last"].clone();
    assert_eq!(recorded(&bench)["text"], "no camera found", "{last}");
}
