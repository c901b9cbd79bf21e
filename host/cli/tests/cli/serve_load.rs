//! What an open page of an arm of 64⁶ words costs the server. `DARM_PAGE_SECONDS` sets for how long it is open.

use std::time::{Duration, Instant};

use super::serve_kills::Serving;
use super::{Board, Home, example};

const ARM: &str = "spatial6.toml";
/// Without the variable.
const SECONDS: u64 = 2;
/// Clock ticks a second of `/proc`.
const TICKS_HZ: f64 = 100.0;
/// Share of a core that no build exceeds: the goal of a measurement is far lower.
const MOST: f64 = 0.5;

/// Time on a processor of a process so far, s.
fn processor_s(process: u32) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap();
    // Behind the name, which may have spaces: state is field 3, user and system time are 14 and 15.
    let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
    fields[11..13].iter().map(|ticks| ticks.parse::<f64>().unwrap()).sum::<f64>() / TICKS_HZ
}

#[test]
fn page_figures_of_the_server() {
    let seconds = std::env::var("DARM_PAGE_SECONDS").ok().and_then(|text| text.parse().ok()).unwrap_or(SECONDS);
    let home = Home::new();
    let board = Board::start(&home, &example(ARM));
    let server = Serving::start(&home, &board.port, ARM, &home.path("history.sqlite3"));
    let mut after = server.wait(|live| live["link"]["state"] == "live")["revision"].as_u64().unwrap();
    let (began, before_s, time) = (Instant::now(), processor_s(server.process.id()), Duration::from_secs(seconds));
    let mut updates = 0u64;
    while began.elapsed() < time {
        // As a page does: at once after each answer.
        let live = server.ask("GET", &format!("/api/live?after={after}"), "", b"").unwrap();
        let revision = live["revision"].as_u64().unwrap();
        updates += u64::from(revision > after);
        after = revision;
    }
    let elapsed_s = began.elapsed().as_secs_f64();
    let share = (processor_s(server.process.id()) - before_s) / elapsed_s;
    assert!(updates > seconds && share < MOST, "{updates} updates in {elapsed_s} s, {share} of a core");
    println!("FIGURE live page of 64^6: updates = {} 1/s", updates as f64 / elapsed_s);
    println!("FIGURE live page of 64^6: processor of the server = {} % of a core", 100.0 * share);
}
