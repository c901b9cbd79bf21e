//! How long a page takes until it can be used, and how large it is.

use std::io::Write as _;

use darm_serve::assets::ASSETS;
use flate2::Compression;
use flate2::write::GzEncoder;

use super::board::{Bench, RealTime};
use super::webdriver::Browser;

/// On a machine with other work and a browser that draws in software, ms.
const MOST_MS: f64 = 10_000.0;
/// Most bytes of what is embedded, compressed.
const MOST_BYTES: usize = 2_000_000;
/// Notes when the values are live and control can be taken, ms since the page was asked for.
const WATCH: &str = "const watch = setInterval(() => { if (document.body?.dataset.link === 'live' && \
                     document.querySelectorAll('#outputs tr').length === 36 && document.querySelector('#take').disabled === false) \
                     { window.usableMs = performance.now(); clearInterval(watch); } }, 4);";

#[test]
fn page_figures_of_the_browser() {
    let bytes: usize = ASSETS.iter().map(|asset| compressed(asset.bytes)).sum();
    assert!(bytes < MOST_BYTES, "{bytes} bytes");
    println!("FIGURE live page: embedded files, compressed = {} MB", bytes as f64 * 1e-6);
    let Some(browser) = Browser::start(1280) else { return };
    let bench = Bench::start("spatial6.toml");
    let _time = RealTime::start(&bench.board);
    bench.phase("idle");
    browser.at_every_page(WATCH);
    browser.open(&format!("http://{}/", bench.address()));
    browser.wait("window.usableMs");
    let ms = browser.value("window.usableMs").as_f64().unwrap();
    assert!(ms < MOST_MS, "{ms} ms");
    println!("FIGURE live page of 64^6: time until it can be used = {} s", 1e-3 * ms);
}

fn compressed(bytes: &[u8]) -> usize {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap().len()
}
