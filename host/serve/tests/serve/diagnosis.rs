//! The page of the diagnosis: files in, verdict and corrected model out; one at a time, given up with its page.

use std::io::Write as _;
use std::net::TcpStream;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use darm_diagnose::files::{FileOptions, Files, Subject};
use serde_json::{Value, json};

use super::board::{Bench, example};
use super::http::{Answer, request};
use super::webdriver::Browser;

/// A diagnosis that is given up ends after the candidate that it is at.
const PATIENCE: Duration = Duration::from_secs(60);

/// The body of an upload: model, measurements, further files.
fn upload(names: &[&str]) -> Vec<u8> {
    let files: Vec<Vec<u8>> = names.iter().map(|name| std::fs::read(example(name)).unwrap()).collect();
    upload_of(&names.iter().copied().zip(files.iter().map(Vec::as_slice)).collect::<Vec<_>>())
}

fn upload_of(files: &[(&str, &[u8])]) -> Vec<u8> {
    let named = |(name, bytes): &(&str, &[u8])| json!({"name": name, "bytes": bytes.len()});
    let more: Vec<Value> = files[2..].iter().map(named).collect();
    let head = json!({"model": named(&files[0]), "data": named(&files[1]), "more": more});
    let bytes: Vec<&[u8]> = files.iter().map(|(_, bytes)| *bytes).collect();
    [format!("{head}\n").as_bytes(), &bytes.concat()].concat()
}

fn diagnose(bench: &Bench, body: &[u8]) -> Answer {
    request(bench.address(), "POST", "/api/diagnosis/run", &[], body)
}

/// The arm of the example with its recording: an effect is found.
pub(crate) fn diagnose_example(bench: &Bench) {
    assert_eq!(diagnose(bench, &upload(&["planar4.toml", "planar4-run.csv"])).status, 200);
}

#[test]
fn the_result_is_that_of_the_library_and_the_corrected_model_is_complete() {
    let bench = Bench::start("planar4.toml");
    assert!(bench.get("/api/diagnosis/result").is_null());
    let (model, data) = (example("planar4.toml"), example("planar4-run.csv"));
    let answer = diagnose(&bench, &upload(&["planar4.toml", "planar4-run.csv"]));
    assert_eq!(answer.status, 200, "{}", answer.json());
    let result = answer.json();
    let files = Files { model: (&model).into(), data: (&data).into() };
    let own = files.diagnose(Subject::read(&model).unwrap(), &FileOptions::default()).unwrap();
    assert_eq!(result["verdict"], own.diagnosis.verdict.to_string());
    let html = result["html"].as_str().unwrap();
    let law = own.diagnosis.effects[0].law.as_str();
    assert!(html.contains(law) && html.contains("rejected: "), "{html}");
    let arm = darm_arm::arm::Arm::parse(Path::new("n.toml"), result["corrected"]["text"].as_str().unwrap()).unwrap();
    assert_eq!(u64::from(arm.model.number), result["corrected"]["number"]);
    assert_eq!(arm.model.effects.len(), own.diagnosis.effects.len());
    the_next_table_is_of_the_corrected_model(&bench, &result, &arm);
    assert_eq!(bench.get("/api/diagnosis/result"), result);
    assert_eq!(bench.get("/api/diagnosis"), json!({"running": null, "finished": 1}));
}

/// It is open on the server, and its visit file belongs to it.
fn the_next_table_is_of_the_corrected_model(bench: &Bench, result: &Value, arm: &darm_arm::arm::Arm) {
    let ask = |number: u64| bench.post("/api/diagnosis/table", &[], &json!({"result": number, "of": "plan"}));
    let number = result["number"].as_u64().unwrap();
    assert_eq!(ask(number + 1).status, 422);
    let made = ask(number).json();
    let program = bench.get("/api/program");
    assert!(program["digest"] == made["digest"] && program["refusal"].is_null(), "{program}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plan.visits.csv");
    let visits = request(bench.address(), "GET", "/api/program/visits", &[], b"");
    std::fs::write(&path, visits.body).unwrap();
    let table = request(bench.address(), "GET", "/api/program/table", &[], b"").body;
    let table = darm_arm::table_file::TableFile::parse(Path::new("plan.darm"), &table).unwrap();
    assert_eq!(table.digest().to_string(), made["digest"].as_str().unwrap());
    let visits = darm_measure::visits::Visits::read(&path).unwrap();
    assert_eq!((visits.model, visits.table.to_string().as_str()), (arm.hash(), made["digest"].as_str().unwrap()));
    assert_eq!(visits.rests.len() as u64, made["n_visits"].as_u64().unwrap());
}

#[test]
fn signals_need_the_robot_that_the_model_names() {
    let bench = Bench::start("planar4.toml");
    let refused = diagnose(&bench, &upload(&["tx40.toml", "tx40-motion.csv.gz"]));
    let text = refused.json()["refused"]["text"].as_str().unwrap().to_owned();
    assert_eq!(refused.status, 422, "{text}");
    assert!(text.starts_with("tx40.toml names tx40.urdf, which was not sent; choose it"), "{text}");
    assert!(!text.contains(std::env::temp_dir().to_str().unwrap()), "{text}");
    let table = b"pressure_bar,force_n,time_s\n1,x,0\n";
    let cylinder = std::fs::read(example("cylinder.toml")).unwrap();
    let refused = diagnose(&bench, &upload_of(&[("cylinder.toml", &cylinder), ("force.csv", table)]));
    let text = refused.json()["refused"]["text"].as_str().unwrap().to_owned();
    assert_eq!(refused.status, 422, "{text}");
    assert!(text.starts_with("force.csv"), "{text}");
}

#[test]
fn one_runs_at_a_time_and_a_stop_does_not_wait_for_it() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let body = upload(&["tx40.toml", "tx40-motion.csv.gz", "tx40.urdf"]);
    let head = format!(
        "POST /api/diagnosis/run HTTP/1.1\r\nHost: {}\r\nContent-Length: {}\r\n\r\n",
        bench.address(),
        body.len()
    );
    let mut page = TcpStream::connect(bench.address()).unwrap();
    page.write_all(head.as_bytes()).unwrap();
    page.write_all(&body).unwrap();
    wait(&bench, |status| status["running"]["stage"] == "select");
    let busy = diagnose(&bench, &body);
    assert_eq!(busy.status, 409, "{}", busy.json());
    assert_eq!(bench.stop().json()["confirmed"], true);
    // The page is closed.
    drop(page);
    let status = wait(&bench, |status| status["running"].is_null());
    assert_eq!(status["finished"], 0, "what was given up has no result");
    let next = diagnose(&bench, &upload(&["planar4.toml", "planar4-run.csv"]));
    assert_eq!(next.status, 200, "{}", next.json());
}

#[track_caller]
fn wait(bench: &Bench, wanted: impl Fn(&Value) -> bool) -> Value {
    let since = Instant::now();
    loop {
        let status = bench.get("/api/diagnosis");
        if wanted(&status) {
            return status;
        }
        assert!(since.elapsed() < PATIENCE, "{status}");
        thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn other_sites_and_large_uploads_are_refused() {
    let bench = Bench::start_wired(
        darm_arm::wired_arm::WiredArm::read(&example("planar4.toml"), None).unwrap(),
        Some("0123456789abcdef"),
    );
    let body = upload(&["planar4.toml", "planar4-run.csv"]);
    assert_eq!(diagnose(&bench, &body).status, 403, "without the token");
    let bearer = "Authorization: Bearer 0123456789abcdef";
    let foreign = [bearer, "Origin: http://evil.example"];
    assert_eq!(request(bench.address(), "POST", "/api/diagnosis/run", &foreign, &body).status, 403);
    assert_eq!(request(bench.address(), "GET", "/api/diagnosis/run", &[bearer], b"").status, 405);
}

#[test]
fn a_person_diagnoses_a_recording_in_a_browser() {
    for width in [390, 1280] {
        let Some(browser) = Browser::start(width) else { return };
        let bench = Bench::start("planar4.toml");
        browser.open(&format!("http://{}/diagnosis", bench.address()));
        browser.wait("document.querySelector('#files-note') && document.body.dataset.link === 'live'");
        assert_eq!(browser.value("document.querySelector('#diagnose').disabled"), true);
        browser.drop_files("#drop", &[&example("planar4-run.csv"), &example("planar4.toml")]);
        browser.wait("document.querySelector('#model').files[0]?.name === 'planar4.toml'");
        browser.click("#diagnose");
        browser.wait("document.activeElement.id === 'verdict-section'");
        browser.wait("document.querySelector('#verdict-section').dataset.verdict === 'effect-found'");
        let is_wide = "document.documentElement.scrollWidth > document.documentElement.clientWidth";
        assert_eq!(browser.value(is_wide), false, "the page scrolls sideways at {width} px");
        zoom(&browser);
        enter(&browser, "#write");
        browser.wait("document.querySelector('#actions-note').textContent.startsWith('Wrote planar4-')");
        // An error has its place; the former result stays.
        browser.choose("#data", example("planar4-frames.toml").to_str().unwrap());
        enter(&browser, "#diagnose");
        browser.wait("document.querySelector('#failure').textContent.includes('planar4-frames.toml')");
        browser.open(&format!("http://{}/diagnosis", bench.address()));
        browser.wait("document.querySelector('#verdict-section')?.dataset.verdict === 'effect-found'");
        plan_again(&browser);
    }
}

/// The new table is open on the page Program, named by what it was made from, and both of its files can be saved.
fn plan_again(browser: &Browser) {
    enter(browser, "#plan");
    browser.wait("location.pathname === '/program' && document.querySelectorAll('#timeline .span').length > 12");
    browser.wait("document.querySelector('#table-facts').textContent.includes('plan.darm')");
    browser.wait("document.querySelector('#origin-text').textContent.includes('planar4.toml and planar4-run.csv')");
    for (button, file) in [("#save-table", "plan.darm"), ("#save-visits", "plan.visits.csv")] {
        enter(browser, button);
        browser.wait(&format!("document.querySelector('#saved').textContent.startsWith('Wrote {file}')"));
    }
    let is_wide = "document.documentElement.scrollWidth > document.documentElement.clientWidth";
    assert_eq!(browser.value(is_wide), false, "the page scrolls sideways");
}

/// The recording names the model whose table was played; the server has it.
#[test]
fn the_model_of_a_recording_is_chosen_by_its_digest() {
    let Some(browser) = Browser::start(1280) else { return };
    let bench = Bench::start("planar4.toml");
    let hash = bench.wired.arm.hash().to_string();
    diagnose_example(&bench);
    let body = upload_of(&[("planar4.toml", b""), ("run.csv", &std::fs::read(example("planar4-run.csv")).unwrap())]);
    let log = request(bench.address(), "POST", "/api/diagnosis/log", &[], &body).json();
    assert_eq!(log["model"], hash.as_str());
    browser.open(&format!("http://{}/diagnosis", bench.address()));
    browser.wait("document.querySelectorAll('#known option').length === 3");
    let names = "[...document.querySelectorAll('#known option')].slice(1).map((option) => option.textContent)";
    let names = browser.value(names);
    let names: Vec<&str> = names.as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert_eq!(names[0], format!("{}, model 0, {hash} (arm of this server)", Bench::FILE));
    assert!(names[1].starts_with("planar4-1.toml, model 1, "), "{names:?}");
    browser.value("document.querySelector('#known').selectedIndex = 2");
    browser.choose("#data", example("planar4-run.csv").to_str().unwrap());
    browser.wait(&format!("document.querySelector('#known').value === '{hash}'"));
    browser.wait("document.querySelector('#recorded').textContent.includes('It is chosen above')");
}

/// Presses a button by the keyboard, once it can be pressed.
fn enter(browser: &Browser, selector: &str) {
    browser.wait(&format!("document.querySelector('{selector}').disabled === false"));
    browser.value(&format!("document.querySelector('{selector}').focus()"));
    browser.press("\u{E007}");
}

/// By keys, and back. The numbers stay at the axes, and are those of the part that is seen.
fn zoom(browser: &Browser) {
    let shown = "document.querySelector('.plot svg svg').getAttribute('viewBox').split(' ').map(Number)";
    let full = browser.value(shown);
    browser.value("document.querySelector('.plot').focus()");
    browser.press("+");
    browser.wait(&format!("{shown}[2] < {}", full[2]));
    let numbers = "[...document.querySelector('.plot > svg').querySelectorAll(':scope > text')].filter((text) => \
                   text.style.display === '' && text.getAttribute('text-anchor') === 'end').map((text) => Number(text.textContent))";
    let seen = browser.value(numbers);
    let seen: Vec<f64> = seen.as_array().unwrap().iter().filter_map(Value::as_f64).collect();
    assert!(seen.len() > 1 && seen.iter().all(|value| *value > 0.0), "{seen:?}");
    browser.press("0");
    assert_eq!(browser.value(shown), full);
    // Colours are those of the page: a plot on the dark page is dark.
    let paper = "getComputedStyle(document.querySelector('.plot svg rect')).fill === getComputedStyle(document.querySelector('section')).backgroundColor";
    assert_eq!(browser.value(paper), true);
}
