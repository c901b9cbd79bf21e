//! The board profile that follows from findings.

use std::collections::BTreeMap;

use darm_core::output::Drive;
use darm_core::profile::{EmergencyStop, Profile};

use super::finding::Finding;
use super::kind::Kind;
use super::subject::Subject;

/// A profile with what can be corrected in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Correction {
    /// The profile; its digest is that of the old one.
    pub profile: Profile,
    /// What was changed, in words.
    pub changes: Vec<String>,
}

/// Exchanges lines and inputs as the findings say. What only a soldering iron can correct, and a change that would use a line
/// or an input twice, is not made.
pub fn correct(profile: &Profile, subject: &Subject, findings: &[Finding]) -> Correction {
    let mut correction = Correction { profile: profile.clone(), changes: Vec::new() };
    let steps = [correct_outputs, correct_inputs, correct_emergency_stop];
    for step in steps {
        let corrected = step(&correction, subject, findings);
        if corrected.profile.check().is_ok() {
            correction = corrected;
        }
    }
    correction
}

/// The drives of exchanged outputs: each output gets the lines that were seen to move its actuator.
fn correct_outputs(correction: &Correction, subject: &Subject, findings: &[Finding]) -> Correction {
    let old = &correction.profile;
    let drive = |number: u8| old.output(number).map(|output| output.drive);
    let mut drives: BTreeMap<u8, Drive> = BTreeMap::new();
    for finding in findings {
        let moved = exchanges(&finding.kind, subject);
        let of = |(to, from): (u8, u8)| Some((to, drive(from)?, drive(to)?));
        let alike = |(to, from, own): (u8, Drive, Drive)| is_alike(&from, &own).then_some((to, from));
        drives.extend(moved.into_iter().filter_map(of).filter_map(alike));
        if let Kind::LatchReversed { output } = finding.kind
            && let Some(Drive::Latch { set, reset, pulse_ms }) = drive(output)
        {
            drives.insert(output, Drive::Latch { set: reset, reset: set, pulse_ms });
        }
    }
    let mut corrected = correction.clone();
    for (number, drive) in drives {
        if let Some(Some(output)) = corrected.profile.outputs.get_mut(usize::from(number)) {
            corrected.changes.push(format!("output {number}: {} instead of {}", drive, output.drive));
            output.drive = drive;
        }
    }
    corrected
}

/// Outputs that get the lines of others: (output, the other).
fn exchanges(kind: &Kind, subject: &Subject) -> Vec<(u8, u8)> {
    match kind {
        Kind::OutputsSwapped { outputs: [first, second] } => vec![(*first, *second), (*second, *first)],
        Kind::MovesOther { output, actuator } => {
            subject.only_output(*actuator).map(|to| (to, *output)).into_iter().collect()
        }
        Kind::CoilsSwapped { actuator } => {
            let own: Vec<u8> =
                subject.places().filter(|place| place.actuator == *actuator).map(|place| place.coil.output).collect();
            own.iter().copied().zip(own.iter().rev().copied()).collect()
        }
        _ => Vec::new(),
    }
}

/// Lines of another kind of drive cannot take its place.
fn is_alike(first: &Drive, second: &Drive) -> bool {
    std::mem::discriminant(first) == std::mem::discriminant(second)
}

/// The inputs of exchanged switches.
fn correct_inputs(correction: &Correction, subject: &Subject, findings: &[Finding]) -> Correction {
    let input_of = |actuator: usize| subject.wiring.actuators.get(actuator)?.switch.map(|switch| switch.input);
    let moved = findings.iter().flat_map(|finding| match finding.kind {
        Kind::SwitchElsewhere { actuator, input } => vec![(actuator, Some(input))],
        Kind::SwitchesSwapped { actuators: [first, second] } => {
            vec![(first, input_of(second)), (second, input_of(first))]
        }
        _ => Vec::new(),
    });
    let mut corrected = correction.clone();
    for (actuator, input) in moved {
        let output = subject.first_output(actuator);
        if let (Some(number), Some(input)) = (output, input) {
            set_input(&mut corrected, number, input);
        }
    }
    corrected
}

fn set_input(corrected: &mut Correction, number: u8, input: u8) {
    if let Some(Some(output)) = corrected.profile.outputs.get_mut(usize::from(number)) {
        let old = output.input.map_or_else(String::new, |old| format!(" instead of {old}"));
        corrected.changes.push(format!("output {number}: input {input}{old}"));
        output.input = Some(input);
    }
}

fn correct_emergency_stop(correction: &Correction, subject: &Subject, findings: &[Finding]) -> Correction {
    let swapped = findings.iter().find_map(|finding| match finding.kind {
        Kind::StopSwapped { input, with } => Some((input, with)),
        _ => None,
    });
    let mut corrected = correction.clone();
    let Some((stop, (input, with))) = corrected.profile.emergency_stop.zip(swapped) else { return corrected };
    corrected.profile.emergency_stop = Some(EmergencyStop { input: with, ..stop });
    corrected.changes.push(format!("emergency stop: input {with} instead of {input}"));
    if let Some(number) = subject.actuator_at(with).and_then(|actuator| subject.first_output(actuator)) {
        set_input(&mut corrected, number, input);
    }
    corrected
}
