//! Limits of outputs and of the supply against what lines really do: stops between ticks, rows that crowd, late ticks.

use super::*;

fn wired(drive: Drive, limit: CoilLimit) -> [Record; 2] {
    let coil = Coil { output: 0, drive, limit };
    [Record::Coil(coil), Record::Actuator(ActuatorWiring { states: 2, switch: None, travel_ms: 0 })]
}

fn row_at_us(at_us: u64, digits: &str) -> Record {
    Record::Row(Row { at: Micros(at_us), word: word(digits), servos: heapless::Vec::new() })
}

/// Ticks whose times are a few microseconds off.
fn run_unevenly(bench: &mut Bench, ticks: u64, noise: &mut u32) {
    let begun_ms = bench.now.0 / MS;
    for tick in 1..=ticks {
        *noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        bench.now = Micros((begun_ms + tick) * MS + u64::from(*noise >> 16) % 8);
        bench.outputs = bench.sequencer.step(bench.now, &bench.seen);
    }
}

/// A stop comes between two ticks, and its line is high until the next one.
#[test]
fn current_that_a_stop_ends_is_counted() {
    let limit = CoilLimit { max_on_ms: 100, duty_percent: 5, window_ms: 10_000 };
    let records = [&[start()], wired(Drive::Hold { line: 0 }, limit).as_slice(), &[end(10)]].concat();
    let mut bench = Bench::new(&records);
    bench.follows = false;
    let mut high_ms = 0;
    for tick in 0..10_000 {
        match tick % 6 {
            0 => drop(bench.command(Command::Coil { coil: 0, on_ms: 50 })),
            2 => bench.command(Command::Stop).unwrap(),
            _ => {}
        }
        high_ms += bench.run(1).outputs.lines & 1;
    }
    assert!((400..=500).contains(&high_ms), "high for {high_ms} ms of 10 s, 500 are allowed");
}

#[test]
fn rows_do_not_crowd_behind_each_other() {
    let limit = CoilLimit { max_on_ms: 1000, duty_percent: 100, window_ms: 10_000 };
    let crowded = |apart_us: u64| {
        let rows = (0..40).map(|number| row_at_us(number * apart_us, "0"));
        let records = [start()].into_iter().chain(wired(Drive::Hold { line: 0 }, limit)).chain(rows).chain([end(50)]);
        let records: Vec<_> = records.collect();
        admitted(&records, &profile(&records)).is_some()
    };
    assert!(crowded(1000));
    assert!(!crowded(999), "one row goes out in a tick: the others are late, and their feed is counted too early");
}

#[test]
fn a_tick_that_is_a_little_late_is_no_fault() {
    let mut noise = 1;
    for _ in 0..100 {
        let limit = CoilLimit { max_on_ms: 20, duty_percent: 50, window_ms: 1600 };
        let latch = wired(Drive::Latch { set: 0, reset: 1, pulse_ms: 20 }, limit);
        let mut bench = Bench::new(&[&[start()], latch.as_slice(), &[row(0, "1"), end(100)]].concat());
        bench.command(Command::Play).unwrap();
        run_unevenly(&mut bench, 90, &mut noise);
        assert_eq!(bench.fault(), None, "a pulse as long as the longest on-time");
        let mut bench =
            Bench::new(&[&[start()], wired(Drive::Hold { line: 0 }, limit).as_slice(), &[end(100)]].concat());
        bench.command(Command::Coil { coil: 0, on_ms: 20 }).unwrap();
        run_unevenly(&mut bench, 90, &mut noise);
        assert_eq!(bench.fault(), None, "on by hand for the longest on-time");
    }
}

/// On at a tick, off 1 µs after another: each pulse is a tick longer than its rows say.
#[test]
fn a_rehearsal_counts_in_ticks() {
    for duty_percent in [40, 50, 60] {
        let limit = CoilLimit { max_on_ms: 100, duty_percent, window_ms: 1600 };
        for n_pulses in (5..205).step_by(20) {
            let pulses =
                (0..n_pulses).flat_map(|number| [row_at_us(8000 * number, "1"), row_at_us(8000 * number + 4001, "0")]);
            let coil = wired(Drive::Hold { line: 0 }, limit);
            let records: Vec<_> = [start()].into_iter().chain(coil).chain(pulses).chain([end(2000)]).collect();
            if admitted(&records, &profile(&records)).is_none() {
                continue;
            }
            let mut bench = Bench::new(&records);
            bench.follows = false;
            bench.command(Command::Play).unwrap();
            bench.run(2050);
            assert_eq!(bench.fault(), None, "{n_pulses} pulses, {duty_percent} %");
        }
    }
}

/// A meter closes its buckets where its own time falls, not where the program begins: what is let begin must get through
/// wherever that is.
#[test]
fn a_program_that_is_let_begin_breaks_no_limit() {
    let mut begun = 0;
    let limit = CoilLimit { max_on_ms: 1000, duty_percent: 60, window_ms: 1600 };
    for (pause_ms, wait_ms) in
        (600..960).step_by(4).flat_map(|pause| (0..2000).step_by(85).map(move |wait| (pause, wait)))
    {
        let rows = [row(0, "1"), row(480, "0"), row(480 + pause_ms, "1"), row(950 + pause_ms, "0"), end(3000)];
        let coil = wired(Drive::Hold { line: 0 }, limit);
        let records: Vec<_> = [start()].into_iter().chain(coil).chain(rows).collect();
        let Some(table) = admitted(&records, &profile(&records)) else { continue };
        let mut bench = Bench::new(&records);
        bench.follows = false;
        bench.command(Command::Coil { coil: 0, on_ms: 9 }).unwrap();
        bench.run(20 + wait_ms).command(Command::Stop).unwrap();
        table.recall(bench.sequencer.used());
        if table.rehearse(0..4).is_ok() {
            begun += 1;
            // As long as servos take to come to the first row.
            bench.run(wait_ms % 97).command(Command::Play).unwrap();
            bench.run(3100);
            assert_eq!(bench.fault(), None, "second pulses {pause_ms} ms later, after a wait of {wait_ms} ms");
        }
    }
    assert!(begun > 20, "only {begun} programs were let begin");
}

const PEAK: Drive = Drive::PeakHold { pull: 0, hold: 1, peak_ms: 50 };
const UNLIMITED: CoilLimit = CoilLimit { max_on_ms: 60_000, duty_percent: 100, window_ms: 60_000 };

/// An output with a peak of 50 ms: 500 ms from the beginning of one to that of the next.
fn with_peak(rows: &[Record]) -> Vec<Record> {
    [&[start()], wired(PEAK, UNLIMITED).as_slice(), rows].concat()
}

fn peak_bench(rows: &[Record]) -> Bench {
    let mut bench = Bench::new(&with_peak(rows));
    bench.follows = false;
    bench
}

#[test]
fn full_current_by_hand_is_on_for_a_tenth_of_the_time_at_most() {
    let mut bench = peak_bench(&[end(10)]);
    let mut full_ms = 0;
    for tick in 0..5_000 {
        match tick % 50 {
            0 => drop(bench.command(Command::Word(word("1")))),
            49 => bench.command(Command::Word(word("0"))).unwrap(),
            _ => {}
        }
        full_ms += bench.run(1).outputs.lines & 1;
    }
    assert!((400..=500).contains(&full_ms), "full current for {full_ms} ms of 5 s, 500 are allowed");
    assert_eq!(bench.fault(), None, "what breaks the limit is refused beforehand");
}

#[test]
fn a_second_peak_by_hand_is_refused_until_its_pause_is_over() {
    let mut bench = peak_bench(&[end(10)]);
    let commands = [Command::Word(word("1")), Command::Coil { coil: 0, on_ms: 5 }];
    for command in commands {
        bench.command(command).unwrap();
        assert_eq!(bench.run(1).outputs.lines, 0b11);
        bench.command(command).expect("it is on already");
        bench.run(59).command(Command::Stop).unwrap();
        for refused in commands {
            let recovering = CommandError::Recovering { output: 0, left_ms: 0, wait_ms: 441 };
            assert_eq!(bench.command(refused), Err(recovering));
        }
        assert_eq!(bench.run(441).outputs.lines, 0);
    }
    bench.command(commands[0]).unwrap();
    assert_eq!(bench.run(1).outputs.lines, 0b11);
}

#[test]
fn no_reset_and_no_other_table_forgets_a_peak() {
    let records = with_peak(&[end(10)]);
    let profile = Box::leak(Box::new(profile(&records)));
    let on = Command::Coil { coil: 0, on_ms: 5 };
    let refused = |wait_ms| Err(CommandError::Recovering { output: 0, left_ms: 0, wait_ms });
    let mut sequencer = Sequencer::new(Box::leak(Box::default()));
    sequencer.configure(profile);
    sequencer.load(table(&records, profile)).expect("a new sequencer is idle");
    take_over(&mut sequencer);
    assert_eq!(sequencer.command(on), refused(500), "nobody knows when the last peak was");
    sequencer.step(Micros::from_millis(500), &Seen::default());
    sequencer.command(on).unwrap();
    sequencer.step(Micros::from_millis(501), &Seen::default());
    sequencer.command(Command::Stop).unwrap();
    let _ = sequencer.unload();
    sequencer.load(table(&records, profile)).expect("nothing runs");
    sequencer.step(Micros::from_millis(600), &Seen::default());
    assert_eq!(sequencer.command(on), refused(401));
}

#[test]
fn a_program_that_is_played_again_waits_for_the_pauses_of_peaks() {
    let mut bench = peak_bench(&[row(0, "1"), row(60, "0"), end(100)]);
    bench.command(Command::Play).unwrap();
    bench.run(110);
    assert_eq!(bench.sequencer.phase(), Phase::Idle);
    bench.command(Command::Play).unwrap();
    assert_eq!(bench.run(390).outputs.lines, 0);
    assert!(matches!(bench.sequencer.phase(), Phase::Approaching { .. }));
    assert_eq!(bench.run(1).outputs.lines, 0b11, "501 ms after the first time");
    assert_eq!(bench.run(110).fault(), None);
    assert_eq!(bench.sequencer.phase(), Phase::Idle);
}

#[test]
fn a_peak_that_a_late_tick_brings_too_near_latches_the_safe_state() {
    for (late_ms, fault) in [(2, None), (3, Some(FaultKind::Duty { output: 0 }))] {
        let mut bench = peak_bench(&[row(0, "0"), row(10, "1"), row(70, "0"), row(512, "1"), end(600)]);
        bench.command(Command::Play).unwrap();
        bench.run(10);
        bench.now = bench.now + Micros::from_millis(late_ms);
        assert_eq!(bench.run(1).outputs.lines, 0b11);
        bench.run(530);
        assert_eq!(bench.fault(), fault, "the first peak is {late_ms} ms late");
        assert_eq!(bench.outputs.lines == 0, fault.is_some());
    }
}

/// A table whose output 0 has peaks of this length, under a profile that allows 1 s.
fn with_peaks_of(peak_ms: u16) -> Vec<Record> {
    let drive = Drive::PeakHold { pull: 0, hold: 1, peak_ms };
    [&[start()], wired(drive, UNLIMITED).as_slice(), &[end(10)]].concat()
}

impl Bench {
    /// Puts another table in the place of the loaded one, while nothing runs.
    fn replace(&mut self, records: &[Record]) {
        let profile = self.sequencer.profile();
        self.command(Command::Stop).unwrap();
        self.run(2).sequencer.unload().expect("nothing runs");
        self.sequencer.load(table(records, profile)).expect("nothing is loaded");
    }

    /// Switches output 0 on whenever that is possible; for how long its full current flowed, and since when, in ms.
    fn peaks_whenever_possible(&mut self, on_ms: u32, ticks: u64) -> (u64, Option<u64>) {
        let (mut full_ms, mut first) = (0, None);
        for _ in 0..ticks {
            if self.outputs.lines == 0 {
                let _ = self.command(Command::Coil { coil: 0, on_ms });
            }
            if self.run(1).outputs.lines & 1 == 1 {
                full_ms += 1;
                first = first.or(Some((self.now - self.begun).0 / MS));
            }
        }
        (full_ms, first)
    }
}

#[test]
fn a_second_table_waits_for_the_pause_after_a_peak_of_the_first() {
    let mut bench = Bench::new(&with_peaks_of(1000));
    bench.follows = false;
    bench.command(Command::Coil { coil: 0, on_ms: 1000 }).unwrap();
    bench.run(1005).replace(&with_peaks_of(100));
    assert_eq!(bench.peaks_whenever_possible(100, 8_990), (0, None), "full current for 1 s of 10 s");
    let (_, first_ms) = bench.peaks_whenever_possible(100, 100);
    assert_eq!(first_ms, Some(10_002), "the pause after the long peak is over");
}

#[test]
fn a_long_peak_after_short_ones_waits_for_its_own_pause() {
    let mut bench = Bench::new(&with_peaks_of(1000));
    bench.follows = false;
    bench.replace(&with_peaks_of(100));
    let (full_ms, _) = bench.peaks_whenever_possible(50, 9_000);
    assert!((400..=450).contains(&full_ms), "cut peaks are a second apart: {full_ms} ms");
    let last_ms = (bench.now - bench.begun).0 / MS;
    bench.replace(&with_peaks_of(1000));
    let (_, first_ms) = bench.peaks_whenever_possible(1000, 10_000);
    assert!(first_ms > Some(last_ms + 9_000), "the last short peak began at most 1 s before: {first_ms:?}");
}

#[test]
fn after_a_reset_the_longest_peak_of_the_profile_counts() {
    let (long, short) = (with_peaks_of(1000), with_peaks_of(100));
    let profile = Box::leak(Box::new(profile(&long)));
    let mut sequencer = Sequencer::new(Box::leak(Box::default()));
    sequencer.configure(profile);
    sequencer.load(table(&short, profile)).expect("a new sequencer is idle");
    take_over(&mut sequencer);
    let refused = Err(CommandError::Recovering { output: 0, left_ms: 0, wait_ms: 10_000 });
    assert_eq!(sequencer.command(Command::Coil { coil: 0, on_ms: 5 }), refused);
}
