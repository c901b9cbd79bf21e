//! What the dispatcher asks of the control tick, and what the tick answers.

use darm_core::output::{Coil, ServoWiring, SwitchLimit};
use darm_core::profile::Profile;
use darm_core::sequencer::{Command, CommandError, Phase};
use darm_core::table::Table;
use darm_core::units::{Micros, ModelHash, Word};
use darm_core::wire::message::{Calibration, OutputState};

use super::{Control, Shared};

/// Makes of each order a method of [`Shared`] that asks it and waits for its answer, and of its body what the control tick does. One task
/// only may ask.
macro_rules! orders {
    (|$control:ident, $shared:ident| $(
        $(#[$doc:meta])*
        $name:ident($($value:ident: $type:ty),*) -> $answer:ty $body:block
    )*) => {
        /// An order on its way to the control tick.
        #[expect(non_camel_case_types, reason = "named as the methods")]
        pub(super) enum Order<'t> { $($name($($type),*)),* }

        /// The answer to the order of the same name.
        #[expect(non_camel_case_types, reason = "named as the methods")]
        pub(super) enum Outcome<'t> { $($name($answer)),* }

        impl<'t> Shared<'t> {
            $(
                $(#[$doc])*
                pub(crate) async fn $name(&self, $($value: $type),*) -> $answer {
                    // The control tick has taken the last order before it answered, so there is room, and the next outcome is this one's.
                    let _ = self.orders.put(Order::$name($($value),*));
                    loop {
                        if let Outcome::$name(answer) = self.outcomes.next().await {
                            return answer;
                        }
                    }
                }
            )*
        }

        impl<'t> Control<'t> {
            pub(super) fn execute(&mut self, order: Order<'t>, $shared: &Shared<'t>) -> Outcome<'t> {
                let $control = self;
                match order {
                    $(Order::$name($($value),*) => Outcome::$name($body)),*
                }
            }
        }
    };
}

orders! { |control, shared|
    /// Does what a person or a host asks for; refused after a stop that came since. `stops`: [their number](Shared::stops) when it was asked.
    command(command: Command, stops: u32) -> Result<(), CommandError> {
        shared.check_stops(stops).and_then(|()| control.sequencer.command(command))
    }

    /// What the board does now.
    snapshot() -> Snapshot {
        control.snapshot()
    }

    /// What is loaded; `None` without a table.
    summary() -> Option<Summary> {
        control.sequencer.table().and_then(summary)
    }

    /// How the coil of one output is wired, if it is.
    coil_wiring(output: u8) -> Option<Coil> {
        control.sequencer.table().and_then(|table| table.wiring().coil(output)).copied()
    }

    /// How long one output has been on, if the profile has it.
    output_state(number: u8) -> Option<OutputState> {
        control.output_state(number)
    }

    /// How one servo joint is wired, if it is.
    servo_wiring(index: u8) -> Option<ServoWiring> {
        control.sequencer.table().and_then(|table| table.wiring().servos.get(usize::from(index))).copied()
    }

    /// Takes this table. It comes back when it cannot be taken now.
    load(table: &'t mut Table) -> Option<&'t mut Table> {
        control.sequencer.load(table).err()
    }

    /// Gives the table back; `None` where there is none, and while a program runs or a coil is on by hand.
    unload() -> Option<&'t mut Table> {
        control.sequencer.unload()
    }

    /// Gives the table back as [`unload`](Shared::unload), ready to rehearse its rows.
    rehearse() -> Option<&'t mut Table> {
        let mut unloaded = control.sequencer.unload();
        if let Some(table) = &mut unloaded {
            table.recall(control.sequencer.used());
        }
        unloaded
    }

    /// Puts this profile in force, once after a start.
    configure(profile: &'t Profile) -> () {
        control.sequencer.configure(profile);
        control.has_limits = false;
    }

    /// Takes the zero offsets of the servos.
    calibrate(calibration: Calibration) -> Result<(), CommandError> {
        control.sequencer.calibrate(calibration.offsets_rad())
    }
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
