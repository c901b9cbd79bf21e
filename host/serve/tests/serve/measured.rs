//! Measured poses on the live page: the residual of a rest, a source that is lost, and the marker in the picture.

use std::sync::{Arc, Mutex};
use std::time::{SystemTime, UNIX_EPOCH};

use darm_arm::arm::ArmScratch;
use darm_arm::wired_arm::WiredArm;
use darm_core::real::Vec3;
use darm_core::se::{Pose, rotation_exp};
use darm_serve::measured::{MeasuredPose, PoseReader, PoseSource};
use serde_json::{Value, json};

use super::board::{Bench, RealTime, example};
use super::webdriver::Browser;

/// What the camera sees: the pose, or why it sees nothing.
type Seen = Arc<Mutex<Result<Pose<f64>, String>>>;

struct Camera(Seen);

impl PoseReader for Camera {
    fn read(&mut self) -> Result<Vec<MeasuredPose>, String> {
        let time_s = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64();
        let pose = self.0.lock().unwrap().clone()?;
        Ok(vec![MeasuredPose { time_s, pose, supply_bar: Some(5.49), temperature_c: Some(34.1) }])
    }
}

fn bench() -> (Bench, Seen) {
    let wired = WiredArm::read(&example("planar4.toml"), None).unwrap();
    let seen: Seen = Arc::new(Mutex::new(Ok(Pose::identity())));
    let camera = Arc::clone(&seen);
    let open = move || Ok(Box::new(Camera(Arc::clone(&camera))) as Box<dyn PoseReader>);
    let source = PoseSource { name: "test camera".into(), open: Box::new(open) };
    (Bench::start_with(wired, None, Some(source)), seen)
}

/// The predicted pose of a word, moved by 3 mm along x, −4 mm along y, and turned by 0.01 rad.
fn moved(bench: &Bench, word: &str) -> Pose<f64> {
    let arm = &bench.wired.arm;
    let condition = arm.working_condition(word.parse().unwrap(), &[]);
    let pose = arm.model.predict(&condition, &mut ArmScratch::default()).unwrap();
    Pose {
        position: pose.position + Vec3::new(3e-3, -4e-3, 0.0),
        rotation: rotation_exp(&Vec3::new(0.0, 0.0, 0.01)) * pose.rotation,
    }
}

#[test]
fn the_residual_is_shown_at_rest_and_a_lost_source_says_why() {
    let (bench, seen) = bench();
    bench.phase("idle");
    *seen.lock().unwrap() = Ok(moved(&bench, "000000000000"));
    let near = |value: &Value, expected: f64| (value.as_f64().unwrap_or(f64::NAN) - expected).abs() < 1e-6;
    bench.live(|live| {
        let residual = &live["measured"]["residual"];
        let [position, rotation] = [&residual["position_m"], &residual["rotation_rad"]];
        near(&position[0], -3e-3) && near(&position[1], 4e-3) && near(&rotation[2], -0.01)
    });
    let page = bench.page_in_control();
    page.upload(&bench.table(&["000010000000"], 20.0));
    assert_eq!(page.command(&json!({"do": "word", "word": "000010000000"})).status, 200);
    // The poses that were measured at the word before are no residual of this one.
    let live = bench.live(|live| live["measured"]["residual"].is_null());
    assert_eq!(live["measured"]["n"], 0, "{live}");
    *seen.lock().unwrap() = Err("the lens is covered".into());
    let live = bench.live(|live| !live["measured"]["problem"].is_null());
    assert_eq!(
        (&live["measured"]["problem"], &live["measured"]["source"]),
        (&json!("the lens is covered"), &json!("test camera"))
    );
}

#[test]
fn a_person_sees_the_measured_pose_beside_the_predicted_one() {
    for width in [390, 1280] {
        let Some(browser) = Browser::start(width) else { return };
        let (bench, seen) = bench();
        let _time = RealTime::start(&bench.board);
        let pose = moved(&bench, "000000000000");
        *seen.lock().unwrap() = Ok(pose);
        browser.open(&format!("http://{}/", bench.address()));
        browser.wait(
            "document.querySelector('#residual').textContent === 'Residual (predicted − measured): 5.000 mm, 0.573°'",
        );
        let residuals = "[...document.querySelectorAll('#measured tr')].map((row) => row.children[0].textContent + ' ' + row.children[3].textContent)";
        assert_eq!(browser.value(residuals), json!(["x, mm −3.000", "y, mm 4.000", "angle, ° −0.573"]));
        browser.wait(&format!(
            "(([x, y]) => Math.hypot(x - {}, y - {}) < 2e-3)(JSON.parse(document.querySelector('#arm').dataset.measured ?? 'null') ?? [9, 9])",
            pose.position.x, pose.position.y
        ));
        let conditions = "document.querySelector('#conditions').textContent";
        assert_eq!(browser.value(conditions), "Supply 5.49 bar, temperature 34.1 °C");
        let is_wide = "document.documentElement.scrollWidth > document.documentElement.clientWidth";
        assert_eq!(browser.value(is_wide), false, "the page scrolls sideways at {width} px");
        assert!(browser.serious_findings().is_empty(), "{:#?}", browser.serious_findings());
    }
}
