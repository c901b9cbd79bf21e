//! The history: runs, diagnoses, models and tables are recorded, listed and exported, and change by no request.

use serde_json::Value;

use super::board::{Bench, RealTime, example};
use super::diagnosis::diagnose_example;
use super::http::request;
use super::webdriver::Browser;

/// Plays a short table to its end, and diagnoses the example.
fn use_it(bench: &Bench) -> String {
    let page = bench.page_in_control();
    let digest = page.upload(&bench.table(&["000010000000", "101000000000"], 0.05));
    page.play(&digest);
    let is_event = |live: &Value, kind| live["events"].as_array().unwrap().iter().any(|event| event["kind"] == kind);
    bench.live(|live| is_event(live, "finished"));
    // What a page has seen is there already.
    assert_eq!(bench.get("/api/history")["runs"][0]["outcome"], "finished");
    diagnose_example(bench);
    digest
}

#[test]
fn what_was_seen_is_listed_and_exported() {
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    let digest = use_it(&bench);
    let history = bench.get("/api/history");
    let run = &history["runs"][0];
    assert_eq!((run["table"].as_str(), run["rows"].as_u64() > Some(1)), (Some(digest.as_str()), true), "{run}");
    let (began_ms, ended_ms) = (run["started_ms"].as_i64().unwrap(), run["ended_ms"].as_i64().unwrap());
    assert!(began_ms < ended_ms && ended_ms - began_ms < 60_000, "{run}");
    let events = bench.get(&format!("/api/history/events?id={}", run["id"]));
    let kinds: Vec<&str> = events.as_array().unwrap().iter().filter_map(|event| event["kind"].as_str()).collect();
    assert_eq!((kinds.first(), kinds.last()), (Some(&"started"), Some(&"finished")));
    let table = request(bench.address(), "GET", &format!("/api/history/table?digest={digest}"), &[], b"");
    assert_eq!(table.body, bench.table(&["000010000000", "101000000000"], 0.05));
    let upload = &history["uploads"][0];
    assert_eq!((upload["table"].as_str(), &upload["device"]), (Some(digest.as_str()), &run["device"]), "{upload}");
    lineage(&bench, &history);
    let export = bench.get("/api/history/export");
    assert_eq!(export["entries"]["runs"][0]["events"], events);
    assert_eq!(export["entries"]["diagnoses"][0]["report"]["verdict"], "effect-found");
    let csv = request(bench.address(), "GET", "/api/history/export?of=runs", &[], b"");
    let text = String::from_utf8(csv.body).unwrap();
    assert!(text.starts_with("id,started_ms,") && text.lines().count() == 2 && text.contains(&digest), "{text}");
    for path in ["/api/history", "/api/history/export", "/api/history/events?id=1"] {
        assert_eq!(request(bench.address(), "POST", path, &[], b"").status, 405, "{path}");
        let foreign = ["Origin: http://evil.example"];
        assert_eq!(request(bench.address(), "GET", path, &foreign, b"").status, 403, "{path}");
    }
    assert_eq!(request(bench.address(), "GET", "/api/history/model?digest=none", &[], b"").status, 422);
}

/// The corrected model is a child of the arm of the server, which is the model that was diagnosed.
fn lineage(bench: &Bench, history: &Value) {
    let diagnosis = &history["diagnoses"][0];
    assert_eq!(
        (&diagnosis["verdict"], &diagnosis["model"]),
        (&"effect-found".into(), &bench.wired.arm.hash().to_string().into())
    );
    let models = history["models"].as_array().unwrap();
    let child = models.iter().find(|model| model["digest"] == diagnosis["corrected"]).unwrap();
    assert_eq!((models.len(), &child["parent"]), (2, &diagnosis["model"]));
    let file = bench.get(&format!("/api/history/model?digest={}", child["digest"].as_str().unwrap()));
    let arm = darm_arm::arm::Arm::parse(&example("n.toml"), file.as_str().unwrap()).unwrap();
    assert_eq!(arm.hash().to_string(), child["digest"].as_str().unwrap());
}

#[test]
fn a_person_looks_at_the_history_in_a_browser() {
    let Some(browser) = Browser::start(1280) else { return };
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    browser.open(&format!("http://{}/history", bench.address()));
    browser.wait("document.querySelector('#runs').textContent.includes('No run yet: a run is')");
    use_it(&bench);
    browser.click("#refresh");
    browser.wait("document.querySelector('#runs').textContent.includes('finished')");
    browser.wait("document.querySelector('.lineage > li > ul > li').textContent.includes('model 1')");
    browser.wait("document.querySelector('#diagnoses').textContent.includes('effect-found')");
    browser.click("#runs button");
    browser.wait("document.activeElement.id === 'events-title' && document.querySelectorAll('#events li').length > 3");
    browser.click("#json");
    browser.wait("document.querySelector('#note').textContent.startsWith('Wrote darm-history.json')");
    browser.click("[data-csv=runs]");
    browser.wait("document.querySelector('#note').textContent.startsWith('Wrote darm-runs.csv')");
}
