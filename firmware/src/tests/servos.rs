//! Servos move only when they are commanded: no table and no calibration moves one.

use core::cell::RefCell;

use darm_core::profile::Profile;
use darm_core::sequencer::{Command, FaultKind, Phase, ServoAction, ServoBreach, ServoSeen, ServoTarget};
use darm_core::units::{DeviceId, Micros};
use darm_core::wire::bootstrap::Identity;
use darm_core::wire::health::Health;
use darm_core::wire::message::{Answer, CHUNK, Calibration, Image, Refusal, Request};

use super::fakes::{Cells, HandClock, caps, run, table};
use super::{Bench, OnBench};
use crate::control::{Control, Inputs, Shared, TICK};
use crate::dispatch::{Board, Dispatcher};

/// A board with a table that has a servo, whose shaft is at `angle_rad`.
pub(super) fn with_servo(angle_rad: f32) -> Bench {
    let bench = Bench::new(Cells::with_profile());
    bench.connect();
    assert_eq!(bench.upload(&table(1, 4, true)), Ok(Answer::Committed { rows: 4 }));
    let answered = Some(Micros(bench.clock.0.get()));
    bench.see_servo(ServoSeen { angle_rad, answered, ..ServoSeen::default() });
    bench.tick();
    bench
}

pub(super) fn servo_target(bench: &Bench) -> Option<ServoTarget> {
    match bench.shared.joints()[0]?.action {
        ServoAction::Go(target) => Some(target),
        ServoAction::Hold | ServoAction::Release => None,
    }
}

#[test]
fn another_table_moves_no_servo() {
    let bench = with_servo(0.0);
    bench.command(Command::Servo { servo: 0, angle_rad: 0.3 }).unwrap();
    bench.pass_ms(5);
    assert!(servo_target(&bench).is_some());
    bench.command(Command::Stop).unwrap();
    assert_eq!(bench.upload(&table(2, 4, true)), Ok(Answer::Committed { rows: 4 }));
    bench.pass_ms(5);
    assert_eq!(servo_target(&bench), None);
}

#[test]
fn another_model_moves_no_servo() {
    let bench = with_servo(0.0);
    let calibration = Calibration::try_from([0.5, 0.0, 0.0, 0.0]).unwrap();
    assert_eq!(bench.ask(Request::Calibrate(calibration)), Ok(Answer::Done));
    bench.upload(&table(2, 4, true)).unwrap();
    let stands_at = bench.status().servos[0].angle_rad;
    assert_eq!(stands_at, -0.5, "a horn does not turn on its shaft because the model is a better one");
    let again = Bench::new(bench.cells);
    again.connect();
    assert_eq!(again.ask(Request::Calibration), Ok(Answer::Calibration(Some(calibration))));
}

/// The servo of a program that has ended is pushed away, or was slow: it is on its way, and nothing runs.
fn with_servo_on_its_way() -> (Bench, Image) {
    let bench = with_servo(0.1);
    let (image, bytes) = table(2, 4, true);
    bench.ask(Request::Begin(image)).unwrap();
    for (offset, chunk) in (0u32..).step_by(CHUNK).zip(bytes.chunks(CHUNK)) {
        bench.ask(Request::Chunk { offset, bytes: chunk }).unwrap();
    }
    bench.command(Command::Play).unwrap();
    for _ in 0..600 {
        is_at(&bench, 0.1);
    }
    is_at(&bench, 1.0);
    assert!(bench.status().phase == Phase::Idle && servo_target(&bench).is_some());
    (bench, image)
}

/// The shaft is at this angle in the next tick.
fn is_at(bench: &Bench, angle_rad: f32) {
    let answered = Some(Micros(bench.clock.0.get()));
    bench.see_servo(ServoSeen { angle_rad, answered, ..ServoSeen::default() });
    bench.tick();
}

#[test]
fn no_flash_is_written_while_a_servo_moves() {
    let (bench, image) = with_servo_on_its_way();
    assert_eq!(bench.ask(Request::Begin(table(3, 4, true).0)), Err(Refusal::Busy));
    assert_eq!(bench.ask(Request::Commit(image)), Err(Refusal::Busy));
    is_at(&bench, 0.1);
    assert_eq!(bench.ask(Request::Commit(image)), Ok(Answer::Committed { rows: 4 }));
}

/// The order to hold goes over the bus: on a board whose ticks an erase stops, the servo would move on until its end.
#[test]
fn no_flash_is_written_before_a_servo_has_its_order_to_hold() {
    for answers in [false, true] {
        let bench = with_servo(0.0);
        bench.command(Command::Servo { servo: 0, angle_rad: 0.3 }).unwrap();
        bench.pass_ms(5);
        bench.command(Command::Stop).unwrap();
        bench.pass_ms(5);
        if answers {
            let answered = Some(Micros(bench.clock.0.get()));
            bench.see_servo(ServoSeen { answered, ..ServoSeen::default() });
            bench.tick();
        }
        let before_us = bench.clock.0.get();
        bench.ask(Request::Begin(table(2, 4, true).0)).unwrap();
        let waited_us = bench.clock.0.get() - before_us;
        assert_eq!(waited_us > 150_000, !answers, "{waited_us} us");
    }
}

/// While code and tables share a flash that is erased no tick runs: the order leaves with the tick after it.
#[test]
fn no_flash_is_written_before_an_order_to_hold_of_a_late_tick() {
    for late_ms in [1, 150, 250, 400] {
        let bench = with_servo(0.0);
        bench.command(Command::Servo { servo: 0, angle_rad: 0.3 }).unwrap();
        bench.pass_ms(5);
        bench.clock.0.set(bench.clock.0.get() + 1000 * late_ms);
        bench.shared.stop();
        bench.tick();
        assert_eq!(servo_target(&bench), None);
        let before_us = bench.clock.0.get();
        bench.ask(Request::Begin(table(2, 4, true).0)).unwrap();
        let waited_us = bench.clock.0.get() - before_us;
        assert!((150_000..220_000).contains(&waited_us), "{late_ms} ms late: {waited_us} us");
    }
}

/// What the bus finds latches the safe state with the next tick, and again after `clear` as long as it lasts.
#[test]
fn a_servo_that_moves_unasked_while_nothing_runs_latches_the_safe_state() {
    let bench = with_servo(0.0);
    let phase = || bench.status().phase;
    bench.shared.set_servo_breach(0, Some(ServoBreach::Moved));
    bench.tick();
    for _ in 0..2 {
        assert!(
            matches!(phase(), Phase::Safe(fault) if fault.kind == FaultKind::ServoMoved { servo: 0 }),
            "{:?}",
            phase()
        );
        bench.command(Command::Clear).unwrap();
        bench.pass_ms(2);
    }
    bench.shared.set_servo_breach(0, None);
    bench.command(Command::Clear).unwrap();
    bench.pass_ms(2);
    assert_eq!(phase(), Phase::Idle);
}

/// When a start writes its count, ms: a servo that an earlier run left on its way answers from this time on, at each visit of the bus.
fn first_write_ms(answers_from_ms: u64) -> u64 {
    let cells = Cells::with_profile();
    let before = cells.copy();
    let shared: &'static Shared<'static> = Box::leak(Box::default());
    let clock: &'static HandClock = Box::leak(Box::default());
    let control = RefCell::new(Control::new(Micros(0), shared, Box::leak(Box::default())));
    let identity = Identity { device: DeviceId([7; 12]), board: heapless::String::try_from("bench").unwrap() };
    let board = Board { identity, crash: None, caps: caps(), guards_loader: true, health: Health::default, kept: None };
    let mut dispatcher: OnBench =
        Dispatcher::new(board, clock, shared, Box::leak(Box::default()), Box::leak(Box::default()));
    let profile = Box::leak(Box::new(Profile::empty()));
    let mut written_ms = None;
    run(dispatcher.open(Some(cells.flash(u32::MAX)), Box::leak(Box::default()), profile), || {
        let now = Micros(clock.0.get()) + TICK;
        clock.0.set(now.0);
        control.borrow_mut().tick(now, now, Inputs::default(), shared);
        if written_ms.is_none() && !cells.is_equal(&before) {
            written_ms = Some(now.0 / 1000);
        }
        let has_order = shared.joints()[0].is_some_and(|joint| joint.action == ServoAction::Hold);
        if has_order && (now.0 / 1000).is_multiple_of(10) && now.0 / 1000 >= answers_from_ms {
            shared.see_servo(0, ServoSeen { answered: Some(now), ..ServoSeen::default() });
        }
    });
    written_ms.expect("a start counts itself")
}

/// While the flash is written nobody looks after a servo; one that does not answer does not keep the board from starting.
#[test]
fn a_start_counts_itself_once_its_servos_have_answered() {
    for answers_from_ms in [0, 15, 60] {
        let written_ms = first_write_ms(answers_from_ms);
        let answered_ms = answers_from_ms.next_multiple_of(10);
        assert!(written_ms > answered_ms && written_ms < answered_ms + 50, "{answers_from_ms}: {written_ms}");
    }
    assert!((200..260).contains(&first_write_ms(u64::MAX)));
}
