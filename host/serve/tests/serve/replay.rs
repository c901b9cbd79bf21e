//! Replay of recordings: curves and rows are those of the file and of the model, a file that grows, and a person who scrubs.

use std::collections::BTreeMap;
use std::fs;
use std::time::Instant;

use darm_arm::arm::{ArmScratch, ZERO_CELSIUS};
use darm_arm::wired_arm::WiredArm;
use darm_core::effect::{Effect, Place};
use darm_core::model::Condition;
use darm_core::real::Vec3;
use darm_core::se::Pose2;
use darm_core::units::Word;
use serde_json::Value;

use super::board::{Bench, RealTime, example};
use super::http::{Answer, request};
use super::webdriver::Browser;

/// 1 nm and 1 nrad.
const NEAR: f64 = 1e-9;
/// Curves have single precision: 0.1 µm, 0.0001°.
const NEAR_CURVE: f64 = 1e-4;

/// What the server says of a recording, its times, and its curves by plot and name.
struct Run {
    head: Value,
    times: Vec<f64>,
    curves: BTreeMap<(String, String), Vec<f32>>,
}

fn ask(bench: &Bench, path: &str) -> Answer {
    request(bench.address(), "GET", &format!("/api/replay/{path}"), &[], b"")
}

fn open(bench: &Bench, name: &str) -> Run {
    let answer = ask(bench, name);
    assert_eq!(answer.status, 200, "{}", answer.json());
    let end = answer.body.iter().position(|byte| *byte == b'\n').unwrap();
    let head: Value = serde_json::from_slice(&answer.body[..end]).unwrap();
    let n = head["rows"].as_u64().unwrap() as usize;
    let (times, values) = answer.body[end + 1..].split_at(8 * n);
    let times = times.chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap())).collect();
    let of = |values: &[u8]| -> Vec<f32> {
        values.chunks_exact(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect()
    };
    let series = head["series"].as_array().unwrap();
    assert_eq!(values.len(), 4 * n * series.len());
    let name = |one: &Value, key: &str| one[key].as_str().unwrap().to_owned();
    let key = |one: &Value| (name(one, "plot"), name(one, "name"));
    let curves = series.iter().zip(values.chunks_exact(4 * n)).map(|(one, values)| (key(one), of(values)));
    let curves = curves.collect();
    Run { head, times, curves }
}

fn row(bench: &Bench, name: &str, bytes: u64, row: usize) -> Answer {
    ask(bench, &format!("{name}/row?bytes={bytes}&row={row}"))
}

fn example_text() -> String {
    fs::read_to_string(example("planar4-run.csv")).unwrap()
}

/// An arm whose pose depends on supply, temperature and the word before, so that a prediction under other conditions is another one.
fn sensitive() -> WiredArm {
    let mut wired = WiredArm::read(&example("planar4.toml"), None).unwrap();
    let effects = [
        Effect::SupplyStroke { at: Place::Arm, gain: 0.06 },
        Effect::ThermalGrowth { at: Place::Arm, expansion_per_k: 2e-5 },
        Effect::Play { at: Place::Arm, width_m: 1e-3 },
    ];
    effects.into_iter().for_each(|effect| wired.arm.model.effects.push(effect).unwrap());
    wired
}

/// The golden values: cells of the file, read here, and the prediction of the core under the conditions of the row.
#[test]
fn curves_and_rows_are_those_of_the_file_and_of_the_core() {
    let bench = Bench::start_wired(sensitive(), None);
    fs::write(bench.data().join("run-1.csv"), example_text()).unwrap();
    let run = open(&bench, "run-1.csv");
    let text = example_text();
    let cells: Vec<Vec<&str>> =
        text.lines().filter(|line| line.starts_with(char::is_numeric)).map(|line| line.split(',').collect()).collect();
    assert_eq!((run.head["rows"].as_u64(), run.times.len()), (Some(cells.len() as u64), cells.len()));
    let curve = |plot: &str, name: &str| &run.curves[&(plot.to_owned(), name.to_owned())];
    let mut last: Option<(Word, Option<Word>)> = None;
    for (index, cells) in cells.iter().enumerate() {
        let number = |column: usize| cells[column].parse::<f64>().unwrap();
        let (word, before): (Word, Word) = (cells[1].parse().unwrap(), cells[2].parse().unwrap());
        // An arm that stays in a word is as it has come there.
        let arrival = match last {
            Some((last, arrival)) if last == word && before == word => arrival,
            _ => Some(before),
        };
        last = Some((word, arrival));
        let condition = Condition {
            previous: arrival,
            supply: 1e5 * number(6),
            temperature_k: number(7) + ZERO_CELSIUS,
            ..Condition::of_word(word)
        };
        let predicted = bench.wired.arm.model.predict(&condition, &mut ArmScratch::default()).unwrap();
        let measured = Vec3::new(number(3), number(4), 0.0);
        let turn_rad = Pose2::projection(&predicted).angle_rad - number(5).to_radians();
        let residual = predicted.position - measured;
        let near = |value: f32, expected: f64| (f64::from(value) - expected).abs() < NEAR_CURVE;
        let curves = [
            (curve("Residual", "x"), 1e3 * residual.x),
            (curve("Residual", "y"), 1e3 * residual.y),
            (curve("Residual, rotation", "angle"), turn_rad.to_degrees()),
            (curve("Supply of the arm", "supply"), number(6)),
            (curve("Temperature", "arm"), number(7)),
        ];
        assert!(curves.iter().all(|(curve, expected)| near(curve[index], *expected)), "row {index}");
        assert_eq!(run.times[index], number(0));
        if index % 40 == 0 {
            let view = row(&bench, "run-1.csv", run.head["bytes"].as_u64().unwrap(), index).json();
            let at = |pointer: &str| view.pointer(pointer).and_then(Value::as_f64).unwrap();
            assert!((at("/residual/position_m/0") - residual.x).abs() < NEAR, "row {index}: {view}");
            assert!((at("/residual/rotation_rad/2") - turn_rad).abs() < NEAR, "row {index}: {view}");
            assert!((at("/picture/tool/position_m/1") - predicted.position.y).abs() < NEAR);
            assert!((at("/measured/position_m/1") - measured.y).abs() < NEAR);
            assert_eq!((view["word"].as_str(), view["visit"].as_u64()), (Some(cells[1]), cells[9].parse().ok()));
            let on = view["outputs"].as_array().unwrap().len();
            assert_eq!(on, cells[1].bytes().filter(|digit| *digit == b'1').count(), "a coil for each digit");
        }
    }
    // Strokes and loads were not measured, and there is no servo.
    assert_eq!(run.curves.len(), 5);
    let notes = run.head["notes"].to_string();
    assert!(run.head["problem"].is_null() && notes.contains("the same arm with other effects"), "{}", run.head);
}

#[test]
fn a_recording_that_is_still_written_has_its_complete_rows_and_keeps_their_numbers() {
    let bench = Bench::start("planar4.toml");
    let (path, text) = (bench.data().join("run-1.csv"), example_text());
    let at = text.match_indices('\n').nth(20).unwrap().0 + 1;
    // Half of a row, and not even the beginning of its last column.
    fs::write(&path, &text[..at + 70]).unwrap();
    let first = open(&bench, "run-1.csv");
    assert_eq!(first.head["rows"], 8);
    assert!(first.head["notes"].to_string().contains("the file ends early"), "{}", first.head);
    let bytes = first.head["bytes"].as_u64().unwrap();
    assert_eq!(bytes, at as u64 + 70);
    let before = row(&bench, "run-1.csv", bytes, 7).json();
    fs::write(&path, &text).unwrap();
    let second = open(&bench, "run-1.csv");
    assert!(second.head["rows"].as_u64() > Some(8));
    assert_eq!(second.times[..8], first.times[..]);
    assert_eq!(row(&bench, "run-1.csv", bytes, 7).json(), before, "as the page has opened it");
    assert_eq!(row(&bench, "run-1.csv", bytes, 8).status, 422);
    assert_eq!(row(&bench, "run-1.csv", second.head["bytes"].as_u64().unwrap(), 8).status, 200);
    // The file is another one, or gone.
    fs::write(&path, &text[..at]).unwrap();
    assert!(row(&bench, "run-1.csv", bytes, 7).json()["refused"]["text"].as_str().unwrap().contains("open it again"));
    fs::remove_file(&path).unwrap();
    assert_eq!((ask(&bench, "run-1.csv").status, row(&bench, "run-1.csv", 5, 0).status), (422, 422));
}

#[test]
fn only_recordings_of_the_folder_are_read() {
    let bench = Bench::start("planar4.toml");
    let data = bench.data();
    fs::write(data.parent().unwrap().join("secret.csv"), example_text()).unwrap();
    std::os::unix::fs::symlink(data.parent().unwrap().join("secret.csv"), data.join("link.csv")).unwrap();
    fs::create_dir(data.join("folder.csv")).unwrap();
    for name in ["run.visits.csv", "run.darm", ".hidden.csv"] {
        fs::write(data.join(name), example_text()).unwrap();
    }
    for name in [
        "link.csv",
        "folder.csv",
        "run.visits.csv",
        "run.darm",
        ".hidden.csv",
        "..%2Fsecret.csv",
        "..%2fhistory.sqlite3",
        "%2Fetc%2Fpasswd",
        "%2e%2e%2Fsecret.csv",
        "..",
        "run-2.csv",
        "a%00.csv",
        "%ff.csv",
        "",
        "data%2Frun.csv",
    ] {
        for path in [name.to_owned(), format!("{name}/row?bytes=10&row=0")] {
            let answer = ask(&bench, &path);
            assert!([400, 404, 422].contains(&answer.status), "{path}: {}", answer.status);
            assert!(!String::from_utf8_lossy(&answer.body).contains("000000000000"), "{path}");
        }
    }
    for numbers in ["bytes=-1&row=0", "bytes=1e3&row=0", "bytes=18446744073709551615&row=0", "bytes=10", ""] {
        fs::write(data.join("run.csv"), example_text()).unwrap();
        let status = ask(&bench, &format!("run.csv/row?{numbers}")).status;
        assert!([400, 422].contains(&status), "{numbers}: {status}");
    }
    let foreign = ["Origin: http://evil.example"];
    assert_eq!(request(bench.address(), "GET", "/api/replay/run.csv", &foreign, b"").status, 403);
    assert_eq!(request(bench.address(), "POST", "/api/replay/run.csv", &[], b"").status, 405);
    assert_eq!(bench.stop().status, 200);
}

#[test]
fn a_file_without_rows_or_poses_and_the_recording_of_another_arm_say_why() {
    let bench = Bench::start("planar4.toml");
    let text = example_text();
    let header = text.find("\ntime_s").unwrap() + 1;
    let files = [
        ("empty", "", "has no complete row yet"),
        ("comments", &text[..header], "has no complete row yet"),
        ("header", &text[..text.find("\n9.669").unwrap() + 1], "has no complete row yet"),
        ("force", "pressure_bar,force_n,time_s\n1,2,0\n", "has no column word"),
        ("cell", "time_s,word,x_m,y_m,angle_deg\n0,00x0,1,2,3\n", "cell.csv:2:3"),
        ("nan", "time_s,word,x_m,y_m,angle_deg\n0,000000000000,NaN,inf,1e999\n", "has no complete row yet"),
    ];
    for (name, text, says) in files {
        fs::write(bench.data().join(format!("{name}.csv")), text).unwrap();
        let answer = ask(&bench, &format!("{name}.csv"));
        let refused = answer.json()["refused"]["text"].as_str().unwrap().to_owned();
        assert!(answer.status == 422 && refused.contains(says), "{name}: {refused}");
    }
    let [own, other] = ["8e415f3039ec8956", "8e415f3039ec8957"];
    fs::write(bench.data().join("other.csv"), text.replace(own, other)).unwrap();
    let run = open(&bench, "other.csv");
    assert!(run.head["problem"].as_str().unwrap().contains("another arm"), "{}", run.head);
    assert!(run.curves.contains_key(&("Temperature".into(), "arm".into())) && run.curves.len() == 2);
    let view = row(&bench, "other.csv", run.head["bytes"].as_u64().unwrap(), 3).json();
    assert!(view["picture"].is_null() && view["residual"].is_null() && view["measured"].is_object(), "{view}");
    // Words of another length have no prediction, and times that run back are sorted.
    let short = "time_s,word,x_m,y_m,angle_deg,stroke5_ms\n2,0101,1,2,3,12.5\n1,000000000000,1,2,3,\n";
    fs::write(bench.data().join("short.csv"), short.replace("stroke5", "stroke0")).unwrap();
    let run = open(&bench, "short.csv");
    assert_eq!(run.times, [1.0, 2.0]);
    assert!(run.head["notes"].to_string().contains("run back"), "{}", run.head);
    let x = &run.curves[&("Residual".into(), "x".into())];
    assert!(x[0].is_finite() && x[1].is_nan(), "{x:?}");
    assert_eq!(run.curves[&("Strokes, actuators 0 to 0".into(), "actuator 0".into())][1], 12.5);
    let view = row(&bench, "short.csv", run.head["bytes"].as_u64().unwrap(), 1).json();
    assert!(view["problem"].as_str().unwrap().contains("digits") && view["outputs"] == serde_json::json!([]), "{view}");
}

/// Plays a table, and writes a recording of it as `darm record` begins one.
pub(crate) fn recorded(bench: &Bench, name: &str) -> Value {
    let words = ["000010000000", "101000000000", "110100110100", "100110100000"];
    let page = bench.page_in_control();
    let digest = page.upload(&bench.table(&words, 0.3));
    page.play(&digest);
    let live = bench.live(|live| live["events"].to_string().contains("finished"));
    let events = live["events"].as_array().unwrap();
    let rows: Vec<&Value> = events.iter().filter(|event| event["kind"] == "row").collect();
    let (hash, board) = (bench.wired.arm.hash(), &live["board"]);
    let about = format!(
        "# model {hash}\n# table {digest}\n# board {}\n# boot {}\n# program_start_s {}\n",
        board["device"].as_str().unwrap(),
        board["boots"],
        rows[0]["at_s"]
    );
    let line = |(visit, row): (usize, &&Value)| {
        let word = row["text"].as_str().unwrap().rsplit(' ').next().unwrap();
        let at_s = row["at_s"].as_f64().unwrap() + 0.2;
        format!("{at_s},{word},0.1,4.2,3.0,5.{visit},3{visit},1{visit},0,{visit},0\n")
    };
    let lines: String = rows.iter().enumerate().map(line).collect();
    let header = "time_s,word,x_m,y_m,angle_deg,supply_bar,temperature_c,stroke0_ms,run,visit,held_out\n";
    fs::write(bench.data().join(name), format!("{about}{header}{lines}")).unwrap();
    page.control("release");
    live["events"].clone()
}

#[test]
fn the_events_of_the_run_are_those_of_the_history() {
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    let seen = recorded(&bench, "run-1.csv");
    let run = open(&bench, "run-1.csv");
    let kinds = |events: &Value| -> Vec<String> {
        events.as_array().unwrap().iter().map(|event| event["kind"].as_str().unwrap().to_owned()).collect()
    };
    let shown = kinds(&run.head["events"]);
    assert_eq!((shown.first().unwrap().as_str(), shown.last().unwrap().as_str()), ("started", "finished"));
    let of_run: Vec<String> = kinds(&seen).into_iter().skip_while(|kind| kind != "started").collect();
    assert_eq!(shown, of_run);
    // The same table later, on another board, or another table: nothing of that run.
    let text = fs::read_to_string(bench.data().join("run-1.csv")).unwrap();
    let others = [
        text.replace("# boot ", "# boot 9"),
        text.replace("# board ", "# board 9"),
        text.replace("# table ", "# table 9"),
        text.replace("# program_start_s ", "# program_start_s 9"),
    ];
    for (k, other) in others.iter().enumerate() {
        fs::write(bench.data().join("run-2.csv"), other).unwrap();
        assert_eq!(open(&bench, "run-2.csv").head["events"], serde_json::json!([]), "{k}");
    }
}

#[test]
fn a_person_scrubs_through_a_run_by_keys_and_plays_it() {
    for width in [390, 1280, 2560] {
        let Some(browser) = Browser::start(width) else { return };
        let bench = Bench::start("planar4.toml");
        let _time = RealTime::start(&bench.board);
        recorded(&bench, "run-1.csv");
        browser.set_size(width, 900);
        browser.open(&format!("http://{}/replay", bench.address()));
        browser.click("#recordings a");
        browser.wait("location.search === '?data=run-1.csv' && document.querySelector('#replay').dataset.row === '0'");
        let text = |id: &str| {
            browser.value(&format!("document.querySelector('{id}').textContent")).as_str().unwrap().to_owned()
        };
        let rows: usize = text("#run-title").split([',', ' ']).rev().nth(1).unwrap().parse().unwrap();
        browser.value("document.querySelector('#at').focus()");
        // Right, right, left; then the end.
        for key in ["\u{E014}", "\u{E014}", "\u{E012}"] {
            browser.press(key);
        }
        browser.wait("document.querySelector('#replay').dataset.row === '1'");
        let time_s = open(&bench, "run-1.csv").times[1];
        assert!(text("#at-text").starts_with(&format!("{time_s:.3} s, row 1 of")), "{}", text("#at-text"));
        browser.wait("document.querySelector('#residual').textContent.startsWith('Residual (predicted − measured): ')");
        browser.wait("JSON.parse(document.querySelector('#arm').dataset.measured ?? 'null')?.[1] > 4.1");
        assert_eq!(browser.value("document.querySelectorAll('#plots figure').length"), 5);
        assert!(text("#plots figure:nth-child(4)").contains("arm 31.0"), "{}", text("#plots figure:nth-child(4)"));
        browser.press("\u{E010}");
        browser.wait(&format!("document.querySelector('#replay').dataset.row === '{}'", rows - 1));
        browser.press("\u{E011}");
        browser.wait("document.querySelector('#replay').dataset.row === '0'");
        // Played to the end, 16 times as fast, by the keyboard.
        browser.value("(document.querySelector('#speed').value = '16', document.querySelector('#play').focus())");
        browser.press("\u{E007}");
        browser.wait(&format!("document.querySelector('#replay').dataset.row === '{}'", rows - 1));
        browser.wait("document.querySelector('#play').textContent === 'Play'");
        plots_and_events(&browser);
        let is_wide = "document.documentElement.scrollWidth > document.documentElement.clientWidth";
        assert_eq!(browser.value(is_wide), false, "the page scrolls sideways at {width} px");
        browser.open(&format!("http://{}/replay?data=run-9.csv", bench.address()));
        browser.wait("document.querySelector('#replay-alert').textContent.includes('no measurement run-9.csv')");
    }
}

/// Plots are enlarged around the cursor by keys, and an event leads to its time.
fn plots_and_events(browser: &Browser) {
    browser.value("document.querySelector('#plots').focus()");
    browser.press("+");
    browser.wait("document.querySelector('#shown').textContent.includes(' to ')");
    browser.press("0");
    browser.wait("document.querySelector('#shown').textContent === 'the complete run'");
    browser.wait("document.querySelector('#events').textContent.includes('the program ran to its end')");
    browser.value("document.querySelector('#events button').focus()");
    browser.press("\u{E007}");
    browser.wait("document.querySelector('#replay').dataset.row === '0'");
}

/// `cargo test --config profile.dev.package.darm-serve.opt-level=3 -p darm-serve --test serve replay_figures -- --ignored --nocapture`
#[test]
#[ignore = "it measures"]
fn replay_figures_of_a_long_run() {
    const ROWS: usize = 100_000;
    let bench = Bench::start("planar4.toml");
    let text = example_text();
    let at = text.find("\n9.669").unwrap() + 1;
    let rows: Vec<&str> = text[at..].lines().filter(|line| line.starts_with(char::is_numeric)).collect();
    let row = |k: usize| format!("{:.6},{}\n", 0.35 * k as f64, rows[k % rows.len()].split_once(',').unwrap().1);
    let long = format!("{}{}", &text[..at], (0..ROWS).map(row).collect::<String>());
    fs::write(bench.data().join("long.csv"), &long).unwrap();
    let began = Instant::now();
    let run = open(&bench, "long.csv");
    println!("FIGURE replay of 100 000 rows: answer of the server = {} s", began.elapsed().as_secs_f64());
    assert_eq!(run.times.len(), ROWS);
    let began = Instant::now();
    assert_eq!(self::row(&bench, "long.csv", run.head["bytes"].as_u64().unwrap(), ROWS / 2).status, 200);
    println!("FIGURE replay of 100 000 rows: a row = {} s", began.elapsed().as_secs_f64());
    let Some(browser) = Browser::start(1280) else { return };
    browser.at_every_page(
        "const watch = setInterval(() => { if (document.querySelector('#replay')?.dataset.row === '0' && \
         document.querySelectorAll('#plots figure').length === 4) { window.openMs = performance.now(); clearInterval(watch); } }, 4);",
    );
    browser.open(&format!("http://{}/replay?data=long.csv", bench.address()));
    browser.wait("window.openMs");
    println!(
        "FIGURE replay of 100 000 rows: until the page shows plots and row = {} s",
        1e-3 * browser.value("window.openMs").as_f64().unwrap()
    );
}
