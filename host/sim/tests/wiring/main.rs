//! An arm that is wired literally by its wiring list: each line of the list, and nothing else, decides what is connected to what.

mod random_arm;

use std::path::Path;

use darm_arm::arm::Arm;
use darm_arm::board_profile::BoardProfile;
use darm_arm::plan::{Visit, plan};
use darm_arm::wiring_list::{CSV_HEADER, WiringList};
use darm_core::output::{ActuatorWiring, Coil, Drive, LimitSwitch, Wiring};
use darm_core::profile::Profile;
use darm_core::sequencer::{Command, Phase};
use darm_core::units::Word;
use darm_device::client::Client;
use darm_sim::in_process::{InProcess, MemoryFlash};
use darm_sim::plant::Plant;
use random_arm::{Draw, files};

/// Arms that are wired and played.
const ARMS: u64 = 20;
const VISITS: usize = 8;
const DWELL_S: f64 = 0.1;

/// A line of the list, as an electrician reads it.
struct Line {
    output: u8,
    /// Line of the chain by chip and pin, eight pins to a chip.
    line: u8,
    coil: String,
    actuator: usize,
    /// Input and states of the switch.
    switch: Option<(u8, u8)>,
}

fn read(csv: &str) -> Vec<Line> {
    let (head, lines) = csv.split_once('\n').unwrap();
    assert_eq!(head, CSV_HEADER);
    let line = |text: &str| {
        let cells: Vec<&str> = text.split(',').collect();
        let [output, _, chip, pin, _, coil, actuator, _, _, input, _, closed_in] = cells[..] else { panic!("{text}") };
        let pins = ["QA", "QB", "QC", "QD", "QE", "QF", "QG", "QH"];
        let place = pins.iter().position(|name| *name == pin).unwrap() as u8;
        let states = closed_in.split_whitespace().map(|state| 1u8 << state.parse::<u8>().unwrap());
        Line {
            output: output.parse().unwrap(),
            line: 8 * chip.parse::<u8>().unwrap() + place,
            coil: coil.to_owned(),
            actuator: actuator.parse().unwrap(),
            switch: input.parse().ok().map(|input| (input, states.sum())),
        }
    };
    lines.lines().map(line).collect()
}

/// What hangs on the board by the list. Limits are on the board, not in the wires.
fn wired(lines: &[Line], arm: &Arm, profile: &Profile) -> Wiring {
    let mut wiring = Wiring::default();
    for (actuator, connection) in arm.connections.iter().enumerate() {
        let own: Vec<&Line> = lines.iter().filter(|line| line.actuator == actuator).collect();
        let mut outputs: Vec<u8> = own.iter().map(|line| line.output).collect();
        outputs.dedup();
        for &output in &outputs {
            let line =
                |coil: &str| own.iter().find(|line| line.output == output && line.coil == coil).map(|line| line.line);
            let drive = match (line("valve"), line("pull-in").zip(line("holding")), line("set").zip(line("reset"))) {
                (Some(line), None, None) => Drive::Hold { line },
                (None, Some((pull, hold)), None) => Drive::PeakHold { pull, hold, peak_ms: 10 },
                (None, None, Some((set, reset))) => Drive::Latch { set, reset, pulse_ms: 20 },
                other => panic!("output {output}: {other:?}"),
            };
            wiring.coils.push(Coil { output, drive, limit: profile.output(output).unwrap().limit }).unwrap();
        }
        let switch = own.iter().find_map(|line| line.switch).map(|(input, closed_in)| LimitSwitch { input, closed_in });
        let states = arm.model.chain.n_states(actuator) as u8;
        wiring.actuators.push(ActuatorWiring { states, switch, travel_ms: connection.travel_ms }).unwrap();
    }
    wiring
}

#[test]
fn an_arm_wired_by_its_list_goes_to_the_words_of_the_table() {
    for seed in 0..ARMS {
        let mut draw = Draw::new(seed);
        let (arm, profile) = files(&mut draw);
        let arm = Arm::parse(Path::new("arm.toml"), &arm).unwrap();
        let profile = BoardProfile::parse(Path::new("profile.toml"), &profile).unwrap();
        let list = WiringList::new(&arm, &profile);
        assert!(list.contradictions.is_empty(), "seed {seed}: {:?}", list.contradictions);
        let wiring = wired(&read(&list.csv()), &arm, &profile.profile);
        let board = InProcess::boot(Plant::new(&wiring, &[]), MemoryFlash::with_profile(&profile.image())).unwrap();
        play(seed, &arm, &profile, &board, &mut draw);
    }
}

/// Plays random words, and looks where the arm is in the middle of each rest.
fn play(seed: u64, arm: &Arm, profile: &BoardProfile, board: &InProcess, draw: &mut Draw) {
    let n_states = |actuator: usize| arm.model.chain.n_states(actuator) as u64;
    let mut word = || {
        (0..arm.n_actuators())
            .fold(arm.rest(), |word, actuator| word.with_digit(actuator, draw.below(n_states(actuator)) as u8))
    };
    let words: Vec<Word> = (0..VISITS).map(|_| word()).collect();
    let visit = |&word: &Word| Visit { word, servos_rad: Vec::new(), dwell_s: DWELL_S, label: word.to_string() };
    let visits: Vec<Visit> = words.iter().map(visit).collect();
    let plan = plan(arm, &visits, &profile.board(None), &[]).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
    let mut client = Client::connect_as(board.link(), 1).unwrap();
    client.upload(&plan.image, &mut |_| {}).unwrap();
    client.command(Command::Play).unwrap();
    // Latches are set before the first row.
    let is_playing = |client: &mut Client| matches!(client.status().unwrap().phase, Phase::Playing { .. });
    let started = (0..1000).any(|_| {
        board.pass(0.001);
        is_playing(&mut client)
    });
    assert!(started, "seed {seed}: {:?}", client.status().unwrap().phase);
    let started_s = board.now_s();
    for (word, (from, to)) in words.iter().zip(&plan.windows) {
        let middle_s = 0.5e-6 * (from.0 + to.0) as f64;
        board.pass((started_s + middle_s - board.now_s()).max(0.0));
        assert_eq!(board.state().unwrap().reached, *word, "seed {seed}");
    }
    board.pass(1.0);
    // A switch at a wrong input would have latched the safe state.
    assert_eq!(client.status().unwrap().phase, Phase::Idle, "seed {seed}");
}
