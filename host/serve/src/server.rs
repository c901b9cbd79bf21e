//! The server: started with a port and an arm, ended when it is dropped.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};
use std::thread::{self, JoinHandle};

use axum::Router;
use axum::extract::{DefaultBodyLimit, Request, State};
use axum::http::header::{self, HeaderName, HeaderValue};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use tokio::net::TcpSocket;
use tokio::runtime::Builder;
use tokio::sync::oneshot;
use tower_http::timeout::RequestBodyTimeoutLayer;

use crate::acceptor::{self, Accepted, STOP};
use crate::access::{Access, AccessError, Token};
use crate::answers::{self, AnswerMemory};
use crate::assets::ASSETS;
use crate::board_port::BoardPort;
use crate::connections::{self, READ_TIMEOUT};
use crate::history::{self, History, HistoryError, ModelEntry};
use crate::hub::{Hub, HubParts};
use crate::measured::PoseSource;
use crate::pose_reader;
use crate::recording::{RecordSetup, Recordings};
use crate::refusal::Refused;
pub use crate::served_arm::ServedArm;
use crate::stop_line::Upgraded;
use crate::watcher::Watcher;
use crate::{api, diagnosis, pages, reach, recording_api, replay, stop_line, unix_time};

/// Connections that wait to be accepted. Where there is no room for another one, its client tries again a second later.
const BACKLOG: u32 = 4096;
/// Largest body of a request: a table of 1024 rows has 60 kB.
const MAX_BODY: usize = 1 << 18;

/// Headers of every answer: nothing is loaded from elsewhere, and no other site may embed a page.
const HEADERS: [(HeaderName, &str); 5] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; \
         base-uri 'none'; form-action 'self'; frame-ancestors 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    // Without it a form would be sent with the origin `null`.
    (header::REFERRER_POLICY, "same-origin"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
];

/// What is served.
pub struct Config {
    /// Address to listen on; port 0 chooses a free one.
    pub listen: SocketAddr,
    /// Names of the server besides `localhost` and its numbers.
    pub names: Vec<String>,
    /// What pages must know; needed where the address is not loopback.
    pub token: Option<Token>,
    /// The board.
    pub board: BoardPort,
    /// The arm on it: without one there are no picture and no names.
    pub arm: Option<ServedArm>,
    /// Where measured poses of its tool come from, if there is a camera.
    pub poses: Option<PoseSource>,
    /// Where what is seen is kept, if it is.
    pub history: Option<History>,
    /// Where pages record, if they may.
    pub record: Option<RecordSetup>,
}

/// Why the server does not start.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The address is not for everybody.
    #[error(transparent)]
    Access(#[from] AccessError),
    /// The address cannot be listened on.
    #[error("cannot listen on {address}: {source}; choose another one with --listen")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// What the operating system said.
        source: io::Error,
    },
    /// A thread cannot start.
    #[error("cannot start the server: {0}")]
    Start(#[from] io::Error),
    /// The history cannot be written.
    #[error("{0}; choose another file with --history, or --history none")]
    History(#[from] HistoryError),
}

/// A running server. It ends when it is dropped; the board does what it did, and a program on it continues.
pub struct Server {
    address: SocketAddr,
    hub: Arc<Hub>,
    accepted: Arc<Accepted>,
    end: Option<oneshot::Sender<()>>,
    threads: Vec<JoinHandle<()>>,
}

impl Server {
    /// Starts a server. The board need not be there yet: the port is opened again and again.
    ///
    /// # Errors
    ///
    /// The address is not loopback and there is no token, it cannot be listened on, or the history cannot be written.
    pub fn start(config: Config) -> Result<Self, ServeError> {
        let Config { listen, names, token, board, arm, poses, history, record } = config;
        let access = Access::new(listen, names, token)?;
        let runtime = Builder::new_current_thread().enable_io().enable_time().build()?;
        let listener = runtime.block_on(async { bound(listen) });
        let listener = listener.map_err(|source| ServeError::Listen { address: listen, source })?;
        let address = listener.local_addr()?;
        let accepted = Arc::new(Accepted::default());
        let (orders, ordered) = channel();
        let BoardPort { open, stop } = board;
        let history = history.map(Arc::new);
        if let (Some(history), Some(arm)) = (&history, &arm) {
            add_arm(history, arm)?;
        }
        let hub = Arc::new(Hub::new(HubParts {
            stopper: stop,
            arm,
            history,
            recordings: Arc::new(Recordings::new(record)),
            orders,
        }));
        let watcher = Watcher::new(Arc::clone(&hub), open, ordered);
        let (end, ended) = oneshot::channel();
        let (line, upgraded) = channel();
        let router = router(Arc::clone(&hub), access, line);
        let (of_control, stops, line) = (Arc::clone(&hub), Arc::clone(&hub), Arc::clone(&hub));
        let has_control = Arc::new(move |headers: &_| api::has_control(&of_control, headers));
        let to_answer = Arc::clone(&accepted);
        let http = move || {
            runtime.block_on(connections::serve(&to_answer, router, has_control, ended));
            runtime.shutdown_timeout(connections::ENDING);
        };
        let to_accept = Arc::clone(&accepted);
        let accept = move || acceptor::accept(&listener, &to_accept);
        let mut threads = vec![
            thread::Builder::new().name("watcher".into()).spawn(move || watcher.run())?,
            thread::Builder::new().name("accept".into()).spawn(accept)?,
            thread::Builder::new().name("http".into()).spawn(http)?,
            thread::Builder::new()
                .name("stop".into())
                .spawn(move || stops.stops().answer_requests(|| stops.has_ended()))?,
            thread::Builder::new().name("stop-line".into()).spawn(move || stop_line::answer(&line, &upgraded))?,
        ];
        if let Some(source) = poses {
            threads.push(follow_poses(&hub, source)?);
        }
        Ok(Self { address, hub, accepted, end: Some(end), threads })
    }

    /// The address that it listens on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Whether all threads still run.
    pub fn is_running(&self) -> bool {
        self.threads.iter().all(|thread| !thread.is_finished())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.hub.end();
        self.accepted.end(self.address);
        // The thread may have ended already.
        let _ = self.end.take().map(|end| end.send(()));
        for thread in self.threads.drain(..) {
            // A panic of the thread was printed already.
            let _ = thread.join();
        }
    }
}

/// A listener with room for many that connect at once.
fn bound(listen: SocketAddr) -> io::Result<TcpListener> {
    let socket = if listen.is_ipv4() { TcpSocket::new_v4() } else { TcpSocket::new_v6() }?;
    // A server that is started again shortly after its end would not get its port.
    #[cfg(unix)]
    socket.set_reuseaddr(true)?;
    socket.bind(listen)?;
    let listener = socket.listen(BACKLOG)?.into_std()?;
    listener.set_nonblocking(false)?;
    Ok(listener)
}

/// Starts the thread that reads measured poses.
fn follow_poses(hub: &Arc<Hub>, source: PoseSource) -> io::Result<JoinHandle<()>> {
    hub.with_measured(|measured| measured.set_source(&source.name));
    let hub = Arc::clone(hub);
    thread::Builder::new().name("poses".into()).spawn(move || pose_reader::follow(&hub, source))
}

/// Keeps the arm of the server in the history.
fn add_arm(history: &History, served: &ServedArm) -> Result<(), HistoryError> {
    let (arm, name) = (&served.wired.arm, served.file_name());
    let (digest, file, number) = (arm.hash().to_string(), arm.to_toml(), arm.model.number);
    let model = ModelEntry { digest: &digest, name, number: Some(number), parent: None, file: &file };
    history.add_model(&model, unix_time::now_ms())
}

fn router(hub: Arc<Hub>, access: Access, line: Sender<Upgraded>) -> Router {
    let history = hub.history().cloned();
    let pages = pages::ALL
        .into_iter()
        .fold(Router::new(), |router, page| router.route(page.path, get(move || async move { page.html() })));
    let assets =
        ASSETS.into_iter().fold(pages, |router, asset| router.route(asset.path, get(move || async move { asset })));
    let requests = Router::new()
        .route("/api/live", get(api::live))
        .route("/api/arm", get(api::arm))
        .route("/api/picture", get(api::picture))
        .route("/api/program", get(api::program))
        .route("/api/program/table", get(api::table_file))
        .route("/api/program/visits", get(api::visit_file))
        .route(STOP, post(api::stop))
        .route("/api/control", post(api::control))
        .route("/api/here", post(api::here))
        .route("/api/samples", get(api::samples))
        .route("/api/console", get(api::console).post(api::type_line))
        .route("/api/open", post(api::open))
        .route("/api/open-visits", post(api::open_visits))
        .route("/api/upload", post(api::upload))
        .route("/api/command", post(api::command))
        .with_state(Arc::clone(&hub))
        .merge(diagnosis::router(Arc::clone(&hub)))
        .merge(history::router(history))
        .merge(reach::router(Arc::clone(&hub)))
        .merge(recording_api::router(Arc::clone(&hub)))
        .merge(replay::router(Arc::clone(&hub)))
        .merge(stop_line::router(hub, line))
        .layer(middleware::from_fn_with_state(AnswerMemory::new(), answers::count));
    // Pages and assets are in the program: they take no memory.
    assets
        .merge(requests)
        .layer(DefaultBodyLimit::max(MAX_BODY))
        .layer(RequestBodyTimeoutLayer::new(READ_TIMEOUT))
        .layer(middleware::from_fn_with_state(Arc::new(access), guard))
}

/// Refuses requests from elsewhere, before anything reads them.
async fn guard(State(access): State<Arc<Access>>, request: Request, next: Next) -> Response {
    let mut response = match access.check(request.method(), request.uri().path(), request.headers()) {
        Ok(()) => next.run(request).await,
        Err(denied) => Refused::from(denied).into_response(),
    };
    let headers = response.headers_mut();
    for (name, value) in HEADERS {
        headers.insert(name, HeaderValue::from_static(value));
    }
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
    response
}
