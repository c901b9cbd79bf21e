//! `darm serve` is started before its board.

use super::serve_kills::Serving;
use super::{Board, Home, example};

const ARM: &str = "planar4.toml";

#[test]
fn a_server_without_a_board_says_so_and_finds_the_one_that_comes() {
    let home = Home::new();
    let server = Serving::start(&home, "", ARM, &home.path("history.sqlite3"));
    let lost = server.wait(|live| live["link"]["state"] == "lost");
    assert!(lost["link"]["reason"].as_str().unwrap().starts_with("no board found; plug one in"), "{lost:#}");
    let refused = server.ask("POST", "/api/stop", "", b"").unwrap();
    assert!(refused["refused"]["text"].as_str().unwrap().contains("no board found"), "{refused:#}");
    let _board = Board::start(&home, &example(ARM));
    let live = server.wait(|live| live["link"]["state"] == "live");
    assert!(live["port"].as_str().unwrap().ends_with("/board/port"), "{live:#}");
    let stopped = server.ask("POST", "/api/stop", "", b"").unwrap();
    assert_eq!(stopped["confirmed"], true, "{stopped:#}");
}
