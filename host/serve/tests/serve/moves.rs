//! Who may move the arm, and what a stop does.

use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

use darm_serve::control::{CHANGE, LEASE};
use serde_json::json;

use super::board::{Bench, Page};

/// From the request to the pins, s of the board's time: a question of the watcher may be on the line.
const STOP_S: f64 = 0.1;

#[test]
fn a_stop_is_confirmed_and_the_pins_are_off() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let page = bench.page_in_control();
    let digest = page.upload(&bench.table(&["111111000000"], 20.0));
    page.play(&digest);
    bench.board.pass(0.5);
    bench.phase("playing");
    let (lines, before_s) = bench.pins();
    assert_eq!(lines.count_ones(), 6);
    let stopped = bench.stop();
    let (lines, after_s) = bench.pins();
    assert_eq!((stopped.json()["confirmed"].as_bool(), lines), (Some(true), 0));
    assert!(after_s - before_s < STOP_S, "{} s", after_s - before_s);
    bench.phase("idle");
    // The page still has control, and its connection to the board is opened again.
    page.play(&digest);
    bench.phase("playing");
    assert_eq!(bench.stop().status, 200);
}

#[test]
fn many_stops_at_once_are_all_confirmed() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    thread::scope(|scope| {
        let stops: Vec<_> = (0..8).map(|_| scope.spawn(|| bench.stop().json()["confirmed"].as_bool())).collect();
        assert!(stops.into_iter().all(|stop| stop.join().unwrap() == Some(true)));
    });
}

#[test]
fn only_the_page_in_control_moves_the_arm() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let word = json!({"do": "word", "word": "000010000000"});
    let refused = bench.post("/api/command", &[], &word);
    assert_eq!((refused.status, refused.json()["refused"]["kind"].as_str()), (409, Some("control")));
    let first = bench.page_in_control();
    first.upload(&bench.table(&["000010000000"], 0.2));
    let taken = bench.post("/api/control", &[], &json!({"do": "take"}));
    assert_eq!((taken.status, taken.json()["refused"]["kind"].as_str()), (409, Some("control")));
    assert_eq!(bench.get("/api/live")["control"]["page"], first.number, "both pages see who controls");
    let forged = bench.post("/api/command", &["x-darm-control: 0123456789abcdef"], &word);
    assert_eq!(forged.status, 409);
    let moved = first.command(&word);
    assert_eq!(moved.status, 200, "{}", moved.json());
    let live = bench.phase("manual");
    assert_eq!(live["board"]["outputs"][4]["is_on"], true);
    assert_eq!(bench.stop().status, 200, "a stop needs no control");
    bench.phase("idle");
    assert_eq!(first.control("release").status, 200);
    assert!(bench.get("/api/live")["control"].is_null());
    let second = bench.page_in_control();
    assert_ne!(second.number, first.number);
    assert_eq!(first.command(&word).status, 409);
}

#[test]
fn a_page_that_has_gone_loses_control() {
    let bench = Bench::start("planar4.toml");
    let gone = bench.page_in_control();
    assert_eq!(gone.control("renew").status, 200);
    thread::sleep(LEASE);
    let other = bench.page_in_control();
    assert_eq!(gone.control("renew").status, 409);
    assert_eq!(bench.get("/api/live")["control"]["page"], other.number);
}

#[test]
fn the_board_refuses_and_says_where() {
    let bench = Bench::start("planar4-hybrid.toml");
    bench.phase("idle");
    let page = bench.page_in_control();
    page.upload(&bench.table(&["000010000000"], 0.2));
    bench.board.pass(0.5);
    let refused = page.command(&json!({"do": "servo", "servo": 0, "angle_rad": 2.0}));
    assert_eq!((refused.status, refused.json()["refused"]["kind"].as_str()), (409, Some("refused")));
    assert_eq!(page.command(&json!({"do": "servo", "servo": 0, "angle_rad": 0.3})).status, 200);
    bench.board.pass(2.0);
    bench.live(|live| (live["board"]["servos"][0]["angle_rad"].as_f64().unwrap_or(0.0) - 0.3).abs() < 2e-3);
    assert_eq!(page.command(&json!({"do": "coil", "coil": 1, "on_ms": 100})).status, 200);
    assert_eq!(page.command(&json!({"do": "coil", "coil": 99, "on_ms": 100})).status, 409);
}

#[test]
fn a_page_that_has_gone_leaves_no_output_on_that_it_switched_by_hand() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let word = json!({"do": "word", "word": "000010000000"});
    for how in ["closed", "silent", "released"] {
        let page = bench.page_in_control();
        page.upload(&bench.table(&["000010000000"], 20.0));
        assert_eq!(page.command(&word).status, 200);
        bench.phase("manual");
        match how {
            "closed" => {
                assert_eq!(page.control("leave").status, 200);
                assert_ne!(bench.pins().0, 0, "the tab may go to another page");
                thread::sleep(CHANGE);
            }
            "silent" => thread::sleep(LEASE),
            _ => {
                assert_eq!(page.control("release").status, 200);
                thread::sleep(Duration::from_millis(500));
                bench.phase("manual");
                assert_ne!(bench.pins().0, 0, "a person who releases control sees the arm");
                continue;
            }
        }
        bench.phase("idle");
        assert_eq!(bench.pins().0, 0, "{how}");
    }
}

#[test]
fn outputs_that_were_switched_by_hand_stay_on_while_their_tab_changes_its_page() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let word = json!({"do": "word", "word": "000010000000"});
    let mut page = bench.page_in_control();
    page.upload(&bench.table(&["000010000000"], 20.0));
    assert_eq!(page.command(&word).status, 200);
    bench.phase("manual");
    let number = page.number;
    for _ in 0..3 {
        assert_eq!(page.control("leave").status, 200);
        thread::sleep(CHANGE / 2);
        let next = page.resumed();
        assert_eq!(page.command(&word).status, 409, "the page before has no key any more");
        page = next;
    }
    assert_eq!((page.number, bench.get("/api/live")["control"]["page"].as_u64()), (number, Some(number)));
    bench.phase("manual");
    assert_ne!(bench.pins().0, 0);
    assert_eq!(page.command(&json!({"do": "word", "word": "000000000000"})).status, 200);
    bench.live(|live| live["board"]["word"] == "000000000000");
}

#[test]
fn a_program_continues_without_the_page_that_started_it() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let page = bench.page_in_control();
    let digest = page.upload(&bench.table(&["000010000000"], 20.0));
    page.play(&digest);
    bench.board.pass(0.5);
    bench.phase("playing");
    assert_eq!(page.control("leave").status, 200);
    thread::sleep(CHANGE + Duration::from_millis(500));
    assert!(bench.phase("playing")["control"].is_null());
    assert_ne!(bench.pins().0, 0);
}

/// A page in control of a board that rests with a table and answers nothing for now.
fn page_at_held_board(bench: &Bench) -> Page<'_> {
    bench.phase("idle");
    let page = bench.page_in_control();
    page.upload(&bench.table(&["000010000000"], 20.0));
    bench.board.pass(2.0);
    bench.phase("idle");
    bench.is_held.store(true, Ordering::SeqCst);
    thread::sleep(Duration::from_millis(100));
    page
}

/// Somebody types a stop at the board, which then answers again.
fn type_stop_and_let_go(bench: &Bench) {
    bench.board.with_board(|board| board.send(b"stop\r")).unwrap();
    bench.board.pass(0.05);
    bench.is_held.store(false, Ordering::SeqCst);
}

/// A stop of the page ends the connection: the server does not see another one that follows while none is open.
#[test]
fn nothing_that_a_page_ordered_between_its_stop_and_one_of_somebody_else_acts_after_both() {
    let bench = Bench::start("planar4.toml");
    let page = page_at_held_board(&bench);
    let order = thread::scope(|scope| {
        scope.spawn(|| bench.stop());
        thread::sleep(Duration::from_millis(100));
        let order = scope.spawn(|| page.command(&json!({"do": "word", "word": "000010000000"})));
        thread::sleep(Duration::from_millis(200));
        type_stop_and_let_go(&bench);
        order.join().unwrap()
    });
    bench.board.pass(0.05);
    assert_eq!(bench.pins().0, 0, "{} {}", order.status, order.json());
}

/// The server opens a connection again by itself after a stop that is not its own, typed or of `darm stop`.
#[test]
fn nothing_that_a_page_ordered_before_a_stop_of_somebody_else_acts_after_it() {
    let bench = Bench::start("planar4.toml");
    let page = page_at_held_board(&bench);
    let word = json!({"do": "word", "word": "000010000000"});
    let answers = thread::scope(|scope| {
        let orders: Vec<_> = (0..2).map(|_| scope.spawn(|| page.command(&word))).collect();
        thread::sleep(Duration::from_millis(300));
        type_stop_and_let_go(&bench);
        orders
            .into_iter()
            .map(|order| order.join().unwrap())
            .map(|a| (a.status, a.json().to_string()))
            .collect::<Vec<_>>()
    });
    bench.board.pass(0.05);
    assert_eq!(bench.pins().0, 0, "{answers:?}");
}

#[test]
fn a_server_that_ends_leaves_no_output_on_that_a_page_switched_by_hand() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let page = bench.page_in_control();
    page.upload(&bench.table(&["000010000000"], 20.0));
    assert_eq!(page.command(&json!({"do": "word", "word": "000010000000"})).status, 200);
    // At once: the server has not looked at the board since.
    let board = bench.end();
    board.pass(3.0);
    let lines = board.with_board(|board| board.plant().lines()).unwrap();
    assert_eq!(lines, 0, "3 s after the end of the server");
}
