//! The console of the pages.

use serde_json::{Value, json};

use super::board::{Bench, Page};
use super::http::Answer;

fn texts(bench: &Bench) -> Vec<String> {
    let lines = bench.get("/api/console?after=0");
    lines.as_array().unwrap().iter().map(|line| line["text"].as_str().unwrap().to_owned()).collect()
}

/// Types a line, and waits until the board has said this.
fn says(bench: &Bench, page: Option<&Page<'_>>, line: &str, answer: &str) {
    let body = json!({ "line": line });
    let typed: Answer = match page {
        Some(page) => page.order("/api/console", &body),
        None => bench.post("/api/console", &[], &body),
    };
    assert_eq!(typed.status, 200, "{line}: {}", typed.json());
    bench.live(|live: &Value| {
        bench.board.pass(0.01);
        live["console"].as_u64() > Some(0) && texts(bench).iter().any(|text| text.contains(answer))
    });
}

#[test]
fn lines_that_read_need_no_control_and_others_do() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    says(&bench, None, "id", "board ");
    says(&bench, None, "help", "coil N");
    for line in ["coil 1 on 200", "Play", "dance"] {
        let refused = bench.post("/api/console", &[], &json!({ "line": line }));
        assert_eq!((refused.status, refused.json()["refused"]["kind"].as_str()), (409, Some("control")), "{line}");
    }
    for line in ["help\x08\x08\x08\x08play", "id\nplay", "a".repeat(201).as_str()] {
        assert_eq!(bench.post("/api/console", &[], &json!({ "line": line })).status, 422, "{line:?}");
    }
    let page = bench.page_in_control();
    page.upload(&bench.table(&["000010000000"], 20.0));
    says(&bench, Some(&page), "dance", "? dance: no such command");
    says(&bench, Some(&page), "word 000010000000", "ok");
    bench.phase("manual");
    assert_eq!(bench.post("/api/console", &[], &json!({"line": "stop"})).status, 200, "a stop needs no control");
    bench.phase("idle");
    assert_eq!(bench.pins().0, 0);
    assert_eq!(texts(&bench).last().unwrap(), "stop");
}

#[test]
fn a_stop_in_a_line_of_any_length_stops_and_is_kept_cut() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let before = bench.get("/api/live")["stops"].as_u64().unwrap();
    let line = format!("stop{}", "a".repeat(250_000));
    for _ in 0..3 {
        assert_eq!(bench.post("/api/console", &[], &json!({ "line": line })).status, 200);
    }
    assert_eq!(bench.get("/api/live")["stops"].as_u64(), Some(before + 3));
    assert!(texts(&bench).iter().all(|text| text.len() <= 400) && texts(&bench).len() == 3);
}
