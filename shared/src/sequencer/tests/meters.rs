//! What the meters of the outputs keep over tables, power-up and resets.

extern crate std;
use std::boxed::Box;

use super::{MS, end, limit_of, profile, rest, row, start, table, take_over, two_valves, word};
use crate::duty::DutyMeters;
use crate::output::{ActuatorWiring, Coil, CoilLimit, Drive};
use crate::profile::Profile;
use crate::sequencer::{Command, CommandError, Seen, Sequencer};
use crate::table::Record;
use crate::units::{Digest, Micros};

/// Two tables for the same two outputs, the second with the actuators swapped.
#[test]
fn an_output_has_its_limit_whatever_table_drives_it() {
    let limit = CoilLimit { max_on_ms: 50_000, duty_percent: 50, window_ms: 100_000 };
    let coil = |output| Record::Coil(Coil { output, drive: Drive::Hold { line: output }, limit });
    let actuator = Record::Actuator(ActuatorWiring { states: 2, switch: None, travel_ms: 10 });
    let valves =
        |outputs: [u8; 2]| [start(), coil(outputs[0]), coil(outputs[1]), actuator.clone(), actuator.clone(), end(10)];
    let profile = profile(&valves([0, 1]));
    let profile = Box::leak(Box::new(profile));
    let mut sequencer = Sequencer::new(Box::leak(Box::default()));
    let (mut now, mut on_ms) = (Micros(0), 0);
    sequencer.configure(profile);
    rest(&mut sequencer, &mut now, 200);
    for (outputs, digits) in [([0, 1], "10"), ([1, 0], "01")] {
        let _ = sequencer.unload();
        sequencer.load(table(&valves(outputs), profile)).expect("nothing runs");
        let _ = sequencer.command(Command::Word(word(digits)));
        for _ in 0..45_000 {
            now = now + Micros(MS);
            on_ms += (sequencer.step(now, &Seen::default()).lines & 1) as u32;
        }
        let _ = sequencer.command(Command::Stop);
        sequencer.step(now, &Seen::default());
    }
    assert!(on_ms <= 50_000, "line 0 may be on for 50 of 100 s, it was on for {on_ms} ms");
}

#[test]
fn after_power_up_outputs_recover_with_time() {
    let records = two_valves(&[end(10)]);
    let profile = Box::leak(Box::new(profile(&records)));
    let mut sequencer = Sequencer::new(Box::leak(Box::default()));
    let mut now = Micros(0);
    sequencer.configure(profile);
    sequencer.load(table(&records, profile)).expect("a new sequencer is idle");
    let on = Command::Coil { coil: 0, on_ms: 20 };
    let refused = sequencer.command(on);
    assert_eq!(refused, Err(CommandError::Recovering { output: 0, left_ms: 0, wait_ms: 1600 }));
    rest(&mut sequencer, &mut now, 2);
    assert_eq!(sequencer.command(on), Ok(()));
}

#[test]
fn a_reset_forgets_no_current() {
    let records = two_valves(&[end(10)]);
    let profile = profile(&records);
    let profile: &'static Profile = Box::leak(Box::new(profile));
    let mut used = DutyMeters::default();
    let left = |used: &DutyMeters| used.meters[0].left_us(&limit_of(profile));
    let before = {
        let memory: &'static mut DutyMeters = Box::leak(Box::new(used.clone()));
        let mut sequencer = Sequencer::new(memory);
        let mut now = Micros(0);
        sequencer.configure(profile);
        rest(&mut sequencer, &mut now, 5);
        sequencer.load(table(&records, profile)).expect("idle");
        sequencer.command(Command::Coil { coil: 0, on_ms: 9 }).unwrap();
        for _ in 0..12 {
            now = now + Micros(MS);
            sequencer.step(now, &Seen::default());
        }
        used = sequencer.used().clone();
        left(&used)
    };
    assert_eq!(before, 960_000 - 9_000);
    let mut sequencer = Sequencer::new(Box::leak(Box::new(used)));
    sequencer.configure(profile);
    take_over(&mut sequencer);
    assert_eq!(left(sequencer.used()), before);
    let other = Box::leak(Box::new(Profile { digest: Digest([4; 32]), ..profile.clone() }));
    let mut sequencer = Sequencer::new(Box::leak(Box::new(sequencer.used().clone())));
    sequencer.configure(other);
    take_over(&mut sequencer);
    assert_eq!(left(sequencer.used()), 0, "what another profile's meters counted says nothing");
}

#[test]
fn a_program_is_rehearsed_after_what_has_flowed() {
    let records = two_valves(&[row(0, "10"), row(90, "00"), end(100)]);
    let profile = profile(&records);
    let table = table(&records, &profile);
    let mut used = DutyMeters::default();
    let limit = &limit_of(&profile);
    for meter in &mut used.meters {
        let _ = meter.pass(Micros(1), false, limit);
    }
    table.recall(&used);
    assert_eq!(table.rehearse(0..2), Ok(()));
    used.meters[0].exhaust(limit);
    table.recall(&used);
    assert!(table.rehearse(0..2).is_err());
}
