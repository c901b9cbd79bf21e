//! Findings in words: the wires, what the files say, what was seen, what to do.

use super::kind::Kind;
use super::subject::Subject;

/// Wires, expected, seen, cure.
type Words = [String; 4];

pub(super) fn words(kind: &Kind, subject: &Subject) -> Words {
    match kind {
        Kind::NothingMoves | Kind::NothingResponds | Kind::NoSwitchCloses => of_all(kind),
        Kind::NoMotion { output }
        | Kind::NoResponse { output, .. }
        | Kind::AlwaysOn { output }
        | Kind::DropsOut { output }
        | Kind::NotReturning { output } => of_motion(kind, *output, subject),
        Kind::MovesOther { .. }
        | Kind::OutputsSwapped { .. }
        | Kind::MovesSeveral { .. }
        | Kind::OutputsJoined { .. }
        | Kind::CoilsSwapped { .. } => of_outputs(kind, subject),
        Kind::DriveInverted { output } | Kind::LatchReversed { output } | Kind::Inverted { output } => {
            of_inversion(kind, *output, subject)
        }
        Kind::SwitchElsewhere { .. }
        | Kind::SwitchesSwapped { .. }
        | Kind::SwitchStuck { .. }
        | Kind::SwitchInverted { .. }
        | Kind::Slow { .. } => of_switches(kind, subject),
        Kind::InputsJoined { .. } | Kind::LooseContact { .. } | Kind::OutputOrSwitch { .. } => of_inputs(kind, subject),
        Kind::StopPressed { input } | Kind::StopSwapped { input, .. } | Kind::StopDead { input } => {
            of_stop(kind, *input, subject)
        }
    }
}

fn of_all(kind: &Kind) -> Words {
    let moves = "each output moves its actuator".to_owned();
    match kind {
        Kind::NothingMoves => [
            "supply of the coils, output enable, data, clock and latch of the chain".into(),
            moves,
            "no output moves anything".into(),
            "measure the supply of the coils behind the emergency stop, then output enable (low while an output is on), then \
             the latch line; `darm status` prints the chips of a chain that is wired back"
                .into(),
        ],
        Kind::NothingResponds => [
            "supply of the coils, the chain, or the common wire of the switches".into(),
            "each output changes the input of its switch".into(),
            "no input changed at any output; nobody looked whether anything moves".into(),
            "run it without --yes and look: where nothing moves it is the supply or the chain, else the common wire of the \
             switches"
                .into(),
        ],
        _ => [
            "common wire of the switches".into(),
            "a switch that is closed connects its input to 3.3 V".into(),
            "actuators move, and every input is open all the time".into(),
            "measure 3.3 V at the common wire of the switches; an input is open at 0 V, closed at 3.3 V".into(),
        ],
    }
}

fn of_motion(kind: &Kind, number: u8, subject: &Subject) -> Words {
    let wire = output(number, subject);
    let place = subject.place(number);
    let name = place.map_or_else(String::new, |place| subject.name(place.actuator));
    let state = place.map_or(1, |place| place.digit());
    let moves = format!("{name} moves to state {state} and back");
    match kind {
        Kind::NoMotion { .. } => [
            wire,
            moves,
            "nothing moves".into(),
            format!(
                "measure at the driver of {} while the output is on: no signal at its input is the chain or the wire, no \
                 voltage at the coil is the driver or its supply; else the coil or its wire is broken, or its wire is at a \
                 line that the profile does not have",
                lines(number, subject)
            ),
        ],
        Kind::NoResponse { closed, .. } => [
            format!("{wire}, or {}", switch_of(number, subject)),
            format!("{name} moves to state {state} and back, and its switch changes"),
            format!("its switch is {} all the time; nobody looked whether it moves", level(*closed)),
            "run it without --yes and look: where it does not move it is the output, else the switch or its wire".into(),
        ],
        Kind::AlwaysOn { .. } => [
            wire,
            format!("{name} is in state 0 while the output is off"),
            format!("it is in state {state} all the time, and nothing moves"),
            "switch the supply of the coils off; the transistor of its driver is shorted, or its gate has no pull-down or is \
             connected to a supply"
                .into(),
        ],
        Kind::DropsOut { .. } => [
            wire,
            format!("{name} stays in state {state} while the holding current flows"),
            "it falls back after the full current".into(),
            format!(
                "check the wire and the driver of the hold line ({}); if they are sound, the holding current is too small",
                lines(number, subject)
            ),
        ],
        _ => [
            wire,
            moves,
            "it does not come back".into(),
            format!(
                "a latch: check the wire and the driver of its reset line ({}); others: the return spring, or a driver that \
                 stays on",
                lines(number, subject)
            ),
        ],
    }
}

fn of_outputs(kind: &Kind, subject: &Subject) -> Words {
    let names = |actuators: &[usize]| list(actuators.iter().map(|&actuator| subject.name(actuator)));
    let outputs = |numbers: &[u8]| list(numbers.iter().map(|&number| output(number, subject)));
    let own = |number| subject.place(number).map_or_else(String::new, |place| subject.name(place.actuator));
    match kind {
        Kind::MovesOther { output: number, actuator } => [
            output(*number, subject),
            format!("it moves {}", own(*number)),
            format!("it moves {}", names(&[*actuator])),
            "connect its line to the right driver, or use the corrected profile".into(),
        ],
        Kind::OutputsSwapped { outputs: pair } => [
            outputs(pair),
            format!("they move {} and {}", own(pair[0]), own(pair[1])),
            "each moves the other's actuator: their wires are exchanged".into(),
            "exchange the two wires, or use the corrected profile, in which their lines are exchanged".into(),
        ],
        Kind::MovesSeveral { output: number, actuators } => [
            output(*number, subject),
            format!("it moves {} alone", own(*number)),
            format!("it moves {}", names(actuators)),
            "several coils are at this line: connect each to the line that the profile names".into(),
        ],
        Kind::OutputsJoined { outputs: joined } => [
            outputs(joined),
            "each moves one actuator".into(),
            "each of them moves the actuators of all".into(),
            "look for a bridge of solder between their lines, gates or coils".into(),
        ],
        Kind::CoilsSwapped { actuator } => {
            let pair: Vec<_> = subject.places().filter(|place| place.actuator == *actuator).collect();
            [
                outputs(&pair.iter().map(|place| place.coil.output).collect::<Vec<_>>()),
                format!("they take {} to states 1 and 2", names(&[*actuator])),
                "each takes it to the other's state: the wires of its coils are exchanged".into(),
                "exchange the two wires, or use the corrected profile, in which their lines are exchanged".into(),
            ]
        }
        _ => Words::default(),
    }
}

fn of_inversion(kind: &Kind, number: u8, subject: &Subject) -> Words {
    let wire = output(number, subject);
    let place = subject.place(number);
    let name = place.map_or_else(String::new, |place| subject.name(place.actuator));
    let state = place.map_or(1, |place| place.digit());
    let expected = format!("{name} is in state {state} while the output is on, in state 0 while it is off");
    match kind {
        Kind::DriveInverted { .. } => [
            wire,
            expected,
            format!("it is in state {state} while the output is off"),
            "switch the supply of the coils off: its driver conducts while its line is low, so also after a stop and without \
             a program; use a driver that is off while its input is low"
                .into(),
        ],
        Kind::LatchReversed { .. } => [
            wire,
            expected,
            "set takes it to state 0, reset to the other: the wires of its coils are exchanged".into(),
            "exchange the two wires, or use the corrected profile, in which `set` and `reset` are exchanged".into(),
        ],
        _ => [
            format!("{wire}, or {}", switch_of(number, subject)),
            expected,
            "its switch shows the opposite; nobody looked in which state it is".into(),
            "run it without --yes and look: if it is in the right state, the switch is of the other kind (break instead of \
             make), else the driver is inverted, or set and reset of a latch are exchanged"
                .into(),
        ],
    }
}

fn of_switches(kind: &Kind, subject: &Subject) -> Words {
    let at = |actuator: usize| subject.wiring.actuators.get(actuator).and_then(|wiring| wiring.switch);
    let wire = |actuator: usize| {
        let input = at(actuator).map_or_else(String::new, |switch| format!(" at input {}", switch.input));
        format!("switch of {}{input}", subject.name(actuator))
    };
    match kind {
        Kind::SwitchElsewhere { actuator, input } => [
            wire(*actuator),
            "this input changes when the actuator moves".into(),
            format!("input {input} changes"),
            "connect the switch to its input, or use the corrected profile".into(),
        ],
        Kind::SwitchesSwapped { actuators: [first, second] } => [
            format!("{} and {}", wire(*first), wire(*second)),
            "each input changes when its actuator moves".into(),
            "each changes when the other's actuator moves: their wires are exchanged".into(),
            "exchange the two wires, or use the corrected profile, in which their inputs are exchanged".into(),
        ],
        Kind::SwitchStuck { actuator, closed } => [
            wire(*actuator),
            "it changes when the actuator moves".into(),
            format!("the actuator moves and the input is {} all the time", level(*closed)),
            if *closed {
                "the wire is connected to 3.3 V, or the switch is stuck or never released: measure with the plug off"
            } else {
                "the switch is missing, not reached or its wire is broken: close it by hand and measure 3.3 V at the input"
            }
            .into(),
        ],
        Kind::SwitchInverted { actuator } => [
            wire(*actuator),
            format!("closed in {}", states(at(*actuator).map_or(0, |switch| switch.closed_in))),
            "open in them, closed in the others; the actuator is in the right states".into(),
            "connect the other contact of the switch (make instead of break), or correct `closed_in` in the arm file".into(),
        ],
        Kind::Slow { actuator, took_ms } => [
            wire(*actuator),
            format!(
                "it changes within the {} ms of `travel_ms`",
                subject.wiring.actuators.get(*actuator).map_or(0, |wiring| wiring.travel_ms)
            ),
            format!("it changes after {took_ms} ms"),
            "use the arm file that `--new-arm` writes; if others of its kind are faster, look for friction or a low supply"
                .into(),
        ],
        _ => Words::default(),
    }
}

fn of_inputs(kind: &Kind, subject: &Subject) -> Words {
    let numbers = |inputs: &[u8]| list(inputs.iter().map(|&input| input_name(input, subject)));
    match kind {
        Kind::InputsJoined { inputs } => [
            numbers(inputs),
            "each changes with its own actuator".into(),
            "they change together when one actuator moves".into(),
            "look for a bridge between the wires, or a plug that is shifted by one".into(),
        ],
        Kind::LooseContact { input } => [
            input_name(*input, subject),
            "one change for each motion".into(),
            "it changes again and again".into(),
            "check the crimps, the plug and how the switch is fastened; a contact that vibrates latches the safe state in a \
             program"
                .into(),
        ],
        Kind::OutputOrSwitch { output: number, inputs } => [
            format!("{}, or {}", output(*number, subject), numbers(inputs)),
            format!("{} changes, and no other", switch_of(*number, subject)),
            format!("{} changed; nobody looked what moves", numbers(inputs)),
            "run it without --yes and look: where another actuator moves it is the wire of the output, else that of the switch"
                .into(),
        ],
        _ => Words::default(),
    }
}

fn of_stop(kind: &Kind, input: u8, subject: &Subject) -> Words {
    let opens = subject.emergency_stop.is_some_and(|stop| stop.opens);
    let wire = format!("emergency stop at input {input}");
    let (pressed, released) = (level(!opens), level(opens));
    match kind {
        Kind::StopPressed { .. } => [
            wire,
            format!("{released} while it is not pressed"),
            format!("{pressed}: the board takes it for pressed and drives nothing"),
            "release it; else its wire is broken, or `opens` in the profile is wrong for this contact".into(),
        ],
        Kind::StopSwapped { with, .. } => [
            format!("{wire} and {}", input_name(*with, subject)),
            format!("input {input} is {released} while it is not pressed, input {with} is {pressed} at rest"),
            "the opposite: their wires are exchanged".into(),
            "exchange the two wires, or use the corrected profile, in which their inputs are exchanged".into(),
        ],
        _ => [
            wire,
            format!("{pressed} while it is pressed"),
            "it did not change when it was pressed".into(),
            "do not run the arm: repair the wire or the contact first".into(),
        ],
    }
}

fn level(closed: bool) -> &'static str {
    if closed { "closed" } else { "open" }
}

fn lines(number: u8, subject: &Subject) -> String {
    subject.place(number).map_or_else(String::new, |place| place.coil.drive.to_string())
}

/// An output with its lines.
pub(super) fn output(number: u8, subject: &Subject) -> String {
    format!("output {number} ({})", lines(number, subject))
}

fn switch_of(number: u8, subject: &Subject) -> String {
    let switch = subject.place(number).and_then(|place| place.switch);
    switch.map_or_else(|| "no input".to_owned(), |switch| input_name(switch.input, subject))
}

fn input_name(input: u8, subject: &Subject) -> String {
    match subject.actuator_at(input) {
        Some(actuator) => format!("input {input} (switch of {})", subject.name(actuator)),
        None => format!("input {input}"),
    }
}

fn states(closed_in: u8) -> String {
    let states: Vec<String> = (0..8).filter(|state| closed_in >> state & 1 == 1).map(|s| s.to_string()).collect();
    format!("state {}", states.join(", "))
}

fn list(names: impl Iterator<Item = String>) -> String {
    names.collect::<Vec<_>>().join(" and ")
}
