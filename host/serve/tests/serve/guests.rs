//! Other programs at the board of a server: what they see, and when they may change something.

use std::path::Path;
use std::thread;
use std::time::Duration;

use darm_arm::table_file;
use darm_core::sequencer::{Command, CommandError};
use darm_core::wire::message::Refusal;
use darm_device::client::{Client, ClientError};
use serde_json::json;

use super::board::{Bench, Page};

fn image(bench: &Bench, words: &[&str]) -> darm_arm::image::UploadImage {
    table_file::TableFile::parse(Path::new("a.darm"), &bench.table(words, 20.0)).unwrap().image
}

fn names(bench: &Bench) -> Vec<String> {
    let live = bench.get("/api/live");
    live["attached"].as_array().unwrap().iter().map(|one| one["name"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn a_program_reads_beside_the_pages_and_they_see_it() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let revision = |bench: &Bench| bench.get("/api/live")["board"]["quality"]["sent"].as_u64().unwrap();
    let mut guest = bench.guest("`darm status --watch`");
    assert_eq!(bench.post("/api/here", &[], &json!({"page": 7, "name": " bench\n"})).status, 200);
    assert_eq!(names(&bench), ["bench", "`darm status --watch`"]);
    let before = revision(&bench);
    for _ in 0..50 {
        guest.status().unwrap();
        guest.events(0).unwrap();
    }
    let live = bench.live(|live| live["board"]["quality"]["sent"].as_u64() > Some(before + 100));
    assert!(live["control"].is_null() && live["link"]["state"] == "live", "{live}");
    drop(guest);
    bench.live(|live| live["attached"].as_array().unwrap().len() < 2);
}

#[test]
fn a_program_changes_something_while_no_page_has_control_and_keeps_pages_out_meanwhile() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let image = image(&bench, &["111111000000"]);
    let page = bench.page_in_control();
    let mut guest = bench.guest("`darm play`");
    let denied = guest.upload(&image, &mut |_| {}).unwrap_err();
    assert!(matches!(denied, ClientError::Denied(_)), "{denied:?}");
    let text = format!("nothing was sent: page {} controls the arm; ask for control, or release it there", page.number);
    assert_eq!(denied.to_string(), text);
    assert_eq!(page.control("release").status, 200);
    guest.upload(&image, &mut |_| {}).unwrap();
    guest.command(Command::Play).unwrap();
    bench.board.pass(0.5);
    bench.phase("playing");
    let control = &bench.get("/api/live")["control"];
    assert_eq!((control["name"].as_str(), control["is_program"].as_bool()), (Some("`darm play`"), Some(true)));
    for what in ["take", "ask"] {
        let taken = bench.post("/api/control", &[], &json!({ "do": what }));
        assert_eq!(taken.status, 409);
        assert_eq!(taken.json()["refused"]["text"], "`darm play` controls the arm; end it first");
    }
    assert_eq!(bench.stop().status, 200, "a stop needs no control");
    assert_eq!(bench.pins().0, 0);
    drop(guest);
    bench.live(|live| live["control"].is_null());
}

/// The server opens the connection again after a stop: the program is to notice that there was one.
#[test]
fn a_stop_of_a_page_ends_what_a_program_does() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let mut guest = bench.guest("`darm record`");
    guest.upload(&image(&bench, &["111111000000"]), &mut |_| {}).unwrap();
    guest.command(Command::Play).unwrap();
    bench.board.pass(0.5);
    bench.phase("playing");
    assert_eq!(bench.stop().status, 200);
    // Some looks of the server later: it has connected again.
    thread::sleep(Duration::from_millis(300));
    bench.phase("idle");
    let refused = guest.command(Command::Play).unwrap_err();
    assert!(matches!(refused, ClientError::Refused(Refusal::Command(CommandError::Stopped))), "{refused:?}");
    guest.say_hello().unwrap();
    guest.command(Command::Play).unwrap();
    guest.stop().unwrap();
    bench.phase("idle");
    assert_eq!(bench.pins().0, 0);
}

fn by_hand(bench: &Bench) -> Client {
    let mut guest = bench.guest("`darm console`");
    guest.upload(&image(bench, &["000010000000"]), &mut |_| {}).unwrap();
    guest.command(Command::Word("000010000000".parse().unwrap())).unwrap();
    bench.phase("manual");
    assert_ne!(bench.pins().0, 0);
    guest
}

#[test]
fn what_a_program_has_switched_by_hand_goes_off_when_it_ends() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    drop(by_hand(&bench));
    bench.phase("idle");
    assert_eq!(bench.pins().0, 0);
}

/// The digest of the table is asked for again: the one that the page knows may have been replaced.
#[test]
fn a_page_plays_no_table_that_a_program_has_brought_meanwhile() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let page = bench.page_in_control();
    let digest = page.upload(&bench.table(&["111111000000"], 20.0));
    assert_eq!(page.control("release").status, 200);
    bench.guest("`darm upload`").upload(&image(&bench, &["000000111111"]), &mut |_| {}).unwrap();
    bench.live(|live| live["control"].is_null());
    let page = bench.page_in_control();
    let refused = page.command(&json!({"do": "play", "table": digest}));
    assert_eq!(refused.status, 409, "{}", refused.json());
    let text = "the board has another table than this page shows; upload it first";
    assert_eq!(refused.json()["refused"]["text"], text);
}

#[test]
fn control_is_asked_for_and_handed_over_with_what_is_on() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let first = bench.page_in_control();
    first.upload(&bench.table(&["000010000000"], 20.0));
    assert_eq!(first.command(&json!({"do": "word", "word": "000010000000"})).status, 200);
    bench.phase("manual");
    assert_eq!(bench.post("/api/here", &[], &json!({"page": 7, "name": "phone"})).status, 200);
    let asked = bench.post("/api/control", &[], &json!({"do": "ask", "page": 7}));
    let second = Page::granted(&bench, &asked.json());
    assert_eq!(bench.get("/api/live")["control"]["asked_by"], "phone");
    assert_eq!(second.control("hand-over").status, 409, "it has only asked");
    assert_eq!(first.control("renew").status, 200);
    assert_eq!(first.control("hand-over").status, 200);
    let control = bench.get("/api/live")["control"].clone();
    assert_eq!((control["name"].as_str(), control["page"].as_u64()), (Some("phone"), Some(second.number)));
    assert_eq!((second.control("renew").status, first.control("renew").status), (200, 409));
    assert_ne!(bench.phase("manual")["board"]["outputs"][4]["is_on"], false);
    assert_eq!(bench.stop().status, 200);
}
