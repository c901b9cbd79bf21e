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
pub const READ_TIMEOUT: Duration = Duration::from_secs(10);
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
    let mut table = Connections {
        router: TowerToHyperService::new(router),
        has_control,
        all: Vec::new(),
        has_ended: watch::Sender::new(false),
    };
    loop {
        tokio::select! {
            _ = &mut ended => break,
            stream = accepted.next() => {
                // One that this thread cannot watch is closed.
                let _ = TcpStream::from_std(stream).map(|stream| table.add(stream));
                // In a flood the connection is read once before the next ones take its place.
                tokio::task::yield_now().await;
            }
        }
    }
    table.has_ended.send_replace(true);
    let all = async {
        for connection in table.all {
            let _ = connection.task.await;
        }
    };
    // A client that has sent half a request does not hold up the end.
    let _ = tokio::time::timeout(ENDING, all).await;
}

/// The table of connections, in no order.
struct Connections {
    router: TowerToHyperService<Router>,
    has_control: HasControl,
    all: Vec<Connection>,
    has_ended: watch::Sender<bool>,
}

struct Connection {
    task: JoinHandle<()>,
    activity: SharedActivity,
}

/// What a connection does, as its task notes it and the table reads it.
#[derive(Clone)]
struct SharedActivity(Arc<Mutex<Activity>>);

/// What a connection does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Activity {
    /// It has a request that is not answered.
    has_request: bool,
    /// That is a stop.
    is_stop: bool,
    /// Since when it has a request, or none.
    since: Instant,
    /// When it carried a request of the page with control last.
    of_control: Option<Instant>,
}

impl Connections {
    fn add(&mut self, stream: TcpStream) {
        self.all.retain(|connection| !connection.task.is_finished());
        if self.all.len() >= MAX_CONNECTIONS {
            self.close_one();
        }
        // Where it fails answers come a little later.
        let _ = stream.set_nodelay(true);
        let activity = SharedActivity::new(Instant::now());
        let service = Registered {
            inner: self.router.clone(),
            activity: activity.clone(),
            has_control: Arc::clone(&self.has_control),
        };
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(READ_TIMEOUT)
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
        self.all.push(Connection { task, activity });
    }

    /// Closes the connection that is missed least.
    fn close_one(&mut self) {
        let all: Vec<Activity> = self.all.iter().map(|connection| *connection.activity.get()).collect();
        if let Some(index) = first_to_close(&all, Instant::now()) {
            self.all.swap_remove(index).task.abort();
        }
    }
}

/// The connection that is missed least; `None` where all are those of the page with control, which are fewer than there are places.
fn first_to_close(all: &[Activity], now: Instant) -> Option<usize> {
    closable(all, now).min_by_key(|(_, activity)| activity.importance()).map(|(index, _)| index)
}

/// The connections that may be closed for another one, with their indices: all but the latest few of the page with control.
fn closable(all: &[Activity], now: Instant) -> impl Iterator<Item = (usize, &Activity)> {
    let mut recent: Vec<Instant> = all.iter().filter_map(|activity| activity.recent_control(now)).collect();
    recent.sort_unstable_by(|a, b| b.cmp(a));
    let kept_from = recent.get(MAX_KEPT - 1).or(recent.last()).copied();
    let is_kept =
        move |activity: &Activity| activity.recent_control(now).zip(kept_from).is_some_and(|(at, from)| at >= from);
    all.iter().enumerate().filter(move |(_, activity)| !is_kept(activity))
}

impl Activity {
    /// When it carried a request of the page with control last, where that is not longer ago than it is kept for.
    fn recent_control(&self, now: Instant) -> Option<Instant> {
        self.of_control.filter(|at| now.saturating_duration_since(*at) < KEPT)
    }

    /// The least is closed first: one without a request before one with, a stop last, and of each the one that is in it longest.
    fn importance(&self) -> (bool, bool, Instant) {
        (self.is_stop, self.has_request, self.since)
    }
}

impl SharedActivity {
    fn new(now: Instant) -> Self {
        Self(Arc::new(Mutex::new(Activity { has_request: false, is_stop: false, since: now, of_control: None })))
    }

    fn get(&self) -> MutexGuard<'_, Activity> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A request begins.
    fn begin(&self, is_stop: bool, of_control: bool) {
        let (mut activity, now) = (self.get(), Instant::now());
        (activity.has_request, activity.is_stop, activity.since) = (true, is_stop, now);
        activity.of_control = of_control.then_some(now).or(activity.of_control);
    }

    /// It is answered.
    fn end(&self) {
        let mut activity = self.get();
        (activity.has_request, activity.is_stop, activity.since) = (false, false, Instant::now());
    }
}

/// The router of one connection, which registers when a request begins and ends.
struct Registered {
    inner: TowerToHyperService<Router>,
    activity: SharedActivity,
    has_control: HasControl,
}

impl Service<hyper::Request<Incoming>> for Registered {
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

    use super::{Activity, KEPT, MAX_KEPT, first_to_close};

    #[test]
    fn connections_of_the_page_with_control_keep_their_places_and_running_stops_leave_last() {
        let now = Instant::now();
        let ago = |ms: u64| now.checked_sub(Duration::from_millis(ms)).unwrap();
        let idle = |ms| Activity { has_request: false, is_stop: false, since: ago(ms), of_control: None };
        let page = Activity { of_control: Some(ago(900)), ..idle(9_000) };
        let stop = Activity { has_request: true, is_stop: true, ..idle(8_000) };
        let busy = Activity { has_request: true, ..idle(7_000) };
        assert_eq!(first_to_close(&[page, stop, busy, idle(10), idle(20)], now), Some(4));
        assert_eq!(first_to_close(&[page, stop, busy], now), Some(2));
        // Stops of everybody else would take all places otherwise.
        assert_eq!(first_to_close(&[page, stop, Activity { since: ago(8_001), ..stop }], now), Some(2));
        assert_eq!(first_to_close(&[page], now), None);
        let left = Activity { of_control: Some(now.checked_sub(KEPT).unwrap()), ..page };
        assert_eq!(first_to_close(&[left, stop, idle(10)], now), Some(0));
        // A page that opens more of them than a browser does keeps the latest.
        let many: Vec<Activity> =
            (0..20).map(|k| Activity { of_control: Some(ago(100 + k)), ..idle(5_000 + k) }).collect();
        assert_eq!(first_to_close(&many, now), Some(19));
        assert_eq!(first_to_close(&many[..MAX_KEPT], now), None);
    }
}
