//! Findings of single outputs that have one cause.

use super::kind::Kind;
use super::subject::Subject;

/// The same findings, with those that belong together as one.
pub(super) fn merged(subject: &Subject, kinds: Vec<Kind>) -> Vec<Kind> {
    let mut merged: Vec<Kind> = Vec::new();
    for kind in &kinds {
        let kind = merge(subject, kind, &kinds);
        if let Some(kind) = kind.filter(|kind| !merged.contains(kind)) {
            merged.push(kind);
        }
    }
    merged
}

/// What becomes of one finding next to the others; `None` where another one explains it.
fn merge(subject: &Subject, kind: &Kind, all: &[Kind]) -> Option<Kind> {
    match kind {
        Kind::MovesOther { output, actuator } => Some(outputs_swapped(subject, *output, *actuator, all)),
        Kind::SwitchElsewhere { actuator, input } => Some(switches_swapped(subject, *actuator, *input, all)),
        Kind::MovesSeveral { actuators, .. } => Some(joined(kind, actuators, all)),
        Kind::NoMotion { output } if is_explained(subject, *output, all) => None,
        kind => Some(kind.clone()),
    }
}

fn outputs_swapped(subject: &Subject, output: u8, actuator: usize, all: &[Kind]) -> Kind {
    let other = subject.only_output(actuator);
    let own = subject.place(output).map(|place| place.actuator);
    let back = other.zip(own).map(|(other, own)| Kind::MovesOther { output: other, actuator: own });
    match other.filter(|_| back.is_some_and(|back| all.contains(&back))) {
        Some(other) => Kind::OutputsSwapped { outputs: [output.min(other), output.max(other)] },
        None => Kind::MovesOther { output, actuator },
    }
}

fn switches_swapped(subject: &Subject, actuator: usize, input: u8, all: &[Kind]) -> Kind {
    let own = subject.wiring.actuators.get(actuator).and_then(|wiring| wiring.switch).map(|switch| switch.input);
    let other = subject.actuator_at(input);
    let back = other.zip(own).map(|(other, own)| Kind::SwitchElsewhere { actuator: other, input: own });
    match other.filter(|_| back.is_some_and(|back| all.contains(&back))) {
        Some(other) => Kind::SwitchesSwapped { actuators: [actuator.min(other), actuator.max(other)] },
        None => Kind::SwitchElsewhere { actuator, input },
    }
}

/// Several outputs that each move the same actuators.
fn joined(kind: &Kind, actuators: &[usize], all: &[Kind]) -> Kind {
    let same = all.iter().filter_map(|other| match other {
        Kind::MovesSeveral { output, actuators: moved } if moved == actuators => Some(*output),
        _ => None,
    });
    let outputs: Vec<u8> = same.collect();
    if outputs.len() > 1 { Kind::OutputsJoined { outputs } } else { kind.clone() }
}

/// Whether another output moves the actuator of this one together with others: this one's wire is there.
fn is_explained(subject: &Subject, output: u8, all: &[Kind]) -> bool {
    let own = subject.place(output).map(|place| place.actuator);
    all.iter().any(|other| match other {
        Kind::MovesSeveral { actuators, .. } => own.is_some_and(|own| actuators.contains(&own)),
        _ => false,
    })
}
