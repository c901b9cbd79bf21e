//! Headless Chromium, driven by `chromedriver`: the few requests of WebDriver that the tests need. A complete client
//! would double what this crate builds.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::http::request;

/// Set where a missing browser is a failure.
const REQUIRED: &str = "DARM_BROWSER_REQUIRED";
/// Finds what people with a screen reader, a keyboard or little contrast cannot use.
const AXE: &str = include_str!("../axe/axe.min.js");
const PATIENCE: Duration = Duration::from_secs(60);
/// The key of a reference to an element, by the WebDriver recommendation.
const ELEMENT: &str = "element-6066-11e4-a52e-4f735466cecf";

/// One browser at a time: each draws in software, on all cores.
static TURN: Mutex<()> = Mutex::new(());

/// A browser with one window.
pub(crate) struct Browser {
    driver: Child,
    address: SocketAddr,
    session: String,
    _profile: tempfile::TempDir,
    _turn: MutexGuard<'static, ()>,
}

impl Browser {
    /// Starts a browser of this width; `None` with a notice where there is none.
    pub(crate) fn start(width: u32) -> Option<Self> {
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let mut command = Command::new("chromedriver");
        let started = command.arg("--port=0").stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let Ok(mut driver) = started else {
            assert!(
                std::env::var_os(REQUIRED).is_none(),
                "chromedriver is not installed: apt-get install chromium-driver"
            );
            eprintln!("NO BROWSER: the test in a browser is left out; apt-get install chromium chromium-driver");
            return None;
        };
        let mut lines = BufReader::new(driver.stdout.take().unwrap()).lines();
        // It names port 0 before it has one.
        let port_of = |line: &str| line.split_once("on port ")?.1.trim_end_matches('.').parse().ok();
        let port: Option<u16> = lines.find_map(|line| port_of(&line.unwrap()).filter(|port| *port > 0));
        let address = SocketAddr::from(([127, 0, 0, 1], port.expect("chromedriver prints its port")));
        // It blocks once nobody reads what it prints.
        std::thread::spawn(move || lines.for_each(drop));
        let profile = tempfile::tempdir().unwrap();
        let folder = format!("--user-data-dir={}", profile.path().display());
        let size = format!("--window-size={width},900");
        let software = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
        let arguments = [&["--headless=new", "--no-sandbox", &folder, &size][..], &software].concat();
        let wanted = json!({"capabilities": {"alwaysMatch": {"goog:chromeOptions": {"args": arguments}}}});
        let mut browser = Self { driver, address, session: String::new(), _profile: profile, _turn: turn };
        let session = browser.send("POST", "/session", &wanted);
        browser.session = format!("/session/{}", session["sessionId"].as_str().unwrap());
        Some(browser)
    }

    fn send(&self, method: &str, path: &str, body: &Value) -> Value {
        let body = if method == "POST" { body.to_string() } else { String::new() };
        let headers = ["Content-Type: application/json"];
        let answer = request(self.address, method, &format!("{}{path}", self.session), &headers, body.as_bytes());
        assert_eq!(answer.status, 200, "{path}: {}", answer.json());
        answer.json()["value"].clone()
    }

    pub(crate) fn open(&self, url: &str) {
        self.send("POST", "/url", &json!({ "url": url }));
    }

    /// Opens another window and goes there; the handle of the one before.
    pub(crate) fn other_window(&self, url: &str) -> String {
        let before = self.window();
        let new = self.send("POST", "/window/new", &json!({"type": "window"}));
        self.to_window(new["handle"].as_str().unwrap());
        self.open(url);
        before
    }

    /// The handle of this window.
    pub(crate) fn window(&self) -> String {
        self.send("GET", "/window", &Value::Null).as_str().unwrap().to_owned()
    }

    pub(crate) fn to_window(&self, handle: &str) {
        self.send("POST", "/window", &json!({ "handle": handle }));
    }

    /// The value of an expression in the page.
    pub(crate) fn value(&self, expression: &str) -> Value {
        self.send("POST", "/execute/sync", &json!({"script": format!("return {expression};"), "args": []}))
    }

    /// Waits until an expression in the page is true.
    #[track_caller]
    pub(crate) fn wait(&self, expression: &str) {
        let since = Instant::now();
        while self.value(&format!("Boolean({expression})")) != true {
            let page = || self.value("document.body.innerText");
            assert!(since.elapsed() < PATIENCE, "{expression}: {}", page().as_str().unwrap_or_default());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn element(&self, selector: &str) -> String {
        let found = self.send("POST", "/element", &json!({"using": "css selector", "value": selector}));
        found[ELEMENT].as_str().unwrap().to_owned()
    }

    /// Clicks an element as a person does, once it can be clicked.
    #[track_caller]
    pub(crate) fn click(&self, selector: &str) {
        self.wait(&format!(
            "document.querySelector('{selector}')?.disabled === false || \
                            document.querySelector('{selector}')?.tagName === 'A'"
        ));
        self.send("POST", &format!("/element/{}/click", self.element(selector)), &json!({}));
    }

    /// Gives a file to an input.
    pub(crate) fn choose(&self, selector: &str, file: &str) {
        let file = std::fs::canonicalize(file).unwrap();
        self.send("POST", &format!("/element/{}/value", self.element(selector)), &json!({ "text": file }));
    }

    /// Drags from a point of an element to another, px from its upper left corner, with a `mouse` or by `touch`.
    pub(crate) fn drag(&self, selector: &str, kind: &str, from: [f64; 2], to: [f64; 2]) {
        let corner = self.value(&format!(
            "(({{left, top}}) => [left, top])(document.querySelector('{selector}').getBoundingClientRect())"
        ));
        let at = |point: [f64; 2], axis: usize| (corner[axis].as_f64().unwrap() + point[axis]).round();
        let go = |point| json!({"type": "pointerMove", "duration": 50, "x": at(point, 0), "y": at(point, 1)});
        let middle = [0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1])];
        let (down, up) = (json!({"type": "pointerDown", "button": 0}), json!({"type": "pointerUp", "button": 0}));
        let moves = json!([go(from), down, go(middle), go(to), up]);
        let pointer = json!({"type": "pointer", "id": kind, "parameters": {"pointerType": kind}, "actions": moves});
        self.send("POST", "/actions", &json!({ "actions": [pointer] }));
    }

    /// Drops files on an element, as from the desktop.
    pub(crate) fn drop_files(&self, selector: &str, files: &[&Path]) {
        let files: Vec<_> = files.iter().map(|file| std::fs::canonicalize(file).unwrap()).collect();
        let middle = self.value(&format!(
            "(({{left, top, width, height}}) => [left + width / 2, top + height / 2])(document.querySelector('{selector}').getBoundingClientRect())"
        ));
        for step in ["dragEnter", "dragOver", "drop"] {
            let data = json!({"items": [], "files": files, "dragOperationsMask": 1});
            let event = json!({"type": step, "x": middle[0], "y": middle[1], "data": data});
            self.protocol("Input.dispatchDragEvent", &event);
        }
    }

    /// Light or dark colours, without movement.
    pub(crate) fn set_dark(&self, is_dark: bool) {
        let value = if is_dark { "dark" } else { "light" };
        let still = json!({"name": "prefers-reduced-motion", "value": "reduce"});
        let features = json!([{"name": "prefers-color-scheme", "value": value}, still]);
        self.protocol("Emulation.setEmulatedMedia", &json!({ "features": features }));
    }

    /// A window of this size, in pixels of the page.
    pub(crate) fn set_size(&self, width: u32, height: u32) {
        let size = json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        self.protocol("Emulation.setDeviceMetricsOverride", &size);
    }

    /// A picture of the upper part of the page, scaled; PNG in base64.
    pub(crate) fn screenshot(&self, width: u32, height: u32, scale: f64) -> String {
        let clip = json!({"x": 0, "y": 0, "width": width, "height": height, "scale": scale});
        let picture = self.protocol("Page.captureScreenshot", &json!({"format": "png", "clip": clip}));
        picture["data"].as_str().unwrap().to_owned()
    }

    /// Runs a script before those of every page that is opened.
    pub(crate) fn at_every_page(&self, script: &str) {
        self.protocol("Page.addScriptToEvaluateOnNewDocument", &json!({ "source": script }));
    }

    /// Asks the browser past WebDriver, which has no word for it.
    fn protocol(&self, command: &str, parameters: &Value) -> Value {
        self.send("POST", "/goog/cdp/execute", &json!({"cmd": command, "params": parameters}))
    }

    /// What `axe-core` finds in the page that is serious or critical: rule, help, and the elements.
    pub(crate) fn serious_findings(&self) -> Vec<String> {
        self.send("POST", "/execute/sync", &json!({"script": AXE, "args": []}));
        let script = "const done = arguments[0]; axe.run({resultTypes: ['violations']}).then((found) => done(found.violations), \
                      (error) => done([{impact: 'critical', id: String(error), help: '', nodes: []}]));";
        let found = self.send("POST", "/execute/async", &json!({"script": script, "args": []}));
        let serious =
            found.as_array().unwrap().iter().filter(|rule| rule["impact"] == "serious" || rule["impact"] == "critical");
        let nodes = |rule: &Value| {
            rule["nodes"].as_array().unwrap().iter().map(|node| node["html"].to_string()).collect::<Vec<_>>()
        };
        serious.map(|rule| format!("{}: {}: {}", rule["id"], rule["help"], nodes(rule).join("; "))).collect()
    }

    /// Presses a key, wherever the focus is.
    pub(crate) fn press(&self, key: &str) {
        let strokes = json!([{"type": "keyDown", "value": key}, {"type": "keyUp", "value": key}]);
        self.send("POST", "/actions", &json!({"actions": [{"type": "key", "id": "keys", "actions": strokes}]}));
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // Also after a failed test: a browser outlives its driver. Nothing here may panic.
        let head = format!("DELETE {} HTTP/1.1\r\nHost: {}\r\nContent-Length: 0\r\n\r\n", self.session, self.address);
        let _ = TcpStream::connect(self.address).and_then(|mut driver| {
            driver.set_read_timeout(Some(Duration::from_secs(10)))?;
            driver.write_all(head.as_bytes())?;
            driver.read(&mut [0])
        });
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}
