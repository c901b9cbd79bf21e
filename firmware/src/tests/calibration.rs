//! Zero offsets of the servos: in force after every start, never taken for zero when they are lost.

use darm_core::profile::{EmergencyStop, Profile};
use darm_core::sequencer::{Command, CommandError, Phase, ServoSeen};
use darm_core::units::Micros;
use darm_core::wire::message::{Answer, Calibration, Refusal, Request};

use super::fakes::{Cells, profile, profile_image, run, table, table_under};
use super::servos::{servo_target, with_servo};
use super::{Bench, loaded};
use crate::store::Store;

fn half_a_radian() -> Calibration {
    Calibration::try_from([0.5, 0.0, 0.0, 0.0]).unwrap()
}

#[test]
fn offsets_are_in_force_after_a_start_with_the_emergency_stop_pressed() {
    let stops = Profile { emergency_stop: Some(EmergencyStop { input: 12, opens: true }), ..profile() };
    let stops = Profile { digest: profile_image(&stops).0.digest, ..stops };
    let cells = Cells::under(&stops);
    run(async { Store::open(cells.flash(u32::MAX)).await.set_calibration(half_a_radian()).await.unwrap() }, || {});
    let bench = Bench::switched_on(cells);
    bench.pass_ms(10);
    bench.stuck.set(Some(1 << 12));
    bench.pass_ms(60_000);
    bench.connect();
    assert!(matches!(bench.status().phase, Phase::Safe(_)));
    assert_eq!(bench.upload(&table_under(&stops, 1, 4, true, &[])), Ok(Answer::Committed { rows: 4 }));
    bench.command(Command::Clear).unwrap();
    let answered = Some(Micros(bench.clock.0.get()));
    bench.see_servo(ServoSeen { angle_rad: 0.5, answered, ..ServoSeen::default() });
    bench.tick();
    assert_eq!(bench.status().servos[0].angle_rad, 0.0);
    bench.command(Command::Servo { servo: 0, angle_rad: 0.0 }).unwrap();
    bench.pass_ms(3);
    assert_eq!(servo_target(&bench).map(|target| target.angle_rad), Some(0.5), "the joint is at 0 already");
}

#[test]
fn what_is_stored_in_the_safe_state_is_in_force() {
    let bench = loaded();
    bench.command(Command::Play).unwrap();
    bench.stuck.set(Some(0));
    bench.pass_ms(300);
    assert!(matches!(bench.status().phase, Phase::Safe(_)));
    assert_eq!(bench.ask(Request::Calibrate(half_a_radian())), Ok(Answer::Done));
    assert_eq!(bench.ask(Request::Calibration), Ok(Answer::Calibration(Some(half_a_radian()))));
}

#[test]
fn no_table_with_servos_is_loaded_while_the_offsets_are_lost() {
    let cells = Cells::with_profile();
    run(async { Store::open(cells.flash(u32::MAX)).await.spoil_calibration().await }, || {});
    let bench = Bench::new(cells);
    bench.connect();
    assert_eq!(bench.ask(Request::Calibration), Err(Refusal::NoCalibration));
    assert_eq!(bench.upload(&table(1, 4, true)), Err(Refusal::NoCalibration));
    assert_eq!(bench.upload(&table(1, 4, false)), Ok(Answer::Committed { rows: 4 }));
    let again = Bench::new(bench.cells);
    again.connect();
    assert_eq!(again.upload(&table(2, 4, true)), Err(Refusal::NoCalibration));
    assert_eq!(again.ask(Request::Calibrate(half_a_radian())), Ok(Answer::Done));
    assert_eq!(again.upload(&table(2, 4, true)), Ok(Answer::Committed { rows: 4 }));
}

#[test]
fn a_calibration_that_waits_for_a_servo_to_hold_is_not_done_after_a_stop() {
    let bench = with_servo(0.0);
    bench.command(Command::Servo { servo: 0, angle_rad: 0.3 }).unwrap();
    bench.pass_ms(5);
    bench.command(Command::Stop).unwrap();
    let begun_us = bench.clock.0.get();
    bench.stop_at.set(Some(begun_us + 50_000));
    assert_eq!(bench.ask(Request::Calibrate(half_a_radian())), Err(Refusal::Command(CommandError::Stopped)));
    assert!(bench.clock.0.get() > begun_us + 150_000, "it has waited");
    assert_eq!(bench.ask(Request::Calibration), Ok(Answer::Calibration(None)));
}

#[test]
fn offsets_that_are_stored_already_are_not_written_again() {
    let bench = loaded();
    assert_eq!(bench.ask(Request::Calibrate(half_a_radian())), Ok(Answer::Done));
    let before = bench.cells.copy();
    for _ in 0..10 {
        assert_eq!(bench.ask(Request::Calibrate(half_a_radian())), Ok(Answer::Done));
    }
    assert!(bench.cells.is_equal(&before), "the flash was written");
}

/// The angles of the joints are those of what the next start will read.
#[test]
fn offsets_whose_write_failed_are_never_in_force() {
    let bench = with_servo(0.5);
    assert_eq!(bench.ask(Request::Calibrate(half_a_radian())), Ok(Answer::Done));
    let other = Calibration::try_from([-0.5, 0.0, 0.0, 0.0]).unwrap();
    bench.cells.refuse_writes(true);
    assert_eq!(bench.ask(Request::Calibrate(other)), Err(Refusal::Storage));
    bench.cells.refuse_writes(false);
    for bench in [&bench, &Bench::new(bench.cells.copy())] {
        bench.connect();
        bench.see_servo(ServoSeen { angle_rad: 0.5, answered: Some(Micros(1)), ..ServoSeen::default() });
        bench.tick();
        assert_eq!(bench.ask(Request::Calibration), Ok(Answer::Calibration(Some(half_a_radian()))));
        assert_eq!(bench.status().servos[0].angle_rad, 0.0);
    }
}
