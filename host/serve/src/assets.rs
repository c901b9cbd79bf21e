//! What a browser loads besides the pages: styles, scripts and the library `three`, all in the program.
//!
//! `host/serve/vendor/vendor.sh` fetches `three` in the version of its lock file from npm and changes one import, so that
//! no bundler and no import map is needed.

use axum::http::header;
use axum::response::{IntoResponse, Response};

/// A file that is served as it is.
#[derive(Clone, Copy, Debug)]
pub struct Asset {
    /// Its path on the server.
    pub path: &'static str,
    /// Its type.
    pub kind: &'static str,
    /// Its bytes.
    pub bytes: &'static [u8],
}

const SCRIPT: &str = "text/javascript; charset=utf-8";

macro_rules! asset {
    ($path:literal, $kind:expr, $file:literal) => {
        Asset { path: $path, kind: $kind, bytes: include_bytes!($file) }
    };
}

/// All of them.
pub const ASSETS: [Asset; 31] = [
    asset!("/style.css", "text/css; charset=utf-8", "../pages/style.css"),
    asset!("/icon.svg", "image/svg+xml", "../pages/icon.svg"),
    asset!("/server.js", SCRIPT, "../pages/server.js"),
    asset!("/frame.js", SCRIPT, "../pages/frame.js"),
    asset!("/stop-line.js", SCRIPT, "../pages/stop-line.js"),
    asset!("/format.js", SCRIPT, "../pages/format.js"),
    asset!("/live.js", SCRIPT, "../pages/live.js"),
    asset!("/console.js", SCRIPT, "../pages/console.js"),
    asset!("/last-hour.js", SCRIPT, "../pages/last-hour.js"),
    asset!("/plots.js", SCRIPT, "../pages/plots.js"),
    asset!("/measured.js", SCRIPT, "../pages/measured.js"),
    asset!("/arm.js", SCRIPT, "../pages/arm.js"),
    asset!("/program.js", SCRIPT, "../pages/program.js"),
    asset!("/editor.js", SCRIPT, "../pages/editor.js"),
    asset!("/draft.js", SCRIPT, "../pages/draft.js"),
    asset!("/playback.js", SCRIPT, "../pages/playback.js"),
    asset!("/timeline.js", SCRIPT, "../pages/timeline.js"),
    asset!("/reach.js", SCRIPT, "../pages/reach.js"),
    asset!("/target.js", SCRIPT, "../pages/target.js"),
    asset!("/latest.js", SCRIPT, "../pages/latest.js"),
    asset!("/density.js", SCRIPT, "../pages/density.js"),
    asset!("/replay.js", SCRIPT, "../pages/replay.js"),
    asset!("/diagnosis.js", SCRIPT, "../pages/diagnosis.js"),
    asset!("/columns.js", SCRIPT, "../pages/columns.js"),
    asset!("/history.js", SCRIPT, "../pages/history.js"),
    asset!("/axes.js", SCRIPT, "../pages/axes.js"),
    asset!("/zoom.js", SCRIPT, "../pages/zoom.js"),
    asset!("/vendor/three.module.min.js", SCRIPT, "../vendor/three/three.module.min.js"),
    asset!("/vendor/three.core.min.js", SCRIPT, "../vendor/three/three.core.min.js"),
    asset!("/vendor/OrbitControls.js", SCRIPT, "../vendor/three/OrbitControls.js"),
    asset!("/vendor/LICENSE", "text/plain; charset=utf-8", "../vendor/three/LICENSE"),
];

impl IntoResponse for Asset {
    fn into_response(self) -> Response {
        // A newer program at the same address has other scripts.
        ([(header::CONTENT_TYPE, self.kind), (header::CACHE_CONTROL, "no-cache")], self.bytes).into_response()
    }
}

#[cfg(test)]
mod tests {
    use super::ASSETS;

    /// Embedded bytes, uncompressed: the limit of 2 MB is for compressed ones.
    const MAX_BYTES: usize = 2_000_000;

    #[test]
    fn the_assets_are_small_and_load_nothing_from_elsewhere() {
        let bytes: usize = ASSETS.iter().map(|asset| asset.bytes.len()).sum();
        assert!(bytes < MAX_BYTES, "{bytes} bytes");
        let own = ASSETS.iter().filter(|asset| !asset.path.starts_with("/vendor/"));
        for asset in own {
            let text = std::str::from_utf8(asset.bytes).unwrap();
            // The name of a format is no address.
            let text = text.replace("http://www.w3.org/2000/svg", "");
            assert!(!text.contains("://"), "{} names another server", asset.path);
        }
    }

    #[test]
    fn imports_of_scripts_are_served() {
        for asset in ASSETS.iter().filter(|asset| asset.path.ends_with(".js")) {
            let text = std::str::from_utf8(asset.bytes).unwrap();
            let folder = asset.path.rsplit_once('/').unwrap().0;
            let imported = text.split(['\n', ';']).filter(|line| line.contains("import") || line.contains("} from"));
            let names = imported.filter_map(|line| line.split(['"', '\'']).nth(1)).filter(|name| name.starts_with('.'));
            for name in names {
                let path = format!("{folder}/{}", name.trim_start_matches("./"));
                assert!(ASSETS.iter().any(|asset| asset.path == path), "{}: {name}", asset.path);
            }
        }
    }
}
