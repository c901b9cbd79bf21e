//! Lines and inputs in the text of a profile, with its comments, layout and derating kept.

use darm_core::output::Drive;
use darm_core::profile::{Output, Profile};
use toml_edit::{DocumentMut, Item, Table, TomlError};

use crate::toml_text::set_number;

/// The text with the lines and inputs of another profile, which has the same outputs with the same kinds of drives.
///
/// # Errors
///
/// The text is not TOML.
pub fn with_wires(text: &str, profile: &Profile) -> Result<String, TomlError> {
    let mut document: DocumentMut = text.parse()?;
    let stop = document.get_mut("emergency_stop").and_then(Item::as_table_like_mut);
    if let (Some(stop), Some(new)) = (stop, profile.emergency_stop) {
        set_number(stop, "input", new.input);
    }
    let outputs = document.get_mut("output").and_then(Item::as_array_of_tables_mut);
    for table in outputs.into_iter().flat_map(|outputs| outputs.iter_mut()) {
        let number = table.get("number").and_then(Item::as_integer).and_then(|number| u8::try_from(number).ok());
        if let Some(output) = number.and_then(|number| profile.output(number)) {
            set_output(table, output);
        }
    }
    Ok(document.to_string())
}

fn set_output(table: &mut Table, output: &Output) {
    let lines = match output.drive {
        Drive::Hold { line } => vec![("line", line)],
        Drive::PeakHold { pull, hold, .. } => vec![("pull", pull), ("hold", hold)],
        Drive::Latch { set, reset, .. } => vec![("set", set), ("reset", reset)],
    };
    let input = output.input.map(|input| ("input", input));
    lines.into_iter().chain(input).for_each(|(key, number)| set_number(table, key, number));
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::with_wires;
    use crate::board_profile::BoardProfile;

    const TEXT: &str = "# Mine.
format = 1
name = \"bench\"
ambient_c = 50.0
derate_percent_per_k = 1.0
supply = { new_outputs = 2, window_ms = 10 }
emergency_stop = { input = 3, opens = true }

[[output]]
number = 0
drive = \"hold\"
line = 4 # the red wire
max_on_ms = 1000
duty_percent = 50
window_ms = 10000

[[output]]
number = 7
drive = \"latch\"
set = 5
reset = 6
pulse_ms = 20
max_on_ms = 1000
duty_percent = 50
window_ms = 10000
input = 1 # behind the plate
";

    #[test]
    fn wires_change_and_all_else_stays() {
        let read = |text: &str| BoardProfile::parse(Path::new("a.toml"), text).unwrap();
        let old = read(TEXT).profile;
        assert_eq!(with_wires(TEXT, &old).unwrap(), TEXT);
        let wanted = TEXT
            .replace("line = 4", "line = 9")
            .replace("set = 5\nreset = 6", "set = 6\nreset = 5")
            .replace("input = 1 #", "input = 3 #")
            .replace("{ input = 3,", "{ input = 1,");
        assert_eq!(with_wires(TEXT, &read(&wanted).profile).unwrap(), wanted);
        let with_switch = TEXT.replacen("window_ms = 10000\n", "window_ms = 10000\ninput = 2\n", 1);
        assert_eq!(with_wires(TEXT, &read(&with_switch).profile).unwrap(), with_switch);
    }
}
