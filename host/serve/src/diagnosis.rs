//! The diagnosis of files that a page sends: as `darm diagnose`, one at a time, in a thread, given up when the page leaves.
//!
//! | request                    | does                                                                              |
//! |----------------------------|-----------------------------------------------------------------------------------|
//! | `GET /api/diagnosis`       | how far the running one is, and the number of the last result                     |
//! | `GET /api/diagnosis/result`| the last result; `null` before the first                                          |
//! | `GET /api/diagnosis/models`| models that need not be sent                                                      |
//! | `POST /api/diagnosis/log`  | what the measurements of an [`Upload`] have, and how they are read                |
//! | `POST /api/diagnosis/table`| makes and opens the table of the next measurement, with its visit file            |
//! | `POST /api/diagnosis/run`  | diagnoses an [`Upload`]; the answer is the result. Without its page it is given up |

mod keep;
mod log;
mod models;
mod sources;
mod view;

use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum::extract::{DefaultBodyLimit, FromRef, State};
use axum::routing::{get, post};
use axum::{Json, Router};
use darm_arm::arm::Arm;
use darm_diagnose::correction::Keep;
use darm_diagnose::progress::{Progress, Stage};
use serde::{Deserialize, Serialize};

use crate::hub::Hub;
use crate::job_queue::{JobQueue, Running, Work};
use crate::made_table::{self, Occasion, TableView, Visited};
use crate::refusal::{Kind, Refused};
use crate::upload::{MAX_FILES, Upload};
use crate::upload_memory::{UploadBody, UploadMemory};
use log::LogView;
use models::KnownModel;
use sources::Sources;
use view::{Corrected, ResultView};

/// The diagnoses of a server.
struct Diagnoses {
    known: Mutex<Known>,
    hub: Arc<Hub>,
    runs: JobQueue,
    tables: JobQueue,
    logs: JobQueue,
    models: JobQueue,
    memory: UploadMemory,
}

impl FromRef<Arc<Diagnoses>> for UploadMemory {
    fn from_ref(diagnoses: &Arc<Diagnoses>) -> Self {
        diagnoses.memory.clone()
    }
}

#[derive(Default)]
struct Known {
    last: Option<ResultView>,
    /// What the next measurement of the last result is made from; none of a model that is no arm of words.
    next: Option<Next>,
    n_finished: u64,
}

/// What the next measurement is made from.
#[derive(Clone)]
struct Next {
    /// The corrected arm, or the one that was diagnosed.
    arm: Arm,
    /// Words that distinguish the candidates.
    words: Vec<String>,
    /// The files that were diagnosed.
    diagnosed: String,
}

/// Which table of the next measurement a page wants.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct TableRequest {
    /// Number of the result that the page shows.
    result: u64,
    of: Of,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Of {
    Words,
    Plan,
}

/// How far a diagnosis is.
#[derive(Debug, Serialize)]
struct RunningView {
    files: String,
    stage: Stage,
    tried: usize,
    for_s: f64,
}

/// What pages ask about again and again.
#[derive(Debug, Serialize)]
struct StatusView {
    running: Option<RunningView>,
    finished: u64,
}

type Shared = State<Arc<Diagnoses>>;

/// The requests about diagnoses.
pub(crate) fn router(hub: Arc<Hub>) -> Router {
    Router::new()
        .route("/api/diagnosis", get(status))
        .route("/api/diagnosis/result", get(result))
        .route("/api/diagnosis/models", get(known_models))
        .route("/api/diagnosis/table", post(make_table))
        .route("/api/diagnosis/log", post(look).layer(DefaultBodyLimit::max(MAX_FILES)))
        .route("/api/diagnosis/run", post(run).layer(DefaultBodyLimit::max(MAX_FILES)))
        .with_state(Arc::new(Diagnoses::new(hub)))
}

async fn status(State(diagnoses): Shared) -> Json<StatusView> {
    let running = diagnoses.runs.look(|running| RunningView {
        files: files_of(running).to_owned(),
        stage: running.progress.stage(),
        tried: running.progress.n_tried(),
        for_s: running.for_s(),
    });
    Json(StatusView { running, finished: diagnoses.known().n_finished })
}

async fn result(State(diagnoses): Shared) -> Json<Option<ResultView>> {
    Json(diagnoses.known().last.clone())
}

async fn known_models(State(diagnoses): Shared) -> Result<Json<Vec<KnownModel>>, Refused> {
    // In a thread: the history is a file, and a stop does not wait for one.
    let hub = Arc::clone(&diagnoses.hub);
    diagnoses.models.run(move |work| models::list(&hub, work)).await.map(Json)
}

async fn look(State(diagnoses): Shared, body: UploadBody) -> Result<Json<LogView>, Refused> {
    let view = move |work: &Work| {
        let upload = Upload::parse(&body.bytes)?;
        let sent = upload.handed();
        let data = sent.file(Path::new(&upload.data));
        log::view(&data, &upload.columns, &|| work.check()).map_err(|fault| Refused::new(Kind::Invalid, fault))
    };
    diagnoses.logs.run(view).await.map(Json)
}

/// What is diagnosed, also before the files were read.
fn files_of(running: &Running) -> &str {
    running.name.as_deref().unwrap_or("files that were just sent")
}

/// Why another diagnosis does not begin while this one runs.
fn busy(running: Option<&Running>) -> Refused {
    let text = match running {
        Some(running) if !running.progress.is_cancelled() => {
            format!("the diagnosis of {} is running, one at a time; wait for it, or close its page", files_of(running))
        }
        Some(running) => {
            format!("the diagnosis of {} is just being given up; try again in a moment", files_of(running))
        }
        None => "another diagnosis is just ending; try again in a moment".to_owned(),
    };
    Refused::new(Kind::Refused, text)
}

async fn run(State(diagnoses): Shared, body: UploadBody) -> Result<Json<ResultView>, Refused> {
    let own = Arc::clone(&diagnoses);
    let work = move |work: &Work| {
        let upload = Upload::parse(&body.bytes)?;
        let sources = Sources::of(&own.hub, &upload)?;
        work.is_called(sources.to_string());
        own.diagnose(&sources, work.progress())
    };
    diagnoses.runs.run_at_once(busy, work).await.map(Json)
}

/// Opens the table too, as a page does with a file: nothing is sent to the board.
async fn make_table(State(diagnoses): Shared, Json(request): Json<TableRequest>) -> Result<Json<TableView>, Refused> {
    let next = {
        let known = diagnoses.known();
        known.next.clone().filter(|_| known.n_finished == request.result)
    };
    let next =
        next.ok_or_else(|| Refused::new(Kind::Invalid, "another diagnosis ended meanwhile; open the page again"))?;
    let hub = Arc::clone(&diagnoses.hub);
    let made = diagnoses.tables.run(move |work| {
        let (visited, name) = match request.of {
            Of::Words => (Visited::of_words(next.words), "next"),
            Of::Plan => (Visited::Plan, "plan"),
        };
        made_table::open(&hub, &next.arm, &visited, Occasion { name, diagnosed: Some(next.diagnosed) }, work)
    });
    made.await.map(Json)
}

impl Diagnoses {
    fn new(hub: Arc<Hub>) -> Self {
        let (known, memory) = (Mutex::default(), UploadMemory::new());
        let [runs, tables, logs, models] = [(); 4].map(|()| JobQueue::new());
        Self { known, hub, runs, tables, logs, models, memory }
    }

    fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn diagnose(&self, sources: &Sources<'_>, progress: &Progress) -> Result<ResultView, Refused> {
        let found = sources.diagnose(progress)?;
        let corrected = found.corrected_text(Keep::Effects);
        let corrected = corrected.map(|(number, text)| Corrected::new(&sources.model, number, text));
        let corrected_arm = found.corrected_arm(Keep::Effects);
        let corrected_digest = corrected_arm.as_ref().map(|arm| arm.hash().to_string());
        // One diagnosis at a time: nobody else counts meanwhile.
        let number = self.known().n_finished + 1;
        let result = ResultView::new(sources, &found, corrected, number);
        self.keep(sources, &found, &result, corrected_digest);
        let words = found.diagnosis.next_measurement.as_ref().map_or_else(Vec::new, |next| next.words.clone());
        let next = corrected_arm.or_else(|| found.arm().cloned()).map(|arm| Next {
            arm,
            words,
            diagnosed: sources.to_string(),
        });
        let mut known = self.known();
        known.n_finished = number;
        known.next = next;
        known.last = Some(result.clone());
        Ok(result)
    }
}
