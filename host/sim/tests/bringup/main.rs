//! Bring-up of a simulated arm, end to end over the wire: wired as its files say, and with each of a list of mistakes.

mod mistakes;
mod person;

use darm_arm::board_profile::BoardProfile;
use darm_core::output::{ActuatorWiring, Coil, Drive, LimitSwitch, SwitchLimit, Wiring};
use darm_core::profile::{EmergencyStop, Profile};

use darm_device::bringup::{BringupError, Consent, Kind, Outcome, Subject, correct, run, travel_ms};
use darm_device::client::{Client, ClientError};
use darm_sim::in_process::{InProcess, MemoryFlash};
use darm_sim::plant::{Broken, Plant};
use mistakes::{MISTAKES, Mistake};
use person::Person;

/// Input of the emergency stop; its contact opens when it is pressed.
const STOP: u8 = 6;
/// Time of travel in the files; the simulated actuators need a quarter of it.
const TRAVEL_MS: u16 = 100;

/// Three valves, a solenoid with a holding current, a latch, and a joint with three states.
fn wiring() -> Wiring {
    let mut wiring = Wiring { switch_limit: SwitchLimit { new_coils: 2, window_ms: 10 }, ..Wiring::default() };
    let hold = |line| Drive::Hold { line };
    let arm: [(&[Drive], u8); 6] = [
        (&[hold(0)], 0b10),
        (&[hold(1)], 0b10),
        (&[hold(2)], 0b01),
        (&[Drive::PeakHold { pull: 3, hold: 4, peak_ms: 100 }], 0b10),
        (&[Drive::Latch { set: 5, reset: 6, pulse_ms: 20 }], 0b10),
        (&[hold(7), hold(8)], 0b10),
    ];
    for (input, (drives, closed_in)) in (0..).zip(arm) {
        for &drive in drives {
            let mut limit = drive.default_limit();
            limit.duty_percent = 100;
            wiring.coils.push(Coil { output: wiring.coils.len() as u8, drive, limit }).unwrap();
        }
        let (states, switch) = (drives.len() as u8 + 1, Some(LimitSwitch { input, closed_in }));
        wiring.actuators.push(ActuatorWiring { states, switch, travel_ms: TRAVEL_MS }).unwrap();
    }
    wiring
}

fn profile() -> Profile {
    let emergency_stop = Some(EmergencyStop { input: STOP, opens: true });
    Profile { emergency_stop, ..Profile::of(&wiring()) }
}

/// What the files say under a profile: its lines and inputs.
fn subject(profile: &Profile) -> Subject {
    let mut wiring = wiring();
    for coil in &mut wiring.coils {
        coil.drive = profile.output(coil.output).unwrap().drive;
    }
    for (actuator, first) in wiring.actuators.iter_mut().zip([0, 1, 2, 3, 4, 5]) {
        let input = profile.output(first).unwrap().input.unwrap();
        actuator.switch = actuator.switch.map(|switch| LimitSwitch { input, ..switch });
    }
    let names = (0..6).map(|actuator| format!("part {actuator}")).collect();
    Subject { wiring, names, emergency_stop: profile.emergency_stop }
}

/// A board with an arm that is wired with a mistake.
fn boot(mistake: &Mistake, profile: &Profile) -> (InProcess, BoardProfile) {
    let (mut wired, mut broken) = (wiring(), Broken { switches_closed: 1 << STOP, ..Broken::default() });
    (mistake.make)(&mut wired, &mut broken);
    let mut plant = Plant::new(&wired, &[]);
    plant.set_broken(0.0, broken);
    let profile = BoardProfile::new("arm", profile.clone());
    let flash = MemoryFlash::with_profile(&profile.image());
    (InProcess::boot(plant, flash).unwrap(), profile)
}

const ALL: [usize; 6] = [0, 1, 2, 3, 4, 5];

/// A bring-up with a person, or without one.
fn bring_up(mistake: &Mistake, profile: &Profile, looks: bool) -> Outcome {
    let (board, profile) = boot(mistake, profile);
    let mut client = Client::connect_as(board.link(), 1).unwrap();
    let mut person = Person::new(board, looks, mistake.stop_at);
    let subject = subject(&profile.profile);
    run(&mut client, &subject, profile.profile.digest, &ALL, &mut person).unwrap()
}

fn kinds(outcome: &Outcome) -> Vec<Kind> {
    outcome.findings.iter().map(|finding| finding.kind.clone()).collect()
}

#[test]
fn an_arm_that_is_wired_as_its_files_say_gives_no_finding() {
    for looks in [true, false] {
        let outcome = bring_up(&mistakes::NONE, &profile(), looks);
        assert_eq!(kinds(&outcome), []);
        assert_eq!((outcome.strokes.len(), outcome.is_stop_checked), (7, looks));
    }
}

#[test]
fn travel_times_enclose_those_of_the_arm() {
    let outcome = bring_up(&mistakes::NONE, &profile(), false);
    // 25 ms on their way; a latch flips after half of its pulse of 20 ms, and a switch opens at once.
    for actuator in [0, 1, 3, 4, 5] {
        let of = |on| outcome.travels.iter().find(|travel| travel.actuator == actuator && travel.on == on).unwrap();
        let late_us = if actuator == 4 { 10_000 } else { 0 };
        for (travel, true_us) in [(of(true), 25_000 + late_us), (of(false), late_us)] {
            assert_eq!(travel.closed, travel.on);
            assert!(travel.min_us <= true_us && true_us <= travel.max_us, "{travel:?}");
            assert!(travel.max_us - travel.min_us < 12_000, "{travel:?}");
        }
        let after_ms = travel_ms(&outcome.travels, actuator).unwrap();
        assert!((60..=100).contains(&after_ms), "{after_ms}");
    }
}

#[test]
fn each_mistake_is_found_and_named() {
    assert!(MISTAKES.len() >= 20);
    for mistake in MISTAKES {
        let found = bring_up(mistake, &profile(), true);
        assert_eq!(kinds(&found), (mistake.found)(), "{}", mistake.what);
        for finding in found.findings {
            let words = [&finding.wire, &finding.expected, &finding.seen, &finding.cure];
            assert!(words.iter().all(|text| text.len() > 3), "{finding:?}");
        }
    }
}

#[test]
fn without_a_person_no_cause_is_named_that_the_inputs_do_not_show() {
    for mistake in MISTAKES {
        let found = kinds(&bring_up(mistake, &profile(), false));
        assert_eq!(found, (mistake.unwatched)(), "{}", mistake.what);
    }
}

#[test]
fn the_corrected_profile_gives_no_finding() {
    for mistake in MISTAKES.iter().filter(|mistake| mistake.rounds > 0) {
        let mut corrected = profile();
        for _ in 0..mistake.rounds {
            let found = bring_up(mistake, &corrected, true);
            let correction = correct(&corrected, &subject(&corrected), &found.findings);
            assert!(!correction.changes.is_empty(), "{}", mistake.what);
            corrected = correction.profile;
        }
        assert_eq!(kinds(&bring_up(mistake, &corrected, true)), [], "{}", mistake.what);
    }
}

#[test]
fn what_only_a_soldering_iron_corrects_leaves_the_profile_as_it_is() {
    for mistake in MISTAKES.iter().filter(|mistake| mistake.rounds == 0 && mistake.what != mistakes::SHIFTED) {
        let found = bring_up(mistake, &profile(), true);
        let correction = correct(&profile(), &subject(&profile()), &found.findings);
        assert_eq!((correction.changes, correction.profile), (Vec::new(), profile()), "{}", mistake.what);
    }
}

#[test]
fn a_slow_actuator_gets_a_longer_time_of_travel() {
    let outcome = bring_up(&mistakes::SLOW, &profile(), false);
    assert_eq!(outcome.findings.iter().map(|finding| finding.kind.name()).collect::<Vec<_>>(), ["slow"]);
    let after_ms = travel_ms(&outcome.travels, 1).unwrap();
    assert!((240..=280).contains(&after_ms), "1.5 times 150 ms and 20 ms: {after_ms}");
}

#[test]
fn one_output_at_a_time_is_on_and_none_is_after_the_end() {
    for quits_at in [None, Some(3)] {
        let (board, profile) = boot(&mistakes::NONE, &profile());
        let mut client = Client::connect_as(board.link(), 1).unwrap();
        let mut person = Person { quits_at, ..Person::new(board.clone(), true, Some(STOP)) };
        let subject = subject(&profile.profile);
        let outcome = run(&mut client, &subject, profile.profile.digest, &ALL, &mut person).unwrap();
        assert_eq!((outcome.is_complete, outcome.strokes.len()), quits_at.map_or((true, 7), |at| (false, at.into())));
        assert_eq!(person.lines_between_strokes, 0);
        let lines = board.with_board(|bench| bench.plant().lines());
        assert_eq!(lines, Some(0));
        // A solenoid pulls in with two lines, all others use one.
        assert!(person.max_moved <= 1);
        client.say_hello().unwrap();
        assert!(client.status().unwrap().word.iter().all(|digit| digit == 0));
    }
}

#[test]
fn single_actuators_can_be_repeated_and_skipped() {
    let (board, profile) = boot(&mistakes::NONE, &profile());
    let mut client = Client::connect_as(board.link(), 1).unwrap();
    let mut person = Person { skips: vec![5], ..Person::new(board, true, Some(STOP)) };
    let subject = subject(&profile.profile);
    let outcome = run(&mut client, &subject, profile.profile.digest, &[2, 5], &mut person).unwrap();
    assert_eq!(outcome.strokes.iter().map(|stroke| stroke.output).collect::<Vec<_>>(), [2, 6]);
    assert_eq!((outcome.skipped.as_slice(), kinds(&outcome)), ([5].as_slice(), vec![]));
    assert_eq!(person.consent_for(2), Consent::Go);
}

#[test]
fn another_profile_on_the_board_is_refused_before_anything_moves() {
    let (board, _) = boot(&mistakes::NONE, &profile());
    let mut client = Client::connect_as(board.link(), 1).unwrap();
    let mut person = Person::new(board, true, Some(STOP));
    let other = Default::default();
    let end = run(&mut client, &subject(&profile()), other, &ALL, &mut person);
    assert!(matches!(end, Err(BringupError::Client(ClientError::Refused(_)))), "{end:?}");
    assert_eq!(person.strokes, 0);
}

#[test]
fn the_book_explains_each_finding() {
    let book = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/bring-up.md");
    let book = std::fs::read_to_string(book).unwrap();
    let found = MISTAKES.iter().flat_map(|mistake| [(mistake.found)(), (mistake.unwatched)()].concat());
    let mut names: Vec<_> = found.map(|kind| kind.name()).chain(["slow"]).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), 28);
    for name in names {
        assert!(book.contains(&format!("\n| `{name}` |")), "{name}");
    }
    assert!(book.contains(&format!("wired with {} mistakes", MISTAKES.len())));
}
