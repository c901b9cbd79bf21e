//! Connections: how many there are at once, and how long one may take.
//!
//! A client that sends its headers byte by byte, or nothing at all, would hold a connection for ever; many such would keep a
//! person's stop out. A new connection therefore always gets a place: where all are taken, the one that has waited longest for
//! a request is closed, and where all have one, that with the oldest request.

use std::future::Future;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::Router;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::Service;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::oneshot;
use tokio::task::AbortHandle;

/// Most connections at once: a browser opens six.
pub const MAX_CONNECTIONS: usize = 128;
/// A connection is closed when the headers of its next request, or the next part of a body, take longer.
pub const PATIENCE: Duration = Duration::from_secs(10);
/// What still runs when the server ends is given this time.
pub(crate) const ENDING: Duration = Duration::from_secs(2);
/// Largest head of a request, and most of a connection that is read ahead, in bytes.
const BUFFER: usize = 1 << 16;
/// The operating system has no file descriptor left: another connection may end in this time.
const RETRY: Duration = Duration::from_millis(100);

/// Answers requests until `ended` is sent or its sender is gone.
pub(crate) async fn serve(
    listener: std::net::TcpListener,
    router: Router,
    mut ended: oneshot::Receiver<()>,
) -> io::Result<()> {
    let listener = TcpListener::from_std(listener)?;
    let mut open =
        Open { router: TowerToHyperService::new(router), connections: Vec::new(), end: GracefulShutdown::new() };
    loop {
        tokio::select! {
            _ = &mut ended => break,
            accepted = listener.accept() => match accepted {
                Ok((stream, _)) => open.add(stream),
                Err(_) => tokio::time::sleep(RETRY).await,
            },
        }
    }
    drop(listener);
    // A client that has sent half a request does not hold up the end.
    let _ = tokio::time::timeout(ENDING, open.end.shutdown()).await;
    Ok(())
}

/// The open connections.
struct Open {
    router: TowerToHyperService<Router>,
    connections: Vec<Connection>,
    end: GracefulShutdown,
}

struct Connection {
    task: AbortHandle,
    activity: Activity,
}

/// Whether a connection has a request that is not answered, and since when it has one or none.
#[derive(Clone)]
struct Activity(Arc<Mutex<(bool, Instant)>>);

impl Open {
    fn add(&mut self, stream: TcpStream) {
        self.connections.retain(|connection| !connection.task.is_finished());
        if self.connections.len() >= MAX_CONNECTIONS {
            self.close_one();
        }
        // Where it fails answers come a little later.
        let _ = stream.set_nodelay(true);
        let activity = Activity(Arc::new(Mutex::new((false, Instant::now()))));
        let service = Noted { inner: self.router.clone(), activity: activity.clone() };
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(PATIENCE)
            .max_buf_size(BUFFER)
            .serve_connection(TokioIo::new(stream), service);
        let connection = self.end.watch(connection);
        // Whatever ends a connection, its client hears of it.
        let task = tokio::spawn(async { drop(connection.await) }).abort_handle();
        self.connections.push(Connection { task, activity });
    }

    /// Closes the connection that is missed least.
    fn close_one(&mut self) {
        let ages = self.connections.iter().enumerate().map(|(index, connection)| (*connection.activity.get(), index));
        if let Some((_, index)) = ages.min() {
            self.connections.swap_remove(index).task.abort();
        }
    }
}

impl Activity {
    fn get(&self) -> MutexGuard<'_, (bool, Instant)> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn set(&self, has_request: bool) {
        *self.get() = (has_request, Instant::now());
    }
}

/// The router of one connection, which notes when a request begins and ends.
struct Noted {
    inner: TowerToHyperService<Router>,
    activity: Activity,
}

impl Service<hyper::Request<Incoming>> for Noted {
    type Response = axum::response::Response;
    type Error = std::convert::Infallible;
    type Future = std::pin::Pin<Box<dyn Future<Output = Result<Self::Response, Self::Error>> + Send>>;

    fn call(&self, request: hyper::Request<Incoming>) -> Self::Future {
        let (answer, activity) = (self.inner.call(request), self.activity.clone());
        activity.set(true);
        Box::pin(async move {
            let answer = answer.await;
            activity.set(false);
            answer
        })
    }
}
