//! Times of travel in the text of an arm file, with its comments and layout kept.

use toml_edit::{DocumentMut, TableLike, TomlError};

use crate::toml_text::set_number;

/// The text with these times of travel in ms, by actuator; `None` leaves the actuator as it is.
///
/// # Errors
///
/// The text is not TOML.
pub fn with_travel_ms(text: &str, travel_ms: &[Option<u16>]) -> Result<String, TomlError> {
    let mut document: DocumentMut = text.parse()?;
    let mut times = travel_ms.iter();
    let stages = document.get_mut("stage").and_then(|stages| stages.as_array_of_tables_mut());
    for stage in stages.into_iter().flat_map(|stages| stages.iter_mut()) {
        if let Some(legs) = stage.get_mut("leg").and_then(|legs| legs.as_array_of_tables_mut()) {
            legs.iter_mut().for_each(|leg| set(leg, &mut times));
        } else if stage.get("kind").and_then(|kind| kind.as_str()) == Some("discrete-joint") {
            set(stage, &mut times);
        }
    }
    Ok(document.to_string())
}

fn set<'a>(actuator: &mut dyn TableLike, times: &mut impl Iterator<Item = &'a Option<u16>>) {
    if let Some(Some(travel_ms)) = times.next() {
        set_number(actuator, "travel_ms", *travel_ms);
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::with_travel_ms;
    use crate::arm::Arm;

    #[test]
    fn only_the_times_that_are_given_change() {
        for name in ["planar4.toml", "serial2.toml", "hybrid6.toml"] {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name);
            let (text, old) = (std::fs::read_to_string(&path).unwrap(), Arm::read(&path).unwrap());
            let count = old.connections.len();
            let times: Vec<Option<u16>> = (0..count).map(|k| (k % 2 == 1).then_some(200 + k as u16)).collect();
            let edited = with_travel_ms(&text, &times).unwrap();
            let new = Arm::parse(&path, &edited).unwrap();
            for ((new, old), time) in new.connections.iter().zip(&old.connections).zip(&times) {
                assert_eq!(new.travel_ms, time.unwrap_or(old.travel_ms), "{name}");
            }
            let comments = |text: &str| text.lines().filter(|line| line.contains('#')).count();
            assert_eq!(comments(&edited), comments(&text));
            assert_eq!(with_travel_ms(&text, &vec![None; count]).unwrap(), text);
        }
    }
}
