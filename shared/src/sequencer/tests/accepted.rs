//! Programs that the board accepts, in time: no limit of on-time latches.

extern crate std;
use std::vec::Vec;

use super::{Bench, profile};
use crate::output::{ActuatorWiring, Coil, CoilLimit, Drive, SwitchLimit};
use crate::sequencer::{Command, Phase};
use crate::table::{Board, Checker, Record, Row};
use crate::units::{Micros, ModelHash, Word};

struct Random(u64);

impl Random {
    fn below(&mut self, n: u32) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as u32 % n
    }
}

/// Valves and latches whose pulses and stays are as short as may be, on the first outputs or on all of a board.
fn wiring(random: &mut Random) -> Vec<Record> {
    let switch_limit = SwitchLimit { new_coils: 16, window_ms: 1 };
    let start = Record::Start { model: ModelHash(1), device: None, profile: super::PROFILE, switch_limit };
    let (count, apart) = (1 + random.below(5) as u8, 1 + random.below(9) as u8);
    let coils = (0..count).map(|index| {
        let (first, second, burst_ms) = (2 * index, 2 * index + 1, 1 + random.below(6) as u16);
        let (drive, max_on_ms) = match random.below(3) {
            0 => (Drive::Hold { line: first }, 20 + random.below(60)),
            1 => (Drive::PeakHold { pull: first, hold: second, peak_ms: burst_ms }, 20 + random.below(60)),
            _ => (Drive::Latch { set: first, reset: second, pulse_ms: burst_ms }, burst_ms.into()),
        };
        let limit = CoilLimit { max_on_ms, duty_percent: 100, window_ms: 1600 };
        Record::Coil(Coil { output: index * apart, drive, limit })
    });
    let coils: Vec<_> = coils.collect();
    let travel_ms = random.below(3) as u16;
    let actuator = Record::Actuator(ActuatorWiring { states: 2, switch: None, travel_ms });
    let actuators = coils.iter().map(|_| actuator.clone()).collect::<Vec<_>>();
    [&[start], &coils[..], &actuators].concat()
}

/// Rows that follow each other as fast as the board accepts them.
fn program(random: &mut Random) -> Vec<Record> {
    let mut records = wiring(random);
    let profile = profile(&records);
    let board = Board { device: None, profile: &profile };
    let is_accepted = |records: &[Record]| {
        let mut checker = Checker::default();
        records.iter().all(|record| checker.admit(record, &board).is_ok())
    };
    let (mut digits, mut at) = (std::vec![0; records.len() / 2], Micros(0));
    for _ in 0..100 {
        let moved = random.below(digits.len() as u32) as usize;
        digits[moved] ^= 1;
        let row = Row { at, word: Word::new(&digits).unwrap(), servos: heapless::Vec::new() };
        records.push(Record::Row(row));
        if !is_accepted(&records) {
            records.pop();
            digits[moved] ^= 1;
        }
        at = at + Micros((1000 * (1 + random.below(3)) + random.below(2) * random.below(1000)).into());
    }
    records.push(Record::End { at });
    while !is_accepted(&records) {
        let end = records.pop();
        records.pop();
        records.extend(end);
    }
    records
}

#[test]
fn a_program_that_the_board_accepts_latches_no_limit_of_on_time_in_time() {
    let mut n_rows = 0;
    for seed in 0..60 {
        let mut random = Random(seed);
        let records = program(&mut random);
        n_rows += records.iter().filter(|record| matches!(record, Record::Row(_))).count();
        let mut bench = Bench::new(&records);
        bench.follows = false;
        // Cut by a stop, and begun again at once.
        for cut_ms in [random.below(40), random.below(40), 5_000] {
            bench.command(Command::Play).unwrap();
            for _ in 0..cut_ms {
                bench.run(1);
                assert_eq!(bench.fault(), None, "seed {seed}");
                if bench.sequencer.phase() == Phase::Idle {
                    break;
                }
            }
            bench.command(Command::Stop).unwrap();
        }
    }
    assert!(n_rows > 600, "{n_rows} rows");
}
