//! What the dispatcher asks of the control tick, and what the tick answers.

use darm_core::output::{Coil, ServoWiring, SwitchLimit};
use darm_core::profile::Profile;
use darm_core::sequencer::{Command, CommandError, Phase};
use darm_core::table::Table;
use darm_core::units::{Micros, ModelHash, Word};
use darm_core::wire::message::{Calibration, OutputState};

/// What the dispatcher asks of the control tick.
pub enum Order<'t> {
    /// Do what a person or a host asks for.
    Command {
        /// What.
        command: Command,
        /// How many [stops](super::Shared::stops) there were when it was requested.
        stops: u32,
    },
    /// Report the present state.
    Status,
    /// Report what is loaded.
    Summary,
    /// Report how the coil of one output is wired.
    Coil(u8),
    /// Report how long one output has been on.
    Output(u8),
    /// Report how one servo joint is wired.
    Servo(u8),
    /// Take this table.
    Load(&'t mut Table),
    /// Give the table back.
    Unload,
    /// Give the table back, ready to rehearse its rows.
    Rehearse,
    /// Put this profile in force, once after a start.
    Configure(&'t Profile),
    /// Take the zero offsets of the servos.
    Calibrate(Calibration),
}

/// What the control tick answers to an [`Order`], variant by variant.
pub enum Outcome<'t> {
    /// To `Command` and `Calibrate`.
    Command(Result<(), CommandError>),
    /// To `Status`.
    Status(Snapshot),
    /// To `Summary`; `None` without a table.
    Summary(Option<Summary>),
    /// To `Coil`; `None` when it is not wired.
    Coil(Option<Coil>),
    /// To `Output`; `None` when the profile does not have it.
    Output(Option<OutputState>),
    /// To `Configure`.
    Configured,
    /// To `Servo`; `None` when it is not wired.
    Servo(Option<ServoWiring>),
    /// To `Load`: the table comes back when it cannot be taken now.
    Load(Option<&'t mut Table>),
    /// To `Unload` and `Rehearse`.
    Unload(Unloaded<'t>),
}

/// What became of the wish to have the table back.
pub enum Unloaded<'t> {
    /// Here it is.
    Table(&'t mut Table),
    /// There is none.
    Empty,
    /// A program runs or a coil is on by hand.
    Busy,
}

/// What the board does in one moment.
#[derive(Clone, Copy, Debug)]
pub struct Snapshot {
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
    /// Servo joints of the table; [`super::Shared::servo_seen`] says what their servos answer.
    pub n_servos: u8,
    /// Whether a person holds the board's button: it was open since the start, and was closed less than a minute ago.
    pub button: bool,
    /// Whether a servo is on its way to a target.
    pub is_moving: bool,
    /// Whether a servo that was on its way may not have its order to hold yet.
    pub is_stopping: bool,
    /// Latest start of a tick so far, after its time.
    pub worst_lateness: Micros,
}

/// A loaded table in numbers.
#[derive(Clone, Copy, Debug)]
pub struct Summary {
    /// The model that it was made with.
    pub model: ModelHash,
    /// Rows.
    pub rows: u16,
    /// When the program ends.
    pub end: Micros,
    /// Discrete actuators.
    pub actuators: u8,
    /// Coils.
    pub coils: u8,
    /// Servo joints.
    pub servos: u8,
    /// What the supply can feed.
    pub switch_limit: SwitchLimit,
}

pub(super) fn summary(table: &Table) -> Option<Summary> {
    let wiring = table.wiring();
    Some(Summary {
        model: table.model(),
        rows: table.rows().len() as u16,
        end: table.end()?,
        actuators: wiring.actuators.len() as u8,
        coils: wiring.coils.len() as u8,
        servos: wiring.servos.len() as u8,
        switch_limit: wiring.switch_limit,
    })
}
