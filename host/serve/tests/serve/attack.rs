//! The server under attack: files that name others, files that expand, uploads that trickle, answers that nobody reads, and a flood of connections.
//!
//! The test is short. `cargo xtask faults --attack SECONDS` runs it with a flood of that length, and with memory and times measured.

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use serde_json::{Value, json};

use super::board::{Bench, RealTime, example};
use super::http::{Answer, request};
use super::stop_line::StopLine;

/// What no answer may have.
const SECRET: &str = "d41rm-secret-of-another-file";
/// Numbers that each file expands to: more than the server reads.
const MANY: usize = 20_000_000;
/// Bytes of the uploads that expand.
const SMALL: usize = 1 << 16;

/// For how long the flood lasts; `None` in the short test.
fn seconds() -> Option<u64> {
    std::env::var("DARM_ATTACK_SECONDS").ok().and_then(|text| text.parse().ok())
}

fn upload(files: &[(&str, &[u8])]) -> Vec<u8> {
    let named = |(name, bytes): &(&str, &[u8])| json!({"name": name, "bytes": bytes.len()});
    let more: Vec<Value> = files[2..].iter().map(named).collect();
    let head = json!({"model": named(&files[0]), "data": named(&files[1]), "more": more});
    let bytes: Vec<&[u8]> = files.iter().map(|(_, bytes)| *bytes).collect();
    [format!("{head}\n").as_bytes(), &bytes.concat()].concat()
}

/// Paths that lead, or may lead, to a file that was not sent.
fn paths(secret: &Path) -> Vec<String> {
    let (path, name) = (secret.display().to_string(), secret.file_name().unwrap().to_string_lossy().into_owned());
    let up = "../".repeat(12);
    let encoded = path.replace('/', "%2F");
    let entity = path.replace('/', "&#47;");
    let all = [
        path.clone(),
        format!(" {path}"),
        format!("{path} "),
        format!("/{path}"),
        format!("./{path}"),
        format!("{up}{path}"),
        format!("a/../..{path}"),
        format!("file://{path}"),
        format!("file:{path}"),
        format!("FILE://{path}"),
        format!("package://{path}"),
        format!("package://a/{up}{path}"),
        format!("package://{}", path.trim_start_matches('/')),
        format!("model://{path}"),
        format!("~{path}"),
        path.to_uppercase(),
        encoded,
        entity,
        path.replace('/', "\\"),
        path.replace('/', "//"),
        name,
        format!("/proc/self/root{path}"),
        format!("/proc/self/cwd{up}{path}"),
        "/proc/self/environ".to_owned(),
        "/proc/self/cmdline".to_owned(),
        "/dev/zero".to_owned(),
        "/dev/stdin".to_owned(),
        "/etc/passwd".to_owned(),
        "../../../../../../etc/passwd".to_owned(),
        "\u{feff}/etc/passwd".to_owned(),
        "/etc/../etc/./passwd".to_owned(),
    ];
    all.into()
}

/// Models that name a file by this path, each in another way: the files of an upload without its measurements.
fn models(path: &str) -> Vec<Vec<(&'static str, String)>> {
    let mjcf = |inside: &str| format!("<mujoco>{inside}</mujoco>");
    let include = mjcf(&format!("<include file=\"{path}\"/>"));
    let mesh = |compiler: &str, file: &str| {
        mjcf(&format!(
            "<compiler {compiler}/><asset><mesh name=\"m\" file=\"{file}\"/></asset><worldbody><body><joint name=\"j\"/>\
             <geom type=\"mesh\" mesh=\"m\"/></body></worldbody>"
        ))
    };
    let robot = |file: &str| format!("kind = \"robot\"\nurdf = {}\nobserved = \"torque\"\n", json!(file));
    let (folder, file) = path.rsplit_once('/').unwrap_or(("", path));
    let urdf = format!(
        "<robot name=\"r\"><link name=\"a\"><collision><geometry><mesh filename=\"{path}\"/></geometry></collision></link></robot>"
    );
    let xi = mjcf(&format!(
        "<xi:include xmlns:xi=\"http://www.w3.org/2001/XInclude\" href=\"{path}\" parse=\"text\"/><worldbody/>"
    ));
    let doctype =
        format!("<!DOCTYPE r [<!ENTITY x SYSTEM \"{path}\">]><mujoco model=\"&x;\"><include file=\"&x;\"/></mujoco>");
    vec![
        vec![("a.xml", include.clone())],
        vec![("a.dat", include.clone())],
        vec![("a.xml", mjcf("<include file=\"b.dat\"/>")), ("b.dat", include.clone())],
        vec![("a.xml", mjcf("<include file=\"b.csv.gz\"/>")), ("b.csv.gz", include.clone())],
        vec![("a.xml", mesh("angle=\"radian\"", path))],
        vec![("a.xml", mesh(&format!("meshdir=\"{folder}\""), file))],
        vec![("a.xml", mesh(&format!("assetdir=\"{folder}\" texturedir=\"{folder}\""), file))],
        vec![("a.xml", mesh("strippath=\"false\"", path))],
        vec![("a.toml", robot(path))],
        vec![("a.toml", robot("b.toml")), ("b.toml", robot(path))],
        vec![("a.toml", robot("b.xml")), ("b.xml", include)],
        vec![("a.toml", format!("format = 2\nprofile = {}\n", json!(path)))],
        vec![("a.urdf", urdf)],
        vec![("a.xml", xi)],
        vec![("a.xml", doctype)],
    ]
}

/// Tries all ways; the number of tries. None may answer with what another file says.
fn read_files(bench: &Bench, n_paths: usize) -> usize {
    let folder = tempfile::tempdir().unwrap();
    let secret = folder.path().join("secret.xml");
    std::fs::write(&secret, format!("<mujoco model=\"{SECRET}\"><{SECRET} </mujoco>")).unwrap();
    let all = paths(&secret);
    let mut n_tries = 0;
    for path in all.iter().step_by(all.len().div_ceil(n_paths)) {
        for files in models(path) {
            let files: Vec<(&str, &[u8])> = files.iter().map(|(name, text)| (*name, text.as_bytes())).collect();
            let data: (&str, &[u8]) = ("d.csv", b"t_s,q1,tau1\n0,1,2\n1,2,3\n");
            let body = upload(&[&files[..1], &[data], &files[1..]].concat());
            let answer = request(bench.address(), "POST", "/api/diagnosis/run", &[], &body);
            let text = String::from_utf8_lossy(&answer.body).into_owned();
            assert!(!text.contains(SECRET) && !text.contains("root:") && !text.contains("PATH="), "{path}: {text}");
            n_tries += 1;
        }
    }
    // Names that leave the folder, and logs that are links or models.
    for name in ["../d.csv", "/tmp/d.csv", "a/b.csv", "..\\d.csv", "c:d.csv", ".d.csv", ""] {
        let head = json!({"data": {"name": name, "bytes": 0}});
        let answer = request(bench.address(), "POST", "/api/diagnosis/log", &[], format!("{head}\n").as_bytes());
        assert_eq!(answer.status, 422, "{name}");
        n_tries += 1;
    }
    n_tries
}

fn gz(text: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(text).unwrap();
    encoder.finish().unwrap()
}

/// A `.npy` of zeros, one byte each.
fn npy(n: usize) -> Vec<u8> {
    let header = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({n},), }}\n");
    [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), &vec![0; n]].concat()
}

fn npz(n: usize) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    archive.start_file("../../q.npy", zip::write::SimpleFileOptions::default()).unwrap();
    archive.write_all(&npy(n)).unwrap();
    archive.finish().unwrap().into_inner()
}

/// A MAT-file with one compressed matrix of bytes.
fn mat(n: usize) -> Vec<u8> {
    let element = |kind: u32, content: &[u8]| {
        let padding = vec![0; content.len().next_multiple_of(8) - content.len()];
        [&kind.to_le_bytes()[..], &(content.len() as u32).to_le_bytes(), content, &padding].concat()
    };
    let shape = [(n as u32).to_le_bytes(), 1u32.to_le_bytes()].concat();
    let parts = [
        element(6, &[9u32.to_le_bytes(), 0u32.to_le_bytes()].concat()),
        element(5, &shape),
        element(1, b"q"),
        element(2, &vec![0; n]),
    ];
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(&element(14, &parts.concat())).unwrap();
    let inside = encoder.finish().unwrap();
    let mut header = [b' '; 128];
    header[..6].copy_from_slice(b"MATLAB");
    header[124..].copy_from_slice(&[0, 1, b'I', b'M']);
    [&header[..], &15u32.to_le_bytes(), &(inside.len() as u32).to_le_bytes(), &inside].concat()
}

/// An MCAP log with one message in a chunk.
fn mcap(message: &[u8]) -> Vec<u8> {
    let text = |text: &str| [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat();
    let record = |opcode: u8, content: &[u8]| [&[opcode][..], &(content.len() as u64).to_le_bytes(), content].concat();
    let channel = [&[1, 0, 0, 0][..], &text("/a"), &text("json"), &0u32.to_le_bytes()].concat();
    let message = [&[1, 0][..], &[0; 4 + 8 + 8], message].concat();
    let records = [record(4, &channel), record(5, &message)].concat();
    let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
    encoder.write_all(&records).unwrap();
    let packed = encoder.finish().unwrap();
    let size = (records.len() as u64).to_le_bytes();
    let chunk = [&[0; 16][..], &size, &[0; 4], &text("lz4"), &(packed.len() as u64).to_le_bytes(), &packed].concat();
    let magic = b"\x89MCAP0\r\n";
    [&magic[..], &record(6, &chunk), magic].concat()
}

/// Files that expand, and a model.
fn bombs(many: usize) -> Vec<(&'static str, Vec<u8>)> {
    let rows = |row: &str| gz(("t_s,word\n".to_owned() + &row.repeat(many / 4)).as_bytes());
    vec![
        ("one-column.csv.gz", gz(&b"1\n".repeat(many))),
        ("rows.csv.gz", rows("0,0\n")),
        ("columns.csv.gz", gz(&b"1,".repeat(many))),
        ("semicolons.csv.gz", gz(&b"1;2\n".repeat(many / 2))),
        ("spaces.txt.gz", gz(&b"1 2 3\n".repeat(many / 3))),
        ("cell.csv.gz", gz(&b"9".repeat(2 * many))),
        ("comments.csv.gz", gz(&b"# a 1\n".repeat(many / 3))),
        ("words.csv.gz", gz(&b"a\n".repeat(many))),
        ("array.npy.gz", gz(&npy(many))),
        ("array.npz", npz(many)),
        ("array.mat", mat(many)),
        ("list.mcap", mcap(format!("{{\"q\":[{}0]}}", "0,".repeat(many / 2)).as_bytes())),
        ("objects.mcap", mcap(format!("{{\"q\":[{}0]}}", "{},".repeat(many / 3)).as_bytes())),
        ("log.mcap.gz", gz(&mcap(format!("{{\"q\":[{}0]}}", "0,".repeat(many / 2)).as_bytes()))),
        ("zeros.csv.gz", gz(&vec![0; 2 * many])),
        ("bag.db3.gz", gz(&[b"SQLite format 3\0".to_vec(), vec![0; 2 * many]].concat())),
    ]
}

/// Sends files that expand; how many, and how many of them have at most 64 kB.
fn expand_files(bench: &Bench, many: usize) -> (usize, usize) {
    let arm = std::fs::read(example("planar4.toml")).unwrap();
    let all = bombs(many);
    for (name, bytes) in &all {
        for path in ["/api/diagnosis/log", "/api/diagnosis/run"] {
            let answer = request(bench.address(), "POST", path, &[], &upload(&[("a.toml", &arm), (name, bytes)]));
            assert!([200, 422].contains(&answer.status), "{name}: {}", answer.head);
        }
    }
    // A model may expand too: by its own elements, and by what it includes.
    let elements = format!("<mujoco>{}</mujoco>", "<a/>".repeat(many / 2));
    let include = format!("<mujoco>{}</mujoco>", "<include file=\"b.xml\"/>".repeat(900));
    let part = format!("<mujoco>{}</mujoco>", "<a/>".repeat(10_000));
    for files in [vec![("a.xml", &elements)], vec![("a.xml", &include), ("b.xml", &part)]] {
        let files: Vec<(&str, &[u8])> = files.iter().map(|(name, text)| (*name, text.as_bytes())).collect();
        let body = upload(&[&files[..1], &[("d.csv", &b"t_s,q1\n0,1\n"[..])], &files[1..]].concat());
        let answer = request(bench.address(), "POST", "/api/diagnosis/run", &[], &body);
        assert!([413, 422].contains(&answer.status), "{}", answer.head);
    }
    (all.len(), all.iter().filter(|(_, bytes)| bytes.len() <= SMALL).count())
}

/// Uploads that have sent a byte each.
fn trickles(bench: &Bench, count: usize) -> Vec<TcpStream> {
    let head =
        format!("POST /api/diagnosis/run HTTP/1.1\r\nHost: {}\r\nContent-Length: 60000000\r\n\r\n{{", bench.address());
    let begin = |_| {
        let mut stream = TcpStream::connect(bench.address()).unwrap();
        let _ = stream.write_all(head.as_bytes());
        stream
    };
    (0..count).map(begin).collect()
}

/// Answers that nobody reads: of a large file, and of the console after lines as long as a request may be.
fn unread(bench: &Bench, count: usize) -> Vec<TcpStream> {
    std::fs::File::create(bench.data().join("big.csv")).unwrap().set_len(60 << 20).unwrap();
    let line = json!({ "line": format!("stop{}", "a".repeat(250_000)) });
    for _ in 0..count {
        assert_eq!(bench.post("/api/console", &[], &line).status, 200);
    }
    let ask = |k: usize| {
        let path = ["/api/data/big.csv", "/api/console?after=0"][k % 2];
        let mut stream = TcpStream::connect(bench.address()).unwrap();
        let _ = stream.write_all(format!("GET {path} HTTP/1.1\r\nHost: {}\r\n\r\n", bench.address()).as_bytes());
        stream
    };
    (0..count).map(ask).collect()
}

/// Opens connections until it is told to end: idle ones, half requests, complete ones and ones that leave at once.
fn flood(address: SocketAddr, has_ended: &AtomicBool, count: &AtomicUsize) {
    let requests = [
        String::new(),
        "GET /api/live HTTP/1.1\r\n".to_owned(),
        format!("GET /api/live?after=18446744073709551615 HTTP/1.1\r\nHost: {address}\r\n\r\n"),
        format!("POST /api/diagnosis/run HTTP/1.1\r\nHost: {address}\r\nContent-Length: 60000000\r\n\r\n{{"),
    ];
    let mut open = std::collections::VecDeque::new();
    for k in 0.. {
        if has_ended.load(Ordering::Relaxed) {
            return;
        }
        let Ok(mut stream) = TcpStream::connect_timeout(&address, Duration::from_secs(5)) else { continue };
        let _ = stream.write_all(requests[k % 4].as_bytes());
        open.push_back(stream);
        if open.len() > 200 {
            open.pop_front();
        }
        count.fetch_add(1, Ordering::Relaxed);
    }
}

/// A connection of a page with control that stays open.
struct Kept {
    stream: TcpStream,
    host: SocketAddr,
    key: String,
}

impl Kept {
    /// Sends a request on it; the status.
    fn post(&mut self, path: &str, body: &str) -> std::io::Result<u16> {
        let Self { stream, host, key } = self;
        let head = format!(
            "POST {path} HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\nx-darm-control: {key}\r\nContent-Length: {}\r\n\r\n{body}",
            body.len()
        );
        stream.write_all(head.as_bytes())?;
        let (mut text, mut buffer) = (Vec::new(), [0; 4096]);
        loop {
            let read = stream.read(&mut buffer)?;
            text.extend_from_slice(&buffer[..read]);
            let answer = String::from_utf8_lossy(&text).into_owned();
            if let Some((head, body)) = answer.split_once("\r\n\r\n") {
                let lower = head.to_ascii_lowercase();
                let length = lower.lines().find_map(|line| line.strip_prefix("content-length: ")?.parse().ok());
                if body.len() >= length.unwrap_or(0) {
                    return Ok(head.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0));
                }
            }
            if read == 0 {
                return Err(std::io::ErrorKind::ConnectionReset.into());
            }
        }
    }
}

/// A stop by a new connection; the status, or why there is none.
fn new_stop(address: SocketAddr) -> std::io::Result<u16> {
    let stream = TcpStream::connect_timeout(&address, Duration::from_secs(5))?;
    stream.set_read_timeout(Some(Duration::from_secs(5)))?;
    Kept { stream, host: address, key: String::new() }.post("/api/stop", "{}")
}

/// Longest time of stops on the connection for stops of a page with control and on new ones, s, and how many of each failed.
struct Stops {
    longest_s: [f64; 2],
    failed: [usize; 2],
    count: usize,
    n_connections: usize,
}

fn stops_in_a_flood(bench: &Bench, lasts: Duration) -> Stops {
    let address = bench.address();
    let granted: Answer = bench.post("/api/control", &[], &json!({"do": "take"}));
    let key = granted.json()["key"].as_str().unwrap().to_owned();
    let stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
    let mut line = StopLine::open(address, &key, &[]).ok().unwrap();
    let mut kept = Kept { stream, host: address, key };
    assert_eq!(kept.post("/api/control", "{\"do\":\"renew\"}").unwrap(), 200);
    let (has_ended, n_connections) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
    let attackers: Vec<_> = (0..4)
        .map(|_| {
            let (has_ended, count) = (Arc::clone(&has_ended), Arc::clone(&n_connections));
            thread::spawn(move || flood(address, &has_ended, &count))
        })
        .collect();
    let (began, mut found) =
        (Instant::now(), Stops { longest_s: [0.0; 2], failed: [0; 2], count: 0, n_connections: 0 });
    while began.elapsed() < lasts {
        let renewed = kept.post("/api/control", "{\"do\":\"renew\"}");
        let since = Instant::now();
        let page = line.stop();
        let page_s = since.elapsed().as_secs_f64();
        let again = Instant::now();
        let new = new_stop(address);
        let times = [page_s, again.elapsed().as_secs_f64()];
        let is_confirmed = page.is_ok_and(|stopped| stopped["confirmed"] == true);
        let good = [is_confirmed && renewed.is_ok(), new.is_ok_and(|status| status == 200)];
        for k in 0..2 {
            found.longest_s[k] = found.longest_s[k].max(times[k]);
            found.failed[k] += usize::from(!good[k]);
        }
        found.count += 1;
        thread::sleep(Duration::from_millis(200));
    }
    has_ended.store(true, Ordering::Relaxed);
    attackers.into_iter().for_each(|attacker| attacker.join().unwrap());
    found.n_connections = n_connections.load(Ordering::Relaxed);
    found
}

#[test]
fn no_file_that_was_not_sent_is_read_whatever_a_model_says() {
    let bench = Bench::start("planar4.toml");
    assert!(read_files(&bench, 4) > 50);
}

#[test]
fn files_that_expand_are_refused_and_trickled_uploads_take_no_memory() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    expand_files(&bench, MANY / 8);
    let held = trickles(&bench, 40);
    assert_eq!(request(bench.address(), "POST", "/api/diagnosis/log", &[], b"{}").status, 422, "it is read");
    drop(held);
    assert_eq!(bench.stop().status, 200);
}

#[test]
fn the_connections_of_a_page_with_control_are_kept_in_a_flood() {
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    bench.phase("idle");
    let found = stops_in_a_flood(&bench, Duration::from_secs(2));
    assert_eq!(found.failed[0], 0);
}

/// Measured by `cargo xtask faults --attack`, which runs it alone.
#[test]
fn attack_figures() {
    let Some(seconds) = seconds() else { return };
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    bench.phase("idle");
    println!(
        "FIGURE serve: tries to read files that were not sent, none read = {} tries",
        read_files(&bench, usize::MAX)
    );
    let (n_files, n_small) = expand_files(&bench, MANY);
    println!("FIGURE serve: files that expand = {n_files} files");
    println!("FIGURE serve: of these at most 64 kB = {n_small} files");
    let held = trickles(&bench, 400);
    let read = request(bench.address(), "POST", "/api/diagnosis/log", &[], b"{}").status;
    println!("FIGURE serve: uploads refused for trickled ones = {} uploads", u8::from(read != 422));
    drop(held);
    let unread = unread(&bench, 200);
    let found = stops_in_a_flood(&bench, Duration::from_secs(seconds));
    drop(unread);
    println!("FIGURE serve: connections of the flood = {} connections", found.n_connections);
    println!("FIGURE serve: stops in the flood = {} stops", 2 * found.count);
    println!("FIGURE serve: stops of a page with control that failed = {} stops", found.failed[0]);
    println!("FIGURE serve: stops by a new connection that failed = {} stops", found.failed[1]);
    println!("FIGURE serve: longest stop of a page with control = {} s", found.longest_s[0]);
    println!("FIGURE serve: longest stop by a new connection = {} s", found.longest_s[1]);
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak =
        status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.trim().parse().ok());
    let peak_kb: f64 = peak.unwrap_or(f64::NAN);
    println!("FIGURE serve: peak memory under attack = {} MiB", peak_kb / 1024.0);
    assert_eq!(bench.stop().status, 200);
}
