//! Which word brings the tool nearest to a pose: the exact search, the density of reachable positions, an order of switching.
//!
//! | request                   | does                                                                                 |
//! |---------------------------|--------------------------------------------------------------------------------------|
//! | `GET /api/reach`          | number of words, the arm at rest, how far the running work is; `null` without an arm   |
//! | `POST /api/reach/nearest` | the nearest word and what is proven of it                                             |
//! | `POST /api/reach/path`    | words between two words                                                               |
//! | `POST /api/reach/slice`   | a plane of the density map                                                            |
//!
//! Nothing is sent to the board. Each kind of work runs one at a time; a request that its page gives up ends its work.

mod check;
mod density;
mod nearest;
mod order;

use std::sync::{Arc, Mutex, PoisonError};

use axum::extract::State;
use axum::routing::{get, post};
use axum::{Json, Router};
use darm_arm::arm::Arm;
use darm_arm::reach::exact::{Options, words_to_choose_from};
use serde::Serialize;

use crate::hub::Hub;
use crate::job_queue::{JobQueue, RunningView};
use crate::picture::{Picture, Posture};
use crate::refusal::Refused;
use check::{invalid, refused};
use density::{Density, SliceRequest, SliceView};
use nearest::{NearestRequest, NearestView, Search};
use order::{OrderRequest, OrderView};

/// What the requests share.
struct Reach {
    hub: Arc<Hub>,
    search: JobQueue,
    order: JobQueue,
    map: JobQueue,
    /// The index of the last search, and the density map of the last slice.
    searched: Arc<Mutex<Option<Search>>>,
    mapped: Arc<Mutex<Option<Density>>>,
}

type Shared = State<Arc<Reach>>;
type Answer<T> = Result<Json<T>, Refused>;

/// The requests about reach.
pub(crate) fn router(hub: Arc<Hub>) -> Router {
    let [search, order, map] = [(); 3].map(|()| JobQueue::new());
    let reach = Reach { hub, search, order, map, searched: Arc::default(), mapped: Arc::default() };
    Router::new()
        .route("/api/reach", get(about))
        .route("/api/reach/nearest", post(nearest_word))
        .route("/api/reach/path", post(order_of_switching))
        .route("/api/reach/slice", post(slice))
        .with_state(Arc::new(reach))
}

/// What can be asked.
#[derive(Serialize)]
struct About {
    words: f64,
    length_scale_m: f64,
    has_effects: bool,
    /// Most actuators that switch at once.
    at_once: u8,
    /// The arm at rest, its servos at 0.
    rest: Picture,
    searching: Option<RunningView>,
    mapping: Option<RunningView>,
    ordering: Option<RunningView>,
}

async fn about(State(reach): Shared) -> Answer<Option<About>> {
    let Some(wired) = reach.hub.wired() else { return Ok(Json(None)) };
    let arm = &wired.arm;
    let posture = Posture { word: arm.rest(), previous: arm.rest(), servos_rad: vec![0.0; arm.n_servos()] };
    Ok(Json(Some(About {
        words: words_to_choose_from(arm, &Options::of(arm), &[]).map_err(refused)?,
        length_scale_m: arm.length_scale_m,
        has_effects: !arm.model.effects.is_empty(),
        at_once: wired.profile.profile.supply.new_coils,
        rest: Picture::of(arm, &posture).map_err(refused)?,
        searching: reach.search.running(),
        mapping: reach.map.running(),
        ordering: reach.order.running(),
    })))
}

async fn nearest_word(State(reach): Shared, Json(request): Json<NearestRequest>) -> Answer<NearestView> {
    let (hub, searched) = (Arc::clone(&reach.hub), Arc::clone(&reach.searched));
    let work = move |work: &_| {
        let mut known = searched.lock().unwrap_or_else(PoisonError::into_inner);
        request.answer(arm(&hub)?, &mut known, work)
    };
    reach.search.run(work).await.map(Json)
}

async fn order_of_switching(State(reach): Shared, Json(request): Json<OrderRequest>) -> Answer<OrderView> {
    let hub = Arc::clone(&reach.hub);
    let work = move |work: &_| {
        let wired = hub.wired().ok_or_else(no_arm)?;
        request.answer(&wired.arm, wired.profile.profile.supply.new_coils, work)
    };
    reach.order.run(work).await.map(Json)
}

async fn slice(State(reach): Shared, Json(request): Json<SliceRequest>) -> Answer<SliceView> {
    let (hub, mapped) = (Arc::clone(&reach.hub), Arc::clone(&reach.mapped));
    let work = move |work: &_| {
        let mut known = mapped.lock().unwrap_or_else(PoisonError::into_inner);
        request.answer(arm(&hub)?, &mut known, work)
    };
    reach.map.run(work).await.map(Json)
}

fn arm(hub: &Hub) -> Result<&Arm, Refused> {
    hub.wired().map(|wired| &wired.arm).ok_or_else(no_arm)
}

fn no_arm() -> Refused {
    invalid("the server has no arm; start it with one: `darm serve arm.toml`")
}
