//! What pages show of the board, as it travels: SI units, named by the end of the key.

use darm_core::sequencer::{Event, Phase};
use darm_core::units::Micros;
use serde::Serialize;

use crate::attached::AttachedView;
use crate::control::GrantNumber;
use crate::measured::MeasuredView;
use crate::program::seconds;
use crate::recording::RecordingsView;
use crate::refusal::{Limit, Place, of_fault};

/// What a page fetches again and again.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct LiveView {
    /// Grows with every change.
    pub revision: u64,
    /// Whether the board answers now. Where it does not, all below is old.
    pub link: LinkView,
    /// Name of the port that was opened last; empty before.
    pub port: String,
    /// Grows with every stop, of anybody.
    pub stops: u64,
    /// Age of what was seen of the board, s.
    pub age_s: Option<f64>,
    /// Who controls the arm.
    pub control: Option<ControlView>,
    /// Who is at the board: pages and programs.
    pub attached: Vec<AttachedView>,
    /// Number of the picture: a page fetches it when it changes.
    pub picture: u64,
    /// Number of the opened table: a page fetches it when it changes.
    pub program: u64,
    /// The upload that runs.
    pub upload: Option<UploadView>,
    /// What pages record, where the server has a folder for it.
    pub recordings: Option<RecordingsView>,
    /// Number of lines of the console so far: a page fetches them when it grows.
    pub console: u64,
    /// The measured pose of the tool, where the server has a source of poses.
    pub measured: Option<MeasuredView>,
    /// What was seen of the board last.
    pub board: Option<BoardView>,
    /// What happened on the board, oldest first.
    pub events: Vec<EventView>,
}

/// Who controls the arm.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct ControlView {
    /// Number of the grant; for pages `page`, as the name of a page without one says it.
    #[serde(rename = "page")]
    pub grant: GrantNumber,
    /// What the page or program is called.
    pub name: String,
    /// Whether it is a program: no page can ask it for control.
    pub is_program: bool,
    /// The page that asks for control.
    pub asked_by: Option<String>,
}

/// Whether the board answers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "state", rename_all = "kebab-case")]
pub(crate) enum LinkView {
    /// It has not answered yet.
    Connecting,
    /// It answered just now.
    Live,
    /// The port is open, and the last answer is too old to call anything live.
    Silent,
    /// The port is lost.
    Lost {
        /// Why.
        reason: String,
    },
}

/// How far an upload is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct UploadView {
    /// Bytes that the board has.
    pub done: u32,
    /// Bytes of the table.
    pub total: u32,
}

/// A board.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct BoardView {
    /// Its kind.
    pub name: String,
    /// Number of the device.
    pub device: String,
    /// Version of the firmware.
    pub firmware: String,
    /// How often it has started.
    pub boots: u32,
    /// Digest of its table.
    pub table: Option<String>,
    /// Digest of its profile; `None` while the built-in one is in force, or none.
    pub profile: Option<String>,
    /// Whether no limits are in force, so that nothing is driven: its profile is lost, or cannot be used.
    pub is_profile_lost: bool,
    /// What the supply can feed; `None` where its limit is not known.
    pub supply: Option<SupplyView>,
    /// Whether its table was made for another model than that of the picture.
    pub has_other_model: bool,
    /// Rows of its table.
    pub rows: u16,
    /// What it does.
    pub phase: PhaseView,
    /// The word that it drives.
    pub word: String,
    /// Its actuators.
    pub actuators: Vec<ActuatorView>,
    /// The outputs of its profile.
    pub outputs: Vec<OutputView>,
    /// Its servos.
    pub servos: Vec<ServoView>,
    /// Quality of link and board.
    pub quality: QualityView,
}

/// What the sequencer does.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct PhaseView {
    /// `idle`, `manual`, `approaching`, `playing` or `safe`.
    pub name: &'static str,
    /// The row that is due next, or that the fault was in.
    pub row: Option<u16>,
    /// Time since the start of the program, s.
    pub since_s: Option<f64>,
    /// Why the safe state is latched.
    pub fault: Option<FaultView>,
}

/// A latched fault.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct FaultView {
    /// In a sentence.
    pub text: String,
    /// Where.
    #[serde(flatten)]
    pub place: Place,
}

/// A discrete actuator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct ActuatorView {
    /// The state that it is driven to.
    pub digit: u8,
    /// Its limit switch.
    pub switch: Option<SwitchView>,
}

/// A limit switch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct SwitchView {
    /// Number of the input.
    pub input: u8,
    /// Whether it is to be closed at the stop.
    pub expected: bool,
    /// Whether it is closed.
    pub seen: bool,
    /// Whether the actuator may still be on its way.
    pub is_moving: bool,
}

/// An output of the board.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct OutputView {
    /// Its number.
    pub output: u8,
    /// Number of the actuator that it feeds; `None` where no arm is known.
    pub actuator: Option<usize>,
    /// How it uses its lines.
    pub drive: Option<&'static str>,
    /// Whether the word switches it on.
    pub is_on: Option<bool>,
    /// For how long, s.
    pub on_s: Option<f64>,
    /// How long it may still be on, in its pulse and in its window, s.
    pub left_s: f64,
    /// Time until the supply can feed it, s: others went on just now.
    pub wait_s: f64,
    /// How long it may be on at most, s.
    pub allowed_s: f64,
    /// After this time without current all of that is free, s.
    pub recovery_s: f64,
    /// Its limits in the profile.
    pub limit: Limit,
}

/// What the supply can feed, as far as the server has seen outputs switched on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct SupplyView {
    /// Outputs that may be switched on now.
    pub room: u32,
    /// Outputs that may be switched on within its window.
    pub all: u32,
    /// Time until one more may be switched on, s.
    pub wait_s: f64,
    /// Time until all of them may, s.
    pub full_s: f64,
}

/// A servo joint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct ServoView {
    /// Joint angle, rad.
    pub angle_rad: f32,
    /// Share of the largest load.
    pub load: f32,
    /// Error bits of its status byte, 0 when it is well.
    pub error_bits: u8,
    /// Whether it has ever answered.
    pub has_answered: bool,
}

/// Quality of link and board.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct QualityView {
    /// Time of the last question and its answer, s.
    pub round_trip_s: f64,
    /// Frames sent.
    pub sent: u32,
    /// Frames that were sent again.
    pub again: u32,
    /// Frames that arrived damaged here.
    pub damaged: u32,
    /// Frames that arrived damaged at the board since its start.
    pub bad_frames: u32,
    /// Latest start of a control tick since the start of the board, s.
    pub worst_lateness_s: f64,
    /// Supply of the board, V, where it is measured.
    pub supply_v: Option<f64>,
    /// The profile's threshold of it, V.
    pub min_supply_v: Option<f64>,
}

/// Something that happened on the board.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EventView {
    /// Its number since the board's start.
    pub number: u32,
    /// Time of the board's clock, s.
    pub at_s: f64,
    /// `booted`, `started`, `row`, `finished`, `stopped`, `fault` or `cleared`.
    pub kind: &'static str,
    /// In a sentence.
    pub text: String,
}

impl PhaseView {
    /// A phase at time `now` of the board.
    pub(crate) fn of(phase: &Phase, now: Micros) -> Self {
        let running = |name, row, since: Micros| Self { name, row, since_s: Some(seconds(now - since)), fault: None };
        let simple = |name| Self { name, row: None, since_s: None, fault: None };
        match phase {
            Phase::Idle => simple("idle"),
            Phase::Manual => simple("manual"),
            Phase::Approaching { since } => running("approaching", None, *since),
            Phase::Playing { started, next } => running("playing", Some(*next), *started),
            Phase::Safe(fault) => {
                let view = FaultView { text: fault.to_string(), place: of_fault(&fault.kind) };
                Self { row: fault.row, fault: Some(view), ..simple("safe") }
            }
        }
    }
}

impl EventView {
    /// An event with its number and time.
    pub fn of(number: u32, at: Micros, event: &Event) -> Self {
        let (kind, text) = match event {
            Event::Booted => ("booted", "the board started".to_owned()),
            Event::Started => ("started", "the program started".to_owned()),
            Event::Row { row, word } => ("row", format!("row {row}: word {word}")),
            Event::Finished => ("finished", "the program ran to its end".to_owned()),
            Event::Stopped => ("stopped", "stopped: all outputs are off".to_owned()),
            Event::Fault(fault) => ("fault", format!("safe state: {}", fault.kind)),
            Event::Cleared => ("cleared", "the safe state was cleared".to_owned()),
        };
        Self { number, at_s: seconds(at), kind, text }
    }
}
