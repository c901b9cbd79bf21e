//! A log and nothing else: the model is that of the server, and the columns are said on the page.

use serde_json::{Value, json};

use super::board::{Bench, example};
use super::http::{Answer, request};
use super::webdriver::Browser;

/// Names of another program for the columns of the example, and what they hold.
const FOREIGN: [(&str, &str, &str); 8] = [
    ("Zeit [ms]", "time", "ms"),
    ("Stellung", "word", ""),
    ("Vorher", "previous", ""),
    ("X [mm]", "x", "mm"),
    ("Y [mm]", "y", "mm"),
    ("Richtung [deg]", "angle", "deg"),
    ("Druck [bar]", "supply", "bar"),
    ("Temperatur [°C]", "temperature", "c"),
];

fn recording() -> String {
    std::fs::read_to_string(example("planar4-run.csv")).unwrap()
}

/// The example as a spreadsheet of another country writes it.
fn foreign() -> String {
    let text = recording();
    let rows = text.lines().filter(|line| !line.starts_with('#')).skip(1);
    let cell = |(column, cell): (usize, &str)| {
        let factor = [1e3, 0.0, 0.0, 1e3, 1e3, 1.0, 1.0, 1.0][column];
        if factor == 0.0 { cell.into() } else { (factor * cell.parse::<f64>().unwrap()).to_string().replace('.', ",") }
    };
    let row = |line: &str| line.split(',').take(8).enumerate().map(cell).collect::<Vec<String>>().join(";");
    let names = FOREIGN.map(|(name, ..)| name).join(";");
    std::iter::once(names).chain(rows.map(row)).map(|line| line + "\n").collect()
}

fn send(bench: &Bench, path: &str, text: &str, mut head: Value) -> Answer {
    head["data"] = json!({"name": "log.csv", "bytes": text.len()});
    request(bench.address(), "POST", path, &[], format!("{head}\n{text}").as_bytes())
}

fn look(bench: &Bench, text: &str, columns: Value) -> Value {
    let answer = send(bench, "/api/diagnosis/log", text, json!({ "columns": columns }));
    assert_eq!(answer.status, 200, "{}", answer.json());
    answer.json()
}

fn served(bench: &Bench) -> String {
    let models = bench.get("/api/diagnosis/models");
    assert_eq!((&models[0]["is_served"], &models[0]["name"]), (&json!(true), &json!(Bench::FILE)), "{models}");
    models[0]["digest"].as_str().unwrap().into()
}

fn read_as(column: &str, quantity: &str, unit: &str) -> Value {
    json!({"column": column, "quantity": quantity, "unit": unit})
}

#[test]
fn a_log_of_another_program_is_diagnosed_with_the_arm_of_the_server() {
    let bench = Bench::start("planar4.toml");
    let text = foreign();
    let seen = look(&bench, &text, json!([]));
    assert_eq!((&seen["is_converted"], &seen["missing"]), (&json!(true), &json!(["word", "angle"])), "{seen}");
    assert_eq!(seen["columns"][3]["unit"], "mm", "the file names it: {seen}");
    let columns: Vec<Value> = FOREIGN.iter().map(|(column, quantity, unit)| read_as(column, quantity, unit)).collect();
    let seen = look(&bench, &text, json!(columns));
    assert_eq!((&seen["problem"], &seen["possible"][0]["kind"]), (&json!(null), &json!("tool-pose")), "{seen}");
    let head = json!({"known": served(&bench), "columns": columns});
    let result = send(&bench, "/api/diagnosis/run", &text, head);
    assert_eq!((result.status, result.json()["verdict"].as_str()), (200, Some("effect-found")), "{}", result.json());
    let corrected = &result.json()["corrected"];
    assert_eq!(corrected["name"], "bench-1.toml");
    // It is the model of the next diagnosis, with what distinguishes it from others of its name.
    let models = bench.get("/api/diagnosis/models");
    let next = models.as_array().unwrap().iter().find(|model| model["name"] == corrected["name"]).unwrap();
    let effect = next["origin"]["effect"].as_str().unwrap();
    assert!(effect.starts_with("supply-stroke, ") && next["origin"]["data"] == "log.csv", "{next}");
    let again = send(&bench, "/api/diagnosis/run", &text, json!({"known": next["digest"], "columns": columns}));
    assert_eq!(again.json()["verdict"], "no-effect", "{}", again.json());
}

#[test]
fn a_wrong_unit_is_asked_about_and_a_missing_column_is_named() {
    let bench = Bench::start("planar4.toml");
    let pascal = recording().replace("supply_bar", "supply_pa");
    let seen = look(&bench, &pascal, json!([]));
    assert_eq!(
        (&seen["doubts"][0]["column"], &seen["doubts"][0]["units"]),
        (&json!("supply_pa"), &json!(["bar"])),
        "{seen}"
    );
    let corrected = look(&bench, &pascal, json!([read_as("supply_pa", "supply", "bar")]));
    assert_eq!(corrected["doubts"], json!([]), "{corrected}");
    let renamed = recording().replace("word,previous", "state,previous");
    let seen = look(&bench, &renamed, json!([]));
    assert_eq!((&seen["is_converted"], &seen["missing"]), (&json!(false), &json!(["word"])), "{seen}");
    let refused = send(&bench, "/api/diagnosis/run", &renamed, json!({"known": served(&bench)}));
    let text = refused.json()["refused"]["text"].as_str().unwrap().to_owned();
    assert!(refused.status == 422 && text.starts_with("log.csv: no column is read as word"), "{text}");
    assert!(!text.contains("--"), "an option of the command line: {text}");
    let late = recording().replace("time_s,", "when,");
    let refused = send(&bench, "/api/diagnosis/run", &late, json!({"known": served(&bench)}));
    let text = refused.json()["refused"]["text"].as_str().unwrap().to_owned();
    assert!(text.starts_with("log.csv: no column is read as time; choose"), "the word of the page: {text}");
    let twice = look(&bench, &renamed, json!([read_as("state", "previous", "")]));
    assert!(twice["problem"].as_str().unwrap().contains("two columns are read as previous"), "{twice}");
    let head = json!({"known": served(&bench), "columns": [read_as("state", "word", "")]});
    assert_eq!(send(&bench, "/api/diagnosis/run", &renamed, head).json()["verdict"], "effect-found");
}

#[test]
fn a_condition_without_a_unit_is_not_read_and_said_first() {
    let bench = Bench::start("planar4.toml");
    let text = recording().replace("supply_bar", "supply").replace("temperature_c", "Temp");
    let seen = look(&bench, &text, json!([]));
    let meaning = |column: usize| seen["columns"][column]["meaning"].as_str().unwrap().to_owned();
    assert_eq!(meaning(6), "supply pressure, unit missing: not read", "{seen}");
    assert_eq!(meaning(7), "temperature, unit missing: not read", "{seen}");
    assert_eq!(seen["doubts"][0]["units"], json!(["bar", "kpa", "pa"]), "{seen}");
    assert_eq!(seen["doubts"][1]["question"], "Temp: temperature, unit missing: not read.", "{seen}");
    let result = send(&bench, "/api/diagnosis/run", &text, json!({"known": served(&bench)})).json();
    let html = result["html"].as_str().unwrap();
    assert!(html.contains("<b>Next: </b>give supply and Temp a unit and diagnose again"), "{html}");
    let columns = json!([read_as("supply", "supply", "bar"), read_as("Temp", "temp", "c")]);
    let seen = look(&bench, &text, columns);
    assert_eq!((&seen["doubts"], &seen["columns"][7]["meaning"]), (&json!([]), &json!("temperature")), "{seen}");
}

#[test]
fn what_is_no_log_or_no_known_model_is_refused() {
    let bench = Bench::start("planar4.toml");
    assert_eq!(send(&bench, "/api/diagnosis/log", "\0\u{1}", json!({})).status, 422);
    let newer = format!("{:<512}\u{89}HDF\r\n\u{1a}\n", "MATLAB 7.3 MAT-file");
    let newer = newer.chars().map(|c| c as u8).collect::<Vec<u8>>();
    for (path, mut head) in [("log", json!({})), ("run", json!({"known": served(&bench)}))] {
        head["data"] = json!({"name": "v73.mat", "bytes": newer.len()});
        let body = [format!("{head}\n").as_bytes(), &newer].concat();
        let refused = request(bench.address(), "POST", &format!("/api/diagnosis/{path}"), &[], &body).json();
        let text = refused["refused"]["text"].as_str().unwrap();
        assert!(text.contains("version 7.3") && !text.contains("UTF-8"), "{path}: {text}");
    }
    let refused = send(&bench, "/api/diagnosis/run", &recording(), json!({"known": "../arm.toml"}));
    assert!(refused.json()["refused"]["text"].as_str().unwrap().contains("no model"), "{}", refused.json());
    assert_eq!(send(&bench, "/api/diagnosis/run", &recording(), json!({})).status, 422);
}

#[test]
fn a_person_with_a_log_alone_writes_a_corrected_model() {
    let Some(browser) = Browser::start(390) else { return };
    let bench = Bench::start("planar4.toml");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.csv");
    std::fs::write(&file, foreign()).unwrap();
    browser.open(&format!("http://{}/diagnosis", bench.address()));
    browser.wait("document.querySelector('#known')?.selectedOptions[0].textContent.includes('arm of this server')");
    let no_time = folder.path().join("no-time.csv");
    std::fs::write(&no_time, recording().replace("time_s,", "when,")).unwrap();
    browser.choose("#data", no_time.to_str().unwrap());
    browser.wait("document.querySelector('#log-text').textContent.includes('add a column time_s')");
    browser.choose("#data", file.to_str().unwrap());
    browser.wait("document.querySelector('#log-text').textContent.includes('word, angle are missing')");
    let options = "[...document.querySelector('#columns .holds').options].some((option) => option.value === 'tau3')";
    assert_eq!(browser.value(options), true, "all quantities are listed");
    let units = "[...document.querySelector('#columns .unit').options].map((option) => option.textContent).join(' ')";
    let units = browser.value(units).as_str().unwrap().to_owned();
    assert!(["N·m", "mA", "°/s²", "K"].iter().all(|unit| units.split(' ').any(|own| own == *unit)), "{units}");
    for (column, quantity) in [(1, "word"), (2, "previous"), (5, "angle"), (6, "supply")] {
        let field = format!("document.querySelector('#columns').rows[{column}].querySelector('.holds')");
        browser.value(&format!("{field}.value = '{quantity}'"));
        browser.value(&format!("{field}.dispatchEvent(new Event('change'))"));
        browser
            .wait(&format!("document.querySelector('#columns').rows[{column}].lastElementChild.textContent !== '?'"));
    }
    browser.wait("document.querySelector('#log-text').textContent.includes('tool-pose with an arm file')");
    let is_wide = "document.documentElement.scrollWidth > document.documentElement.clientWidth";
    assert_eq!(browser.value(is_wide), false, "the page scrolls sideways");
    for is_dark in [false, true] {
        browser.set_dark(is_dark);
        let findings = browser.serious_findings();
        assert!(findings.is_empty(), "dark {is_dark}: {findings:#?}");
    }
    browser.click("#diagnose");
    browser.wait("document.querySelector('#verdict-section')?.dataset.verdict === 'effect-found'");
    browser.click("#write");
    browser.wait("document.querySelector('#actions-note').textContent.startsWith('Wrote bench-1.toml')");
}
