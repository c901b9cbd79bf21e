//! What pages see of the board.

use darm_arm::arm::ArmScratch;
use darm_arm::wired_arm::WiredArm;
use serde_json::json;

use super::board::{Bench, example};

#[test]
fn a_board_is_shown_with_its_outputs_switches_and_limits() {
    let bench = Bench::start("planar4-hybrid.toml");
    let live = bench.live(|live| live["board"]["outputs"].as_array().is_some_and(|outputs| outputs.len() == 12));
    let board = &live["board"];
    let output = &board["outputs"][3];
    assert_eq!((&output["output"], &output["actuator"], &output["is_on"]), (&json!(3), &json!(3), &json!(false)));
    let [allowed_s, window_s] =
        [&output["allowed_s"], &output["limit"]["window_s"]].map(|value| value.as_f64().unwrap());
    let duty = output["limit"]["duty_percent"].as_f64().unwrap();
    let max_on_s = output["limit"]["max_on_s"].as_f64().unwrap();
    assert!((allowed_s - max_on_s.min(0.01 * duty * window_s)).abs() < 1e-9, "{output}");
    assert!(live["age_s"].as_f64().unwrap() < 0.5 && board["quality"]["sent"].as_u64().unwrap() > 0);
    let arm = bench.get("/api/arm");
    assert_eq!((&arm["name"], &arm["actuators"][0]["states"]), (&json!("planar4-hybrid"), &json!(2)));
    assert_eq!(arm["actuators"].as_array().unwrap().len(), 12);
    assert_eq!(arm["servos"][0]["name"], "base joint");
}

#[test]
fn the_picture_follows_the_word_and_agrees_with_the_model() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let page = bench.page_in_control();
    let digest = page.upload(&bench.table(&["000010000000", "101000000000"], 0.4));
    let before = bench.get("/api/picture");
    page.play(&digest);
    bench.board.pass(0.8);
    let live = bench.live(|live| live["board"]["word"] == "101000000000");
    let picture = bench.get("/api/picture");
    assert_eq!(picture["word"], live["board"]["word"]);
    assert_ne!(picture["tool"], before["tool"]);
    let arm = &bench.wired.arm;
    let word = "101000000000".parse().unwrap();
    let pose = arm.model.predict(&arm.working_condition(word, &[]), &mut ArmScratch::default()).unwrap();
    let shown = picture["tool"]["position_m"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap());
    assert!(shown.zip(pose.position.iter()).all(|(shown, own)| (shown - own).abs() < 1e-9), "{picture}");
    let extended = picture["lines"].as_array().unwrap().iter().filter(|line| line["part"] == "extended").count();
    assert_eq!(extended, 2);
}

#[test]
fn a_killed_board_is_shown_at_once_and_comes_back() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let page = bench.page_in_control();
    let digest = page.upload(&bench.table(&["000010000000"], 0.2));
    bench.plug(false);
    let lost = bench.live(|live| live["link"]["state"] == "lost");
    assert!(lost["link"]["reason"].as_str().unwrap().contains("in-process"), "{lost}");
    let refused = page.command(&json!({"do": "play", "table": digest}));
    assert_eq!((refused.status, refused.json()["refused"]["kind"].as_str()), (503, Some("link")));
    assert_eq!(bench.stop().status, 503, "a stop that cannot be sent is no success");
    bench.board.power_cycle();
    bench.plug(true);
    let back = bench.phase("idle");
    assert_eq!(back["board"]["table"], digest.as_str());
    assert!(back["board"]["boots"].as_u64().unwrap() > 1, "{back}");
    let mut kinds = back["events"].as_array().unwrap().iter().map(|event| event["kind"].as_str().unwrap());
    assert!(kinds.all(|kind| kind == "booted"), "nothing was played meanwhile: {back}");
}

#[test]
fn a_fault_is_shown_with_its_actuator_and_cleared() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let page = bench.page_in_control();
    let digest = page.upload(&bench.table(&["000010000000"], 0.5));
    let broken = darm_sim::plant::Broken { lines_low: 1 << 4, ..Default::default() };
    bench.board.set_broken(broken);
    page.play(&digest);
    bench.board.pass(0.5);
    let live = bench.phase("safe");
    let phase = &live["board"]["phase"];
    assert_eq!((&phase["fault"]["actuator"], &phase["row"]), (&json!(4), &json!(0)), "{phase}");
    bench.board.set_broken(darm_sim::plant::Broken::default());
    assert_eq!(page.command(&json!({"do": "clear"})).status, 200);
    bench.phase("idle");
}

#[test]
fn the_supply_counts_down_until_it_can_feed_more_outputs() {
    let folder = tempfile::tempdir().unwrap();
    let profile = folder.path().join("slow.toml");
    let text = std::fs::read_to_string(example("planar4.profile.toml")).unwrap();
    let slow = text.replacen("new_outputs = 6\nwindow_ms = 10\n", "new_outputs = 2\nwindow_ms = 5000\n", 1);
    assert_ne!(slow, text);
    std::fs::write(&profile, slow).unwrap();
    let bench = Bench::start_wired(WiredArm::read(&example("planar4.toml"), Some(&profile)).unwrap(), None);
    bench.phase("idle");
    let page = bench.page_in_control();
    page.upload(&bench.table(&["110000000000"], 0.1));
    // After a start the board takes its supply as exhausted.
    bench.board.pass(6.0);
    assert_eq!(page.command(&json!({"do": "word", "word": "110000000000"})).status, 200);
    // Before the word is shown the supply may still count as exhausted from the start.
    let live = bench.live(|live| live["board"]["outputs"][0]["is_on"] == true);
    let (supply, outputs) = (&live["board"]["supply"], &live["board"]["outputs"]);
    let wait_s = supply["wait_s"].as_f64().unwrap();
    assert!(supply["room"] == 0 && supply["all"] == 2 && wait_s > 0.0 && wait_s <= 5.0, "{supply}");
    assert_eq!((&outputs[0]["wait_s"], &outputs[2]["wait_s"]), (&json!(0.0), &supply["wait_s"]));
    bench.board.pass(5.0);
    let later = bench.live(|live| live["board"]["supply"]["room"] == 2);
    assert_eq!(later["board"]["outputs"][2]["wait_s"], 0.0);
}

/// The plots of a page that is opened later begin before it.
#[test]
fn what_was_seen_is_kept_for_plots() {
    let bench = Bench::start("planar4-hybrid.toml");
    bench.phase("idle");
    let later = bench.live(|_| bench.get("/api/samples?after=0")["next"].as_u64() > Some(5));
    assert_eq!(later["link"]["state"], "live");
    let samples = bench.get("/api/samples?after=2");
    let (series, values) = (samples["series"].as_array().unwrap(), samples["values"].as_array().unwrap());
    assert_eq!((samples["first"].as_u64(), series.len()), (Some(2), values.len()));
    let of = |plot: &str| series.iter().position(|one| one["plot"] == plot).unwrap();
    assert_eq!(values[of("Outputs")][0], 0.0);
    assert!(values[of("Residual")][0].is_null() && series[of("Residual")]["unit"] == "mm");
    assert_eq!(samples["times_s"].as_array().unwrap().len(), values[0].as_array().unwrap().len());
}
