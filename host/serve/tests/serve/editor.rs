//! A person makes a table on the page, goes through it row by row, and plays it again and again.

use serde_json::{Value, json};

use super::board::{Bench, RealTime};
use super::webdriver::Browser;

/// Types into a field as a person who then leaves it.
fn fill(browser: &Browser, selector: &str, text: &str) {
    browser.value(&format!(
        "(() => {{ const field = document.querySelector('{selector}'); field.value = '{text}'; \
         field.dispatchEvent(new Event('input')); field.dispatchEvent(new Event('change')); }})()"
    ));
}

fn words(browser: &Browser) -> Value {
    browser.value("[...document.querySelectorAll('#visits .word')].map((field) => field.value)")
}

/// Clicks a lane of the draft at this share of its length.
fn click_time_line(browser: &Browser, lane: usize, at: f64) {
    browser.value(&format!(
        "(() => {{ const ground = document.querySelectorAll('#draft .ground')[{lane}]; const box = ground.getBoundingClientRect(); \
         ground.dispatchEvent(new MouseEvent('click', {{ clientX: box.left + {at} * box.width, clientY: box.top + 2, bubbles: true }})); }})()"
    ));
}

#[test]
fn visits_are_edited_undone_switched_on_the_time_line_and_stepped_through() {
    let Some(browser) = Browser::start(1280) else { return };
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    bench.phase("idle");
    browser.open(&format!("http://{}/program", bench.address()));
    browser.wait("document.body.dataset.link === 'live' && !document.querySelector('#make-section').hidden");
    browser.click("#add");
    fill(&browser, "#visits tr:nth-child(1) .word", "000010000000");
    browser.wait("!document.querySelector('#make-visits').disabled");
    browser.click("#add");
    fill(&browser, "#visits tr:nth-child(2) .word", "00001");
    browser.wait("document.querySelector('#visits tr:nth-child(2)').classList.contains('refused')");
    assert_eq!(browser.value("document.querySelector('#make-visits').disabled"), true);
    // The time line is still that of the draft before.
    click_time_line(&browser, 11, 0.75);
    assert_eq!(words(&browser), json!(["000010000000", "00001"]));
    browser.click("#undo");
    browser.wait("!document.querySelector('#make-visits').disabled");
    assert_eq!(words(&browser), json!(["000010000000", "000010000000"]));
    browser.click("#redo");
    assert_eq!(words(&browser), json!(["000010000000", "00001"]));
    browser.click("#undo");
    browser.wait("!document.querySelector('#make-visits').disabled");
    // The second half of the time line is the second visit.
    click_time_line(&browser, 11, 0.75);
    assert_eq!(words(&browser), json!(["000010000000", "000010000001"]));
    // The draft stays with the tab.
    browser.click("nav a[href=\"/history\"]");
    browser.wait("location.pathname === '/history'");
    browser.click("nav a[href=\"/program\"]");
    browser.wait(
        "document.querySelectorAll('#visits tr').length === 2 && !document.querySelector('#make-visits').disabled",
    );
    assert_eq!(words(&browser), json!(["000010000000", "000010000001"]));
    browser.click("#make-visits");
    browser.wait("document.querySelector('#origin-text').textContent.includes('2 visits')");
    browser.click("#take");
    browser.wait("document.body.hasAttribute('data-controls')");
    browser.click("#upload");
    browser.wait("document.querySelector('#table-note').textContent.includes('has this table')");
    let row_word = |row: u64| bench.get("/api/program")["rows"][row as usize]["word"].clone();
    for (button, row) in [("#step", 0), ("#step", 1), ("#step-back", 0)] {
        browser.wait(&format!("!document.querySelector('{button}').disabled"));
        browser.click(button);
        let word = row_word(row);
        bench.live(|live| live["board"]["phase"]["name"] == "manual" && live["board"]["word"] == word);
    }
}

#[test]
fn a_click_on_the_time_line_gives_an_actuator_only_digits_that_it_has() {
    let Some(browser) = Browser::start(1280) else { return };
    let bench = Bench::start("serial2.toml");
    browser.open(&format!("http://{}/program", bench.address()));
    browser.wait("!document.querySelector('#make-section').hidden");
    browser.click("#add");
    // Two outputs an actuator, which are never on together: three states.
    for (lane, word) in [(0, "10"), (1, "20"), (0, "10"), (2, "11"), (0, "01")] {
        browser.wait("!document.querySelector('#make-visits').disabled");
        click_time_line(&browser, lane, 0.5);
        assert_eq!(words(&browser), json!([word]));
    }
}

/// Another page of the tab has added to the draft, of a server that had an arm without servos.
#[test]
fn a_page_that_comes_back_has_the_draft_of_its_tab_with_the_servos_of_its_arm() {
    let Some(browser) = Browser::start(1280) else { return };
    let bench = Bench::start("planar4-hybrid.toml");
    browser.open(&format!("http://{}/program", bench.address()));
    browser.wait("!document.querySelector('#make-section').hidden");
    let word = "0".repeat(bench.wired.arm.n_actuators());
    let visit = json!({"word": word, "servosDeg": [], "dwell": ""});
    let draft = json!({"states": [{"visits": [visit], "mayRest": false}], "at": 0}).to_string();
    browser.value(&format!("sessionStorage.setItem('darm-draft', {})", json!(draft)));
    browser.value("window.dispatchEvent(new PageTransitionEvent('pageshow', { persisted: true }))");
    assert_eq!(words(&browser), json!([word]));
    assert_eq!(browser.value("document.querySelector('[aria-label^=\"Angle of servo 0\"]').value"), "0");
    browser.wait("!document.querySelector('#make-visits').disabled");
}

/// Key codes of WebDriver.
const TAB: &str = "\u{E004}";
const HOME: &str = "\u{E011}";
const DELETE: &str = "\u{E017}";

/// Types a digit over the first one of a word, and does not leave the field.
fn type_first_digit(browser: &Browser, selector: &str, digit: &str) {
    browser.click(selector);
    for key in [HOME, DELETE, digit] {
        browser.press(key);
    }
}

#[test]
fn a_field_that_is_left_loses_neither_the_focus_nor_a_click_and_undo_takes_back_what_is_typed() {
    let Some(browser) = Browser::start(1280) else { return };
    let bench = Bench::start("planar4.toml");
    browser.open(&format!("http://{}/program", bench.address()));
    browser.wait("!document.querySelector('#make-section').hidden");
    browser.click("#add");
    let word = "#visits tr:nth-child(1) .word";
    type_first_digit(&browser, word, "1");
    browser.press(TAB);
    assert_eq!(browser.value("document.activeElement.getAttribute('aria-label')"), "Rest of visit 1, s");
    type_first_digit(&browser, word, "0");
    browser.click("[aria-label=\"Copy visit 1\"]");
    assert_eq!(words(&browser), json!(["000000000000", "000000000000"]));
    browser.click("#undo");
    assert_eq!(words(&browser), json!(["000000000000"]));
    type_first_digit(&browser, word, "1");
    browser.value(
        "document.activeElement.dispatchEvent(new KeyboardEvent('keydown', { key: 'z', ctrlKey: true, bubbles: true }))",
    );
    assert_eq!(words(&browser), json!(["000000000000"]), "only what was typed");
    browser.click("#undo");
    assert_eq!(words(&browser), json!(["100000000000"]), "the change before it");
}

/// Somebody else stops the arm as soon as a request of this page to `path` is answered.
fn stop_after(browser: &Browser, path: &str) {
    browser.value(&format!(
        "(() => {{ const plain = window.fetch; window.fetch = async (path, options) => {{ \
         const answer = await plain(path, options); \
         if (path === '{path}') {{ window.fetch = plain; await plain('/api/stop', {{ method: 'POST' }}); }} \
         return answer; }}; }})()"
    ));
}

#[test]
fn a_stop_of_somebody_else_outdates_what_is_left_of_a_pause_or_a_row() {
    let Some(browser) = Browser::start(1280) else { return };
    let bench = Bench::start("planar4-hybrid.toml");
    let _time = RealTime::start(&bench.board);
    bench.phase("idle");
    let word = "1".repeat(bench.wired.arm.n_actuators());
    assert_eq!(bench.open("long.darm", &bench.table(&[&word], 5.0)).status, 200);
    browser.open(&format!("http://{}/program", bench.address()));
    browser.click("#take");
    browser.click("#upload");
    let is_outdated = |button: &str| {
        browser.click(button);
        browser.wait("document.querySelector('#alert').textContent.includes('a stop came meanwhile')");
        bench.phase("idle");
        assert_eq!(bench.pins().0, 0, "{button}");
    };
    browser.wait("!document.querySelector('#step').disabled");
    stop_after(&browser, "/api/command");
    is_outdated("#step");
    browser.click("#play");
    bench.phase("playing");
    stop_after(&browser, "/api/stop");
    is_outdated("#pause");
}

/// How many programs of the board have finished, as far as its events are shown.
fn n_finished(live: &Value) -> usize {
    live["events"].as_array().unwrap().iter().filter(|event| event["kind"] == "finished").count()
}

/// A page that plays a short table again and again.
fn play_again_and_again(browser: &Browser, bench: &Bench) {
    bench.phase("idle");
    assert_eq!(bench.open("short.darm", &bench.table(&["000010000000"], 0.2)).status, 200);
    browser.open(&format!("http://{}/program", bench.address()));
    browser.wait("document.body.dataset.link === 'live'");
    browser.click("#take");
    browser.wait("document.body.hasAttribute('data-controls')");
    browser.click("#upload");
    browser.wait("!document.querySelector('#play').disabled");
    browser.click("#loop");
    browser.click("#play");
    bench.live(|live| n_finished(live) >= 3);
}

#[test]
fn a_table_is_played_again_and_again_until_anybody_stops_it() {
    let Some(browser) = Browser::start(1280) else { return };
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    play_again_and_again(&browser, &bench);
    assert_eq!(bench.stop().status, 200);
    browser.wait("!document.querySelector('#loop').checked");
    let before = n_finished(&bench.phase("idle"));
    std::thread::sleep(std::time::Duration::from_millis(1500));
    assert_eq!(n_finished(&bench.phase("idle")), before);
}

/// Its events count from 0 again: none of them is newer than those of before.
#[test]
fn a_table_is_not_played_again_after_a_restart_of_the_board() {
    let Some(browser) = Browser::start(1280) else { return };
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    play_again_and_again(&browser, &bench);
    bench.board.with_board(|board| board.reset()).unwrap();
    browser.wait("!document.querySelector('#loop').checked");
    assert_eq!(n_finished(&bench.phase("idle")), 0);
}

#[test]
fn a_play_that_knows_of_fewer_stops_is_outdated() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let page = bench.page_in_control();
    let digest = page.upload(&bench.table(&["000010000000"], 0.3));
    let stops = bench.get("/api/live")["stops"].clone();
    let play = json!({"do": "play", "table": digest, "stops": stops});
    assert_eq!(page.command(&play).status, 200);
    assert_eq!(bench.stop().status, 200);
    bench.phase("idle");
    let refused = page.command(&play);
    assert_eq!((refused.status, refused.json()["refused"]["kind"].as_str()), (409, Some("stopped")));
    assert_eq!(bench.pins().0, 0);
}
