//! One stroke against what the files say of its output.

use darm_core::output::{Drive, LimitSwitch};

use super::kind::Kind;
use super::stroke::{Edge, Stroke, inputs_of};
use super::subject::{Place, Subject};

/// A contact that changes more often than this within one half of a stroke is loose: the samples are too far apart to see a
/// contact bounce.
const MAX_CHANGES: usize = 3;

/// A stroke and the coil that it was of.
pub(super) struct Response<'a> {
    pub(super) stroke: &'a Stroke,
    pub(super) place: Place,
    /// Inputs of switches that had another level while the output was on.
    pub(super) changed: Vec<u8>,
    /// Inputs that switches can be at.
    inputs: u32,
}

impl<'a> Response<'a> {
    /// `None` where the arm does not have the output.
    pub(super) fn new(subject: &Subject, stroke: &'a Stroke) -> Option<Self> {
        let inputs = subject.switch_inputs();
        let changed = inputs_of((stroke.at_rest() ^ stroke.when_on()) & inputs);
        Some(Self { stroke, place: subject.place(stroke.output)?, changed, inputs })
    }

    /// Actuators that a person saw move.
    pub(super) fn moved(&self) -> Option<&[usize]> {
        self.stroke.sight.as_ref().map(|sight| sight.moved.as_slice())
    }

    /// Whether no input of a switch changed at any time.
    pub(super) fn is_silent(&self) -> bool {
        self.stroke.samples.iter().all(|sample| (sample.inputs ^ self.stroke.at_rest()) & self.inputs == 0)
    }

    /// What is wrong with it, if something is.
    pub(super) fn kind(&self) -> Option<Kind> {
        let Place { actuator, coil, .. } = self.place;
        if let Some(input) = self.loose_input() {
            return Some(Kind::LooseContact { input });
        }
        match self.moved() {
            None => self.unwatched(),
            Some([]) if self.changed.is_empty() => Some(self.without_motion()),
            Some([]) => self.unwatched(),
            Some(&[own]) if own == actuator => self.of_own_motion(),
            Some(&[other]) => Some(Kind::MovesOther { output: coil.output, actuator: other }),
            Some(several) => Some(Kind::MovesSeveral { output: coil.output, actuators: several.to_vec() }),
        }
    }

    fn loose_input(&self) -> Option<u8> {
        let halves = [self.stroke.on_edges(), self.stroke.off_edges()];
        let count = |edges: &[Edge], input| edges.iter().filter(|edge| edge.input == input).count();
        inputs_of(u32::MAX).into_iter().find(|&input| halves.iter().any(|edges| count(edges, input) > MAX_CHANGES))
    }

    /// A person saw nothing move, and no input changed.
    fn without_motion(&self) -> Kind {
        let output = self.place.coil.output;
        match self.place.expected() {
            Some((switch, [_, on])) if self.level(&switch) == on => Kind::AlwaysOn { output },
            _ => Kind::NoMotion { output },
        }
    }

    /// A person saw the right actuator move.
    fn of_own_motion(&self) -> Option<Kind> {
        let Place { actuator, coil, .. } = self.place;
        let Some((switch, closed)) = self.place.expected() else {
            let (output, inputs) = (coil.output, self.changed.clone());
            return (!inputs.is_empty()).then_some(Kind::OutputOrSwitch { output, inputs });
        };
        match self.changed.as_slice() {
            [] => Some(self.by_course(&switch).unwrap_or(Kind::SwitchStuck { actuator, closed: self.level(&switch) })),
            &[input] if input == switch.input => self.of_own_switch(&switch, closed),
            &[input] => Some(Kind::SwitchElsewhere { actuator, input }),
            several => Some(Kind::InputsJoined { inputs: several.to_vec() }),
        }
    }

    /// Nobody looked: what the inputs alone show.
    fn unwatched(&self) -> Option<Kind> {
        let (output, inputs) = (self.place.coil.output, self.changed.clone());
        match (self.place.expected(), self.changed.as_slice()) {
            (None, []) => None,
            (Some((switch, _)), []) => {
                let unknown = Kind::NoResponse { output, closed: self.level(&switch) };
                Some(self.by_course(&switch).unwrap_or(unknown))
            }
            (Some((switch, closed)), &[input]) if input == switch.input => self.of_own_switch(&switch, closed),
            _ => Some(Kind::OutputOrSwitch { output, inputs }),
        }
    }

    /// The switch has the same level before and at the end of the time in which the output was on: what it did in between
    /// and afterwards.
    fn by_course(&self, switch: &LimitSwitch) -> Option<Kind> {
        let Place { coil, .. } = self.place;
        let changes = self.stroke.on_edges().iter().filter(|edge| edge.input == switch.input).count();
        let is_moved_at_end = (self.stroke.at_end() ^ self.stroke.at_rest()) >> switch.input & 1 == 1;
        match coil.drive {
            Drive::PeakHold { .. } if changes > 1 => Some(Kind::DropsOut { output: coil.output }),
            Drive::Latch { .. } if is_moved_at_end => Some(Kind::LatchReversed { output: coil.output }),
            Drive::Hold { .. } | Drive::PeakHold { .. } | Drive::Latch { .. } => None,
        }
    }

    /// Its switch alone has changed: as it should?
    fn of_own_switch(&self, switch: &LimitSwitch, closed: [bool; 2]) -> Option<Kind> {
        let Place { actuator, coil, .. } = self.place;
        let output = coil.output;
        if self.level(switch) != closed[0] {
            let in_state = self.stroke.sight.as_ref().and_then(|sight| sight.in_state);
            return Some(match (in_state, coil.drive) {
                (Some(true), _) => Kind::SwitchInverted { actuator },
                (Some(false), Drive::Latch { .. }) => Kind::LatchReversed { output },
                (Some(false), Drive::Hold { .. } | Drive::PeakHold { .. }) => Kind::DriveInverted { output },
                (None, _) => Kind::Inverted { output },
            });
        }
        let is_back = self.stroke.at_end() >> switch.input & 1 == self.stroke.at_rest() >> switch.input & 1;
        (!is_back).then_some(Kind::NotReturning { output })
    }

    /// Whether the switch is closed before the output is on.
    fn level(&self, switch: &LimitSwitch) -> bool {
        self.stroke.at_rest() >> switch.input & 1 == 1
    }
}
