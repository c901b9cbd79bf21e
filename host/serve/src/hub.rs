//! What watcher and pages share: the last state of the board, who controls the arm, the opened table, and the stop.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use darm_arm::wired_arm::WiredArm;
use darm_device::client::sharing::{Guest, Rights};
use darm_device::client::stop::StopHandle;
use tokio::sync::{oneshot, watch};

use crate::attached::{Attached, PageId};
use crate::board_port::Stopper;
use crate::console::{Console, ConsoleLine};
use crate::control::{Control, ControlAt, ControlError};
use crate::history::History;
use crate::measured::Measured;
use crate::order::{Order, Ordered, Task};
use crate::picture::{Picture, Tool};
use crate::program::Program;
use crate::recording::Recordings;
use crate::refusal::{Kind, Refused};
use crate::samples::{Samples, SamplesView};
use crate::served_arm::ServedArm;
use crate::stops::Stops;
use crate::unix_time;
use crate::view::{BoardView, ControlView, EventView, LinkView, LiveView, UploadView};

/// What is older than this is not live: ten times the interval of the questions.
pub(crate) const LIVE: Duration = Duration::from_millis(500);
/// Events that are kept for pages.
const EVENTS: usize = 60;

/// What watcher and pages share.
pub(crate) struct Hub {
    stops: Stops,
    arm: Option<ServedArm>,
    history: Option<Arc<History>>,
    recordings: Arc<Recordings>,
    orders: Sender<Order>,
    state: Mutex<State>,
    /// Wakes pages that wait for news.
    revision: watch::Sender<u64>,
    has_ended: AtomicBool,
}

struct State {
    link: LinkView,
    seen: Option<Instant>,
    board: Option<BoardView>,
    events: VecDeque<EventView>,
    upload: Option<UploadView>,
    control: Control,
    attached: Attached,
    console: Console,
    samples: Samples,
    /// Name of the port that was opened last; empty before.
    port: String,
    picture: Revised<Result<Picture, String>>,
    program: Revised<Program>,
    measured: Measured,
}

impl State {
    /// Where the model has the tool in the posture of the picture.
    fn predicted(&self) -> Option<Tool> {
        let picture = self.picture.value.as_deref()?.as_ref().ok()?;
        Some(picture.tool)
    }
}

/// A value that pages fetch when its number has changed.
struct Revised<T> {
    /// 0 before the first value.
    number: u64,
    value: Option<Arc<T>>,
}

impl<T> Default for Revised<T> {
    fn default() -> Self {
        Self { number: 0, value: None }
    }
}

impl<T> Revised<T> {
    fn set(&mut self, value: Arc<T>) {
        self.number += 1;
        self.value = Some(value);
    }
}

/// What a hub is made of.
pub(crate) struct HubParts {
    pub(crate) stopper: Stopper,
    pub(crate) arm: Option<ServedArm>,
    pub(crate) history: Option<Arc<History>>,
    pub(crate) recordings: Arc<Recordings>,
    pub(crate) orders: Sender<Order>,
}

impl Hub {
    pub(crate) fn new(parts: HubParts) -> Self {
        let HubParts { stopper, arm, history, recordings, orders } = parts;
        let state = State {
            link: LinkView::Connecting,
            seen: None,
            board: None,
            events: VecDeque::new(),
            upload: None,
            control: Control::default(),
            attached: Attached::default(),
            console: Console::default(),
            samples: Samples::default(),
            port: String::new(),
            picture: Revised::default(),
            program: Revised::default(),
            measured: Measured::default(),
        };
        Self {
            stops: Stops::new(stopper),
            arm,
            history,
            recordings,
            orders,
            state: Mutex::new(state),
            revision: watch::Sender::new(1),
            has_ended: AtomicBool::new(false),
        }
    }

    /// The arm of the server with its file, where it was started with one.
    pub(crate) fn served(&self) -> Option<&ServedArm> {
        self.arm.as_ref()
    }

    /// The arm on its board, where one is known.
    pub(crate) fn wired(&self) -> Option<&WiredArm> {
        self.arm.as_ref().map(|arm| &arm.wired)
    }

    /// Where what was seen is kept.
    pub(crate) fn history(&self) -> Option<&Arc<History>> {
        self.history.as_ref()
    }

    /// What pages record.
    pub(crate) fn recordings(&self) -> &Arc<Recordings> {
        &self.recordings
    }

    /// What sends stops and counts them.
    pub(crate) fn stops(&self) -> &Stops {
        &self.stops
    }

    /// Whether this is the key of the page with control.
    pub(crate) fn controls(&self, key: u64) -> bool {
        // Control that has run out by itself: the watcher notices it within its period, and wakes pages.
        self.change_quietly(|state| state.control.at(Instant::now()).check(key).is_ok())
    }

    /// Whether a page has gone with its control since this was called last.
    pub(crate) fn take_abandoned(&self) -> bool {
        self.change_if(|state| state.control.at(Instant::now()).take_abandoned())
    }

    /// Whether the board has said last that it is moved by hand, and by no program.
    pub(crate) fn is_by_hand(&self) -> bool {
        self.read(|state| state.board.as_ref().is_some_and(|board| board.phase.name == "manual"))
    }

    /// Queues an order of the page with this key, or one that needs no control; its result comes through the receiver. `known_stops` is
    /// the number of stops that the page knows of: a later one outdates it. A program that is no page may leave it out.
    pub(crate) fn order(
        &self,
        key: Option<u64>,
        task: Task,
        known_stops: Option<u64>,
    ) -> Result<oneshot::Receiver<Result<(), Refused>>, Refused> {
        let ordered = self.ordered(known_stops);
        if let Some(key) = key {
            self.control(|control| control.check(key))?;
        }
        let (answer, answered) = oneshot::channel();
        let order = Order { task, key, ordered, answer };
        self.orders.send(order).map_err(|_| Refused::new(Kind::Link, "the server is ending"))?;
        Ok(answered)
    }

    /// What a page orders now; `known_stops` as of [`order`](Self::order).
    pub(crate) fn ordered(&self, known_stops: Option<u64>) -> Ordered {
        Ordered::now(known_stops.unwrap_or_else(|| self.stops.count()))
    }

    /// Changes or asks who controls the arm.
    pub(crate) fn control<T>(
        &self,
        act: impl FnOnce(&mut ControlAt<'_>) -> Result<T, ControlError>,
    ) -> Result<T, ControlError> {
        self.change(|state| act(&mut state.control.at(Instant::now())))
    }

    /// A page says that it is there.
    pub(crate) fn see_page(&self, id: PageId, name: &str) {
        self.change_if(|state| state.attached.see(Instant::now(), id, name));
    }

    /// What a page is called that has said that it is there; else nothing.
    pub(crate) fn page_name(&self, id: Option<PageId>) -> String {
        id.and_then(|id| self.read(|state| state.attached.name(id))).unwrap_or_default()
    }

    /// A page has typed a line.
    pub(crate) fn typed(&self, line: &str) {
        self.change(|state| state.console.typed(line));
    }

    /// The board has sent text.
    pub(crate) fn hear_text(&self, bytes: &[u8]) {
        self.change_if(|state| state.console.hear(bytes));
    }

    /// What was seen, from the sample with this number on.
    pub(crate) fn samples(&self, from: u64) -> SamplesView {
        self.read(|state| state.samples.from(from))
    }

    /// Lines of the console from this number on.
    pub(crate) fn console(&self, from: u64) -> Vec<ConsoleLine> {
        self.read(|state| state.console.from(from))
    }

    /// What pages show now.
    pub(crate) fn view(&self) -> LiveView {
        let now = Instant::now();
        // Control that has run out by itself, as in `controls`.
        self.change_quietly(|state| {
            let age = state.seen.map(|seen| now.saturating_duration_since(seen));
            let is_old = age.is_none_or(|age| age > LIVE);
            let link = if state.link == LinkView::Live && is_old { LinkView::Silent } else { state.link.clone() };
            let predicted = state.predicted();
            let control = state.control.at(now);
            let control = control.holder().map(|holder| ControlView {
                grant: holder.grant.number,
                name: holder.name.clone(),
                is_program: holder.is_program,
                asked_by: control.asking().map(str::to_owned),
            });
            LiveView {
                revision: *self.revision.borrow(),
                link,
                port: state.port.clone(),
                stops: self.stops.count(),
                age_s: age.map(|age| age.as_secs_f64()),
                control,
                attached: state.attached.view(now),
                picture: state.picture.number,
                program: state.program.number,
                upload: state.upload,
                recordings: self.recordings.view(),
                console: state.console.count(),
                measured: state.measured.view(predicted.as_ref(), unix_time::now_s()),
                board: state.board.clone(),
                events: state.events.iter().cloned().collect(),
            }
        })
    }

    /// Waits until there is something newer than `revision`, at most this long.
    pub(crate) async fn news(&self, revision: u64, patience: Duration) {
        let mut changes = self.revision.subscribe();
        // Nothing new in time is an answer too: it has the age.
        let _ = tokio::time::timeout(patience, changes.wait_for(|newest| *newest > revision)).await;
    }

    /// The posture that the model predicts, or why it has none; `None` before the board has answered or without an arm.
    pub(crate) fn picture(&self) -> Option<Arc<Result<Picture, String>>> {
        self.read(|state| state.picture.value.clone())
    }

    /// The arm goes to another posture, where it is at rest after `travel_s`.
    pub(crate) fn set_picture(&self, picture: Result<Picture, String>, travel_s: f64) {
        // The answer of the board that it was drawn for follows: pages get both at once.
        self.change_quietly(|state| {
            state.picture.set(Arc::new(picture));
            state.measured.moves(unix_time::now_s() + travel_s);
        });
    }

    /// Changes what was measured.
    pub(crate) fn with_measured(&self, change: impl FnOnce(&mut Measured)) {
        // As often as a camera sends: pages see it with the next answer of the board, or when they ask again.
        self.change_quietly(|state| change(&mut state.measured));
    }

    /// The opened table.
    pub(crate) fn program(&self) -> Option<Arc<Program>> {
        self.read(|state| state.program.value.clone())
    }

    /// A table is opened; its number.
    pub(crate) fn set_program(&self, program: Arc<Program>) -> u64 {
        self.change(|state| {
            state.program.set(program);
            state.program.number
        })
    }

    /// The port of this name is open.
    pub(crate) fn set_port_open(&self, port: &str, handle: StopHandle) {
        self.stops.open(handle);
        self.change(|state| state.port = port.to_owned());
    }

    /// The board has answered.
    pub(crate) fn set_board(&self, board: BoardView, new_events: Vec<EventView>) {
        self.change(|state| {
            let predicted = state.predicted();
            let now_s = unix_time::now_s();
            let measured = state.measured.view(predicted.as_ref(), now_s);
            state.samples.push(now_s, &board, measured.as_ref());
            state.events.extend(new_events);
            let old = state.events.len().saturating_sub(EVENTS);
            state.events.drain(..old);
            (state.link, state.seen, state.board) = (LinkView::Live, Some(Instant::now()), Some(board));
        });
    }

    /// The board started again: its events count from the beginning.
    pub(crate) fn forget_events(&self) {
        // Its answer follows, with the events that are fetched again: no page sees none of them.
        self.change_quietly(|state| state.events.clear());
    }

    /// The port is lost, or did not open.
    pub(crate) fn set_lost(&self, reason: String) {
        self.stops.close();
        self.change(|state| (state.link, state.upload) = (LinkView::Lost { reason }, None));
    }

    pub(crate) fn set_upload(&self, upload: Option<UploadView>) {
        self.change(|state| state.upload = upload);
    }

    /// Watcher and server are to end.
    pub(crate) fn end(&self) {
        self.has_ended.store(true, Ordering::Relaxed);
    }

    pub(crate) fn has_ended(&self) -> bool {
        self.has_ended.load(Ordering::Relaxed)
    }

    /// Changes the state, and wakes pages that wait for news.
    fn change<T>(&self, act: impl FnOnce(&mut State) -> T) -> T {
        let done = self.change_quietly(act);
        self.wake();
        done
    }

    /// Changes the state, and wakes pages where `act` says that they see it.
    fn change_if(&self, act: impl FnOnce(&mut State) -> bool) -> bool {
        let is_news = self.change_quietly(act);
        if is_news {
            self.wake();
        }
        is_news
    }

    /// Changes the state and wakes nobody: each use says why.
    fn change_quietly<T>(&self, act: impl FnOnce(&mut State) -> T) -> T {
        act(&mut self.state.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn read<T>(&self, look: impl FnOnce(&State) -> T) -> T {
        look(&self.state.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn wake(&self) {
        self.revision.send_modify(|revision| *revision += 1);
    }
}

/// Programs that use the port of the server have the rights of a page; an order is one to the board itself.
impl Rights for Hub {
    fn arrive(&self, guest: &Guest) {
        self.change(|state| state.attached.arrive(guest));
    }

    fn stay(&self, guest: &Guest) {
        // Nothing that pages show has changed. One that has no control has none to keep.
        let _ = self.change_quietly(|state| state.control.at(Instant::now()).renew(guest.key));
    }

    fn take_control(&self, guest: &Guest) -> Result<(), String> {
        // Its process says `Hello` when it has started, which opens the connection again that the stop has ended.
        if self.recordings.is_outdated(guest.process, self.stops.count()) {
            return Err("a stop came after the recording was ordered; start it again".to_owned());
        }
        let taken = self.control(|control| {
            // What a page records moves the arm with its control; another page that has control is asked first, as by anybody.
            if control.holder().is_some_and(|holder| self.recordings.is_for(guest.process, holder.grant.number)) {
                return Ok(());
            }
            control.take_as_program(guest.key, &guest.name)
        });
        taken.map_err(|error| error.to_string())
    }

    fn leave(&self, guest: &Guest) {
        self.change(|state| {
            state.attached.leave(guest);
            state.control.at(Instant::now()).abandon(guest.key);
        });
    }
}

#[cfg(test)]
mod tests {
    use std::process::Command;
    use std::sync::Arc;
    use std::sync::mpsc::channel;
    use std::thread;
    use std::time::Duration;

    use darm_device::client::sharing::{Guest, Rights as _};
    use darm_device::client::stop::Confirmation;

    use super::{Hub, HubParts};
    use crate::recording::{RecordSetup, RecordingOrder, Recordings};

    /// The process of a recording attaches after the stop that was confirmed.
    #[test]
    fn a_recording_gets_no_control_after_a_stop_also_where_its_page_has_gone() {
        let folder = tempfile::tempdir().unwrap();
        let note = folder.path().join("process");
        let script = format!("echo $$ > {0}.new && mv {0}.new {0}; exec sleep 2", note.display());
        let command = move |_: &_| {
            let mut command = Command::new("sh");
            command.args(["-c", &script]);
            command
        };
        let setup = RecordSetup { folder: folder.path().to_owned(), command: Box::new(command) };
        let recordings = Arc::new(Recordings::new(Some(setup)));
        let hub = Hub::new(HubParts {
            stopper: Box::new(|| Ok(Confirmation::Confirmed)),
            arm: None,
            history: None,
            recordings: Arc::clone(&recordings),
            orders: channel().0,
        });
        let grant = hub.control(|control| control.take(7, "page")).unwrap().number;
        let stops = hub.stops().count();
        let order = RecordingOrder { grant, stops, name: "run-1", table: b"table", visits: "visits" };
        recordings.start(&order, || Ok(())).unwrap();
        while !note.exists() {
            thread::sleep(Duration::from_millis(1));
        }
        let process = std::fs::read_to_string(&note).unwrap().trim().parse().ok();
        let guest = Guest { key: 9, name: "`darm record`".to_owned(), process };
        assert_eq!(hub.take_control(&guest), Ok(()));
        hub.stops().send().unwrap();
        assert!(hub.take_control(&guest).unwrap_err().contains("a stop came"));
        hub.control(|control| {
            control.release(7);
            Ok(())
        })
        .unwrap();
        assert!(hub.take_control(&guest).unwrap_err().contains("a stop came"));
        assert_eq!(hub.take_control(&Guest { process: None, ..guest }), Ok(()), "another program has control");
    }
}
