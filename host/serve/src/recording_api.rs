//! Tables that a page makes, and recordings that it starts.
//!
//! | request              | needs control | does                                                                           |
//! |----------------------|---------------|--------------------------------------------------------------------------------|
//! | `GET /api/data`      | no            | names of the measurements in the folder of `--data`                             |
//! | `GET /api/data/NAME` | no            | one of them                                                                     |
//! | `POST /api/draft`    | no            | how a table of these visits of the server's arm would be; opens nothing         |
//! | `POST /api/plan`     | no            | makes and opens a table of the server's arm: of visits, or of a measurement plan |
//! | `POST /api/record`   | yes           | plays the opened table and measures, into a new file of that folder              |

use std::sync::Arc;

use axum::extract::{Path, State};
use axum::http::HeaderMap;
use axum::response::Response;
use axum::routing::{get, post};
use axum::{Json, Router};
use darm_arm::wired_arm::WiredArm;
use serde::Deserialize;

use crate::answers::FileBody;
use crate::api::key;
use crate::control::ControlError;
use crate::hub::Hub;
use crate::job_queue::{JobQueue, Work};
use crate::made_table::{self, DraftView, EditedVisit, Occasion, TableView, Visited};
use crate::recording::{DataFile, RecordingOrder};
use crate::refusal::{Kind, Refused};

/// Visits of one table, at most: more than a board stores.
const MAX_VISITS: usize = 4096;

#[derive(Deserialize)]
#[serde(tag = "of", rename_all = "kebab-case", deny_unknown_fields)]
enum PlanRequest {
    Plan,
    Visits(EditedTable),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EditedTable {
    visits: Vec<EditedVisit>,
    /// Whether the arm may rest between them with every coil off, where limits of outputs demand it.
    may_rest: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RecordRequest {
    /// Digest of the table that the page shows.
    table: String,
    name: String,
    /// As of `CommandRequest`.
    stops: Option<u64>,
}

#[derive(Clone)]
struct Requests {
    hub: Arc<Hub>,
    files: Arc<JobQueue>,
    plans: Arc<JobQueue>,
    drafts: Arc<JobQueue>,
}

/// The requests about recordings.
pub(crate) fn router(hub: Arc<Hub>) -> Router {
    let [files, plans, drafts] = [(); 3].map(|()| Arc::new(JobQueue::new()));
    Router::new()
        .route("/api/data", get(list))
        .route("/api/data/{name}", get(file))
        .route("/api/draft", post(draft))
        .route("/api/plan", post(plan))
        .route("/api/record", post(record))
        .with_state(Requests { hub, files, plans, drafts })
}

async fn list(State(requests): State<Requests>) -> Result<Json<Vec<DataFile>>, Refused> {
    let hub = requests.hub;
    requests.files.run(move |_| hub.recordings().list()).await.map(Json)
}

async fn file(State(requests): State<Requests>, Path(name): Path<String>) -> Result<Response, Refused> {
    let hub = requests.hub;
    let (file, bytes) = requests.files.run(move |_| hub.recordings().file(&name)).await?;
    Ok(FileBody::answer(file, bytes, "text/csv; charset=utf-8"))
}

impl EditedTable {
    fn visited(self) -> Result<Visited, Refused> {
        let is_dwell = |dwell_s: &f64| (0.0..=3600.0).contains(dwell_s);
        let Self { visits, may_rest } = self;
        let is_allowed = visits.iter().filter_map(|visit| visit.dwell_s.as_ref()).all(is_dwell);
        if visits.is_empty() || visits.len() > MAX_VISITS || !is_allowed {
            let text = format!("a table has 1 to {MAX_VISITS} visits, each for 0 to 3600 s");
            return Err(Refused::new(Kind::Invalid, text));
        }
        Ok(Visited::Edited { visits, may_rest })
    }
}

fn wired(hub: &Hub) -> Result<&WiredArm, Refused> {
    hub.wired().ok_or_else(|| Refused::new(Kind::Invalid, "the server has no arm; start it with one"))
}

async fn draft(State(requests): State<Requests>, Json(table): Json<EditedTable>) -> Result<Json<DraftView>, Refused> {
    let (visited, hub) = (table.visited()?, requests.hub);
    let made = requests.drafts.run(move |_| {
        let WiredArm { arm, profile, .. } = wired(&hub)?;
        made_table::draft(arm, profile, &visited)
    });
    made.await.map(Json)
}

async fn plan(State(requests): State<Requests>, Json(request): Json<PlanRequest>) -> Result<Json<TableView>, Refused> {
    let (visited, name) = match request {
        PlanRequest::Plan => (Visited::Plan, "plan"),
        PlanRequest::Visits(table) => (table.visited()?, "visits"),
    };
    let hub = requests.hub;
    let made = requests.plans.run(move |work: &Work| {
        let arm = wired(&hub)?.arm.clone();
        made_table::open(&hub, &arm, &visited, Occasion { name, diagnosed: None }, work)
    });
    made.await.map(Json)
}

async fn record(
    State(requests): State<Requests>,
    headers: HeaderMap,
    Json(RecordRequest { table, name, stops }): Json<RecordRequest>,
) -> Result<Json<()>, Refused> {
    let (key, hub) = (key(&headers)?, requests.hub);
    // Before the request waits for others.
    let ordered = hub.ordered(stops);
    let started = requests.files.run(move |work: &Work| {
        let grant = hub.control(|control| {
            control.check(key)?;
            control.holder().map(|holder| holder.grant.number).ok_or(ControlError::Missing)
        })?;
        let program = hub.program().filter(|program| program.view.digest.as_ref() == Some(&table));
        let other = "another table was opened meanwhile; look at it";
        let program = program.ok_or_else(|| Refused::new(Kind::Invalid, other))?;
        let no_visits = "the table has no visit file: make it on this page, or after a diagnosis";
        let visits = program.visits.as_ref().ok_or_else(|| Refused::new(Kind::Invalid, no_visits))?;
        let check = || {
            work.check()?;
            ordered.check_stops(hub.stops().count())?;
            ordered.check_age()
        };
        check()?;
        let order = RecordingOrder { grant, stops: ordered.stops, name: &name, table: &program.bytes, visits };
        hub.recordings().start(&order, check)
    });
    started.await.map(Json)
}
