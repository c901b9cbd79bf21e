//! What goes wrong at a Pico: its wires, its software, its cable, its power in a store.

use darm_arm::board_profile::BoardProfile;
use darm_core::output::CoilLimit;
use darm_core::profile::{BoardWiring, EmergencyStop, PICO, Profile};
use darm_core::sequencer::{Command, CommandError, Event, FaultKind, Phase};
use darm_core::units::ModelHash;
use darm_core::wire::bootstrap::CrashKind;
use darm_core::wire::health::LineErrors;
use darm_core::wire::message::{Calibration, Refusal};
use darm_device::client::Client;
use darm_sim::pico::{Ended, PicoBench};

use crate::bench::Bench;
use crate::tables::{profile, stepped, table, table_under, wiring};

/// The fault of the safe state, which the board enters within this time.
#[track_caller]
fn fault_within(bench: &Bench, client: &mut Client, limit_s: f64) -> FaultKind {
    let end_s = bench.board.now_s() + limit_s;
    loop {
        if let Phase::Safe(fault) = client.status().unwrap().phase {
            return fault.kind;
        }
        assert!(bench.board.now_s() < end_s, "no safe state");
    }
}

/// Plays until the board drives a line.
fn play(bench: &Bench, client: &mut Client) {
    client.upload(&table(&bench.wiring, &stepped(40), ModelHash(1)), &mut |_| {}).unwrap();
    client.command(Command::Play).unwrap();
    bench.wait("a line", || bench.lines() != 0);
}

#[test]
fn an_emergency_stop_at_an_input_latches_the_safe_state_until_it_is_released() {
    let wiring = wiring(false);
    let stop = EmergencyStop { input: 12, opens: false };
    let board = BoardWiring { chips: Some(2), layout: Some(PICO.layout()) };
    let with_stop = Profile { emergency_stop: Some(stop), board, ..profile(&wiring).profile };
    let with_stop = BoardProfile::new("stop", with_stop);
    let Some(bench) = Bench::with_profile(wiring, &with_stop) else { return };
    let mut client = bench.connect();
    let table = table_under(&with_stop, &bench.wiring, &stepped(40), ModelHash(1), &[]);
    client.upload(&table, &mut |_| {}).unwrap();
    client.command(Command::Play).unwrap();
    bench.wait("a line", || bench.lines() != 0);
    bench.with(|board| board.set_input(12, true));
    bench.board.pass(0.003);
    assert_eq!(bench.lines(), 0);
    assert_eq!(fault_within(&bench, &mut client, 0.1), FaultKind::EmergencyStop);
    for refusal in [CommandError::Stopped, CommandError::EmergencyStop] {
        let refused = client.command(Command::Clear).unwrap_err().refusal();
        assert_eq!(refused, Some(Refusal::Command(refusal)), "it ends the connection");
        client.say_hello().unwrap();
    }
    bench.with(|board| board.set_input(12, false));
    bench.board.pass(0.1);
    client.command(Command::Clear).unwrap();
    assert_eq!(client.status().unwrap().phase, Phase::Idle);
}

#[test]
fn a_chain_whose_state_machine_stops_is_a_fault_and_disables_the_outputs() {
    let Some(bench) = Bench::start(false) else { return };
    let mut client = bench.connect();
    play(&bench, &mut client);
    bench.with(PicoBench::freeze_chain);
    // A refresh is due each 0.1 s, and two ticks behind it decide.
    assert_eq!(fault_within(&bench, &mut client, 0.2), FaultKind::Chain);
    assert_eq!(bench.lines(), 0);
}

#[test]
fn output_enable_that_is_connected_to_ground_is_a_fault_at_the_start_and_later() {
    let Some(bench) = Bench::start(false) else { return };
    bench.with(|board| board.short_enable(true));
    assert_eq!(fault_within(&bench, &mut bench.connect(), 0.2), FaultKind::OutputEnable);
    bench.board.power_cycle();
    bench.board.pass(1.0);
    let happened = bench.connect().events(0).unwrap();
    let fault =
        happened.iter().find_map(|timed| if let Event::Fault(fault) = timed.event { Some(fault) } else { None });
    let fault = fault.expect("the first ticks find it");
    assert_eq!(fault.kind, FaultKind::OutputEnable);
    assert!(fault.at.0 < 500_000, "{fault}");
    bench.with(|board| board.short_enable(false));
    bench.board.pass(0.2);
    bench.connect().command(Command::Clear).unwrap();
    assert_eq!(bench.connect().status().unwrap().phase, Phase::Idle);
}

#[test]
fn a_panic_disables_the_outputs_and_is_reported_by_the_next_start() {
    let Some(bench) = Bench::start(false) else { return };
    let mut client = bench.connect();
    play(&bench, &mut client);
    let resets = bench.with(|board| board.resets());
    bench.with(PicoBench::panic);
    bench.board.pass(0.002);
    assert_eq!(bench.lines(), 0);
    bench.board.pass(1.0);
    assert_eq!(bench.with(|board| board.resets()), resets + 1);
    let crash = bench.connect().last_crash().unwrap().expect("a record");
    assert_eq!(crash.kind, CrashKind::Panic);
    assert!(crash.text.contains("async fn"), "{crash:?}");
    bench.board.power_cycle();
    bench.board.pass(1.0);
    assert_eq!(bench.connect().last_crash().unwrap(), None, "noise is no record");
}

/// Below the memory of the stack, amid it, at its end with less room than a frame, and anywhere.
#[test]
fn a_hard_fault_disables_the_outputs_wherever_the_stack_pointer_is() {
    let Some(bench) = Bench::start(false) else { return };
    for pointer in [0x1fff_ff00, 0x2000_1000, 0x2000_5ff8, 0x2004_2000, 0xffff_fff0] {
        let mut client = bench.connect();
        play(&bench, &mut client);
        bench.with(move |board| board.hard_fault(pointer));
        bench.board.pass(0.001);
        assert_eq!(bench.lines(), 0, "{pointer:#x}");
        bench.board.pass(1.0);
        let crash = bench.connect().last_crash().unwrap().expect("a record");
        assert_eq!(crash.kind, CrashKind::HardFault, "{crash:?}");
        assert_eq!(crash.text.contains("stack overflow"), pointer < 0x2000_0000, "{crash:?}");
        // Crashes in a row would hold the board.
        bench.board.power_cycle();
        bench.board.pass(1.0);
    }
}

/// RP2040 data sheet, 2.19.6.3, 4.6.5 and 4.7.6; ARMv6-M, B3.5.
#[test]
fn the_board_needs_no_default_of_the_chip_for_its_safety() {
    let Some(bench) = Bench::start(false) else { return };
    let register = |address| bench.with(move |board| board.register(address)).expect("the emulator runs");
    let pad = register(0x4001_c018);
    assert_eq!((pad >> 4 & 3, pad >> 1 & 1), (3, 1), "GP5: 12 mA, Schmitt trigger");
    let control = register(0x4005_8000);
    assert_eq!((control >> 30 & 1, control >> 24 & 7), (1, 0), "the watchdog counts under a debugger");
    assert_eq!(register(0x4005_402c), 0, "the timer too");
    let [control, base, size] = [0xe000_ed94, 0xe000_ed9c, 0xe000_eda0].map(register);
    assert_eq!((control, base & !0x1f), (5, 0x1f00_0000), "the region below the stack");
    assert_eq!((size & 1, size >> 1 & 0x1f, size >> 24 & 7), (1, 23, 0), "16 MiB without any access");
}

/// The emulator's converter has 1.667 V of the supply and 0.706 V of the sensor.
#[test]
fn what_the_board_does_not_measure_is_not_zero() {
    let Some(bench) = Bench::start(false) else { return };
    let health = bench.connect().health().unwrap().unwrap();
    assert!(health.supply_mv.is_some_and(|supply| supply.abs_diff(5_000) < 10), "{health:?}");
    assert!(health.chip_celsius.is_some_and(|celsius| (celsius - 27).abs() <= 1), "{health:?}");
    assert_eq!((health.console, health.flash), (None, None));
    assert_eq!(health.servo_bus, Some(LineErrors::default()));
}

/// The boot ROM writes the image and ends by its watchdog; memory then holds what the loader left there.
#[test]
fn the_first_start_of_an_image_reports_no_crash() {
    let Some(bench) = Bench::start(false) else { return };
    bench.with(PicoBench::start_as_flashed);
    bench.board.pass(1.0);
    assert_eq!(bench.connect().last_crash().unwrap(), None);
    bench.with(PicoBench::bite);
    bench.board.pass(1.0);
    let crash = bench.connect().last_crash().unwrap().expect("the firmware's own watchdog");
    assert_eq!(crash.kind, CrashKind::Watchdog);
}

#[test]
fn on_times_survive_a_reset_and_a_loss_of_power_counts_as_used() {
    let mut wiring = wiring(false);
    wiring.coils[0].limit = CoilLimit { max_on_ms: 2_000, duty_percent: 50, window_ms: 10_000 };
    let Some(bench) = Bench::wired(wiring) else { return };
    bench.board.pass(30.0);
    let left_ms = || bench.connect().outputs().unwrap()[0].left_ms;
    let mut client = bench.connect();
    client.upload(&table(&bench.wiring, &stepped(2), ModelHash(1)), &mut |_| {}).unwrap();
    let before_ms = left_ms();
    bench.connect().command(Command::Coil { coil: 0, on_ms: 800 }).unwrap();
    bench.board.pass(1.0);
    let used_ms = left_ms();
    assert!(used_ms + 700 <= before_ms, "{used_ms} of {before_ms}");
    bench.with(PicoBench::bite);
    bench.board.pass(1.0);
    let after_ms = left_ms();
    // The window is longer than what has passed, so nothing has recovered; a reset costs what the meter cannot know.
    assert!(after_ms <= used_ms && after_ms + 50 >= used_ms, "{after_ms}, {used_ms} before the reset");
    bench.board.power_cycle();
    bench.board.pass(0.5);
    assert!(left_ms() <= 500, "{}", left_ms());
}

#[test]
fn a_cable_that_is_plugged_in_again_finds_the_board_as_it_was() {
    let Some(bench) = Bench::start(false) else { return };
    let mut client = bench.connect();
    play(&bench, &mut client);
    let resets = bench.with(|board| board.resets());
    for _ in 0..3 {
        bench.with(PicoBench::replug);
        bench.board.pass(0.3);
        let status = bench.connect().status().unwrap();
        assert!(matches!(status.phase, Phase::Playing { .. }), "{status:?}");
    }
    bench.connect().stop_at_once().unwrap();
    bench.board.pass(0.005);
    assert_eq!((bench.lines(), bench.with(|board| board.resets())), (0, resets));
}

/// Cuts the power within each operation of the flash that `store` needs; how many there were. `check` looks at the board after each.
fn cut_each(bench: &Bench, store: impl Fn(&Bench, u32) -> bool, check: impl Fn(&Bench, u32, bool)) -> u32 {
    for operation in 1.. {
        bench.with(move |board| board.cut_within(operation, operation.wrapping_mul(0x9e37_79b9)));
        let acknowledged = store(bench, operation);
        let is_cut = bench.with(|board| board.ended()) == Some(Ended::Cut);
        bench.board.hold_button(false);
        bench.board.power_cycle();
        bench.board.pass(1.0);
        check(bench, operation, acknowledged);
        if !is_cut {
            assert!(acknowledged);
            return operation - 1;
        }
    }
    unreachable!("an operation ends")
}

#[test]
fn a_power_cut_within_a_store_of_the_calibration_leaves_the_old_or_the_new_one() {
    let Some(bench) = Bench::start(false) else { return };
    let of = |operation: u32| Calibration::try_from([0.01 * operation as f32, 0.0, 0.0, 0.0]).unwrap();
    bench.connect().calibrate(of(0)).unwrap();
    let known = std::cell::Cell::new(0);
    let store = |bench: &Bench, operation| {
        Client::connect(bench.board.link()).is_ok_and(|mut client| client.calibrate(of(operation)).is_ok())
    };
    let cuts = cut_each(&bench, store, |bench, operation, acknowledged| {
        let found = bench.connect().calibration().unwrap();
        assert!([Some(of(known.get())), Some(of(operation))].contains(&found), "operation {operation}: {found:?}");
        assert!(!acknowledged || found == Some(of(operation)), "operation {operation}: {found:?}");
        if found == Some(of(operation)) {
            known.set(operation);
        }
    });
    assert!(cuts > 0, "no operation was cut");
}

#[test]
fn a_power_cut_within_a_store_of_the_profile_leaves_the_old_or_the_new_one() {
    let Some(bench) = Bench::start(false) else { return };
    let of = |operation: u32| {
        let mut profile = profile(&bench.wiring).profile;
        profile.supply.new_coils = 1 + (operation % 8) as u8;
        BoardProfile::new("cut", profile)
    };
    let known = std::cell::Cell::new(bench.connect().hello().unwrap().profile);
    let store = |bench: &Bench, operation| {
        bench.board.pass(0.1);
        bench.board.hold_button(true);
        bench.board.pass(0.1);
        let image = of(operation).image();
        Client::connect(bench.board.link()).is_ok_and(|mut client| client.upload(&image, &mut |_| {}).is_ok())
    };
    let cuts = cut_each(&bench, store, |bench, operation, acknowledged| {
        let (found, new) = (bench.connect().hello().unwrap().profile, of(operation).profile.digest);
        assert!([known.get(), new].contains(&found), "operation {operation}");
        assert!(!acknowledged || found == new, "operation {operation}: an acknowledged profile was lost");
        known.set(found);
    });
    assert!(cuts > 2, "only {cuts} operations were cut");
}
