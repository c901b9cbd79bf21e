//! What a bring-up can find.

/// What is wrong. Actuators count from the base; outputs, inputs and lines are numbered as in the profile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A person saw nothing move at any output.
    NothingMoves,
    /// No input changed at any output, and nobody looked.
    NothingResponds,
    /// Actuators move, and no switch ever closes.
    NoSwitchCloses,
    /// An output moves nothing.
    NoMotion {
        /// The output.
        output: u8,
    },
    /// Neither motion nor a change of the switch is known of: nobody looked.
    NoResponse {
        /// The output.
        output: u8,
        /// Level of the switch all the time.
        closed: bool,
    },
    /// The actuator is in the state of its coil while the output is off, and nothing moves.
    AlwaysOn {
        /// The output.
        output: u8,
    },
    /// An output moves another actuator.
    MovesOther {
        /// The output.
        output: u8,
        /// The actuator that moves.
        actuator: usize,
    },
    /// Two outputs are exchanged.
    OutputsSwapped {
        /// The outputs.
        outputs: [u8; 2],
    },
    /// An output moves several actuators, and their other outputs nothing.
    MovesSeveral {
        /// The output.
        output: u8,
        /// The actuators that move.
        actuators: Vec<usize>,
    },
    /// Several outputs each move the same actuators.
    OutputsJoined {
        /// The outputs.
        outputs: Vec<u8>,
    },
    /// The two coils of one actuator are exchanged.
    CoilsSwapped {
        /// The actuator.
        actuator: usize,
    },
    /// The switch of an actuator is at another input.
    SwitchElsewhere {
        /// The actuator.
        actuator: usize,
        /// The input that changes.
        input: u8,
    },
    /// The switches of two actuators are exchanged.
    SwitchesSwapped {
        /// The actuators.
        actuators: [usize; 2],
    },
    /// The actuator moves and its switch does not change.
    SwitchStuck {
        /// The actuator.
        actuator: usize,
        /// Level of the switch all the time.
        closed: bool,
    },
    /// The switch is closed where it should be open.
    SwitchInverted {
        /// The actuator.
        actuator: usize,
    },
    /// A switch changes several inputs.
    InputsJoined {
        /// The inputs.
        inputs: Vec<u8>,
    },
    /// An input changes again and again.
    LooseContact {
        /// The input.
        input: u8,
    },
    /// The coil carries current while the line is low.
    DriveInverted {
        /// The output.
        output: u8,
    },
    /// The coils that set and reset a latch are exchanged.
    LatchReversed {
        /// The output.
        output: u8,
    },
    /// The switch shows the opposite: the switch or the drive is inverted, and nobody looked.
    Inverted {
        /// The output.
        output: u8,
    },
    /// The output or the switch is exchanged: nobody looked.
    OutputOrSwitch {
        /// The output.
        output: u8,
        /// The inputs that change.
        inputs: Vec<u8>,
    },
    /// The actuator falls back while the holding current flows.
    DropsOut {
        /// The output.
        output: u8,
    },
    /// The actuator does not come back when the output is switched off.
    NotReturning {
        /// The output.
        output: u8,
    },
    /// The actuator moves, later than the arm file says.
    Slow {
        /// The actuator.
        actuator: usize,
        /// The least that the stroke took, ms.
        took_ms: u32,
    },
    /// The emergency stop is pressed, its wire is broken or its contact is of the other kind.
    StopPressed {
        /// Its input.
        input: u8,
    },
    /// The emergency stop and a switch are exchanged.
    StopSwapped {
        /// Input of the emergency stop.
        input: u8,
        /// The input that is closed instead.
        with: u8,
    },
    /// A person pressed the emergency stop, and its input did not change.
    StopDead {
        /// Its input.
        input: u8,
    },
}

impl Kind {
    /// Its name in the documentation and in JSON.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::NothingMoves => "nothing-moves",
            Self::NothingResponds => "nothing-responds",
            Self::NoSwitchCloses => "no-switch-closes",
            Self::NoMotion { .. } => "no-motion",
            Self::NoResponse { .. } => "no-response",
            Self::AlwaysOn { .. } => "always-on",
            Self::MovesOther { .. } => "moves-other",
            Self::OutputsSwapped { .. } => "outputs-swapped",
            Self::MovesSeveral { .. } => "moves-several",
            Self::OutputsJoined { .. } => "outputs-joined",
            Self::CoilsSwapped { .. } => "coils-swapped",
            Self::SwitchElsewhere { .. } => "switch-elsewhere",
            Self::SwitchesSwapped { .. } => "switches-swapped",
            Self::SwitchStuck { closed: false, .. } => "switch-open",
            Self::SwitchStuck { closed: true, .. } => "switch-closed",
            Self::SwitchInverted { .. } => "switch-inverted",
            Self::InputsJoined { .. } => "inputs-joined",
            Self::LooseContact { .. } => "loose-contact",
            Self::DriveInverted { .. } => "drive-inverted",
            Self::LatchReversed { .. } => "latch-reversed",
            Self::Inverted { .. } => "inverted",
            Self::OutputOrSwitch { .. } => "output-or-switch",
            Self::DropsOut { .. } => "drops-out",
            Self::NotReturning { .. } => "not-returning",
            Self::Slow { .. } => "slow",
            Self::StopPressed { .. } => "stop-pressed",
            Self::StopSwapped { .. } => "stop-swapped",
            Self::StopDead { .. } => "stop-dead",
        }
    }
}
