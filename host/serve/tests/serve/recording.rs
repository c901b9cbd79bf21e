//! A page makes a table, records it and finds the measurement. In place of `darm record` runs a script, as `board.rs` says.

use std::thread;

use serde_json::{Value, json};

use super::board::{Bench, Page, SLOW_START};
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

fn of_words(words: &[&str], dwell_s: f64) -> Value {
    let visits: Vec<Value> = words.iter().map(|word| json!({"word": word, "dwell_s": dwell_s})).collect();
    json!({"of": "visits", "visits": visits, "may_rest": false})
}

/// A draft opens nothing, and what is wrong is the visit's.
#[test]
fn a_draft_shows_when_the_arm_rests_or_which_visit_is_refused() {
    let bench = Bench::start("planar4.toml");
    let draft = |visits: Value, may_rest: bool| {
        let answer = bench.post("/api/draft", &[], &json!({"visits": visits, "may_rest": may_rest}));
        (answer.status, answer.json())
    };
    let visit = |word: &str, dwell_s: f64| json!({"word": word, "dwell_s": dwell_s});
    let (status, seen) = draft(json!([visit("000010000000", 0.5), visit("111000000000", 1.5)]), false);
    let rests = seen["visits_s"].as_array().unwrap();
    let length = |k: usize| rests[k][1].as_f64().unwrap() - rests[k][0].as_f64().unwrap();
    assert!(status == 200 && (length(0) - 0.5).abs() < 1e-9 && (length(1) - 1.5).abs() < 1e-9, "{seen}");
    assert!(seen["lanes"].as_array().unwrap().len() == 12 && bench.get("/api/program").is_null());
    for (wrong, says) in [("0000", "visit 2, 0000: "), ("00001000000x", "visit 2, 00001000000x: ")] {
        let (status, refused) = draft(json!([visit("000010000000", 0.5), visit(wrong, 0.5)]), false);
        assert!(status == 409 && refused["refused"]["text"].as_str().unwrap().starts_with(says), "{refused}");
        assert_eq!(refused["refused"]["visit"], 1);
    }
    // Longer than an output may be on without a pause.
    let long = json!([visit("000010000000", 200.0), visit("000010000000", 3000.0)]);
    let (status, refused) = draft(long.clone(), false);
    assert!(status == 409 && refused["refused"]["visit"] == 1, "{refused}");
    let many: Value = vec![visit("000010000000", 200.0); 10].into();
    assert_eq!(draft(many.clone(), false).0, 409);
    assert_eq!(draft(many, true).0, 200, "with rests");
}

#[test]
fn a_table_that_is_opened_with_its_visit_file_is_recorded() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    planned(&bench, &of_words(&["000010000000", "111000000000"], 0.5));
    let [table, visits] =
        ["table", "visits"].map(|part| request(bench.address(), "GET", &format!("/api/program/{part}"), &[], b"").body);
    let open_visits = |text: &[u8]| request(bench.address(), "POST", "/api/open-visits?name=a.visits.csv", &[], text);
    assert_eq!(bench.open("other.darm", &bench.table(&["000010000000"], 0.3)).status, 200);
    let refused = open_visits(&visits);
    assert!(refused.status == 422 && refused.json()["refused"]["text"].as_str().unwrap().contains("another table"));
    assert_eq!(open_visits(b"visit,label").status, 422);
    assert_eq!(bench.open("a.darm", &table).status, 200);
    assert!(bench.get("/api/program")["origin"].is_null());
    assert_eq!(open_visits(&visits).status, 200);
    let program = bench.get("/api/program");
    let origin = &program["origin"];
    assert_eq!((origin["n_visits"].as_u64(), origin["model"].as_u64()), (Some(2), Some(0)), "{origin}");
    assert_eq!(record(&bench.page_in_control(), &program["digest"], "run-1").status, 200);
    assert_eq!(recorded(&bench)["is_complete"], true);
}

#[test]
fn a_page_makes_a_table_of_visits_or_of_a_measurement_plan() {
    let bench = Bench::start("planar4.toml");
    let made = planned(&bench, &of_words(&["000010000000", "111000000000"], 0.5));
    assert_eq!((made["n_visits"].as_u64(), made["name"].as_str()), (Some(2), Some("visits.darm")));
    let program = bench.get("/api/program");
    assert_eq!((&program["digest"], &program["origin"]["visits_name"]), (&made["digest"], &json!("visits.visits.csv")));
    for words in [vec![], vec!["000010000000"; 5000]] {
        assert_eq!(bench.post("/api/plan", &[], &of_words(&words, 0.5)).status, 422);
    }
    assert!(planned(&bench, &json!({"of": "plan"}))["n_visits"].as_u64() > Some(20));
}

#[test]
fn a_recording_needs_control_a_free_plain_name_and_the_table_that_is_shown() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let made = planned(&bench, &of_words(&["000010000000"], 0.5));
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

/// Its process would say `Hello` after the stop was confirmed, and play.
#[test]
fn a_recording_that_a_stop_overtakes_does_not_start() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let digest = planned(&bench, &of_words(&["000010000000"], 0.5))["digest"].clone();
    let page = bench.page_in_control();
    let refused = |name: &str, known: &Value| {
        let order = json!({ "table": digest, "name": name, "stops": known });
        let answer = page.order("/api/record", &order);
        assert_eq!((answer.status, &answer.json()["refused"]["kind"]), (409, &json!("stopped")), "{name}");
    };
    thread::scope(|scope| {
        let late = scope.spawn(|| refused("slow-1", &Value::Null));
        thread::sleep(SLOW_START / 2);
        assert_eq!(bench.stop().status, 200);
        late.join().unwrap();
    });
    let known = bench.get("/api/live")["stops"].as_u64().unwrap();
    refused("run-1", &json!(known - 1));
    assert_eq!(bench.get("/api/data"), json!([]));
    assert_eq!(page.order("/api/record", &json!({ "table": digest, "name": "run-1", "stops": known })).status, 200);
}
