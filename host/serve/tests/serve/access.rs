//! Requests from elsewhere are refused, and no `GET` changes anything.

use darm_arm::wired_arm::WiredArm;
use serde_json::json;

use super::board::{Bench, example};
use super::http::request;

const TOKEN: &str = "secret-of-the-bench";

#[test]
fn a_foreign_origin_or_host_is_refused_and_changes_nothing() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    for header in ["Origin: http://evil.example", "Origin: null", "Sec-Fetch-Site: cross-site", "Host: evil.example"] {
        for (path, body) in [("/api/stop", json!({})), ("/api/control", json!({"do": "take"}))] {
            let refused = bench.post(path, &[header], &body);
            assert_eq!((refused.status, refused.json()["refused"]["kind"].as_str()), (403, Some("denied")), "{header}");
        }
        let opened =
            request(bench.address(), "POST", "/api/open?name=a", &[header], &bench.table(&["000010000000"], 0.1));
        assert_eq!(opened.status, 403, "{header}");
    }
    let live = bench.phase("idle");
    assert!(live["control"].is_null() && live["program"] == 0, "{live}");
    assert!(!live["events"].to_string().contains("stopped"), "{live}");
    let own = format!("Origin: http://{}", bench.address());
    assert_eq!(bench.post("/api/stop", &[&own, "Sec-Fetch-Site: same-origin"], &json!({})).status, 200);
}

#[test]
fn no_get_changes_anything() {
    let bench = Bench::start("planar4.toml");
    let before = bench.phase("idle");
    for path in ["/api/stop", "/api/control", "/api/open?name=a", "/api/upload", "/api/command"] {
        let answer = request(bench.address(), "GET", path, &["Content-Type: application/json"], br#"{"do":"take"}"#);
        assert_eq!(answer.status, 405, "{path}");
    }
    for path in ["/", "/program", "/api/live", "/api/arm", "/api/picture", "/api/program", "/style.css"] {
        assert_eq!(request(bench.address(), "GET", path, &[], b"").status, 200, "{path}");
    }
    let after = bench.phase("idle");
    for key in ["control", "program", "events", "upload"] {
        assert_eq!(before[key], after[key], "{key}");
    }
}

#[test]
fn every_answer_forbids_to_load_or_embed_from_elsewhere() {
    let bench = Bench::start("planar4.toml");
    for path in ["/", "/live.js", "/vendor/three.module.min.js", "/api/live", "/missing"] {
        let head = request(bench.address(), "GET", path, &[], b"").head.to_lowercase();
        for part in ["default-src 'none'", "script-src 'self'", "frame-ancestors 'none'", "nosniff"] {
            assert!(head.contains(part), "{path}: {part}: {head}");
        }
        assert!(!head.contains("access-control-allow"), "{path}");
    }
    let page = String::from_utf8(request(bench.address(), "GET", "/", &[], b"").body).unwrap();
    assert!(!page.contains("://") && !page.contains("<style") && page.contains("type=\"submit\""), "{page}");
}

#[test]
fn a_token_opens_the_interface_and_nothing_else_does() {
    let bench = Bench::start_wired(WiredArm::read(&example("planar4.toml"), None).unwrap(), Some(TOKEN));
    for headers in [vec![], vec!["Authorization: Bearer secret-of-the-bencH"], vec!["Authorization: Basic x"]] {
        assert_eq!(request(bench.address(), "GET", "/api/live", &headers, b"").status, 403);
        assert_eq!(bench.post("/api/stop", &headers, &json!({})).status, 403);
    }
    let right = format!("Authorization: Bearer {TOKEN}");
    assert_eq!(request(bench.address(), "GET", "/api/live", &[&right], b"").status, 200);
    assert_eq!(request(bench.address(), "GET", "/", &[], b"").status, 200);
}

#[test]
fn what_is_not_understood_is_refused() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let page = bench.page_in_control();
    for body in [json!({"do": "jump"}), json!({"do": "play", "table": "", "more": 1}), json!({"do": "word"}), json!([])]
    {
        assert_eq!(page.command(&body).status, 422, "{body}");
    }
    for word in ["9", "00000000000000000000000000000000000000000000000000000000000000000"] {
        let refused = page.command(&json!({"do": "word", "word": word}));
        assert_eq!((refused.status, refused.json()["refused"]["kind"].as_str()), (422, Some("invalid")), "{word}");
    }
    assert_eq!(bench.open("big.darm", &vec![0; 1 << 20]).status, 413);
    assert_eq!(bench.open("other.txt", b"no table").status, 422);
}
