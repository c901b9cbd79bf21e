//! The messages of protocol version [`crate::wire::PROTOCOL`]: postcard under tag 10 and 90.
//!
//! | request     | answer      | runs  | meaning                                                                 |
//! |-------------|-------------|-------|-------------------------------------------------------------------------|
//! | `Hello`     | `Hello`     | often | opens a connection; says what is loaded                                 |
//! | `Status`    | `Status`    | often | what the board does now                                                 |
//! | `Events`    | `Events`    | often | what happened, from a number on                                         |
//! | `Begin`     | `Upload`    | often | starts the upload of a table, or resumes the same one where it broke off |
//! | `Chunk`     | `Upload`    | often | bytes at an offset; the answer says which offset is wanted next, blocks ahead of it are kept |
//! | `Commit`    | `Committed` | once  | checks the table, stores it and loads it                                |
//! | `Command`   | `Done`      | once  | play, clear, a coil, a word, a servo; the stop is no request like the others, see [`is_stop`] |
//! | `Calibrate` | `Done`      | once  | stores the servos' zero offsets                                         |
//! | `Calibration` | `Calibration` | often | the stored offsets                                                  |
//! | `Nearest`   | `Nearest`   | often | which word brings the tool near a pose, by the frames in the table      |
//! | `Outputs`   | `Outputs`   | often | how long outputs have been on, and how long they may be                 |
//! | `Health`    | `Health`    | often | clock, resets, errors of lines, flash and chain                         |
//! | `PastEvents` | `PastEvents` | often | what happened before this start                                       |
//! | `PastCrash` | `PastCrash` | often | how earlier starts ended                                               |
//! | `Inputs`    | `Inputs`    | often | when inputs changed, from a number on                                   |
//!
//! `Begin`, `Chunk` and `Commit` also bring a profile; that is committed only while a person holds the board's button,
//! and the board starts again with it.

use core::fmt;

use serde::{Deserialize, Serialize};

use crate::nearest::{Coordinates, Found};
use crate::output::{CoilLimit, MAX_SERVOS};
use crate::profile::ProfileError;
use crate::sequencer::{Command, CommandError, Event, Phase, ServoSeen};
use crate::table::TableError;
use crate::units::{DeviceId, Digest, Micros, ModelHash, Word};
use crate::wire::PROTOCOL;
use crate::wire::bootstrap::CrashRecord;
use crate::wire::caps::Caps;
use crate::wire::health::Health;
use crate::wire::inputs::InputChanges;

/// Tag of requests.
pub const REQUEST: u8 = 0x10;
/// Tag of replies.
pub const REPLY: u8 = 0x90;
/// Bytes of a table in one chunk, at most.
pub const CHUNK: usize = 256;
/// Events in one answer, at most.
pub const EVENTS: usize = 8;
/// Outputs in one answer, at most.
pub const OUTPUTS: usize = 12;

/// What a host asks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Request<'a> {
    /// Opens a connection.
    Hello {
        /// Version that the host speaks.
        protocol: u16,
        /// The board's last [challenge](Refusal::Challenge); 0 by a host that does not know it.
        challenge: u64,
    },
    /// What do you do now?
    Status,
    /// What happened since?
    Events {
        /// Number of the first event wanted.
        from: u32,
    },
    /// A table follows.
    Begin(Image),
    /// A piece of the table.
    Chunk {
        /// Where it is in the image.
        offset: u32,
        /// At most [`CHUNK`] bytes.
        bytes: &'a [u8],
    },
    /// Check the table, store it, load it.
    Commit(Image),
    /// Do something.
    Command(Command),
    /// Store the servos' zero offsets.
    Calibrate(Calibration),
    /// Report the stored offsets.
    Calibration,
    /// Find a word that brings the tool near this pose in the base.
    Nearest(Coordinates),
    /// How long have the outputs been on, from this number on?
    Outputs {
        /// Number of the first output wanted.
        from: u8,
    },
    /// How is the board itself?
    Health,
    /// What happened before this start?
    PastEvents {
        /// Leave out this number of the newest.
        skip: u32,
    },
    /// How did earlier starts end?
    PastCrash {
        /// 0 is the last crash, 1 the one before.
        back: u8,
    },
    /// When did inputs change since?
    Inputs {
        /// Number of the first change wanted.
        from: u32,
    },
}

/// What a request does to the board, and so what becomes of one that comes again because its answer was lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doing {
    /// Nothing: it is answered as often as it comes.
    Reads,
    /// Brings a piece of an image, the same however often it comes.
    Uploads,
    /// Puts an image in force: once on a connection, and on another one again without a change.
    Commits,
    /// Moves or stores something: once, and never again on another connection.
    Acts,
}

impl Request<'_> {
    /// What it does. Each request is listed: one that comes later has to say whether it may act twice.
    pub const fn doing(&self) -> Doing {
        match self {
            Self::Hello { .. }
            | Self::Status
            | Self::Events { .. }
            | Self::Calibration
            | Self::Nearest(_)
            | Self::Outputs { .. }
            | Self::Health
            | Self::PastEvents { .. }
            | Self::PastCrash { .. }
            | Self::Inputs { .. } => Doing::Reads,
            Self::Begin(_) | Self::Chunk { .. } => Doing::Uploads,
            Self::Commit(_) => Doing::Commits,
            Self::Command(_) | Self::Calibrate(_) => Doing::Acts,
        }
    }

    /// True of requests that may run as often as they come.
    pub const fn is_repeatable(&self) -> bool {
        matches!(self.doing(), Doing::Reads | Doing::Uploads)
    }
}

/// The protocol version of a host that says `Hello`, of any version: what follows may differ.
pub fn hello_protocol(payload: &[u8]) -> Option<u16> {
    match postcard::take_from_bytes::<(u32, u16)>(payload) {
        Ok(((0, protocol), _)) => Some(protocol),
        _ => None,
    }
}

/// Longest payload that means a stop: two varints.
pub const MAX_STOP: usize = 10;

/// Whether the payload of a request means `Command(Stop)`: exactly where postcard would decode it so, however its two indices are
/// written. The board looks for it in the bytes of the port, before any queue, whatever the link and the number.
pub fn is_stop(payload: &[u8]) -> bool {
    matches!(postcard::take_from_bytes::<(u32, u32)>(payload), Ok(((6, 1), [])))
}

/// The payload of the reply `Done` at this time, without a [`Reply`] on the stack.
pub fn done(at: Micros) -> heapless::Vec<u8, 12> {
    let mut bytes = [0; 12];
    let used = postcard::to_slice(&(at, 0u8, 5u8), &mut bytes);
    used.ok().and_then(|used| heapless::Vec::from_slice(used).ok()).unwrap_or_default()
}

/// What an upload carries.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum ImageKind {
    /// A list of [`crate::table::Record`]s.
    #[default]
    Table,
    /// A list of [`crate::profile::ProfileRecord`]s.
    Profile,
}

/// Which image an upload carries: a list of records, one postcard after the other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Image {
    /// What it is.
    pub kind: ImageKind,
    /// Its length in bytes.
    pub len: u32,
    /// Its SHA-256.
    pub digest: Digest,
    /// The model that it was made for; 0 for a profile.
    pub model: ModelHash,
}

/// Zero offsets of the servos, measured once and kept on the board: joint angle = shaft angle − offset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "[f32; MAX_SERVOS]", into = "[f32; MAX_SERVOS]")]
pub struct Calibration {
    offsets_rad: [f32; MAX_SERVOS],
}

/// An offset is not a number within half a turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OffsetError;

impl fmt::Display for OffsetError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the zero offset of a servo must be within 180 deg")
    }
}

impl core::error::Error for OffsetError {}

impl TryFrom<[f32; MAX_SERVOS]> for Calibration {
    type Error = OffsetError;
    fn try_from(offsets_rad: [f32; MAX_SERVOS]) -> Result<Self, OffsetError> {
        let sound = offsets_rad.iter().all(|offset| offset.abs() <= core::f32::consts::PI);
        if sound { Ok(Self { offsets_rad }) } else { Err(OffsetError) }
    }
}

impl From<Calibration> for [f32; MAX_SERVOS] {
    fn from(calibration: Calibration) -> Self {
        calibration.offsets_rad
    }
}

impl Calibration {
    /// Offset of each servo joint, in radians, at most half a turn.
    pub const fn offsets_rad(&self) -> [f32; MAX_SERVOS] {
        self.offsets_rad
    }
}

/// What the board answers: its own time, and the answer or why it refuses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reply {
    /// The board's clock when it answered.
    pub at: Micros,
    /// The answer.
    pub result: Result<Answer, Refusal>,
}

/// An answer.
#[allow(clippy::large_enum_variant, reason = "there is no heap to box the events on")]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Answer {
    /// To `Hello`.
    Hello(Hello),
    /// To `Status`.
    Status(Status),
    /// To `Events`.
    Events(Events),
    /// To `Begin` and `Chunk`: the offset that is wanted next.
    Upload {
        /// Bytes that have arrived in order.
        next: u32,
    },
    /// To `Commit`.
    Committed {
        /// Rows of the table that is now stored and loaded.
        rows: u16,
    },
    /// It is done.
    Done,
    /// To `Calibration`.
    Calibration(Option<Calibration>),
    /// To `Nearest`: near, not proven to be the nearest.
    Nearest(Found<f32>),
    /// To `Outputs`: up to [`OUTPUTS`] outputs of the profile, by number; none after the last.
    Outputs(heapless::Vec<OutputState, OUTPUTS>),
    /// To `Health`.
    Health(Health),
    /// To `PastEvents`: the newest first; none after the oldest. Times are those of their start, which begins with `Booted`.
    PastEvents(heapless::Vec<(Micros, Event), EVENTS>),
    /// To `PastCrash`.
    PastCrash(Option<CrashRecord>),
    /// To `Inputs`.
    Inputs(InputChanges),
}

/// How long an output has been on, and how long it may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OutputState {
    /// Its number.
    pub output: u8,
    /// The profile's limit.
    pub limit: CoilLimit,
    /// How long it may still be on in the present window.
    pub left_ms: u32,
    /// After this time without current all of its window is free.
    pub recovery_ms: u32,
}

/// Who answers, what it holds and what it can do.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// Version that the board speaks.
    pub protocol: u16,
    /// The chip's unique number.
    pub device: DeviceId,
    /// The model of the loaded table.
    pub model: Option<ModelHash>,
    /// Digest of the loaded table.
    pub table: Option<Digest>,
    /// Digest of the profile in force; zeros for the one that is built in.
    pub profile: Digest,
    /// How often the board has started.
    pub boots: u32,
    /// Number that the next event will have.
    pub next_event: u32,
    /// What the board can do.
    pub caps: Caps,
}

/// What the board does now.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// What the sequencer does.
    pub phase: Phase,
    /// The word that the coils hold.
    pub word: Word,
    /// Rows of the loaded table.
    pub rows: u16,
    /// The model of the loaded table.
    pub model: Option<ModelHash>,
    /// Limit switches as seen.
    pub switches: u32,
    /// Servos as seen, with joint angles, as many as the table has.
    pub servos: heapless::Vec<ServoSeen, MAX_SERVOS>,
    /// Frames that could not be read since the start.
    pub bad_frames: u32,
    /// Latest start of a control tick since the start, in microseconds after its time.
    pub worst_lateness_us: u32,
}

/// What happened, in order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Events {
    /// Number of the first event in the list; larger than requested when older ones are lost.
    pub first: u32,
    /// The events with the board's time.
    pub list: heapless::Vec<(Micros, Event), EVENTS>,
}

/// Why the board does not do what was asked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Refusal {
    /// Another host has connected, or the board was restarted: say `Hello`.
    NotConnected,
    /// The board speaks another version.
    Protocol {
        /// Version that it speaks.
        board: u16,
    },
    /// The request is not known.
    Unknown,
    /// A program runs or a coil is on: stop first.
    Busy,
    /// There is no upload, or another one.
    NoUpload,
    /// The image is longer than a slot.
    TooLong {
        /// Longest image in bytes.
        max: u32,
    },
    /// The bytes that arrived are not those that were announced.
    Damaged,
    /// The table breaks a limit.
    Table(TableError),
    /// The command cannot be done.
    Command(CommandError),
    /// The program would exceed the limit of an output that has lately been on.
    Recovering {
        /// The row in which it would.
        row: u16,
        /// Number of the output.
        output: u8,
        /// After this time without current all of its window is free.
        wait_ms: u32,
    },
    /// A profile is written only while a person holds the board's user button.
    NobodyPresent,
    /// The profile cannot be run safely.
    Profile(ProfileError),
    /// The flash could not be written.
    Storage,
    /// The loaded table has no frames of modules.
    NoFrames,
    /// The pose is not one of numbers, or farther away than any arm reaches.
    NoPose,
    /// The stored zero offsets of the servos cannot be read: no table with servos is loaded until they are stored again.
    NoCalibration,
    /// A connection is opened only by a `Hello` that carries the board's last challenge. There is another one after each
    /// connection, stop and start, so no copy of an earlier `Hello` opens one.
    Challenge {
        /// The challenge.
        challenge: u64,
    },
    /// Each write wears the flash, and there were more than the board takes in this time.
    TooSoon {
        /// After this time the request is taken.
        wait_ms: u32,
    },
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotConnected => f.write_str("another host is connected or the board was restarted; connect again"),
            Self::Protocol { board: 0 } => f.write_str(
                "the board is held after crashes and answers little: type `fault` on its console, then `reboot`",
            ),
            Self::Protocol { board } => {
                let update = if *board < PROTOCOL { "the firmware, with `darm flash`" } else { "this tool, `darm`" };
                write!(f, "the board speaks protocol version {board}, this tool {PROTOCOL}; update {update}")
            }
            Self::Unknown => f.write_str("the request is not known to this firmware"),
            Self::Busy => f.write_str("a program runs, a coil is on or a servo moves; stop it first"),
            Self::NoUpload => f.write_str("no upload of this table has begun; start it again"),
            Self::TooLong { max } => {
                write!(f, "the table is longer than the {max} bytes of a slot")
            }
            Self::Damaged => f.write_str("the bytes that arrived are not the table; upload it again"),
            Self::Table(error) => error.fmt(f),
            Self::Command(error) => error.fmt(f),
            Self::Recovering { row, output, wait_ms } => write!(
                f,
                "row {row} would exceed the limit of output {output}, which has lately been on; play again in at most {} s",
                wait_ms.div_ceil(1000)
            ),
            Self::NobodyPresent => f.write_str(
                "hold the user button of the board, or set its jumper, less than 60 s before; one that is already closed must be opened first",
            ),
            Self::Profile(error) => error.fmt(f),
            Self::Storage => f.write_str("the flash could not be written; the old table is still there"),
            Self::NoFrames => {
                f.write_str("the table has no frames of modules; make it with darm table --nearest, upload it")
            }
            Self::NoCalibration => f.write_str("the zero offsets of the servos cannot be read; calibrate them again"),
            Self::Challenge { .. } => {
                f.write_str("another host connected or there was a stop at the same time; connect again")
            }
            Self::TooSoon { wait_ms } => write!(
                f,
                "each write wears the flash, and there were too many of late; repeat it in {} s",
                wait_ms.div_ceil(1000)
            ),
            Self::NoPose => f.write_str("the pose has a number that is none, or is larger than a kilometre"),
        }
    }
}

impl core::error::Error for Refusal {}

#[cfg(test)]
mod tests;
