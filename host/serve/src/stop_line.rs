//! A connection for stops alone, which the page with control keeps open: a WebSocket, as a browser opens it apart from its
//! connections for requests.
//!
//! ```text
//!  page ── GET /stop-line?key=… ──► the server's thread: is it the page with control?
//!    │                                     │ the connection leaves the server, which can close it no longer
//!    └── any message, again and again ──► the thread of this connection ──► the board
//! ```
//!
//! There is one: the latest takes the place of the one before. Each message is a stop, and its answer that of `POST /api/stop`. A
//! browser sends no header of the page's own with it, so the key of the page with control is in the address; nobody has one
//! who could not show the token. The thread reads this connection, sends stops, and does nothing else: no flood of
//! connections and no work of the server keeps it waiting.

use std::net::{Shutdown, TcpStream};
use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Body;
use axum::extract::{Query, Request, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use hyper_util::rt::TokioIo;
use serde::Deserialize;
use tungstenite::handshake::server::create_response_with_body;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Message, WebSocket};

use crate::api;
use crate::control::ControlError;
use crate::hub::Hub;
use crate::refusal::Refused;

/// The path; not below `/api/`, where the token would have to be in a header.
const PATH: &str = "/stop-line";
/// The thread looks this often whether a later connection is there, or the server ends.
const READ_SLICE: Duration = Duration::from_millis(50);
/// A client that takes no answer for this long is gone.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(1);
/// Longest message, bytes: what it says does not matter.
const MAX_MESSAGE: usize = 1 << 10;

/// A connection that has left the server.
pub(crate) struct Upgraded {
    stream: TcpStream,
    /// Its bytes that were read already.
    read: Vec<u8>,
}

#[derive(Clone)]
struct Door {
    hub: Arc<Hub>,
    upgraded: Sender<Upgraded>,
    /// A handle of the connection that the thread reads, or reads next. The thread does not leave a message whose bytes still come, so a
    /// later connection is heard only once this one is shut.
    latest: Arc<Mutex<Option<TcpStream>>>,
}

#[derive(Deserialize)]
struct Shown {
    key: String,
}

/// Lets the page with control open its connection, which goes to `upgraded`.
pub(crate) fn router(hub: Arc<Hub>, upgraded: Sender<Upgraded>) -> Router {
    Router::new().route(PATH, get(upgrade)).with_state(Door { hub, upgraded, latest: Arc::default() })
}

async fn upgrade(State(door): State<Door>, Query(shown): Query<Shown>, mut request: Request) -> Response {
    let key = u64::from_str_radix(&shown.key, 16).ok().filter(|key| door.hub.controls(*key));
    let Some(key) = key else {
        return Refused::from(ControlError::Missing).into_response();
    };
    let Ok(answer) = create_response_with_body(&request, Body::empty) else {
        return StatusCode::BAD_REQUEST.into_response();
    };
    let upgrading = hyper::upgrade::on(&mut request);
    tokio::spawn(async move {
        // Where the client has left meanwhile there is no connection to hand over.
        let Ok(connection) = upgrading.await else { return };
        let Ok(parts) = connection.downcast::<TokioIo<tokio::net::TcpStream>>() else { return };
        let Ok(stream) = parts.io.into_inner().into_std() else { return };
        let Ok(latest) = stream.try_clone() else { return };
        // A client that reads its answer late has handed control over meanwhile: it shuts no line of the next page.
        if !door.hub.controls(key) {
            return;
        }
        // Locked until it is sent, so that the one that is shut is never the last that the thread gets.
        let mut current = door.latest.lock().unwrap_or_else(PoisonError::into_inner);
        // Of one that has ended nothing is left to be shut.
        current.replace(latest).map(|former| former.shutdown(Shutdown::Both));
        // The thread ends with the server.
        let _ = door.upgraded.send(Upgraded { stream, read: parts.read_buf.into() });
    });
    answer
}

/// Answers the stops of the latest connection until the server ends.
pub(crate) fn answer(hub: &Hub, upgraded: &Receiver<Upgraded>) {
    let mut line = None;
    while !hub.has_ended() {
        if let Some(newer) = upgraded.try_iter().last() {
            line = newer.accept();
        }
        match &mut line {
            Some(open) => {
                if !answer_one(hub, open) {
                    // The door has a handle of it too, which keeps it open: its page would send stops that nobody reads.
                    let _ = open.get_ref().shutdown(Shutdown::Both);
                    line = None;
                }
            }
            None => line = upgraded.recv_timeout(READ_SLICE).ok().and_then(Upgraded::accept),
        }
    }
}

impl Upgraded {
    fn accept(self) -> Option<WebSocket<TcpStream>> {
        let Self { stream, read } = self;
        stream.set_nonblocking(false).ok()?;
        stream.set_read_timeout(Some(READ_SLICE)).ok()?;
        stream.set_write_timeout(Some(ANSWER_TIMEOUT)).ok()?;
        let config = WebSocketConfig::default().max_message_size(Some(MAX_MESSAGE)).max_frame_size(Some(MAX_MESSAGE));
        Some(WebSocket::from_partially_read(stream, read, Role::Server, Some(config)))
    }
}

/// Waits for a message for a while and answers it; whether the connection is still open.
fn answer_one(hub: &Hub, line: &mut WebSocket<TcpStream>) -> bool {
    use std::io::ErrorKind::{TimedOut, WouldBlock};
    match line.read() {
        Ok(Message::Text(_) | Message::Binary(_)) => {
            let began = Instant::now();
            let answer = api::stopped(began, hub.stops().send());
            line.send(Message::text(api::stop_json(&answer))).is_ok()
        }
        // A ping, which the library has answered, or the client's farewell: the next read is the end.
        Ok(_) => true,
        Err(tungstenite::Error::Io(error)) => matches!(error.kind(), TimedOut | WouldBlock),
        Err(_) => false,
    }
}
