//! Servos: targets, answers, calibration.

use super::{Bench, actuator, coil, end, row, start, two_valves, word};
use crate::output::{Drive, ServoWiring};
use crate::profile::Fallback;
use crate::sequencer::{Command, CommandError, FaultKind, Phase, ServoAction, ServoBreach, ServoSeen};
use crate::table::{Record, Row};
use crate::units::{Micros, Word};

fn servo_arm() -> Bench {
    let servo =
        ServoWiring { id: 1, min_rad: -1.0, max_rad: 1.0, max_speed_rad_s: 2.0, max_torque: 0.5, timeout_ms: 20 };
    let at = |at_ms, angle| {
        let servos = heapless::Vec::from_slice(&[angle]).expect("one fits");
        Record::Row(Row { at: Micros::from_millis(at_ms), word: Word::default(), servos })
    };
    let mut bench = Bench::new(&[start(), Record::Servo(servo), at(0, 0.5), at(500, -0.4), end(900)]);
    bench.servo(0.0).run(1);
    bench
}

impl Bench {
    fn servo(&mut self, angle_rad: f32) -> &mut Self {
        self.seen.servos[0] = ServoSeen { angle_rad, load: 0.1, error: 0, answered: Some(self.now) };
        self
    }
}

fn servo(id: u8) -> Record {
    let (max_speed_rad_s, max_torque, timeout_ms) = (1.0, 0.5, 100);
    Record::Servo(ServoWiring { id, min_rad: 0.5, max_rad: 1.5, max_speed_rad_s, max_torque, timeout_ms })
}

fn one_servo() -> Bench {
    Bench::new(&[start(), servo(1), end(10)])
}

fn row_with_servo(at_ms: u32, digits: &str, angle_rad: f32) -> Record {
    let servos = [angle_rad].into_iter().collect();
    Record::Row(Row { at: Micros::from_millis(at_ms), word: word(digits), servos })
}

#[test]
fn rows_wait_until_the_servos_have_come_slowly_to_the_first() {
    let mut bench = servo_arm();
    bench.command(Command::Play).unwrap();
    for _ in 0..50 {
        bench.servo(0.0).run(1);
    }
    let target = bench.target().unwrap();
    assert_eq!((target.angle_rad, target.speed_rad_s), (0.5, 0.5));
    assert!(matches!(bench.sequencer.phase(), Phase::Approaching { .. }));
    bench.servo(0.495).run(2);
    assert!(matches!(bench.sequencer.phase(), Phase::Playing { .. }));
    assert_eq!(bench.target().unwrap().speed_rad_s, 2.0);
}

#[test]
fn a_silent_overloaded_or_faulty_servo_latches_the_safe_state() {
    type Break = fn(&mut ServoSeen);
    let faults: [(Break, FaultKind); 3] = [
        (|_| {}, FaultKind::ServoSilent { servo: 0 }),
        (|seen| seen.load = 0.9, FaultKind::ServoTorque { servo: 0, load: 0.9 }),
        (|seen| seen.error = 4, FaultKind::ServoError { servo: 0, bits: 4 }),
    ];
    for (break_it, expected) in faults {
        let mut bench = servo_arm();
        bench.command(Command::Play).unwrap();
        bench.servo(0.5).run(5);
        break_it(&mut bench.seen.servos[0]);
        assert_eq!(bench.run(25).fault(), Some(expected));
        assert_eq!(bench.outputs.servos[0], ServoAction::Hold);
    }
}

#[test]
fn stop_ends_the_motion_of_a_servo() {
    let mut bench = one_servo();
    bench.answer(0.6);
    bench.command(Command::Servo { servo: 0, angle_rad: 1.4 }).unwrap_err();
    bench.run(1).command(Command::Servo { servo: 0, angle_rad: 1.4 }).unwrap();
    assert!(bench.run(5).target().is_some());
    bench.command(Command::Stop).unwrap();
    assert_eq!(bench.run(1).outputs.servos[0], ServoAction::Hold);
}

#[test]
fn a_servo_that_never_answered_gets_no_target() {
    let mut bench = one_servo();
    let refused = bench.command(Command::Servo { servo: 0, angle_rad: 1.0 });
    assert_eq!(refused, Err(CommandError::ServoSilent { servo: 0 }));
    assert_eq!(bench.run(5).target(), None);
}

/// One that was cut off before the board started may bear the arm by what it was ordered in the run before.
#[test]
fn a_servo_that_never_answered_lets_nothing_be_driven() {
    let mut bench = Bench::new(&two_valves(&[servo(1), row_with_servo(0, "10", 1.0), end(90)]));
    for command in [Command::Play, Command::Coil { coil: 0, on_ms: 20 }, Command::Word(word("10"))] {
        assert_eq!(bench.run(500).command(command), Err(CommandError::ServoSilent { servo: 0 }), "{command:?}");
        assert_eq!(bench.run(50).outputs.lines, 0);
    }
}

#[test]
fn the_safe_state_has_no_target() {
    for (fallback, action) in [(Fallback::Hold, ServoAction::Hold), (Fallback::Release, ServoAction::Release)] {
        let records = two_valves(&[servo(1), row_with_servo(0, "10", 1.0), end(90)]);
        let mut bench = Bench::with(&records, |profile| profile.servos[0].fallback = fallback);
        bench.follows = false;
        bench.servo(0.6).run(1).command(Command::Play).unwrap();
        for _ in 0..31_000 {
            bench.servo(0.6).run(1);
        }
        assert_eq!(bench.fault(), Some(FaultKind::ServoStalled { servo: 0 }));
        assert_eq!(bench.outputs.servos[0], action);
    }
}

#[test]
fn a_calibration_moves_no_servo_and_widens_no_range() {
    let mut bench = one_servo();
    bench.answer(1.0);
    bench.run(1).command(Command::Servo { servo: 0, angle_rad: 1.2 }).unwrap();
    assert_eq!(bench.sequencer.calibrate([0.4, 0.0, 0.0, 0.0]), Ok(()));
    assert_eq!(bench.run(1).outputs.servos[0], ServoAction::Hold);
    let refused = bench.command(Command::Servo { servo: 0, angle_rad: 1.2 });
    assert!(matches!(refused, Err(CommandError::ServoRange { .. })), "the shaft would turn to 1.6 rad: {refused:?}");
    bench.command(Command::Servo { servo: 0, angle_rad: 1.0 }).unwrap();
    assert!(bench.run(1).target().is_some_and(|target| (target.angle_rad - 1.4).abs() < 1e-6));
}

#[test]
fn a_table_whose_rows_leave_the_profile_range_does_not_play() {
    let mut bench = Bench::new(&[start(), servo(1), row_with_servo(0, "", 1.4), end(10)]);
    bench.sequencer.calibrate([0.2, 0.0, 0.0, 0.0]).unwrap();
    assert!(matches!(bench.command(Command::Play), Err(CommandError::ServoRange { .. })));
}

/// While a flash is erased that holds the code too, neither ticks nor the servo bus run.
#[test]
fn time_without_ticks_is_no_silence_of_a_servo() {
    for (late_ms, ticks, fault) in
        [(45, 16, None), (400, 16, None), (45, 30, Some(FaultKind::ServoSilent { servo: 0 }))]
    {
        let mut bench = servo_arm();
        bench.command(Command::Play).unwrap();
        bench.servo(0.5).run(2);
        bench.now = bench.now + Micros::from_millis(late_ms);
        assert_eq!(bench.run(ticks).fault(), fault, "{late_ms} ms without ticks, then {ticks} of them");
        if fault.is_none() {
            assert_eq!(bench.run(4).fault(), Some(FaultKind::ServoSilent { servo: 0 }), "silent for 23 ticks");
        }
    }
}

#[test]
fn a_servo_moves_until_it_is_near_its_target() {
    let mut bench = one_servo();
    bench.answer(0.6);
    bench.run(1).command(Command::Servo { servo: 0, angle_rad: 1.4 }).unwrap();
    bench.run(1);
    assert!(bench.sequencer.has_moving_servo(&bench.seen));
    bench.answer(1.37);
    assert!(!bench.sequencer.has_moving_servo(&bench.seen), "a load keeps it a little away");
    bench.answer(0.6);
    bench.command(Command::Stop).unwrap();
    assert!(!bench.sequencer.has_moving_servo(&bench.seen));
}

/// Whatever it is to do: idle, by hand, in a program and after a stop.
#[test]
fn what_a_servo_does_that_nobody_allowed_is_a_fault_in_every_state() {
    type Reach = fn(&mut Bench);
    let states: [Reach; 4] = [
        |_| {},
        |bench| bench.command(Command::Servo { servo: 0, angle_rad: 0.5 }).unwrap(),
        |bench| bench.command(Command::Play).unwrap(),
        |bench| {
            bench.command(Command::Play).unwrap();
            bench.servo(0.5).run(5).command(Command::Stop).unwrap();
        },
    ];
    let faults = [
        (ServoBreach::Range, FaultKind::ServoRange { servo: 0, angle_rad: 0.5 }),
        (ServoBreach::Speed, FaultKind::ServoSpeed { servo: 0 }),
        (ServoBreach::Moved, FaultKind::ServoMoved { servo: 0 }),
    ];
    for reach in states {
        for (breach, fault) in faults {
            let mut bench = servo_arm();
            bench.servo(0.5).run(2);
            reach(&mut bench);
            assert_eq!(bench.servo(0.5).run(2).fault(), None);
            bench.seen.servo_breaches[0] = Some(breach);
            assert_eq!(bench.servo(0.5).run(1).fault(), Some(fault));
            assert_eq!(bench.outputs.servos[0], ServoAction::Hold);
        }
    }
}

#[test]
fn without_a_table_a_servo_out_of_its_range_is_a_fault_too() {
    let mut bench = servo_arm();
    assert!(bench.sequencer.unload().is_some());
    bench.servo(1.5).seen.servo_breaches[0] = Some(ServoBreach::Range);
    assert_eq!(bench.run(1).fault(), Some(FaultKind::ServoRange { servo: 0, angle_rad: 1.5 }));
}

/// An arm may hang on a servo that the table leaves out.
#[test]
fn a_servo_that_the_table_leaves_out_has_to_answer_too() {
    let servos = servo_arm().sequencer.profile.servos.clone();
    let mut bench =
        Bench::with(&two_valves(&[row(0, "10"), row(40, "11"), end(90)]), |profile| profile.servos = servos);
    bench.servo(0.0).run(1);
    bench.command(Command::Play).unwrap();
    assert_eq!(bench.run(10).fault(), None);
    assert_eq!(bench.run(20).fault(), Some(FaultKind::ServoSilent { servo: 0 }));
    bench.command(Command::Clear).unwrap();
    let silent = Err(CommandError::ServoSilent { servo: 0 });
    for command in [Command::Play, Command::Coil { coil: 0, on_ms: 10 }, Command::Word(word("10"))] {
        assert_eq!(bench.command(command), silent, "{command:?}");
    }
    assert_eq!(bench.command(Command::Coil { coil: 0, on_ms: 0 }), Ok(()), "off drives nothing");
    assert_eq!(bench.run(10).fault(), None, "nor does it begin what a silent servo would have to end");
}

#[test]
fn no_latch_is_reset_by_hand_while_a_servo_is_silent() {
    let latch = coil(0, Drive::Latch { set: 0, reset: 1, pulse_ms: 5 });
    let mut bench = Bench::new(&[start(), latch, actuator(0), servo(1), end(10)]);
    bench.servo(1.0).run(200);
    assert_eq!(bench.command(Command::Coil { coil: 0, on_ms: 0 }), Err(CommandError::ServoSilent { servo: 0 }));
    assert_eq!((bench.run(20).outputs.lines, bench.fault()), (0, None));
}
