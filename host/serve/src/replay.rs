//! Replay of the recordings in the folder of `--data`: all curves at once for plots, and any row exactly.
//!
//! | request                                 | does                                                                                 |
//! |-----------------------------------------|--------------------------------------------------------------------------------------|
//! | `GET /api/replay/NAME`                  | opens a recording, as far as it is written: a line of JSON, then numbers, see below      |
//! | `GET /api/replay/NAME/row?bytes=&row=`  | a row of the recording as it was with this number of bytes, with the predicted posture   |
//!
//! Behind the line are the times of the rows in s, eight bytes each, then one curve after the other, four bytes a value, all little
//! endian; what was not measured is not a number. A recording of 100 000 rows has a few MB so, a sixth of its text.
//!
//! A recording only grows, so the rows of its first bytes stay as they are: a page that has opened it keeps its row numbers. The server
//! keeps the recording that was asked about last, and reads another one again.

mod curves;
mod opened;
mod row;

use std::sync::{Arc, Mutex, PoisonError};

use axum::extract::{Path, Query, State};
use axum::http::header;
use axum::response::{IntoResponse as _, Response};
use axum::routing::get;
use axum::{Json, Router};
use serde::Deserialize;

use crate::hub::Hub;
use crate::job_queue::{JobQueue, Work};
use crate::refusal::{Kind, Refused};
use opened::Opened;
use row::RowView;

/// Events of the board that a page gets, at most.
const MAX_EVENTS: u32 = 5000;

#[derive(Clone)]
struct Replay {
    hub: Arc<Hub>,
    queue: Arc<JobQueue>,
    last: Arc<Mutex<Option<Arc<Opened>>>>,
}

/// A row of a recording as a page has opened it.
#[derive(Deserialize)]
struct RowRequest {
    /// Bytes of the file then.
    bytes: usize,
    row: usize,
}

/// The requests about replays.
pub(crate) fn router(hub: Arc<Hub>) -> Router {
    Router::new().route("/api/replay/{name}", get(open)).route("/api/replay/{name}/row", get(row)).with_state(Replay {
        hub,
        queue: Arc::new(JobQueue::new()),
        last: Arc::default(),
    })
}

async fn open(State(replay): State<Replay>, Path(name): Path<String>) -> Result<Response, Refused> {
    let queue = Arc::clone(&replay.queue);
    let body = queue.run(move |work| {
        let bytes = replay.hub.recordings().read(&name)?;
        let opened = replay.read(&name, bytes, work)?;
        opened.body(&replay.events(&opened)?).map_err(|error| Refused::new(Kind::Refused, error))
    });
    Ok(([(header::CONTENT_TYPE, "application/octet-stream")], body.await?).into_response())
}

async fn row(
    State(replay): State<Replay>,
    Path(name): Path<String>,
    Query(RowRequest { bytes, row }): Query<RowRequest>,
) -> Result<Json<RowView>, Refused> {
    let queue = Arc::clone(&replay.queue);
    let view = queue.run(move |work| {
        let opened = match replay.kept(&name, bytes) {
            Some(opened) => opened,
            None => {
                let mut read = replay.hub.recordings().read(&name)?;
                if read.len() < bytes {
                    return Err(Refused::new(Kind::Invalid, format!("{name} is another file now; open it again")));
                }
                read.truncate(bytes);
                replay.read(&name, read, work)?
            }
        };
        RowView::of(&opened, row, replay.hub.wired()).ok_or_else(|| {
            Refused::new(Kind::Invalid, format!("{name} has rows 0 to {}, not {row}", opened.run.samples.len() - 1))
        })
    });
    view.await.map(Json)
}

impl Replay {
    /// The recording that was asked about last, if it is this one.
    fn kept(&self, name: &str, n_bytes: usize) -> Option<Arc<Opened>> {
        let last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        last.clone().filter(|opened| opened.name == name && opened.n_bytes == n_bytes)
    }

    /// Reads a recording and keeps it in place of another one.
    fn read(&self, name: &str, bytes: Vec<u8>, work: &Work) -> Result<Arc<Opened>, Refused> {
        let keep = |opened: Option<Arc<Opened>>| *self.last.lock().unwrap_or_else(PoisonError::into_inner) = opened;
        // Two at once would take the memory twice.
        keep(None);
        let arm = self.hub.wired().map(|wired| &wired.arm);
        let opened = Arc::new(Opened::read(name, bytes, arm, work)?);
        keep(Some(Arc::clone(&opened)));
        Ok(opened)
    }

    /// What the history has of the board at the time of a recording.
    fn events(&self, opened: &Opened) -> Result<Vec<serde_json::Value>, Refused> {
        let known = self.hub.history().zip(opened.played());
        let events = known.map_or(Ok(Vec::new()), |(history, played)| history.events_of(&played, MAX_EVENTS));
        events.map_err(|error| Refused::new(Kind::Refused, error))
    }
}
