//! What pages ask of the history. They change nothing but names of entries.

use std::sync::Arc;

use axum::extract::{Query, State};
use axum::http::header;
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::comparison::{Line, lines};
use super::{History, HistoryError, Kind};
use crate::job_queue::{JobQueue, Work};
use crate::refusal::{self, Refused};

/// Entries of each kind that a page shows; an export has all.
const SHOWN: u32 = 200;

/// Longest name of an entry.
const MAX_LABEL: usize = 60;

/// The history, and who reads it.
struct Reads {
    history: Option<Arc<History>>,
    queue: JobQueue,
}

type Shared = State<Arc<Reads>>;

/// The requests about the history.
pub(crate) fn router(history: Option<Arc<History>>) -> Router {
    Router::new()
        .route("/api/history", get(newest))
        .route("/api/history/events", get(events))
        .route("/api/history/diagnosis", get(diagnosis))
        .route("/api/history/result", get(result))
        .route("/api/history/numbers", get(numbers))
        .route("/api/history/name", post(name))
        .route("/api/history/model", get(model))
        .route("/api/history/table", get(table))
        .route("/api/history/export", get(export))
        .with_state(Arc::new(Reads { history, queue: JobQueue::new() }))
}

#[derive(Deserialize)]
struct Id {
    id: i64,
}

#[derive(Deserialize)]
struct Digest {
    digest: String,
}

#[derive(Deserialize)]
struct Of {
    of: Option<Kind>,
}

/// A diagnosis or a model.
#[derive(Deserialize)]
struct EntryOf {
    of: Kind,
    /// Its `id`, of a model its `digest`.
    entry: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NameRequest {
    of: Kind,
    /// Its `id`, of a model or table its `digest`.
    entry: String,
    /// Empty takes it away.
    name: String,
}

#[derive(Serialize)]
struct Newest {
    file: String,
    problem: Option<String>,
    runs: Vec<Value>,
    diagnoses: Vec<Value>,
    models: Vec<Value>,
    tables: Vec<Value>,
    uploads: Vec<Value>,
}

impl Newest {
    fn of(history: &History) -> Result<Self, HistoryError> {
        let of = |kind| history.entries(kind, Some(SHOWN));
        Ok(Self {
            file: history.path().display().to_string(),
            problem: history.problem(),
            runs: of(Kind::Runs)?,
            diagnoses: of(Kind::Diagnoses)?,
            models: of(Kind::Models)?,
            tables: of(Kind::Tables)?,
            uploads: of(Kind::Uploads)?,
        })
    }
}

async fn newest(State(reads): Shared) -> Result<Json<Option<Newest>>, Refused> {
    if reads.history.is_none() {
        return Ok(Json(None));
    }
    reads.ask(Newest::of).await.map(Some).map(Json)
}

async fn events(State(reads): Shared, Query(Id { id }): Query<Id>) -> Result<Json<Vec<Value>>, Refused> {
    reads.ask(move |history| history.events(id)).await.map(Json)
}

async fn diagnosis(State(reads): Shared, Query(Id { id }): Query<Id>) -> Result<Response, Refused> {
    let report = reads.ask(move |history| history.report(id)).await?.ok_or_else(missing)?;
    Ok(([(header::CONTENT_TYPE, "application/json")], report).into_response())
}

async fn result(State(reads): Shared, Query(Id { id }): Query<Id>) -> Result<Response, Refused> {
    let result = reads.ask(move |history| history.result(id)).await?;
    let result = result.ok_or_else(|| {
        Refused::new(
            refusal::Kind::Invalid,
            "the history has only the numbers of this diagnosis; diagnose its files again",
        )
    })?;
    Ok(([(header::CONTENT_TYPE, "application/json")], result).into_response())
}

async fn numbers(
    State(reads): Shared,
    Query(EntryOf { of, entry }): Query<EntryOf>,
) -> Result<Json<Vec<Line>>, Refused> {
    reads.ask(move |history| lines(history, of, &entry)).await?.ok_or_else(missing).map(Json)
}

async fn name(
    State(reads): Shared,
    Json(NameRequest { of, entry, name }): Json<NameRequest>,
) -> Result<Json<()>, Refused> {
    let name: String = name.trim().chars().filter(|c| !c.is_control()).take(MAX_LABEL).collect();
    let is_known =
        reads.ask(move |history| history.set_label(of, &entry, Some(&*name).filter(|name| !name.is_empty())));
    if is_known.await? { Ok(Json(())) } else { Err(missing()) }
}

async fn model(State(reads): Shared, Query(Digest { digest }): Query<Digest>) -> Result<Json<String>, Refused> {
    reads.ask(move |history| history.model_file(&digest)).await?.ok_or_else(missing).map(Json)
}

async fn table(State(reads): Shared, Query(Digest { digest }): Query<Digest>) -> Result<Response, Refused> {
    let file = reads.ask(move |history| history.table_file(&digest)).await?.ok_or_else(missing)?;
    Ok(([(header::CONTENT_TYPE, "application/octet-stream")], file).into_response())
}

async fn export(State(reads): Shared, Query(Of { of }): Query<Of>) -> Result<Response, Refused> {
    match of {
        None => {
            let all = reads.ask(History::export).await?;
            let program = json!({"program": "darm", "version": env!("CARGO_PKG_VERSION")});
            Ok(Json(json!({"history": program, "entries": all})).into_response())
        }
        Some(kind) => {
            let text = reads.ask(move |history| history.csv(kind)).await?;
            Ok(([(header::CONTENT_TYPE, "text/csv; charset=utf-8")], text).into_response())
        }
    }
}

impl Reads {
    /// Asks in a thread, one request at a time: a disk may be slow, and a page that comes and goes leaves no reads behind.
    async fn ask<T: Send + 'static>(
        &self,
        read: impl FnOnce(&History) -> Result<T, HistoryError> + Send + 'static,
    ) -> Result<T, Refused> {
        let refused = |error: &dyn std::fmt::Display| Refused::new(refusal::Kind::Refused, error);
        let history = self.history.clone();
        let history = history.ok_or_else(|| refused(&"this server keeps no history; start it with --history FILE"))?;
        let read = move |work: &Work| {
            work.check()?;
            read(&history).map_err(|error| Refused::new(refusal::Kind::Refused, error))
        };
        self.queue.run(read).await
    }
}

fn missing() -> Refused {
    Refused::new(refusal::Kind::Invalid, "the history has no such entry")
}
