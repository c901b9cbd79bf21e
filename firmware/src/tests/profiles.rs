//! The board's profile: who may write it, what it refuses, how outputs recover under it.

use darm_core::output::{Drive, SwitchLimit};
use darm_core::profile::{
    B_L475E_IOT01A, BUILT_IN, BoardWiring, Mismatch, Output, PICO, PinTable, Profile, ProfileError, Shortage,
};
use darm_core::sequencer::{Command, CommandError, FaultKind, Phase};
use darm_core::table::TableError;
use darm_core::wire::bootstrap;
use darm_core::wire::bootstrap::Servos;
use darm_core::wire::frame::Header;
use darm_core::wire::message::{Answer, Refusal, Request};

use super::fakes::{Cells, profile, profile_image, run, table};
use super::{Bench, hello, loaded};
use crate::hardware::Converted;

#[test]
fn a_profile_is_written_only_while_a_person_holds_the_button() {
    let bench = Bench::new(Cells::erased());
    bench.connect();
    assert_eq!(hello(&bench).profile, BUILT_IN.digest);
    let (image, bytes) = profile_image(&profile());
    assert_eq!(bench.upload(&(image, bytes.clone())), Err(Refusal::NobodyPresent));
    let refused = bench.upload(&table(1, 4, false));
    assert!(matches!(refused, Err(Refusal::Table(TableError::Profile(Mismatch::Limit { output: 0, .. })))));
    bench.button.set(true);
    assert_eq!(bench.upload(&(image, bytes)), Ok(Answer::Done));
    assert_eq!(
        bench.dispatcher.borrow_mut().as_mut().unwrap().restart_due(false),
        Some(bootstrap::RebootTarget::Application)
    );
    let again = Bench::new(bench.cells);
    again.connect();
    assert_eq!(hello(&again).profile, image.digest);
    assert_eq!(again.upload(&table(1, 4, false)), Ok(Answer::Committed { rows: 4 }));
}

#[test]
fn a_jumper_that_was_left_in_its_place_writes_no_profile() {
    let cells = Cells::erased();
    let bench = Bench::new(cells.copy());
    bench.connect();
    let new = profile_image(&profile());
    bench.button.set(true);
    bench.pass_ms(60_001);
    assert_eq!(bench.upload(&new), Err(Refusal::NobodyPresent), "pressed a minute ago");
    bench.button.set(false);
    bench.pass_ms(100);
    bench.button.set(true);
    bench.pass_ms(50_000);
    assert_eq!(bench.upload(&new), Ok(Answer::Done));
}

#[test]
fn a_guarded_loader_is_entered_only_while_a_person_holds_the_button() {
    let bench = Bench::new(Cells::with_profile());
    let due = |bench: &Bench| bench.dispatcher.borrow_mut().as_mut().unwrap().restart_due(false);
    let request = bootstrap::Request::Reboot(bootstrap::RebootTarget::Loader);
    let header = Header { tag: request.tag(), link: 0, number: 9 };
    assert_eq!(bench.send(header, request.payload()), Some(vec![1]));
    assert!(bench.type_line("reboot loader").starts_with('?'));
    assert_eq!(due(&bench), None);
    bench.button.set(true);
    bench.pass_ms(1);
    assert_eq!(bench.send(header, request.payload()), Some(vec![0]));
    assert_eq!(due(&bench), Some(bootstrap::RebootTarget::Loader));
}

#[test]
fn a_table_of_another_profile_is_kept_and_not_loaded() {
    let bench = loaded();
    bench.button.set(true);
    let narrower = Profile { supply: SwitchLimit { new_coils: 5, window_ms: 10 }, ..profile() };
    assert_eq!(bench.upload(&profile_image(&narrower)), Ok(Answer::Done));
    let again = Bench::new(bench.cells);
    again.connect();
    assert_eq!(again.command(Command::Play), Err(Refusal::Command(CommandError::NoTable)));
    let status = again.type_line("status");
    assert!(status.contains("what is stored was refused: the table switches at most 6 outputs on"), "{status}");
}

#[test]
fn just_after_power_up_a_program_has_to_wait() {
    let bench = loaded();
    let again = Bench::switched_on(bench.cells);
    again.connect();
    let refused = again.command(Command::Play);
    assert!(matches!(refused, Err(Refusal::Recovering { row: 2, output: 0, wait_ms: 59_000.. })), "{refused:?}");
    let Ok(Answer::Outputs(outputs)) = again.ask(Request::Outputs { from: 0 }) else { panic!() };
    assert_eq!((outputs.len(), outputs[0].left_ms), (2, 0));
    again.pass_ms(60_000);
    assert_eq!(again.command(Command::Play), Ok(Answer::Done));
}

/// The limits that are built in know nothing of this board's latches and of its emergency stop.
#[test]
fn a_damaged_profile_drives_nothing() {
    let cells = Cells::with_profile();
    cells.spoil(&profile_image(&profile()).1);
    let bench = Bench::new(cells);
    bench.connect();
    let mut with_built_in = table(1, 4, false);
    let refused = bench.upload(&with_built_in);
    assert!(matches!(refused, Err(Refusal::Table(TableError::Profile(Mismatch::NoOutput { .. })))), "{refused:?}");
    with_built_in = profile_image(&profile());
    bench.button.set(true);
    assert_eq!(bench.upload(&with_built_in), Ok(Answer::Done));
}

#[test]
fn a_profile_of_a_larger_board_is_refused_and_drives_nothing() {
    let bench = Bench::new(Cells::with_profile());
    bench.connect();
    bench.button.set(true);
    let mut larger = profile();
    let output = larger.outputs[0].unwrap();
    larger.outputs[0] = Some(Output { drive: Drive::Hold { line: 63 }, ..output });
    let short = |bench: &Bench, lines| bench.dispatcher.borrow_mut().as_mut().unwrap().board.caps.lines = lines;
    short(&bench, 63);
    let refusal = Refusal::Profile(ProfileError::Board(Shortage::Line { line: 63, lines: 63 }));
    assert_eq!(bench.upload(&profile_image(&larger)), Err(refusal));
    assert_eq!(hello(&bench).profile, profile_image(&profile()).0.digest);
    short(&bench, 64);
    assert_eq!(bench.upload(&profile_image(&larger)), Ok(Answer::Done));
}

#[test]
fn a_profile_for_other_pins_or_for_a_longer_chain_is_refused_and_drives_nothing() {
    let bench = Bench::new(Cells::with_profile());
    bench.connect();
    bench.button.set(true);
    let become_pico = |bench: &Bench, lines| {
        let mut dispatcher = bench.dispatcher.borrow_mut();
        let caps = &mut dispatcher.as_mut().unwrap().board.caps;
        (caps.lines, caps.board) = (lines, "Pico".try_into().unwrap());
    };
    let refused = |shortage| Err(Refusal::Profile(ProfileError::Board(shortage)));
    let made_for = |chips, table: &PinTable| {
        profile_image(&Profile { board: BoardWiring { chips, layout: Some(table.layout()) }, ..profile() })
    };
    assert_eq!(bench.upload(&made_for(None, &PICO)), refused(Shortage::Pins), "no board with known pins");
    become_pico(&bench, 16);
    assert_eq!(bench.upload(&made_for(None, &B_L475E_IOT01A)), refused(Shortage::Pins));
    assert_eq!(bench.upload(&made_for(Some(3), &PICO)), refused(Shortage::Chips { chips: 3, lines: 16 }));
    assert_eq!(hello(&bench).profile, profile_image(&profile()).0.digest);
    assert_eq!(bench.upload(&made_for(Some(2), &PICO)), Ok(Answer::Done));
}

#[test]
fn a_threshold_of_the_supply_is_refused_by_a_board_that_does_not_measure_it() {
    let bench = Bench::new(Cells::with_profile());
    bench.connect();
    bench.button.set(true);
    let with = |mv| profile_image(&Profile { min_supply_mv: Some(mv), ..profile() });
    let refused = |mv, measured_mv| Err(Refusal::Profile(ProfileError::Board(Shortage::Supply { mv, measured_mv })));
    assert_eq!(bench.upload(&with(4_500)), refused(4_500, None));
    bench.dispatcher.borrow_mut().as_mut().unwrap().board.caps.board = "Pico".try_into().unwrap();
    assert_eq!(bench.upload(&with(1_700)), refused(1_700, Some([1_800, 5_500])));
    assert_eq!(bench.upload(&with(4_500)), Ok(Answer::Done));
}

#[test]
fn a_low_supply_latches_the_safe_state_and_both_languages_report_it_with_the_threshold() {
    let pico = Profile { min_supply_mv: Some(4_500), ..profile() };
    let bench = Bench::new(Cells::with_profile());
    bench.connect();
    let profile: &'static Profile = Box::leak(Box::new(pico));
    bench.dispatcher.borrow_mut().as_mut().unwrap().put_in_force(profile);
    run(bench.shared.configure(profile), || bench.tick());
    let measure = |mv| {
        bench.shared.see_converted(Converted::SupplyMv(mv));
        bench.supply_mv.set(Some(mv));
        bench.pass_ms(10);
    };
    (0..4).for_each(|_| measure(4_400));
    assert_eq!(bench.status().phase, Phase::Idle);
    measure(4_400);
    let Phase::Safe(fault) = bench.status().phase else { panic!("not safe") };
    assert_eq!(fault.kind, FaultKind::Supply { mv: 4_400, min_mv: 4_500 });
    let Ok(Answer::Health(health)) = bench.ask(Request::Health) else { panic!("no health") };
    assert_eq!((health.supply_mv, health.min_supply_mv), (Some(4_400), Some(4_500)));
    let text = bench.type_line("status");
    assert!(text.contains("the supply of the board fell to 4400 mV, below the profile's 4500 mV"), "{text}");
    assert!(text.contains("supply 4400 mV, at least 4500 mV"), "{text}");
}

#[test]
fn hello_says_what_the_board_can_do() {
    let bench = Bench::new(Cells::erased());
    bench.connect();
    assert_eq!(hello(&bench).caps, super::caps());
}

/// Outputs that the profile in force has.
fn outputs(bench: &Bench) -> usize {
    bench.dispatcher.borrow_mut().as_mut().unwrap().profile().outputs.iter().flatten().count()
}

/// docs/safety.md: "write the profile again, holding the button, which erases the records; …; until then nothing is driven".
/// The limits that are built in know nothing of this board's latches and of its emergency stop.
#[test]
fn a_reset_while_a_profile_is_written_over_unreadable_records_puts_no_built_in_limits_in_force() {
    let cells = Cells::with_profile();
    cells.spoil_records();
    let bench = Bench::new(cells);
    bench.connect();
    assert_eq!(outputs(&bench), 0);
    bench.button.set(true);
    bench.pass_ms(1);
    let (image, _) = profile_image(&profile());
    assert_eq!(bench.ask(Request::Begin(image)), Ok(Answer::Upload { next: 0 }));
    // The power fails, or anybody asks for a reboot, before the upload is committed.
    let again = Bench::new(bench.cells);
    again.connect();
    assert_eq!(outputs(&again), 0, "the limits that are built in are in force");
}

/// A board whose profile is damaged is no board without a profile.
#[test]
fn both_copies_of_the_record_of_a_profile_are_damaged_and_nothing_is_driven() {
    let cells = Cells::with_profile();
    cells.spoil_copies(&profile_image(&profile()).0.digest.0);
    let bench = Bench::new(cells);
    bench.connect();
    assert_eq!(outputs(&bench), 0, "the limits that are built in are in force");
    assert_eq!(bench.shared.servos(), Servos::Uncontrolled, "they may be on their way");
}

/// A table may be tighter than the profile.
#[test]
fn what_an_output_has_left_is_what_its_table_leaves_it() {
    let mut wide = profile();
    wide.outputs[0].as_mut().unwrap().limit.max_on_ms = 20_000;
    let wide = Profile { digest: profile_image(&wide).0.digest, ..wide };
    let bench = Bench::new(Cells::under(&wide));
    bench.connect();
    assert_eq!(bench.upload(&super::fakes::table_under(&wide, 1, 4, false, &[])), Ok(Answer::Committed { rows: 4 }));
    bench.command(darm_core::sequencer::Command::Word("10".parse().unwrap())).unwrap();
    bench.pass_ms(10);
    let Ok(Answer::Outputs(outputs)) = bench.ask(Request::Outputs { from: 0 }) else { panic!("outputs") };
    let said_ms = outputs[0].left_ms.min(outputs[0].limit.max_on_ms);
    let mut on_ms = 0;
    while on_ms < said_ms - 100 && bench.outputs.get().lines == 1 {
        bench.tick();
        on_ms += 1;
    }
    assert!(
        on_ms >= said_ms - 100,
        "{said_ms} ms are left, and the board latched after {on_ms}: {:?}",
        bench.status().phase
    );
}
