//! The pictures of the live page in the book: each page at three widths.
//!
//! ```text
//! DARM_SCREENSHOTS=docs/images/serve cargo test -p darm-serve --test serve screenshots -- --ignored
//! ```
//!
//! It needs `pngquant`, which makes the pictures small.

use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{SystemTime, UNIX_EPOCH};

use darm_arm::arm::ArmScratch;
use darm_arm::wired_arm::WiredArm;
use darm_core::real::Vec3;
use darm_serve::measured::{MeasuredPose, PoseReader, PoseSource};
use serde_json::json;

use super::board::{Bench, RealTime, example};
use super::diagnosis::diagnose_example;
use super::webdriver::Browser;

/// Width and height of the window, and width of the picture.
const SIZES: [[u32; 3]; 3] = [[390, 844, 390], [1280, 800, 800], [3840, 2160, 1200]];
/// Largest picture, bytes.
const MAX_BYTES: u64 = 60_000;
/// The pages, and what each shows when it is complete.
const PAGES: [[&str; 3]; 6] = [
    [
        "live",
        "/",
        "document.querySelector('#arm').dataset.measured !== 'null' && document.querySelectorAll('#outputs tr').length === 12",
    ],
    [
        "program",
        "/program",
        "document.querySelectorAll('#timeline .span').length > 0 && !document.querySelector('#make-visits').disabled",
    ],
    [
        "reach",
        "/reach",
        "document.querySelector('#word').textContent.length === 12 && document.querySelector('#density svg')",
    ],
    [
        "replay",
        "/replay?data=run-1.csv",
        "document.querySelector('#replay').dataset.row && document.querySelector('#arm').dataset.measured",
    ],
    ["diagnosis", "/diagnosis", "document.querySelector('#verdict-section')"],
    ["history", "/history", "document.querySelector('#diagnoses code')"],
];
const WORD: &str = "100110100000";

/// Sees the arm a few millimetres away from where the model has it.
struct Camera(WiredArm);

impl PoseReader for Camera {
    fn read(&mut self) -> Result<Vec<MeasuredPose>, String> {
        let arm = &self.0.arm;
        let condition = arm.working_condition(WORD.parse().unwrap(), &[]);
        let mut pose = arm.model.predict(&condition, &mut ArmScratch::default()).unwrap();
        pose.position += Vec3::new(2.1e-3, -4.6e-3, 0.0);
        let time_s = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64();
        Ok(vec![MeasuredPose { time_s, pose, supply_bar: Some(5.49), temperature_c: Some(34.1) }])
    }
}

#[test]
#[ignore = "it writes the pictures of the book"]
fn screenshots_of_each_page() {
    let folder = std::env::var_os("DARM_SCREENSHOTS").expect("DARM_SCREENSHOTS names the folder");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(folder);
    std::fs::create_dir_all(&folder).unwrap();
    let browser = Browser::start(1280).expect("a browser");
    let wired = WiredArm::read(&example("planar4.toml"), None).unwrap();
    let camera = wired.clone();
    let open = move || Ok(Box::new(Camera(camera.clone())) as Box<dyn PoseReader>);
    let bench = Bench::start_with(wired, None, Some(PoseSource { name: "sim".into(), open: Box::new(open) }));
    let _time = RealTime::start(&bench.board);
    prepare(&bench);
    browser.open(&format!("http://{}/program", bench.address()));
    let visit = |word: &str| json!({"word": word, "servosDeg": [], "dwell": ""});
    let visits = [WORD, "101000000000", "110100110100"].map(visit);
    let draft = json!({"states": [{"visits": visits, "mayRest": false}], "at": 0}).to_string();
    browser.value(&format!("sessionStorage.setItem('darm-draft', {})", json!(draft)));
    for [name, path, ready] in PAGES {
        for [width, height, small] in SIZES {
            browser.set_size(width, height);
            browser.open(&format!("http://{}{path}", bench.address()));
            browser.wait(&format!("document.body.dataset.link === 'live' && ({ready})"));
            std::thread::sleep(std::time::Duration::from_millis(700));
            let file = folder.join(format!("{name}-{width}.png"));
            write(&browser.screenshot(width, height, f64::from(small) / f64::from(width)), &file);
            let bytes = std::fs::metadata(&file).unwrap().len();
            assert!(bytes <= MAX_BYTES, "{}: {bytes} bytes", file.display());
        }
    }
}

/// A table was played, the example was diagnosed, and the arm rests in a word.
fn prepare(bench: &Bench) {
    bench.phase("idle");
    // Control does not wait for it.
    diagnose_example(bench);
    std::fs::copy(example("planar4-run.csv"), bench.data().join("run-1.csv")).unwrap();
    let page = bench.page_in_control();
    let digest = page.upload(&bench.table(&[WORD, "101000000000", "110100110100"], 0.4));
    page.play(&digest);
    bench.live(|live| live["events"].to_string().contains("finished"));
    assert_eq!(page.command(&json!({"do": "word", "word": WORD})).status, 200);
    page.control("release");
}

/// Writes a picture with few colours.
fn write(base64: &str, file: &Path) {
    let script = "base64 -d | pngquant --speed 1 64 - > \"$1\"";
    let mut shell = Command::new("sh").args(["-c", script, "sh"]).arg(file).stdin(Stdio::piped()).spawn().unwrap();
    shell.stdin.take().unwrap().write_all(base64.as_bytes()).unwrap();
    assert!(shell.wait().unwrap().success(), "pngquant is installed");
}
