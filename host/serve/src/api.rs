//! The requests of the pages.
//!
//! | request             | needs control | does                                                                   |
//! |---------------------|---------------|------------------------------------------------------------------------|
//! | `GET /api/live`     | no            | the state, as soon as there is one after `?after=REVISION`              |
//! | `GET /api/arm`      | no            | names of actuators and servos                                           |
//! | `GET /api/picture`  | no            | the arm as lines                                                        |
//! | `GET /api/program`  | no            | the opened table                                                        |
//! | `GET /api/program/table`, `/visits` | no | the file of the opened table, and its visit file             |
//! | `POST /api/stop`    | no            | switches all outputs off, past everything else                          |
//! | `GET /stop-line`    | yes           | a WebSocket: each message is a stop, see `stop_line.rs`                |
//! | `POST /api/control` | no            | takes, renews or releases control, leaves a page with it, resumes it on the next, asks for it, hands it over or refuses to |
//! | `POST /api/here`    | no            | says that a page is there, and what it is called; pages show the list    |
//! | `GET /api/samples`  | no            | what was seen over the last hour, after `?after=NUMBER`                  |
//! | `GET /api/console`  | no            | lines of the console after `?after=NUMBER`                              |
//! | `POST /api/console` | only for a line that may change something | types a line, as at the board's console             |
//! | `POST /api/open`    | no            | opens a table file: its bytes; nothing is sent to the board             |
//! | `POST /api/open-visits` | no        | opens the visit file of the opened table                                |
//! | `POST /api/upload`  | yes           | brings the opened table to the board                                    |
//! | `POST /api/command` | yes           | plays, clears the safe state, switches an output, a word or a servo     |
//!
//! A page shows its control by the header `x-darm-control`. No `GET` changes anything but `GET /stop-line`, a WebSocket, which browsers
//! open by no other method: it shuts the line that the page with control had. Only the key of that page opens one, a page of another
//! site is refused by its `Origin`, and the line that is shut costs no stop: its page opens another a second later, and until then
//! sends stops by `POST /api/stop`.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::Json;
use axum::body::Bytes;
use axum::extract::{Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use darm_arm::table_file::digest;
use darm_core::sequencer::Command;
use darm_device::client::sharing::LineKind;
use darm_device::client::stop::Confirmation;
use darm_measure::visits::Visits;
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::attached::PageId;
use crate::console::ConsoleLine;
use crate::control::{ControlAt, ControlError, Grant, GrantNumber, LEASE};
use crate::hub::Hub;
use crate::order::Task;
use crate::program::{Origin, Program};
use crate::refusal::{Kind, Refused};
use crate::samples::SamplesView;

/// A page gets an answer after this time, also where nothing has changed: it shows the age.
const NEWS_WAIT: Duration = Duration::from_millis(250);
/// Longest name of a file that is shown.
const MAX_FILE_NAME: usize = 100;
/// Longest name of a page.
const MAX_PAGE_NAME: usize = 40;

type Shared = State<Arc<Hub>>;
type Answer<T> = Result<Json<T>, Refused>;

impl IntoResponse for Refused {
    fn into_response(self) -> Response {
        let status = match self.kind {
            Kind::Denied => StatusCode::FORBIDDEN,
            Kind::Control | Kind::Stopped | Kind::Refused => StatusCode::CONFLICT,
            Kind::Invalid => StatusCode::UNPROCESSABLE_ENTITY,
            Kind::Link | Kind::Busy => StatusCode::SERVICE_UNAVAILABLE,
        };
        (status, Json(json!({ "refused": self }))).into_response()
    }
}

#[derive(Deserialize)]
pub(crate) struct After {
    #[serde(default)]
    after: u64,
}

pub(crate) async fn live(State(hub): Shared, Query(After { after }): Query<After>) -> Response {
    hub.news(after, NEWS_WAIT).await;
    Json(hub.view()).into_response()
}

#[derive(Serialize)]
struct ArmView<'a> {
    name: &'a str,
    /// Its file, as it was given to `darm serve`.
    file: &'a str,
    /// Its digest.
    model: String,
    /// Number of the model.
    number: u32,
    is_planar: bool,
    actuators: Vec<ActuatorName>,
    servos: Vec<ServoName>,
}

#[derive(Serialize)]
struct ActuatorName {
    name: String,
    states: usize,
}

#[derive(Serialize)]
struct ServoName {
    name: String,
    min_rad: f32,
    max_rad: f32,
}

/// The arm's names; `null` where the server was started without an arm.
pub(crate) async fn arm(State(hub): Shared) -> Response {
    let view = hub.served().map(|served| {
        let arm = &served.wired.arm;
        let chain = &arm.model.chain;
        let actuator = |index| ActuatorName { name: arm.actuator_name(index), states: chain.n_states(index) };
        let servo = |(index, servo): (usize, &darm_arm::arm::Servo)| ServoName {
            name: arm.servo_name(index),
            min_rad: servo.min_rad,
            max_rad: servo.max_rad,
        };
        ArmView {
            name: &arm.name,
            file: &served.file,
            model: arm.hash().to_string(),
            number: arm.model.number,
            is_planar: chain.is_planar(),
            actuators: (0..arm.n_actuators()).map(actuator).collect(),
            servos: arm.servos.iter().enumerate().map(servo).collect(),
        }
    });
    Json(view).into_response()
}

/// The picture, `{"error": …}` where the model has no pose, `null` where there is no arm or no word yet.
pub(crate) async fn picture(State(hub): Shared) -> Response {
    match hub.picture().as_deref() {
        Some(Ok(picture)) => Json(picture).into_response(),
        Some(Err(error)) => Json(json!({ "error": error })).into_response(),
        None => Json(json!(null)).into_response(),
    }
}

pub(crate) async fn program(State(hub): Shared) -> Response {
    Json(hub.program().as_ref().map(|program| &program.view)).into_response()
}

/// The file of the opened table.
pub(crate) async fn table_file(State(hub): Shared) -> Result<Response, Refused> {
    let program = hub.program().ok_or_else(no_table)?;
    Ok(([(header::CONTENT_TYPE, "application/octet-stream")], program.bytes.clone()).into_response())
}

/// The visit file of the opened table.
pub(crate) async fn visit_file(State(hub): Shared) -> Result<Response, Refused> {
    let visits = hub.program().and_then(|program| program.visits.clone()).ok_or_else(no_table)?;
    Ok(([(header::CONTENT_TYPE, "text/csv; charset=utf-8")], visits).into_response())
}

fn no_table() -> Refused {
    Refused::new(Kind::Invalid, "no such file is open; open the page again")
}

#[derive(Serialize)]
pub(crate) struct Stopped {
    /// The board has answered: all outputs are off. Otherwise the stop was sent and no answer came.
    confirmed: bool,
    /// The board is held after crashes and does not control its servos.
    servos_uncontrolled: bool,
    took_s: f64,
}

/// Stops the board by the thread of stops, which waits for nothing that the server does.
pub(crate) async fn stop(State(hub): Shared) -> Answer<Stopped> {
    let began = Instant::now();
    stopped(began, hub.stops().request().await).map(Json)
}

/// The answer to a stop that was sent, or why it could not be.
pub(crate) fn stopped(began: Instant, outcome: Result<Confirmation, String>) -> Result<Stopped, Refused> {
    let not_sent = |error| Refused::new(Kind::Link, format!("the stop could not be sent: {error}"));
    let confirmation = outcome.map_err(not_sent)?;
    Ok(Stopped {
        confirmed: confirmation != Confirmation::Missing,
        servos_uncontrolled: confirmation == Confirmation::OutputsAlone,
        took_s: began.elapsed().as_secs_f64(),
    })
}

/// The answer to a stop as a message of the stop line, which has no status: a refusal is below `refused`.
pub(crate) fn stop_json(answer: &Result<Stopped, Refused>) -> String {
    match answer {
        Ok(stopped) => json!(stopped),
        Err(refused) => json!({ "refused": refused }),
    }
    .to_string()
}

#[derive(Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum ControlRequest {
    Take {
        /// As it has said that it is there.
        page: Option<PageId>,
    },
    Renew,
    Resume,
    Release,
    Leave,
    /// Asks the page with control for it: what is granted is valid once it hands it over.
    Ask {
        /// As of `Take`.
        page: Option<PageId>,
    },
    HandOver,
    /// Control is not handed over, or not wanted any more.
    Refuse,
}

#[derive(Serialize)]
pub(crate) struct Granted {
    /// Number of the grant.
    #[serde(rename = "page")]
    number: Option<GrantNumber>,
    key: Option<String>,
    lease_s: f64,
}

impl Granted {
    /// The answer to a request that grants nothing.
    const NOTHING: Self = Self { number: None, key: None, lease_s: LEASE.as_secs_f64() };
}

impl From<Grant> for Granted {
    fn from(Grant { number, key }: Grant) -> Self {
        Self { number: Some(number), key: Some(format!("{key:016x}")), ..Self::NOTHING }
    }
}

pub(crate) async fn control(
    State(hub): Shared,
    headers: HeaderMap,
    Json(request): Json<ControlRequest>,
) -> Answer<Granted> {
    let key = || key(&headers);
    let kept = |act: fn(&mut ControlAt<'_>, u64) -> Result<(), ControlError>| {
        let key = key()?;
        hub.control(|control| act(control, key))?;
        Ok::<_, Refused>(Granted::NOTHING)
    };
    let ended = |act: fn(&mut ControlAt<'_>, u64)| {
        let key = key()?;
        hub.control(|control| {
            act(control, key);
            Ok(())
        })?;
        Ok::<_, Refused>(Granted::NOTHING)
    };
    let granted = match request {
        ControlRequest::Take { page } => {
            let name = hub.page_name(page);
            hub.control(|control| control.take(rand::random(), &name))?.into()
        }
        ControlRequest::Ask { page } => {
            let name = hub.page_name(page);
            hub.control(|control| control.ask(rand::random(), &name))?.into()
        }
        ControlRequest::Resume => {
            let key = key()?;
            hub.control(|control| control.resume(key, rand::random()))?.into()
        }
        ControlRequest::Renew => kept(|control, key| control.renew(key))?,
        ControlRequest::HandOver => kept(|control, key| control.hand_over(key))?,
        ControlRequest::Refuse => ended(|control, key| control.refuse(key))?,
        ControlRequest::Leave => ended(|control, key| control.leave(key))?,
        ControlRequest::Release => ended(|control, key| control.release(key))?,
    };
    Ok(Json(granted))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Here {
    page: PageId,
    /// What it is called.
    name: String,
}

pub(crate) async fn here(State(hub): Shared, Json(Here { page, name }): Json<Here>) -> Answer<()> {
    let name: String = name.trim().chars().filter(|c| !c.is_control()).take(MAX_PAGE_NAME).collect();
    hub.see_page(page, &name);
    Ok(Json(()))
}

/// Whether a request is one of the page with control.
pub(crate) fn has_control(hub: &Hub, headers: &HeaderMap) -> bool {
    key(headers).is_ok_and(|key| hub.controls(key))
}

/// The key that the page shows.
pub(crate) fn key(headers: &HeaderMap) -> Result<u64, Refused> {
    let shown = headers.get("x-darm-control").and_then(|value| value.to_str().ok());
    let key = shown.and_then(|text| u64::from_str_radix(text, 16).ok());
    key.ok_or_else(|| Refused::new(Kind::Control, "this page does not control the arm; take control first"))
}

#[derive(Deserialize)]
pub(crate) struct Named {
    name: String,
}

impl Named {
    fn shown(&self) -> String {
        self.name.chars().filter(|c| !c.is_control()).take(MAX_FILE_NAME).collect()
    }
}

pub(crate) async fn open(State(hub): Shared, Query(named): Query<Named>, bytes: Bytes) -> Answer<u64> {
    Ok(Json(hub.set_program(Arc::new(Program::open(&named.shown(), &bytes)?))))
}

/// A table is recorded with its visit file: from here on as one that the server made.
pub(crate) async fn open_visits(State(hub): Shared, Query(named): Query<Named>, text: String) -> Answer<u64> {
    let invalid = |error: &dyn std::fmt::Display| Refused::new(Kind::Invalid, error);
    let visits_name = named.shown();
    let visits = Visits::parse(Path::new(&visits_name), &text).map_err(|error| invalid(&error))?;
    let program = hub.program().filter(|program| program.digest() == Some(visits.table));
    let other = format!("{visits_name} belongs to another table than the one that is open; open its table first");
    let program = program.ok_or_else(|| invalid(&other))?;
    let own = hub.wired().filter(|wired| wired.arm.hash() == visits.model);
    let model = own.map(|wired| wired.arm.model.number);
    let origin = Origin { visits_name, n_visits: visits.rests.len(), diagnosed: None, model };
    let program = Program::open(&program.view.name, &program.bytes)?.with_visits(origin, text);
    Ok(Json(hub.set_program(Arc::new(program))))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct UploadRequest {
    /// Digest of the table that the page shows.
    table: String,
}

pub(crate) async fn upload(State(hub): Shared, headers: HeaderMap, Json(request): Json<UploadRequest>) -> Answer<()> {
    let program = hub.program().filter(|program| program.view.digest.as_ref() == Some(&request.table));
    let program =
        program.ok_or_else(|| Refused::new(Kind::Invalid, "another table was opened meanwhile; look at it"))?;
    order(&hub, Some(key(&headers)?), Task::Upload(program), None).await
}

/// `stops` is the count of stops that the page knows of: what a person orders who does not see the last stop yet is refused, as is what
/// follows another order of the page.
#[derive(Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum CommandRequest {
    Play { table: String, stops: Option<u64> },
    Clear,
    Coil { coil: u8, on_ms: u32 },
    Word { word: String, stops: Option<u64> },
    Servo { servo: u8, angle_rad: f32, stops: Option<u64> },
}

pub(crate) async fn command(State(hub): Shared, headers: HeaderMap, Json(request): Json<CommandRequest>) -> Answer<()> {
    let invalid = |text: &str| Refused::new(Kind::Invalid, text);
    let (task, known_stops) = match request {
        CommandRequest::Play { table, stops } => {
            let table = digest(&table).ok_or_else(|| invalid("a digest has 64 hexadecimal digits"))?;
            (Task::Play { table }, stops)
        }
        CommandRequest::Clear => (Task::Command(Command::Clear), None),
        CommandRequest::Coil { coil, on_ms } => (Task::Command(Command::Coil { coil, on_ms }), None),
        CommandRequest::Word { word, stops } => {
            let word = word.parse().map_err(|_| invalid("a word has one digit 0 to 3 for each actuator"))?;
            (Task::Command(Command::Word(word)), stops)
        }
        CommandRequest::Servo { servo, angle_rad, stops } => {
            (Task::Command(Command::Servo { servo, angle_rad }), stops)
        }
    };
    order(&hub, Some(key(&headers)?), task, known_stops).await
}

pub(crate) async fn samples(State(hub): Shared, Query(After { after }): Query<After>) -> Json<SamplesView> {
    Json(hub.samples(after))
}

pub(crate) async fn console(State(hub): Shared, Query(After { after }): Query<After>) -> Json<Vec<ConsoleLine>> {
    Json(hub.console(after))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TypeRequest {
    line: String,
    /// As of [`CommandRequest`].
    stops: Option<u64>,
}

pub(crate) async fn type_line(
    State(hub): Shared,
    headers: HeaderMap,
    Json(TypeRequest { line, stops }): Json<TypeRequest>,
) -> Answer<()> {
    let (key, known_stops) = match LineKind::of(&line).map_err(|error| Refused::new(Kind::Invalid, error))? {
        LineKind::Reads => (None, None),
        LineKind::Changes => (Some(key(&headers)?), stops),
        // By the thread of stops: it waits for nothing.
        LineKind::Stops => {
            hub.typed(&line);
            return stopped(Instant::now(), hub.stops().request().await).map(|_| Json(()));
        }
    };
    order(&hub, key, Task::Type(line), known_stops).await
}

async fn order(hub: &Hub, key: Option<u64>, task: Task, known_stops: Option<u64>) -> Answer<()> {
    let answered = hub.order(key, task, known_stops)?;
    answered.await.map_err(|_| Refused::new(Kind::Link, "the server is ending"))?.map(Json)
}
