//! Every page, light and dark, as `axe-core` judges it, and at the width of a telephone.

use super::board::{Bench, RealTime};
use super::diagnosis::diagnose_example;
use super::replay::recorded;
use super::webdriver::Browser;

#[test]
fn no_page_has_a_serious_finding_or_scrolls_sideways() {
    let Some(browser) = Browser::start(390) else { return };
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    diagnose_example(&bench);
    recorded(&bench, "run-1.csv");
    let ready = [
        ("/", "document.querySelectorAll('#outputs tr').length === 12"),
        ("/program", "document.querySelectorAll('#timeline .span').length > 0"),
        (
            "/reach",
            "document.querySelector('#word').textContent.length === 12 && document.querySelector('#density svg')",
        ),
        ("/replay?data=run-1.csv", "document.querySelector('#replay').dataset.row === '0'"),
        ("/diagnosis", "document.querySelector('#verdict-section')"),
        ("/history", "document.querySelector('#diagnoses code')"),
    ];
    for (path, ready) in ready {
        browser.open(&format!("http://{}{path}", bench.address()));
        browser.wait(&format!("document.body.dataset.link === 'live' && ({ready})"));
        let is_wide = "document.documentElement.scrollWidth > document.documentElement.clientWidth";
        assert_eq!(browser.value(is_wide), false, "{path} scrolls sideways");
        for is_dark in [false, true] {
            browser.set_dark(is_dark);
            let findings = browser.serious_findings();
            assert!(findings.is_empty(), "{path}, dark {is_dark}: {findings:#?}");
        }
    }
}
