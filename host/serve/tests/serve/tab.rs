//! Control stays with its tab while that goes from page to page, and ends with it.

use super::board::{Bench, RealTime};
use super::webdriver::Browser;

/// What a person sees of control.
const CONTROLS: &str = "document.body.dataset.link === 'live' && document.body.hasAttribute('data-controls')";

/// Opens Live at a board with a table, and takes control there; its address.
pub(crate) fn live_with_control(browser: &Browser, bench: &Bench) -> String {
    bench.phase("idle");
    let page = bench.page_in_control();
    page.upload(&bench.table(&["000010000000"], 20.0));
    assert_eq!(page.control("release").status, 200);
    let address = format!("http://{}/", bench.address());
    browser.open(&address);
    browser.wait("document.querySelectorAll('#outputs tr').length === 12");
    browser.click("#take");
    browser.wait(CONTROLS);
    address
}

#[test]
fn a_tab_keeps_control_from_page_to_page_and_its_end_switches_off_what_was_set_by_hand() {
    let Some(browser) = Browser::start(1280) else { return };
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    let address = live_with_control(&browser, &bench);
    browser.click("#outputs tr:nth-child(5) button:last-of-type");
    bench.phase("manual");
    let holder = bench.get("/api/live")["control"]["page"].clone();
    let still = |how: &str| {
        browser.wait(CONTROLS);
        let live = bench.phase("manual");
        assert_eq!((&live["control"]["page"], bench.pins().0 != 0), (&holder, true), "{how}");
    };
    for path in ["/program", "/reach", "/diagnosis", "/history"] {
        browser.click(&format!("nav a[href=\"{path}\"]"));
        browser.wait(&format!("location.pathname === '{path}'"));
        still(path);
    }
    browser.value("history.back()");
    browser.wait("location.pathname === '/diagnosis'");
    still("back");
    browser.value("location.reload()");
    browser.wait("!document.body?.dataset.old");
    still("loaded again");
    browser.open(&address);
    still("typed");
    browser.open("about:blank");
    bench.phase("idle");
    assert!(bench.get("/api/live")["control"].is_null() && bench.pins().0 == 0);
    // Who comes back later does not get what another person may have taken.
    browser.open(&address);
    browser.wait(
        "document.body.dataset.link === 'live' && document.querySelector('#holder').textContent === 'nobody controls'",
    );
    browser.wait("sessionStorage.getItem('darm-control-key') === null");
}
