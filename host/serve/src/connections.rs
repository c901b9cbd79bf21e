//! Connections: how many there are at once, and how long one may take.
//!
//! A client that sends its headers byte by byte, or nothing at all, would hold a connection for ever; many such would keep a
//! person's stop out. A new connection therefore always gets a place: where all are taken, the one that has waited longest for
//! a request is closed, and where all have one, that with the oldest request. One that does not read its answer keeps its place until then.
//!
//! A few are never closed for a place: those that carried a request of the page with control a moment ago, so that what renews its
//! control finds a connection open. One whose stop is not answered yet is closed after all others: its stop is in force already.
//! The page's connection for stops has no place here: it leaves once it is opened, see `stop_line.rs`.

use std::future::Future;
use std::pin::pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::Router;
use axum::http::HeaderMap;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::Service;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::TcpStream;
use tokio::sync::{oneshot, watch};
use tokio::task::JoinHandle;

use crate::acceptor::{Accepted, STOP};

/// Most connections at once: a browser opens six.
pub const MAX_CONNECTIONS: usize = 256;
/// Connections of the page with control that are kept, the latest: a browser opens six, and nobody takes all places.
const MAX_KEPT: usize = 8;
/// How long after a request of the page with control: it renews once a second.
pub const KEPT: Duration = Duration::from_secs(3);
/// A connection is closed when the headers of its next request, or the next part of a body, take longer.
pub const PATIENCE: Duration = Duration::from_secs(10);
/// What still runs when the server ends is given this time.
pub(crate) const ENDING: Duration = Duration::from_secs(2);
/// Largest head of a request, and most of a connection that is read ahead, in bytes.
const BUFFER: usize = 1 << 16;

/// Whether a request shows the key of the page with control.
pub(crate) type HasControl = Arc<dyn Fn(&HeaderMap) -> bool + Send + Sync>;

/// Answers requests until `ended` is sent or its sender is gone.
pub(crate) async fn serve(
    accepted: &Accepted,
    router: Router,
    has_control: HasControl,
    mut ended: oneshot::Receiver<()>,
) {
    let mut open = Open {
        router: TowerToHyperService::new(router),
        has_control,
        connections: Vec::new(),
        has_ended: watch::Sender::new(false),
    };
    loop {
        tokio::select! {
            _ = &mut ended => break,
            stream = accepted.next() => {
                // One that this thread cannot watch is closed.
                let _ = TcpStream::from_std(stream).map(|stream| open.add(stream));
                // In a flood each is read before the next ones take its place.
                tokio::task::yield_now().await;
            }
        }
    }
    open.has_ended.send_replace(true);
    let all = async {
        for connection in open.connections {
            let _ = connection.task.await;
        }
    };
    // A client that has sent half a request does not hold up the end.
    let _ = tokio::time::timeout(ENDING, all).await;
}

/// The open connections.
struct Open {
    router: TowerToHyperService<Router>,
    has_control: HasControl,
    connections: Vec<Connection>,
    has_ended: watch::Sender<bool>,
}

struct Connection {
    task: JoinHandle<()>,
    activity: Activity,
}

/// What a connection does.
#[derive(Clone)]
struct Activity(Arc<Mutex<Doing>>);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Doing {
    /// It has a request that is not answered.
    has_request: bool,
    /// That is a stop.
    is_stop: bool,
    /// Since when it has a request, or none.
    since: Instant,
    /// When it carried a request of the page with control last.
    of_control: Option<Instant>,
}

impl Open {
    fn add(&mut self, stream: TcpStream) {
        self.connections.retain(|connection| !connection.task.is_finished());
        if self.connections.len() >= MAX_CONNECTIONS {
            self.close_one();
        }
        // Where it fails answers come a little later.
        let _ = stream.set_nodelay(true);
        let activity = Activity::new(Instant::now());
        let service = Noted {
            inner: self.router.clone(),
            activity: activity.clone(),
            has_control: Arc::clone(&self.has_control),
        };
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(PATIENCE)
            .max_buf_size(BUFFER)
            .serve_connection(TokioIo::new(stream), service)
            .with_upgrades();
        let mut ended = self.has_ended.subscribe();
        // Whatever ends a connection, its client hears of it.
        let task = tokio::spawn(async move {
            let mut connection = pin!(connection);
            tokio::select! {
                _ = connection.as_mut() => return,
                _ = ended.wait_for(|has_ended| *has_ended) => {}
            }
            // The request that runs is answered.
            connection.as_mut().graceful_shutdown();
            let _ = connection.await;
        });
        self.connections.push(Connection { task, activity });
    }

    /// Closes the connection that is missed least.
    fn close_one(&mut self) {
        let all: Vec<Doing> = self.connections.iter().map(|connection| *connection.activity.get()).collect();
        if let Some(index) = first_to_close(&all, Instant::now()) {
            self.connections.swap_remove(index).task.abort();
        }
    }
}

/// The connection that is missed least; `None` where all are those of the page with control, which are fewer than there are places.
fn first_to_close(all: &[Doing], now: Instant) -> Option<usize> {
    let is_recent = |doing: &Doing| doing.of_control.filter(|at| now.saturating_duration_since(*at) < KEPT);
    let mut recent: Vec<Instant> = all.iter().filter_map(is_recent).collect();
    recent.sort_unstable_by(|a, b| b.cmp(a));
    let kept_from = recent.get(MAX_KEPT - 1).or(recent.last()).copied();
    let is_kept = |doing: &Doing| is_recent(doing).zip(kept_from).is_some_and(|(at, from)| at >= from);
    let others = all.iter().enumerate().filter(|(_, doing)| !is_kept(doing));
    others.min_by_key(|(_, doing)| (doing.is_stop, doing.has_request, doing.since)).map(|(index, _)| index)
}

impl Activity {
    fn new(now: Instant) -> Self {
        Self(Arc::new(Mutex::new(Doing { has_request: false, is_stop: false, since: now, of_control: None })))
    }

    fn get(&self) -> MutexGuard<'_, Doing> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A request begins.
    fn begin(&self, is_stop: bool, of_control: bool) {
        let (mut doing, now) = (self.get(), Instant::now());
        (doing.has_request, doing.is_stop, doing.since) = (true, is_stop, now);
        doing.of_control = of_control.then_some(now).or(doing.of_control);
    }

    /// It is answered.
    fn end(&self) {
        let mut doing = self.get();
        (doing.has_request, doing.is_stop, doing.since) = (false, false, Instant::now());
    }
}

/// The router of one connection, which notes when a request begins and ends.
struct Noted {
    inner: TowerToHyperService<Router>,
    activity: Activity,
    has_control: HasControl,
}

impl Service<hyper::Request<Incoming>> for Noted {
    type Response = axum::response::Response;
    type Error = std::convert::Infallible;
    type Future = std::pin::Pin<Box<dyn Future<Output = Result<Self::Response, Self::Error>> + Send>>;

    fn call(&self, request: hyper::Request<Incoming>) -> Self::Future {
        let activity = self.activity.clone();
        activity.begin(request.uri().path() == STOP, (self.has_control)(request.headers()));
        let answer = self.inner.call(request);
        Box::pin(async move {
            let answer = answer.await;
            activity.end();
            answer
        })
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::{Doing, KEPT, MAX_KEPT, first_to_close};

    #[test]
    fn connections_of_the_page_with_control_keep_their_places_and_running_stops_leave_last() {
        let now = Instant::now();
        let ago = |ms: u64| now.checked_sub(Duration::from_millis(ms)).unwrap();
        let idle = |ms| Doing { has_request: false, is_stop: false, since: ago(ms), of_control: None };
        let page = Doing { of_control: Some(ago(900)), ..idle(9_000) };
        let stop = Doing { has_request: true, is_stop: true, ..idle(8_000) };
        let busy = Doing { has_request: true, ..idle(7_000) };
        assert_eq!(first_to_close(&[page, stop, busy, idle(10), idle(20)], now), Some(4));
        assert_eq!(first_to_close(&[page, stop, busy], now), Some(2));
        // Stops of everybody else would take all places otherwise.
        assert_eq!(first_to_close(&[page, stop, Doing { since: ago(8_001), ..stop }], now), Some(2));
        assert_eq!(first_to_close(&[page], now), None);
        let left = Doing { of_control: Some(now.checked_sub(KEPT).unwrap()), ..page };
        assert_eq!(first_to_close(&[left, stop, idle(10)], now), Some(0));
        // A page that opens more of them than a browser does keeps the latest.
        let many: Vec<Doing> = (0..20).map(|k| Doing { of_control: Some(ago(100 + k)), ..idle(5_000 + k) }).collect();
        assert_eq!(first_to_close(&many, now), Some(19));
        assert_eq!(first_to_close(&many[..MAX_KEPT], now), None);
    }
}
