//! Why the server or the board does not do what a page asks: a sentence, and the place that caused it.

use darm_arm::table_file::TableFileError;
use darm_core::output::{CoilLimit, Wiring};
use darm_core::sequencer::{CommandError, FaultKind};
use darm_core::table::{RowError, TableError};
use darm_core::wire::message::Refusal;
use darm_device::client::ClientError;
use serde::Serialize;

use crate::access::Denied;
use crate::control::ControlError;

/// Which kind of reason it is: pages decide by it, never by the sentence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Kind {
    /// The request is from elsewhere, or its token is wrong.
    Denied,
    /// The page does not control the arm.
    Control,
    /// A stop came between the request and its execution; nothing was sent.
    Stopped,
    /// The board, or the check of the table, refuses it.
    Refused,
    /// What was sent cannot be read.
    Invalid,
    /// The board was not reached, or its answer was lost.
    Link,
    /// The server has no memory left for the answer.
    Busy,
}

/// Where the cause is, as far as there is one place.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Place {
    /// Index of the visit, of a table that is being made.
    pub visit: Option<usize>,
    /// Index of the row; the number of rows for the end of the program.
    pub row: Option<u16>,
    /// Number of the output.
    pub output: Option<u8>,
    /// Number of the actuator.
    pub actuator: Option<u8>,
    /// Index of the servo.
    pub servo: Option<u8>,
    /// The limit of the output.
    pub limit: Option<Limit>,
}

/// The limit of an output.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Limit {
    /// Longest time on without a pause, s.
    pub max_on_s: f64,
    /// Largest share of the window, in percent.
    pub duty_percent: u8,
    /// Length of the window, s.
    pub window_s: f64,
}

impl From<CoilLimit> for Limit {
    fn from(limit: CoilLimit) -> Self {
        let [max_on_s, window_s] = [limit.max_on_ms, limit.window_ms].map(|ms| 1e-3 * f64::from(ms));
        Self { max_on_s, duty_percent: limit.duty_percent, window_s }
    }
}

/// Why something was not done.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Refused {
    /// Which kind of reason.
    pub kind: Kind,
    /// The reason in a sentence, for people.
    pub text: String,
    /// Where the cause is.
    #[serde(flatten)]
    pub place: Place,
}

impl Refused {
    /// A reason without a place.
    pub(crate) fn new(kind: Kind, text: impl ToString) -> Self {
        Self { kind, text: text.to_string(), place: Place::default() }
    }

    /// The refusal with the limits of the output that it names.
    #[must_use]
    pub(crate) fn with_limit_of(mut self, wiring: &Wiring) -> Self {
        let coil = |output| wiring.coils.iter().find(|coil| coil.output == output);
        self.place.limit = self.place.output.and_then(coil).map(|coil| coil.limit.into());
        self
    }
}

impl From<ClientError> for Refused {
    fn from(error: ClientError) -> Self {
        let (kind, place) = match &error {
            ClientError::Transport(_) | ClientError::Frame(_) => (Kind::Link, Place::default()),
            ClientError::Refused(Refusal::Command(CommandError::Stopped)) => (Kind::Stopped, Place::default()),
            ClientError::Refused(refusal) => (Kind::Refused, of_refusal(refusal)),
            ClientError::Denied(_) => (Kind::Control, Place::default()),
            ClientError::NoReboot(_) => (Kind::Refused, Place::default()),
        };
        Self { kind, text: error.to_string(), place }
    }
}

impl From<TableFileError> for Refused {
    fn from(error: TableFileError) -> Self {
        match &error {
            TableFileError::Refused { source, .. } => {
                Self { kind: Kind::Refused, text: source.to_string(), place: of_table(source) }
            }
            TableFileError::OtherDevice { .. } | TableFileError::OtherProfile { .. } => Self::new(Kind::Refused, error),
            _ => Self::new(Kind::Invalid, error),
        }
    }
}

impl From<ControlError> for Refused {
    fn from(error: ControlError) -> Self {
        Self::new(Kind::Control, error)
    }
}

impl From<Denied> for Refused {
    fn from(error: Denied) -> Self {
        Self::new(Kind::Denied, error)
    }
}

fn of_refusal(refusal: &Refusal) -> Place {
    match refusal {
        Refusal::Table(error) => of_table(error),
        Refusal::Command(CommandError::Recovering { output, .. }) => {
            Place { output: Some(*output), ..Place::default() }
        }
        Refusal::Command(CommandError::ServoSilent { servo }) => Place { servo: Some(*servo), ..Place::default() },
        Refusal::Recovering { row, output, .. } => Place { row: Some(*row), output: Some(*output), ..Place::default() },
        _ => Place::default(),
    }
}

fn of_table(error: &TableError) -> Place {
    match error {
        TableError::Row { row, error } => Place { row: Some(*row), ..of_row(error) },
        _ => Place::default(),
    }
}

fn of_row(error: &RowError) -> Place {
    match *error {
        RowError::Servo { servo } | RowError::ServoSpeed { servo } => Place { servo: Some(servo), ..Place::default() },
        RowError::OnTooLong { output } | RowError::Duty { output } => {
            Place { output: Some(output), ..Place::default() }
        }
        RowError::Travel { actuator } => Place { actuator: Some(actuator.0), ..Place::default() },
        RowError::Time | RowError::Word | RowError::TooManyCoils => Place::default(),
    }
}

/// Where a fault was.
pub(crate) fn of_fault(fault: &FaultKind) -> Place {
    match *fault {
        FaultKind::OnTooLong { output } | FaultKind::Duty { output } => {
            Place { output: Some(output), ..Place::default() }
        }
        FaultKind::Switch { actuator, .. } => Place { actuator: Some(actuator.0), ..Place::default() },
        FaultKind::ServoStalled { servo }
        | FaultKind::ServoSilent { servo }
        | FaultKind::ServoError { servo, .. }
        | FaultKind::ServoTorque { servo, .. }
        | FaultKind::ServoRange { servo, .. }
        | FaultKind::ServoSpeed { servo }
        | FaultKind::ServoMoved { servo } => Place { servo: Some(servo), ..Place::default() },
        FaultKind::TooManyCoils
        | FaultKind::EmergencyStop
        | FaultKind::Chain
        | FaultKind::OutputEnable
        | FaultKind::OutputEnableHigh
        | FaultKind::FarEnd { .. }
        | FaultKind::Supply { .. } => Place::default(),
    }
}

#[cfg(test)]
mod tests {
    use darm_core::table::{RowError, TableError};
    use darm_core::wire::message::Refusal;
    use darm_device::client::ClientError;

    use super::{Kind, Refused};

    #[test]
    fn a_refusal_names_its_row_and_output() {
        let error = TableError::Row { row: 3, error: RowError::Duty { output: 7 } };
        let refused = Refused::from(ClientError::Refused(Refusal::Table(error)));
        assert_eq!((refused.kind, refused.place.row, refused.place.output), (Kind::Refused, Some(3), Some(7)));
        let recovering = Refusal::Recovering { row: 1, output: 2, wait_ms: 100 };
        let refused = Refused::from(ClientError::Refused(recovering));
        assert_eq!((refused.place.row, refused.place.output), (Some(1), Some(2)));
    }
}
