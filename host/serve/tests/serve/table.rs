//! A table is opened, shown, uploaded and played.

use darm_arm::arm::wiring;
use darm_arm::board_profile::BoardProfile;
use darm_arm::plan::{Visit, plan};
use darm_arm::table_file;
use darm_arm::wired_arm::WiredArm;
use darm_core::output::CoilLimit;
use serde_json::json;

use super::board::{Bench, example};

#[test]
fn a_table_is_opened_uploaded_and_played_to_its_end() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let bytes = bench.table(&["000010000000", "000010000001", "111000111000"], 0.3);
    assert_eq!(bench.open("visits.darm", &bytes).status, 200);
    let program = bench.get("/api/program");
    assert_eq!((&program["name"], &program["refusal"]), (&json!("visits.darm"), &json!(null)));
    assert_eq!(program["lanes"].as_array().unwrap().len(), 12);
    let page = bench.page_in_control();
    let digest = page.upload(&bytes);
    bench.live(|live| live["board"]["table"] == digest.as_str());
    let other = page.command(&json!({"do": "play", "table": "0".repeat(64)}));
    assert_eq!((other.status, other.json()["refused"]["kind"].as_str()), (409, Some("refused")));
    page.play(&digest);
    bench.board.pass(program["end_s"].as_f64().unwrap() + 0.5);
    let live = bench.live(|live| live["events"].to_string().contains("finished"));
    let rows = live["events"].as_array().unwrap().iter().filter(|event| event["kind"] == "row").count();
    assert_eq!(rows, program["rows"].as_array().unwrap().len());
}

#[test]
fn an_upload_needs_control_and_the_table_that_is_shown() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let bytes = bench.table(&["000010000000"], 0.3);
    assert_eq!(bench.open("a.darm", &bytes).status, 200);
    let digest = bench.get("/api/program")["digest"].clone();
    assert_eq!(bench.post("/api/upload", &[], &json!({ "table": digest })).status, 409);
    let page = bench.page_in_control();
    assert_eq!(bench.open("b.darm", &bench.table(&["000010000001"], 0.3)).status, 200);
    let other = page.order("/api/upload", &json!({ "table": digest }));
    assert_eq!((other.status, other.json()["refused"]["kind"].as_str()), (422, Some("invalid")));
}

#[test]
fn a_table_for_another_profile_is_refused_with_the_reason() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let wired = WiredArm::read(&example("planar4-hybrid.toml"), None).unwrap();
    let visit = Visit { word: "000010000000".parse().unwrap(), servos_rad: vec![0.0], dwell_s: 0.1, label: "A".into() };
    let plan = plan(&wired.arm, &[visit], &wired.profile.board(None), &[]).unwrap();
    assert_eq!(bench.open("hybrid.darm", &table_file::bytes(&plan.image)).status, 200);
    let digest = bench.get("/api/program")["digest"].clone();
    let refused = bench.page_in_control().order("/api/upload", &json!({ "table": digest }));
    assert_eq!(refused.status, 409, "{}", refused.json());
    assert!(bench.phase("idle")["board"]["table"].is_null());
}

#[test]
fn a_play_that_the_limits_refuse_names_row_and_output() {
    let mut wired = WiredArm::read(&example("planar4.toml"), None).unwrap();
    let mut profile = wired.profile.profile.clone();
    let limit = CoilLimit { max_on_ms: 5_000, duty_percent: 50, window_ms: 20_000 };
    profile.outputs.iter_mut().flatten().for_each(|output| output.limit = limit);
    wired.profile = BoardProfile::new("half", profile);
    wired.wiring = wiring(&wired.arm, &wired.profile.profile).unwrap();
    let bench = Bench::start_wired(wired, None);
    bench.phase("idle");
    // A board that was just switched on counts each output as used.
    bench.board.pass(25.0);
    let page = bench.page_in_control();
    let digest = page.upload(&bench.table(&["000010000000"], 4.0));
    // A few runs use up what the outputs may be on in a window.
    let refused = (0..5).find_map(|_| {
        let played = page.command(&json!({"do": "play", "table": digest}));
        bench.board.pass(4.5);
        (played.status != 200).then(|| played.json())
    });
    let refused = refused.expect("a limit of on-time")["refused"].clone();
    assert_eq!(refused["kind"], "refused", "{refused}");
    assert_eq!((&refused["row"], &refused["output"]), (&json!(1), &json!(4)), "{refused}");
}
