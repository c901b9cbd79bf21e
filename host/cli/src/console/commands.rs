//! The commands of the console, with their arguments and what `help COMMAND` says of them.

/// A command.
pub(crate) struct CommandText {
    /// Its first word.
    pub(crate) name: &'static str,
    /// Names of its arguments.
    pub(crate) arguments: &'static str,
    /// What it does.
    pub(crate) help: &'static str,
    /// Its line in the list of `help`, where the console runs it; the board lists those that it runs.
    summary: Option<&'static str>,
}

const fn board(name: &'static str, arguments: &'static str, help: &'static str) -> CommandText {
    CommandText { name, arguments, help, summary: None }
}

const fn console(
    name: &'static str,
    arguments: &'static str,
    summary: &'static str,
    help: &'static str,
) -> CommandText {
    CommandText { name, arguments, help, summary: Some(summary) }
}

/// All of them.
pub(crate) const COMMANDS: [CommandText; 18] = [
    board("clear", "", "Leaves the safe state once the cause of its fault is gone. `fault` prints the fault."),
    board(
        "coil",
        "N on MS | N off",
        "Switches output N on for MS milliseconds, or off: `coil 3 on 200`. Outputs are numbered from 0. The board's profile \
         limits the time; an output that has been on recovers while it is off. Both coils of an actuator are never on together.",
    ),
    board("fault", "", "Prints the latched fault, and the record of the last crash of the firmware."),
    console("help", "[COMMAND]", "explain a command", "Lists the commands, or explains one."),
    board("id", "", "Prints board, device number, versions of firmware and protocol."),
    board(
        "limits",
        "",
        "Prints the limits of all outputs and servos of the loaded table, and what is left of each on-time.",
    ),
    board("log", "", "Prints the last events with the board's time."),
    board(
        "nearest",
        "X Y ANGLE | X Y Z RX RY RZ",
        "Searches a word near this pose of the tool, in mm and degrees; in space the last three are a rotation vector. The table \
         must have been made with `darm table --nearest`.",
    ),
    board("play", "", "Runs the stored table from its first row. `stop` and Ctrl-C stop it."),
    board("profile", "", "Prints the wiring of the board, and the limits that no table can exceed."),
    board(
        "reboot",
        "[loader]",
        "Restarts the board; with `loader` into the loader of the chip. Refused while something runs.",
    ),
    board(
        "servo",
        "N DEG",
        "Moves servo N to an angle in degrees: `servo 0 -12.5`. Servos are numbered from 0; `limits` prints their ranges.",
    ),
    board("status", "", "Prints state, table, profile, word, switches and servos."),
    board("stop", "", "Switches all coils off at once, whatever runs. Ctrl-C does the same."),
    board("table", "", "Prints the loaded table: rows, length, model, actuators, outputs, servos."),
    board(
        "word",
        "DIGITS",
        "Switches all actuators to a word, the digit of actuator 0 first: `word 010,110`. Commas and spaces are optional. A table \
         must be loaded: it names the outputs of the actuators.",
    ),
    console(
        "quit",
        "",
        "leave; a program on the board continues",
        "Leaves the console; Ctrl-D does the same. What the board runs continues.",
    ),
    console(
        "upload",
        "FILE.darm",
        "store a table of `darm table` on the board",
        "Uploads a table that `darm table` made; the board takes it completely or keeps the old one.",
    ),
];

/// Those that the console runs, with their lines in the list.
pub(crate) fn local() -> impl Iterator<Item = (&'static CommandText, &'static str)> {
    COMMANDS.iter().filter_map(|command| Some((command, command.summary?)))
}

/// A command by its first word, in capitals or not, as the board reads it.
pub(crate) fn find(name: &str) -> Option<&'static CommandText> {
    COMMANDS.iter().find(|command| command.name.eq_ignore_ascii_case(name))
}

/// The command whose name is the nearest to a word that is none: one letter changed, missing, added or exchanged.
pub(crate) fn similar(word: &str) -> Option<&'static CommandText> {
    let word = word.to_ascii_lowercase();
    COMMANDS.iter().find(|command| command.name.starts_with(&word) || is_typed_wrong(command.name, &word))
}

/// Whether two words differ by one letter, or by two neighbours that are exchanged.
fn is_typed_wrong(right: &str, typed: &str) -> bool {
    let same = right.bytes().zip(typed.bytes()).take_while(|(a, b)| a == b).count();
    let (right, typed) = (&right.as_bytes()[same..], &typed.as_bytes()[same..]);
    match (right, typed) {
        ([a, b, right @ ..], [c, d, typed @ ..]) if (a, b) == (d, c) => right == typed,
        ([_, a @ ..], [_, b @ ..]) if a == b => true,
        ([_, rest @ ..], typed) if rest == typed => true,
        (right, [_, rest @ ..]) => right == rest,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::{COMMANDS, find, similar};

    #[test]
    fn each_command_of_the_firmware_is_known() {
        let firmware = include_str!("../../../../firmware/src/text.rs");
        let list = firmware.split("const HELP").nth(1).unwrap().split("];").next().unwrap();
        let lines = list.lines().filter_map(|line| line.trim().strip_prefix('"'));
        let names: Vec<_> = lines.filter(|line| !line.starts_with(' ')).filter_map(|it| it.split(' ').next()).collect();
        assert_eq!(
            names.len(),
            COMMANDS.iter().filter(|command| command.summary.is_none()).count() + 1,
            "help is in both"
        );
        assert!(names.iter().all(|name| find(name).is_some()), "{names:?}");
    }

    #[test]
    fn a_command_that_was_typed_wrong_is_recognised() {
        let meant = |word| similar(word).map(|command| command.name);
        for (typed, right) in
            [("statsu", "status"), ("coill", "coil"), ("wrd", "word"), ("plax", "play"), ("sto", "stop")]
        {
            assert_eq!(meant(typed), Some(right), "{typed}");
        }
        assert_eq!(meant("dance"), None);
    }
}
