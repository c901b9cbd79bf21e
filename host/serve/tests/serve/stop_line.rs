//! The connection for stops of the page with control.

use std::io::Write as _;
use std::net::{SocketAddr, TcpStream};
use std::thread;
use std::time::Duration;

use darm_serve::connections::{KEPT, MAX_CONNECTIONS};
use serde_json::{Value, json};
use tungstenite::handshake::HandshakeError;
use tungstenite::http::Request;
use tungstenite::{Message, WebSocket};

use super::board::{Bench, RealTime};
use super::webdriver::Browser;

/// No answer takes longer, on a machine with other work.
const PATIENCE: Duration = Duration::from_secs(30);

/// The connection, as a page has it.
pub(crate) struct StopLine(WebSocket<TcpStream>);

impl StopLine {
    /// Opens it with these header lines; the status where it is refused.
    pub(crate) fn open(address: SocketAddr, key: &str, headers: &[(&str, &str)]) -> Result<Self, u16> {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let mut request = Request::builder().uri(format!("ws://{address}/stop-line?key={key}"));
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let needed = [
            ("Host", &*address.to_string()),
            ("Connection", "Upgrade"),
            ("Upgrade", "websocket"),
            ("Sec-WebSocket-Version", "13"),
            ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
        ];
        for (name, value) in needed {
            request = request.header(name, value);
        }
        match tungstenite::client(request.body(()).unwrap(), stream) {
            Ok((line, _)) => Ok(Self(line)),
            Err(HandshakeError::Failure(tungstenite::Error::Http(answer))) => Err(answer.status().as_u16()),
            Err(error) => panic!("{error}"),
        }
    }

    /// Sends a stop; the answer.
    pub(crate) fn stop(&mut self) -> tungstenite::Result<Value> {
        self.0.send(Message::text("stop"))?;
        Ok(serde_json::from_str(self.0.read()?.to_text()?).unwrap())
    }
}

#[test]
fn a_page_with_control_keeps_its_connection_for_stops_whoever_takes_all_others() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let page = bench.page_in_control();
    let mut line = StopLine::open(bench.address(), page.key(), &[]).ok().unwrap();
    // Another connection of this page would have lost its place meanwhile.
    thread::sleep(KEPT + Duration::from_millis(100));
    let others: Vec<_> = (0..2 * MAX_CONNECTIONS).map(|_| TcpStream::connect(bench.address()).unwrap()).collect();
    for _ in 0..3 {
        let stopped = line.stop().unwrap();
        assert_eq!(stopped["confirmed"], true, "{stopped}");
    }
    drop(others);
}

#[test]
fn only_the_page_with_control_opens_it_and_the_latest_one_is_answered() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let address = bench.address();
    assert_eq!(StopLine::open(address, "7", &[]).err(), Some(409), "no page has control");
    let page = bench.page_in_control();
    for key in ["7", "", "%00"] {
        assert_eq!(StopLine::open(address, key, &[]).err(), Some(409), "{key}");
    }
    let foreign = [("Origin", "http://evil.example")];
    assert_eq!(StopLine::open(address, page.key(), &foreign).err(), Some(403));
    let path = format!("/stop-line?key={}", page.key());
    let plain = super::http::request(address, "GET", &path, &[], b"");
    assert_eq!(plain.status, 400, "no WebSocket");
    let mut first = StopLine::open(address, page.key(), &[]).ok().unwrap();
    assert_eq!(first.stop().unwrap()["confirmed"], true);
    page.control("leave");
    let next = page.resumed();
    let mut second = StopLine::open(address, next.key(), &[]).ok().unwrap();
    assert_eq!(second.stop().unwrap()["confirmed"], true);
    assert!(first.stop().is_err(), "it is closed");
    // A stop needs no control.
    next.control("release");
    assert_eq!(second.stop().unwrap()["confirmed"], true);
    bench.plug(false);
    bench.live(|live| live["link"]["state"] == "lost");
    let refused = second.stop().unwrap();
    assert_eq!(refused["refused"]["kind"], "link", "{refused}");
}

#[test]
fn a_person_stops_by_it_where_no_request_gets_through() {
    let Some(browser) = Browser::start(1280) else { return };
    let bench = Bench::start("planar4.toml");
    let _time = RealTime::start(&bench.board);
    bench.phase("idle");
    let page = bench.page_in_control();
    page.upload(&bench.table(&["000010000000"], 20.0));
    page.control("release");
    browser.open(&format!("http://{}/", bench.address()));
    browser.wait("document.querySelectorAll('#outputs tr').length === 12");
    browser.click("#take");
    browser.wait("document.body.hasAttribute('data-stop-line')");
    browser.click("#outputs tr:nth-child(5) button:last-of-type");
    bench.phase("manual");
    browser.value("window.fetch = () => Promise.reject(new Error('no request'))");
    browser.press(" ");
    browser.wait("document.querySelector('#stopped').dataset.outcome === 'confirmed'");
    assert_eq!(bench.pins().0, 0);
}

/// As after a stop by a request: whoever stops, and whatever becomes of the port since.
#[test]
fn an_order_from_before_a_stop_or_a_lost_port_is_outdated() {
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let page = bench.page_in_control();
    let digest = page.upload(&bench.table(&["000010000000"], 0.3));
    let play = || json!({"do": "play", "table": digest, "stops": bench.get("/api/live")["stops"]});
    let mut line = StopLine::open(bench.address(), page.key(), &[]).ok().unwrap();
    let earlier = [
        play(),
        {
            line.stop().unwrap();
            play()
        },
        {
            bench.guest("`darm stop`").stop().unwrap();
            bench.plug(false);
            bench.live(|live| live["link"]["state"] == "lost");
            bench.plug(true);
            bench.phase("idle");
            line.stop().unwrap();
            play()
        },
    ];
    line.stop().unwrap();
    bench.phase("idle");
    for order in &earlier {
        let refused = page.command(order);
        assert_eq!(refused.json()["refused"]["kind"], "stopped", "{order}");
    }
    assert_eq!(bench.pins().0, 0);
    assert_eq!(page.command(&play()).status, 200);
}

/// Its page opens another one then, in place of sending stops that nobody reads.
#[test]
fn a_connection_that_the_server_has_given_up_is_closed() {
    let bench = Bench::start("planar4.toml");
    let page = bench.page_in_control();
    let mut line = StopLine::open(bench.address(), page.key(), &[]).ok().unwrap();
    line.0.send(Message::text("x".repeat(2000))).unwrap();
    match line.0.read() {
        Err(tungstenite::Error::Io(error)) => assert_ne!(error.kind(), std::io::ErrorKind::WouldBlock, "it is open"),
        other => assert!(matches!(other, Err(_) | Ok(Message::Close(_))), "{other:?}"),
    }
}

/// The thread of the connection reads on as long as bytes come.
#[test]
fn a_former_page_that_keeps_sending_does_not_keep_the_next_one_waiting() {
    const BYTES: usize = 1000;
    let bench = Bench::start("planar4.toml");
    bench.phase("idle");
    let former = bench.page_in_control();
    let mut first = StopLine::open(bench.address(), former.key(), &[]).ok().unwrap();
    assert_eq!(first.stop().unwrap()["confirmed"], true);
    former.control("release");
    let next = bench.page_in_control();
    let mut raw = first.0.get_ref().try_clone().unwrap();
    let trickle = thread::spawn(move || {
        // The header of a text of `BYTES` bytes whose mask is zeros.
        raw.write_all(&[0x81, 0xfe, (BYTES >> 8) as u8, BYTES as u8, 0, 0, 0, 0]).unwrap();
        let is_sent = |_: &usize| {
            thread::sleep(Duration::from_millis(20));
            raw.write_all(b"x").is_ok()
        };
        (0..BYTES).take_while(is_sent).count()
    });
    let mut second = StopLine::open(bench.address(), next.key(), &[]).ok().unwrap();
    assert_eq!(second.stop().unwrap()["confirmed"], true);
    assert!(trickle.join().unwrap() < BYTES, "the former connection was read to its end");
}
