//! Clients that are slow, many or hostile: the server lives, and a stop gets through.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::TcpStream;
use std::thread;
use std::time::{Duration, Instant};

use darm_serve::connections::{MAX_CONNECTIONS, READ_TIMEOUT};
use darm_serve::upload::MAX_FILES;
use serde_json::json;

use super::board::Bench;
use super::http::request;

/// A stop takes a few ms; a busy machine may need more.
const STOP: Duration = Duration::from_secs(2);
/// Nested deeper than any recursion of a thread of the server could follow.
const DEPTH: usize = 200_000;

/// The body of an upload of a model and measurements.
fn upload(model: [&str; 2], data: [&str; 2]) -> Vec<u8> {
    let file = |[name, text]: [&str; 2]| json!({ "name": name, "bytes": text.len() });
    let head = json!({ "model": file(model), "data": file(data) });
    format!("{head}\n{}{}", model[1], data[1]).into_bytes()
}

/// Connections with nothing, half of the headers, or half of a body.
fn halves(bench: &Bench, count: usize) -> Vec<TcpStream> {
    let head = format!("POST /api/diagnosis/run HTTP/1.1\r\nHost: {}\r\n", bench.address());
    let body = format!("{head}Content-Length: 60000000\r\n\r\n{{\"model\"");
    let sent = ["", &head, &body];
    let connect = |k: usize| {
        let mut stream = TcpStream::connect(bench.address()).unwrap();
        stream.write_all(sent[k % 3].as_bytes()).unwrap();
        stream
    };
    (0..count).map(connect).collect()
}

/// Whether the server has closed a connection, after an answer or without one.
fn is_closed(stream: &mut TcpStream, patience: Duration) -> bool {
    stream.set_read_timeout(Some(patience)).unwrap();
    let (began, mut buffer) = (Instant::now(), [0; 4096]);
    loop {
        match stream.read(&mut buffer) {
            Ok(0) => return true,
            Ok(_) if began.elapsed() < patience => {}
            Ok(_) => return false,
            Err(error) => return error.kind() == ErrorKind::ConnectionReset,
        }
    }
}

#[test]
fn half_requests_hold_up_neither_a_stop_nor_the_end() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let halves = halves(&bench, 100);
    let began = Instant::now();
    assert_eq!(bench.stop().status, 200);
    assert!(began.elapsed() < STOP, "{:?}", began.elapsed());
    let ending = Instant::now();
    drop(bench);
    assert!(ending.elapsed() < Duration::from_secs(8), "{:?}", ending.elapsed());
    drop(halves);
}

#[test]
fn half_requests_and_idle_connections_are_closed_after_a_while() {
    let bench = Bench::start("planar4.toml");
    let mut waiting = halves(&bench, 6);
    // One that was answered, and is kept for more.
    let mut idle = TcpStream::connect(bench.address()).unwrap();
    idle.write_all(format!("GET /icon.svg HTTP/1.1\r\nHost: {}\r\n\r\n", bench.address()).as_bytes()).unwrap();
    waiting.push(idle);
    // Headers that arrive byte by byte.
    let mut slow = TcpStream::connect(bench.address()).unwrap();
    let began = Instant::now();
    while slow.write_all(b"G").is_ok() {
        thread::sleep(Duration::from_millis(200));
        assert!(began.elapsed() < 2 * READ_TIMEOUT, "{:?}", began.elapsed());
    }
    assert!(began.elapsed() > READ_TIMEOUT / 2, "{:?}", began.elapsed());
    for (index, stream) in waiting.iter_mut().enumerate() {
        assert!(is_closed(stream, READ_TIMEOUT), "{index}");
    }
}

#[test]
fn more_connections_than_there_are_places_leave_a_stop_its_time() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let mut halves = halves(&bench, 2 * MAX_CONNECTIONS);
    let began = Instant::now();
    assert_eq!(bench.stop().status, 200);
    assert!(began.elapsed() < STOP, "{:?}", began.elapsed());
    // Long before they would have been closed for their age.
    let closed = halves.iter_mut().filter_map(|half| is_closed(half, Duration::from_millis(1)).then_some(())).count();
    assert!(closed >= MAX_CONNECTIONS && began.elapsed() < READ_TIMEOUT, "{closed}, {:?}", began.elapsed());
}

/// Uploads take memory as they arrive: announced ones keep no other out.
#[test]
fn uploads_that_send_nothing_keep_neither_another_upload_nor_a_stop_out() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let begin = || {
        let mut stream = TcpStream::connect(bench.address()).unwrap();
        let head = format!(
            "POST /api/diagnosis/log HTTP/1.1\r\nHost: {}\r\nContent-Length: {MAX_FILES}\r\n\r\n",
            bench.address()
        );
        stream.write_all(head.as_bytes()).unwrap();
        stream
    };
    let uploads: Vec<_> = (0..MAX_CONNECTIONS - 8).map(|_| begin()).collect();
    thread::sleep(Duration::from_millis(300));
    let began = Instant::now();
    assert_eq!(bench.stop().status, 200);
    assert!(began.elapsed() < STOP, "{:?}", began.elapsed());
    let read = request(bench.address(), "POST", "/api/diagnosis/log", &[], b"{}");
    assert_eq!(read.status, 422, "it is read");
    drop(uploads);
    let answer = without_length(&bench);
    assert!(answer.starts_with("HTTP/1.1 411"), "{answer}");
}

/// The first line of the answer to a request that does not say how long it is.
fn without_length(bench: &Bench) -> String {
    let mut stream = TcpStream::connect(bench.address()).unwrap();
    let head =
        format!("POST /api/diagnosis/log HTTP/1.1\r\nHost: {}\r\nTransfer-Encoding: chunked\r\n", bench.address());
    stream.write_all(format!("{head}\r\n0\r\n\r\n").as_bytes()).unwrap();
    let mut answer = [0; 64];
    let read = stream.read(&mut answer).unwrap();
    String::from_utf8_lossy(&answer[..read]).lines().next().unwrap_or_default().to_owned()
}

#[test]
fn a_hundred_pages_leave_a_stop_its_time() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let (address, until) = (bench.address(), Instant::now() + Duration::from_secs(2));
    let page = move || {
        while Instant::now() < until {
            assert_eq!(request(address, "GET", "/api/live?after=18446744073709551615", &[], b"").status, 200);
        }
    };
    let pages: Vec<_> = (0..100).map(|_| thread::spawn(page)).collect();
    thread::sleep(Duration::from_millis(500));
    let began = Instant::now();
    assert_eq!(bench.stop().status, 200);
    assert!(began.elapsed() < STOP, "{:?}", began.elapsed());
    pages.into_iter().for_each(|page| page.join().unwrap());
}

#[test]
fn hostile_files_are_refused_and_the_server_lives() {
    let bench = Bench::start("planar4.toml");
    let nested = |open: &str, close: &str| open.repeat(DEPTH) + &close.repeat(DEPTH);
    let toml = format!("format = 2\nx = {}\n", nested("[", "]"));
    let urdf = format!("<robot name=\"r\">{}</robot>", nested("<link name=\"a\">", "</link>"));
    let mjcf = format!("<mujoco><worldbody>{}</worldbody></mujoco>", nested("<body>", "</body>"));
    let wide = (0..DEPTH).map(|k| format!("c{k},")).collect::<String>() + "\n";
    let numbers = "t_s,word,x_mm,y_mm,angle_deg\n0,000000000000,NaN,inf,1e999\n";
    let cell = format!("t_s,word,x_mm,y_mm,angle_deg\n0,000000000000,{},1,1\n", "9".repeat(10 << 20));
    let arm = std::fs::read_to_string(super::board::example("planar4.toml")).unwrap();
    let bodies = [
        nested("[", "]").into_bytes(),
        br#"{"data":{"name":"a","bytes":18446744073709551615}}"#.to_vec(),
        br#"{"data":{"name":"a","bytes":NaN}}"#.to_vec(),
        upload(["a.toml", &toml], ["b.csv", numbers]),
        upload(["a.urdf", &urdf], ["b.csv", numbers]),
        upload(["a.xml", &mjcf], ["b.csv", numbers]),
        upload(["a.toml", &arm], ["b.csv", &wide]),
        upload(["a.toml", &arm], ["b.csv", numbers]),
        upload(["a.toml", &arm], ["b.csv", &cell]),
        upload(["a.toml", &arm], ["b.mcap", "\u{89}MCAP"]),
        upload(["a.toml", &arm], ["b.csv.gz", "\u{1f}\u{8b}"]),
    ];
    for (index, body) in bodies.iter().enumerate() {
        for path in ["/api/diagnosis/log", "/api/diagnosis/run"] {
            let began = Instant::now();
            let answer = request(bench.address(), "POST", path, &["Content-Type: text/plain"], body);
            let may_be_read = path.ends_with("log") && index >= 3;
            assert!(answer.status == 422 || (may_be_read && answer.status == 200), "{index}: {}", answer.head);
            assert!(began.elapsed() < Duration::from_secs(20), "{index}: {:?}", began.elapsed());
        }
    }
    assert_eq!(bench.stop().status, 200);
}

/// Memory of this process, MiB.
fn memory_mib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kb = status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.trim().strip_suffix(" kB"))?;
    Some(kb.trim().parse::<u64>().ok()? >> 10)
}

/// A file is read as it is sent.
#[test]
fn answers_that_nobody_reads_take_no_memory_and_leave_a_stop_its_time() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let length = 60 << 20;
    std::fs::File::create(bench.data().join("big.csv")).unwrap().set_len(length).unwrap();
    let ask = || {
        let mut stream = TcpStream::connect(bench.address()).unwrap();
        let head = format!("GET /api/data/big.csv HTTP/1.1\r\nHost: {}\r\n\r\n", bench.address());
        stream.write_all(head.as_bytes()).unwrap();
        let mut status = [0; 12];
        stream.read_exact(&mut status).unwrap();
        assert_eq!(&status, b"HTTP/1.1 200");
        stream
    };
    let unread: Vec<_> = (0..40).map(|_| ask()).collect();
    let memory = memory_mib();
    assert!(memory.is_none_or(|mib| mib < 1024), "{memory:?} MiB with {} answers", unread.len());
    let began = Instant::now();
    assert_eq!(bench.stop().status, 200);
    assert!(began.elapsed() < STOP, "{:?}", began.elapsed());
    let read = request(bench.address(), "GET", "/api/data/big.csv", &[], b"");
    assert!(read.status == 200 && read.body.len() as u64 == length && read.body.iter().all(|byte| *byte == 0));
}
