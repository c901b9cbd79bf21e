//! Mistakes of wiring, and what a bring-up finds with a person who looks and without one.

use darm_core::output::{Drive, Wiring};

use super::STOP;
use darm_device::bringup::Kind;
use darm_sim::plant::Broken;

/// A mistake.
pub(super) struct Mistake {
    pub(super) what: &'static str,
    /// Makes it in an arm that is wired as its files say.
    pub(super) make: fn(&mut Wiring, &mut Broken),
    /// The input that the emergency stop acts on.
    pub(super) stop_at: Option<u8>,
    /// What is found.
    pub(super) found: fn() -> Vec<Kind>,
    /// What is found where nobody looks.
    pub(super) unwatched: fn() -> Vec<Kind>,
    /// The profile is right after this number of bring-ups and corrections; 0: it takes a soldering iron.
    pub(super) rounds: usize,
}

const fn mistake(what: &'static str, make: fn(&mut Wiring, &mut Broken)) -> Mistake {
    Mistake { what, make, stop_at: Some(STOP), found: Vec::new, unwatched: Vec::new, rounds: 0 }
}

impl Mistake {
    const fn found(self, found: fn() -> Vec<Kind>) -> Self {
        Self { found, ..self }
    }

    const fn unwatched(self, unwatched: fn() -> Vec<Kind>) -> Self {
        Self { unwatched, ..self }
    }

    const fn stop_at(self, input: u8) -> Self {
        Self { stop_at: Some(input), ..self }
    }

    const fn corrected_in(self, rounds: usize) -> Self {
        Self { rounds, ..self }
    }
}

pub(super) const NONE: Mistake = mistake("none", |_, _| {});
pub(super) const SLOW: Mistake = mistake("slow", |wiring, _| wiring.actuators[1].travel_ms = 600);
pub(super) const SHIFTED: &str = "the plug of outputs 0 to 2 is shifted by one line";

fn line(wiring: &mut Wiring, coil: usize, line: u8) {
    wiring.coils[coil].drive = Drive::Hold { line };
}

fn input(wiring: &mut Wiring, actuator: usize, input: u8) {
    let switch = wiring.actuators[actuator].switch.as_mut();
    switch.unwrap().input = input;
}

fn either(output: u8, inputs: &[u8]) -> Kind {
    Kind::OutputOrSwitch { output, inputs: inputs.to_vec() }
}

fn swap_outputs(wiring: &mut Wiring) {
    line(wiring, 0, 1);
    line(wiring, 1, 0);
}

fn swap_switches(wiring: &mut Wiring) {
    input(wiring, 0, 1);
    input(wiring, 1, 0);
}

pub(super) const MISTAKES: &[Mistake] = &[
    mistake("the wires of outputs 0 and 1 are exchanged", |wiring, _| swap_outputs(wiring))
        .found(|| vec![Kind::OutputsSwapped { outputs: [0, 1] }])
        .unwatched(|| vec![either(0, &[1]), either(1, &[0])])
        .corrected_in(1),
    mistake("the wires of switches 0 and 1 are exchanged", |wiring, _| swap_switches(wiring))
        .found(|| vec![Kind::SwitchesSwapped { actuators: [0, 1] }])
        .unwatched(|| vec![either(0, &[1]), either(1, &[0])])
        .corrected_in(1),
    // The inputs show nothing of this one: each output closes the switch that it should.
    mistake("outputs 0 and 1 and switches 0 and 1 are exchanged", |wiring, _| {
        swap_outputs(wiring);
        swap_switches(wiring);
    })
    .found(|| vec![Kind::OutputsSwapped { outputs: [0, 1] }])
    .corrected_in(2),
    mistake("three outputs are rotated", |wiring, _| {
        line(wiring, 0, 1);
        line(wiring, 1, 2);
        line(wiring, 2, 0);
    })
    .found(|| [(0, 2), (1, 0), (2, 1)].map(|(output, actuator)| Kind::MovesOther { output, actuator }).to_vec())
    .unwatched(|| vec![either(0, &[2]), either(1, &[0]), either(2, &[1])])
    .corrected_in(1),
    mistake(SHIFTED, |wiring, _| (0..3).for_each(|coil| line(wiring, coil, coil as u8 + 1)))
        .found(|| {
            vec![
                Kind::NoMotion { output: 0 },
                Kind::MovesOther { output: 1, actuator: 0 },
                Kind::MovesOther { output: 2, actuator: 1 },
                Kind::MovesSeveral { output: 3, actuators: vec![2, 3] },
            ]
        })
        .unwatched(|| {
            let silent = Kind::NoResponse { output: 0, closed: false };
            // Actuator 2 follows the full current of output 3 and is back before it is looked at.
            vec![silent, either(1, &[0]), either(2, &[1])]
        }),
    mistake("switch 0 is at input 9", |wiring, _| input(wiring, 0, 9))
        .found(|| vec![Kind::SwitchElsewhere { actuator: 0, input: 9 }])
        .unwatched(|| vec![either(0, &[9])])
        .corrected_in(1),
    mistake("the wire of output 1 is at a line that the profile does not have", |wiring, _| line(wiring, 1, 20))
        .found(|| vec![Kind::NoMotion { output: 1 }])
        .unwatched(|| vec![Kind::NoResponse { output: 1, closed: false }]),
    mistake("the driver of line 1 is shorted", |_, broken| broken.lines_high = 1 << 1)
        .found(|| vec![Kind::AlwaysOn { output: 1 }])
        .unwatched(|| vec![Kind::NoResponse { output: 1, closed: true }]),
    mistake("switch 1 is shorted to the supply", |_, broken| broken.switches_closed |= 1 << 1)
        .found(|| vec![Kind::SwitchStuck { actuator: 1, closed: true }])
        .unwatched(|| vec![Kind::NoResponse { output: 1, closed: true }]),
    mistake("the wire of switch 1 is broken", |_, broken| broken.switches_open = 1 << 1)
        .found(|| vec![Kind::SwitchStuck { actuator: 1, closed: false }])
        .unwatched(|| vec![Kind::NoResponse { output: 1, closed: false }]),
    mistake("switch 2 is wired to its other contact", |wiring, _| {
        wiring.actuators[2].switch.as_mut().unwrap().closed_in = 0b10;
    })
    .found(|| vec![Kind::SwitchInverted { actuator: 2 }])
    .unwatched(|| vec![Kind::Inverted { output: 2 }]),
    mistake("the coils of actuators 0 and 1 are both at line 0", |wiring, _| line(wiring, 1, 0))
        .found(|| vec![Kind::MovesSeveral { output: 0, actuators: vec![0, 1] }])
        .unwatched(|| vec![either(0, &[0, 1]), Kind::NoResponse { output: 1, closed: false }]),
    mistake("a bridge of solder joins lines 0 and 1", |_, broken| broken.lines_joined = 0b11)
        .found(|| vec![Kind::OutputsJoined { outputs: vec![0, 1] }])
        .unwatched(|| vec![either(0, &[0, 1]), either(1, &[0, 1])]),
    mistake("a bridge of solder joins inputs 0 and 1", |_, broken| broken.switches_joined = 0b11)
        .found(|| vec![Kind::InputsJoined { inputs: vec![0, 1] }])
        .unwatched(|| vec![either(0, &[0, 1]), either(1, &[0, 1])]),
    mistake("the pull wire of solenoid 3 is missing", |wiring, _| {
        wiring.coils[3].drive = Drive::PeakHold { pull: 63, hold: 4, peak_ms: 100 };
    })
    .found(|| vec![Kind::NoMotion { output: 3 }])
    .unwatched(|| vec![Kind::NoResponse { output: 3, closed: false }]),
    mistake("the hold wire of solenoid 3 is missing", |wiring, _| {
        wiring.coils[3].drive = Drive::PeakHold { pull: 3, hold: 63, peak_ms: 100 };
    })
    .found(|| vec![Kind::DropsOut { output: 3 }])
    .unwatched(|| vec![Kind::DropsOut { output: 3 }]),
    mistake("set and reset of latch 4 are exchanged", |wiring, _| {
        wiring.coils[4].drive = Drive::Latch { set: 6, reset: 5, pulse_ms: 20 };
    })
    .found(|| vec![Kind::LatchReversed { output: 4 }])
    .unwatched(|| vec![Kind::Inverted { output: 4 }])
    .corrected_in(1),
    mistake("the reset wire of latch 4 is missing", |wiring, _| {
        wiring.coils[4].drive = Drive::Latch { set: 5, reset: 63, pulse_ms: 20 };
    })
    .found(|| vec![Kind::NotReturning { output: 4 }])
    .unwatched(|| vec![Kind::NotReturning { output: 4 }]),
    mistake("the coils of joint 5 are exchanged", |wiring, _| {
        line(wiring, 5, 8);
        line(wiring, 6, 7);
    })
    .found(|| vec![Kind::CoilsSwapped { actuator: 5 }])
    .unwatched(|| vec![Kind::CoilsSwapped { actuator: 5 }])
    .corrected_in(1),
    mistake("the driver of line 1 is inverted", |_, broken| broken.lines_inverted = 1 << 1)
        .found(|| vec![Kind::DriveInverted { output: 1 }])
        .unwatched(|| vec![Kind::Inverted { output: 1 }]),
    mistake("the contact of switch 0 is loose", |_, broken| broken.switches_loose = 1)
        .found(|| vec![Kind::LooseContact { input: 0 }])
        .unwatched(|| vec![Kind::LooseContact { input: 0 }]),
    mistake("the coils have no supply", |_, broken| broken.lines_low = u64::MAX)
        .found(|| vec![Kind::NothingMoves])
        .unwatched(|| vec![Kind::NothingResponds]),
    mistake("the common wire of the switches is missing", |_, broken| broken.switches_open = 0b11_1111)
        .found(|| vec![Kind::NoSwitchCloses])
        .unwatched(|| vec![Kind::NothingResponds]),
    mistake("the wire of the emergency stop is broken", |_, broken| broken.switches_open = 1 << STOP)
        .found(|| vec![Kind::StopPressed { input: STOP }])
        .unwatched(|| vec![Kind::StopPressed { input: STOP }]),
    mistake("the emergency stop and switch 0 are exchanged", |wiring, broken| {
        broken.switches_closed = 1;
        input(wiring, 0, STOP);
    })
    .stop_at(0)
    .found(|| vec![Kind::StopSwapped { input: STOP, with: 0 }])
    .unwatched(|| vec![Kind::StopSwapped { input: STOP, with: 0 }])
    .corrected_in(1),
    Mistake { stop_at: None, ..mistake("the contact of the emergency stop is bridged", |_, _| {}) }
        .found(|| vec![Kind::StopDead { input: STOP }]),
];
