//! The history: runs, diagnoses, models and tables are recorded, listed, compared and exported, and no request changes more than their names.

use serde_json::{Value, json};

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
    assert!(text.starts_with("id,label,started_ms,") && text.lines().count() == 2 && text.contains(&digest), "{text}");
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

#[test]
fn entries_have_the_names_that_people_give_them() {
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    let digest = use_it(&bench);
    let name = |of: &str, entry: &str, name: &str| {
        let answer = bench.post("/api/history/name", &[], &json!({"of": of, "entry": entry, "name": name}));
        answer.status
    };
    let hash = bench.wired.arm.hash().to_string();
    let entries = [("runs", "1"), ("diagnoses", "1"), ("models", &hash), ("tables", &digest)];
    for (of, entry) in entries {
        assert_eq!(name(of, entry, " =bench\u{7}-1 "), 200, "{of}");
        let found = |entries: &Value| {
            let entries = entries.as_array().unwrap();
            let is_it =
                |one: &&Value| one["id"].as_u64().is_some_and(|id| entry.parse() == Ok(id)) || one["digest"] == entry;
            entries.iter().find(is_it).unwrap()["label"].clone()
        };
        assert_eq!(found(&bench.get("/api/history")[of]), "=bench-1", "{of}");
        let csv = request(bench.address(), "GET", &format!("/api/history/export?of={of}"), &[], b"");
        assert!(String::from_utf8(csv.body).unwrap().contains(",'=bench-1,"), "{of}: no formula");
    }
    assert_eq!(bench.get("/api/history")["uploads"][0]["label"], "=bench-1", "that of its table");
    assert_eq!(bench.get("/api/diagnosis/models")[0]["label"], "=bench-1");
    assert_eq!(name("models", &hash, &"a".repeat(1000)), 200);
    assert_eq!(bench.get("/api/diagnosis/models")[0]["label"].as_str().unwrap().len(), 60);
    assert_eq!(name("models", &hash, " "), 200);
    assert!(bench.get("/api/diagnosis/models")[0]["label"].is_null());
    for (of, entry) in [("runs", "2"), ("runs", "1 OR 1"), ("models", "none"), ("uploads", "1"), ("diagnoses", "")] {
        assert_eq!(name(of, entry, "x"), 422, "{of} {entry}");
    }
    let other = json!({"of": "sqlite_schema", "entry": "1", "name": "x"});
    assert_eq!(bench.post("/api/history/name", &[], &other).status, 422);
    let foreign = ["Origin: http://evil.example"];
    let body = json!({"of": "runs", "entry": "1", "name": "x"});
    assert_eq!(bench.post("/api/history/name", &foreign, &body).status, 403);
    assert_eq!(request(bench.address(), "GET", "/api/history/name", &[], b"").status, 405);
}

/// The golden values are those of the diagnosis as the page has got it.
#[test]
fn a_diagnosis_is_opened_as_it_was_and_compared() {
    let bench = Bench::start("planar4.toml");
    diagnose_example(&bench);
    let result = bench.get("/api/diagnosis/result");
    assert_eq!(bench.get("/api/history/result?id=1"), result);
    assert_eq!(request(bench.address(), "GET", "/api/history/result?id=2", &[], b"").status, 422);
    let history = bench.get("/api/history");
    let report = bench.get("/api/history/diagnosis?id=1");
    let numbers = |of: &str, entry: &Value| {
        let entry = entry.as_str().map_or_else(|| entry.to_string(), str::to_owned);
        bench.get(&format!("/api/history/numbers?of={of}&entry={entry}"))
    };
    let line = |lines: &Value, name: &str| {
        let line = lines.as_array().unwrap().iter().find(|line| line["name"] == name);
        line.map(|line| line["text"].as_str().unwrap().to_owned())
    };
    let diagnosis = numbers("diagnoses", &json!(1));
    let mm = |pointer: &str| format!("{:.3} mm", 1e3 * report.pointer(pointer).and_then(Value::as_f64).unwrap());
    assert_eq!(line(&diagnosis, "held-out error before"), Some(mm("/error/before/held_out/norm/value")));
    assert_eq!(line(&diagnosis, "held-out error after"), Some(mm("/error/after/held_out/norm/value")));
    assert_eq!(line(&diagnosis, "repeatability"), Some(mm("/repeatability/norm/value")));
    let effect = &report["effects"][0];
    let parameter = &effect["parameters"][0];
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let name = format!("{}, {}: {}", text(&effect["law"]), text(&effect["where"]), text(&parameter["name"]));
    let found = line(&diagnosis, &name).unwrap();
    assert!(found.contains(" (95 % CI "), "{name}: {found}");
    assert!(result["html"].as_str().unwrap().contains(found.split(" (").next().unwrap()), "{found}");
    // The corrected model has the effect with its interval, the one before has none.
    let corrected = numbers("models", &history["diagnoses"][0]["corrected"]);
    assert_eq!((line(&corrected, &name), line(&corrected, "number")), (Some(found), Some("1".into())));
    assert_eq!(line(&corrected, "corrected after"), Some("planar4-run.csv".into()));
    let before = numbers("models", &history["diagnoses"][0]["model"]);
    assert_eq!((line(&before, &name), line(&before, "number")), (None, Some("0".into())));
    for path in ["of=models&entry=none", "of=diagnoses&entry=x", "of=runs&entry=1", "of=diagnoses"] {
        let status = request(bench.address(), "GET", &format!("/api/history/numbers?{path}"), &[], b"").status;
        assert!([400, 422].contains(&status), "{path}: {status}");
    }
}

#[test]
fn a_person_names_opens_and_compares_entries_by_the_keyboard() {
    for width in [390, 1280, 2560] {
        let Some(browser) = Browser::start(width) else { return };
        let bench = Bench::start("planar4.toml");
        let _time = RealTime::start(&bench.board);
        use_it(&bench);
        browser.set_size(width, 900);
        browser.open(&format!("http://{}/history", bench.address()));
        browser.wait("document.querySelector('#diagnoses .label')");
        browser.value("document.querySelector('#diagnoses .label').focus()");
        for key in "bench-1\u{E007}".chars() {
            browser.press(&key.to_string());
        }
        browser.wait("document.querySelector('#note').textContent === 'diagnosis 1 is called bench-1.'");
        browser.wait("document.activeElement === document.querySelector('#diagnoses .label')");
        browser.wait("document.querySelector('#lineage').textContent.includes('corrected after bench-1')");
        // The corrected model and the one before.
        browser.value(
            "[['first', 'model 0'], ['second', 'model 1']].forEach(([id, name]) => { const select = document.getElementById(id); \
             select.value = [...select.options].find((option) => option.textContent.includes(name)).value; \
             select.dispatchEvent(new Event('change')); })",
        );
        browser.wait("document.querySelectorAll('#compared tbody .differs').length > 2");
        let rows = "[...document.querySelectorAll('#compared tbody tr')].map((row) => row.textContent)";
        let rows = browser.value(rows).to_string();
        assert!(rows.contains("number01≠") && rows.contains("corrected after") && rows.contains("95 % CI"), "{rows}");
        let is_wide = "document.documentElement.scrollWidth > document.documentElement.clientWidth";
        assert_eq!(browser.value(is_wide), false, "the page scrolls sideways at {width} px");
        assert!(browser.serious_findings().is_empty(), "{:#?}", browser.serious_findings());
        browser.value("document.querySelector('#diagnoses a').focus()");
        browser.press("\u{E007}");
        browser.wait("location.pathname === '/diagnosis' && document.querySelector('#verdict-section')?.dataset.verdict === 'effect-found'");
        browser
            .wait("document.querySelector('#result-files').textContent.endsWith('planar4-run.csv, from the history')");
        browser.wait("document.activeElement.id === 'verdict-section'");
        assert_eq!(browser.value("document.querySelector('#write').disabled"), false);
        assert_eq!(browser.value("document.querySelector('#plan').hidden"), true);
        let is_named = "[...document.querySelectorAll('#known option')].some((option) => option.textContent.includes('planar4-1.toml'))";
        browser.wait(is_named);
    }
}
