//! The page of reach: the answers are those of the library; a person drags the target by mouse, finger and keys, or types it.

use darm_arm::arm::ArmScratch;
use darm_arm::reach::exact::{Index, Options};
use darm_core::se::{Pose, Pose2};
use serde_json::{Value, json};

use super::board::{Bench, RealTime};
use super::http::Answer;
use super::webdriver::Browser;

fn nearest(bench: &Bench, target: [f64; 3], servos_rad: &[f64], optimise_servos: bool) -> Answer {
    let [x, y, angle] = target;
    let target = json!({"position_m": [x, y, 0.0], "rotation_rad": [0.0, 0.0, angle]});
    let from = bench.wired.arm.rest().to_string();
    bench.post(
        "/api/reach/nearest",
        &[],
        &json!({"target": target, "position_only": false, "servos_rad": servos_rad,
                "optimise_servos": optimise_servos, "from": from}),
    )
}

#[test]
fn the_nearest_word_is_that_of_the_exact_search_and_proven() {
    let bench = Bench::start("planar4.toml");
    let arm = &bench.wired.arm;
    let index = Index::new(arm, &Options::of(arm)).unwrap();
    for target in [[0.3, 4.2, 0.17], [-0.8, 4.0, 0.4], [30.0, 0.0, 0.0]] {
        let found = nearest(&bench, target, &[], false).json();
        let own = &index.nearest(&Pose2::new(target[0], target[1], target[2]).into(), 1, &[])[0];
        assert_eq!(found["word"], own.word.to_string());
        let [distance_m, bound_m] = ["distance_m", "lower_bound_m"].map(|name| found[name].as_f64().unwrap());
        assert!((distance_m - own.distance_m).abs() < 1e-12 && bound_m == distance_m, "{found}");
        assert_eq!((&found["is_proven"], &found["words"]), (&json!(true), &json!(4096.0)));
        assert_eq!(found["picture"]["word"], found["word"]);
    }
    let refused = nearest(&bench, [0.3, 4.2, 0.0], &[0.1], false);
    assert_eq!(refused.status, 422, "{}", refused.json());
    assert_eq!(nearest(&bench, [1e9, 0.0, 0.0], &[], false).status, 422);
}

#[test]
fn servo_angles_are_kept_or_optimised() {
    let bench = Bench::start("planar4-hybrid.toml");
    let chain = &bench.wired.arm.model.chain;
    let word = "010110011101".parse().unwrap();
    let pose: Pose<f64> = chain.pose_base_tool(&word, &[0.31], &mut ArmScratch::default()).unwrap();
    let angle = pose.rotation[(1, 0)].atan2(pose.rotation[(0, 0)]);
    let target = [pose.position.x, pose.position.y, angle];
    let there = nearest(&bench, target, &[0.31], false).json();
    assert!(there["distance_m"].as_f64().unwrap() < 1e-9 && there["is_proven"] == true, "{there}");
    let kept = nearest(&bench, target, &[0.0], false).json();
    let free = nearest(&bench, target, &[0.0], true).json();
    let distance_m = |found: &Value| found["distance_m"].as_f64().unwrap();
    assert!(distance_m(&free) < distance_m(&kept), "{free} {kept}");
    assert!(free["lower_bound_m"].as_f64().unwrap() <= distance_m(&free));
    let text = nearest(&bench, target, &[9.0], false).json()["refused"]["text"].to_string();
    assert!(text.contains("servo 0") && text.contains("allowed"), "{text}");
}

#[test]
fn a_path_leads_to_the_word_and_a_plane_has_every_word() {
    let bench = Bench::start("planar4.toml");
    let ask = |deviation_m: Value| {
        let words = ("000000000000", "111000111000");
        let request = json!({"from": words.0, "to": words.1, "servos_rad": [], "deviation_m": deviation_m});
        bench.post("/api/reach/path", &[], &request)
    };
    let rests = ask(Value::Null).json()["rests"].as_array().unwrap().clone();
    assert_eq!((&rests[0]["word"], &rests[rests.len() - 1]["word"]), (&json!("000000000000"), &json!("111000111000")));
    let narrow = ask(json!(1e-6));
    assert!(narrow.status == 409 || narrow.json()["rests"].as_array().unwrap().len() == 2, "{}", narrow.json());
    assert_eq!(ask(json!(-1.0)).status, 422);
    let plane = json!({"plane": "xy", "at_m": 0.0, "servos_rad": []});
    let slice = bench.post("/api/reach/slice", &[], &plane).json();
    let words: f64 = slice["cells"].as_array().unwrap().iter().map(|cell| cell[2].as_f64().unwrap()).sum();
    assert_eq!(words, 4096.0);
    let elsewhere = json!({"plane": "xy", "at_m": 5.0, "servos_rad": []});
    assert!(bench.post("/api/reach/slice", &[], &elsewhere).json()["cells"].as_array().unwrap().is_empty());
}

#[test]
fn a_person_drags_the_target_and_drives_the_arm_to_the_word() {
    let Some(browser) = Browser::start(1280) else { return };
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    let page = bench.page_in_control();
    // The board moves an arm whose wiring it has from a table.
    page.upload(&bench.table(&["000000000000"], 0.1));
    page.control("release");
    browser.open(&format!("http://{}/reach", bench.address()));
    browser.wait(
        "document.querySelector('#word').textContent.length === 12 && document.querySelector('#arm').dataset.target",
    );
    let x = || browser.value("Number(document.querySelector('#pose-0').value)").as_f64().unwrap();
    let mut last = x();
    for kind in ["mouse", "touch"] {
        let at = browser.value("JSON.parse(document.querySelector('#arm').dataset.target)");
        let from = [0, 1].map(|axis| at[axis].as_f64().unwrap());
        browser.drag("#arm", kind, from, [from[0] + 40.0, from[1] + 5.0]);
        browser.wait(&format!("Number(document.querySelector('#pose-0').value) > {last} + 50"));
        last = x();
    }
    browser.value("document.querySelector('#arm').focus()");
    browser.press("\u{E014}");
    browser.wait(&format!("Math.abs(Number(document.querySelector('#pose-0').value) - {last} - 10) < 0.2"));
    browser.value("[['#pose-0', 300], ['#pose-1', 4200], ['#pose-5', 10]].forEach(([id, value]) => { \
                   const field = document.querySelector(id); field.value = value; field.dispatchEvent(new Event('input')); })");
    let found = nearest(&bench, [0.3, 4.2, 10f64.to_radians()], &[], false).json();
    let word = found["word"].as_str().unwrap();
    browser.wait(&format!("document.querySelector('#word').textContent === '{word}'"));
    // The scene graph has the tool where the model has it, and the path ends at the word.
    let [tool_x, tool_y] = [0, 1].map(|axis| found["picture"]["tool"]["position_m"][axis].as_f64().unwrap());
    browser.wait(&format!(
        "(([x, y]) => Math.hypot(x - {tool_x}, y - {tool_y}) < 1e-6)(JSON.parse(document.querySelector('#arm').dataset.tool))"
    ));
    browser.wait(&format!("document.querySelector('#rests tr:last-child code')?.textContent === '{word}'"));
    browser
        .wait("document.querySelectorAll('#density .cell').length > 2 && document.querySelector('#density .target')");
    let rows = "document.querySelectorAll('#rests tr').length";
    let has_control = "document.body.hasAttribute('data-controls')";
    while browser.value(&format!("{rows} > 1")) == true {
        // On a busy machine control runs out, and the outputs go off.
        if browser.value(has_control) == false {
            browser.click("#take");
        }
        let before = browser.value(rows);
        browser.click("#set");
        browser.wait(&format!("{rows} !== {before} || !{has_control}"));
    }
    bench.live(|live| live["board"]["word"] == word);
    browser.wait("document.querySelector('#order-note').textContent.includes('is at the nearest word')");
}
