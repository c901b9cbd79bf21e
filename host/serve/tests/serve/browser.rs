//! A person at the pages, in a real browser: takes control, uploads, plays, sees the arm move, stops, loses the board.

use darm_arm::arm::ArmScratch;

use super::board::{Bench, RealTime};
use super::replay::recorded;
use super::tab::live_with_control;
use super::webdriver::Browser;

/// Width of the window, pixels.
const WIDTH: u32 = 1280;

#[test]
fn a_person_uploads_plays_sees_the_arm_move_and_stops_it() {
    let Some(browser) = Browser::start(WIDTH) else { return };
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    browser.open(&format!("http://{}/", bench.address()));
    browser.wait("document.body.dataset.link === 'live'");
    browser.wait("document.querySelectorAll('#outputs tr').length === 12");
    upload_and_play(&browser, &bench);
    see_the_arm(&browser, &bench);
    stop(&browser, &bench);
    lose_the_board(&browser, &bench);
    // The page loaded nothing that the content security policy forbids.
    let errors =
        browser.value("performance.getEntriesByType('resource').filter((r) => r.responseStatus >= 400).length");
    assert_eq!(errors, 0);
}

fn upload_and_play(browser: &Browser, bench: &Bench) {
    browser.click("#take");
    browser.wait("document.body.hasAttribute('data-controls')");
    browser.click("a[href=\"/program\"]");
    browser.wait("document.body.hasAttribute('data-controls') && document.body.dataset.link === 'live'");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("long.darm");
    std::fs::write(&file, bench.table(&["000010000000", "101000000000"], 60.0)).unwrap();
    browser.choose("#file", file.to_str().unwrap());
    browser.wait("document.querySelectorAll('#timeline .span').length === 3");
    browser.click("#upload");
    browser.wait("document.querySelector('#table-note').textContent.includes('has this table')");
    browser.click("#play");
    browser.wait("document.querySelector('#running').textContent.startsWith('playing')");
    bench.phase("playing");
}

/// The scene graph has the tool where the model has it.
fn see_the_arm(browser: &Browser, bench: &Bench) {
    browser.click("a[href=\"/\"]");
    browser.wait("document.querySelector('#arm')?.dataset.tool && document.body.dataset.link === 'live'");
    let arm = &bench.wired.arm;
    let word = "000010000000".parse().unwrap();
    let pose = arm.model.predict(&arm.working_condition(word, &[]), &mut ArmScratch::default()).unwrap();
    let [x, y] = [pose.position.x, pose.position.y];
    browser.wait(&format!(
        "(([x, y, z]) => Math.hypot(x - {x}, y - {y}, z) < 1e-6)(JSON.parse(document.querySelector('#arm').dataset.tool))"
    ));
    browser.wait("document.querySelector('#outputs tr:nth-child(5)').classList.contains('on')");
}

/// The space bar stops wherever the focus is, also on a button, which it does not press.
fn stop(browser: &Browser, bench: &Bench) {
    assert_ne!(bench.pins().0, 0);
    browser.value("document.querySelector('#take').focus()");
    browser.press(" ");
    browser.wait("document.querySelector('#stopped').dataset.outcome === 'confirmed'");
    assert_eq!(bench.pins().0, 0);
    // The button with the focus was not pressed: control is not released. On a busy machine it may have run out.
    browser
        .wait("document.body.hasAttribute('data-controls') || document.body.textContent.includes('has lost control')");
    bench.phase("idle");
    browser.value("document.querySelector('#stopped').dataset.outcome = ''");
    browser.click("#stop");
    browser.wait("document.querySelector('#stopped').dataset.outcome === 'confirmed'");
}

fn lose_the_board(browser: &Browser, bench: &Bench) {
    bench.plug(false);
    browser.wait("document.body.dataset.link === 'lost'");
    browser.wait("getComputedStyle(document.querySelector('#phase')).opacity < 1");
    // That the board confirmed a stop says nothing of now.
    browser.wait("document.querySelector('#stopped').hidden");
    bench.plug(true);
    browser.wait("document.body.dataset.link === 'live'");
}

/// Elements that use the space bar themselves, or that a person types into, and their pages.
const FOCUSED: [[&str; 2]; 9] = [
    ["/", "#arm"],
    ["/", "a[href=\"/program\"]"],
    ["/program", "#file"],
    ["/reach", "#pose-0"],
    ["/reach", "#compare"],
    ["/reach", "#deviation"],
    ["/replay?data=run-1.csv", "#at"],
    ["/diagnosis", "#data"],
    ["/history", "#json"],
];

#[test]
fn the_space_bar_stops_whatever_has_the_focus_and_no_other_key_does() {
    let Some(browser) = Browser::start(WIDTH) else { return };
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    recorded(&bench, "run-1.csv");
    for [path, selector] in FOCUSED {
        browser.open(&format!("http://{}{path}", bench.address()));
        let focused = format!("document.querySelector('{selector}')");
        browser.wait(&format!("document.body.dataset.link === 'live' && {focused}?.getClientRects().length"));
        browser.value(&format!("{focused}.focus()"));
        browser.wait(&format!("document.activeElement === {focused}"));
        for other in ["s", "\u{E00C}", "\u{E004}"] {
            browser.press(other);
        }
        assert_eq!(browser.value("document.querySelector('#stopped').hidden"), true, "{path} {selector}");
        browser.value(&format!("{focused}.focus()"));
        let typed = browser.value(&format!("{focused}.value ?? ''"));
        browser.press(" ");
        browser.wait("document.querySelector('#stopped').dataset.outcome === 'confirmed'");
        assert_eq!(browser.value(&format!("{focused}.value ?? ''")), typed, "{path} {selector}");
    }
}

#[test]
fn two_pages_agree_on_who_controls() {
    let Some(browser) = Browser::start(WIDTH) else { return };
    let bench = Bench::start("planar4.toml");
    let address = format!("http://{}/", bench.address());
    let holder = |text: &str| format!("document.querySelector('#holder').textContent === '{text}'");
    browser.open(&address);
    browser.wait(&holder("nobody controls"));
    browser.click("#take");
    browser.wait(&holder("this page controls"));
    let name = bench.get("/api/live")["control"]["name"].as_str().unwrap().to_owned();
    let first = browser.other_window(&address);
    let second = browser.window();
    let other = format!("{name} controls");
    browser.wait(&holder(&other));
    for answer in ["#keep", "#hand-over"] {
        browser.click("#take");
        browser.wait(&holder(&format!("asked {name} for control")));
        browser.to_window(&first);
        browser.wait("!document.querySelector('#asked').hidden");
        browser.click(answer);
        browser.to_window(&second);
        browser.wait(&holder(if answer == "#keep" { &other } else { "this page controls" }));
    }
    browser.to_window(&first);
    browser.wait(&holder(&format!("{name} (2) controls")));
    browser.to_window(&second);
    browser.click("#take");
    browser.wait(&holder("nobody controls"));
    let names = "[...document.querySelectorAll('#here-list li')].map((one) => one.textContent).join(', ')";
    browser.wait(&format!("{names} === '{name}, {name} (2)'"));
}

/// A click makes a complete word of the state that the page shows: what another page has stopped since would be switched on again.
#[test]
fn a_click_on_what_was_shown_before_a_stop_of_another_page_is_refused() {
    let Some(browser) = Browser::start(WIDTH) else { return };
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    live_with_control(&browser, &bench);
    browser.click("#outputs tr:nth-child(5) button:last-of-type");
    browser.wait("document.querySelector('#outputs tr:nth-child(5)').classList.contains('on')");
    bench.phase("manual");
    // From now on the page learns nothing new.
    browser.value(
        "(window.answered = window.fetch, window.fetch = (path, options) => String(path).startsWith('/api/live') \
         ? new Promise(() => {}) : answered(path, options), 0)",
    );
    std::thread::sleep(std::time::Duration::from_millis(600));
    assert_eq!(bench.stop().status, 200);
    bench.phase("idle");
    browser.click("#outputs tr:nth-child(6) button:last-of-type");
    browser.wait("document.querySelector('#alert').textContent.includes('a stop came meanwhile')");
    assert_eq!(bench.pins().0, 0);
}
