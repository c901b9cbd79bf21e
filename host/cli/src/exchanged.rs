//! Two files of a command line that are exchanged: a model in the place of measurements, and measurements in that of the model.

use std::path::Path;

use crate::failure::Usage;

const MODELS: [&str; 3] = [".toml", ".urdf", ".xml"];
const MEASUREMENTS: [&str; 4] = [".csv", ".csv.gz", ".mcap", ".gz"];

/// Refuses a model and measurements that are exchanged, by the ends of their names, with the line that was meant.
pub(crate) fn refuse(model: &Path, data: &Path) -> Result<(), Usage> {
    let ends_in = |path: &Path, ends: &[&str]| ends.iter().any(|end| path.to_string_lossy().ends_with(end));
    if !(ends_in(model, &MEASUREMENTS) && ends_in(data, &MODELS)) {
        return Ok(());
    }
    let given: Vec<String> = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned()).collect();
    let (data, model) = (data.to_string_lossy(), model.to_string_lossy());
    Err(Usage(format!(
        "{model} and {data} are exchanged: the model comes first; run `darm {}`",
        with(&given, &data, &model)
    )))
}

/// The words of a command line with two arguments exchanged; the value of an option is none of them.
fn with(given: &[String], one: &str, other: &str) -> String {
    let mut words: Vec<&str> = given.iter().map(String::as_str).collect();
    let is_value = |k: usize| k > 0 && given[k - 1].starts_with('-');
    let place = |argument: &str| {
        let places = || (0..given.len()).filter(|&k| given[k] == argument);
        places().find(|&k| !is_value(k)).or(places().next())
    };
    if let (Some(first), Some(second)) = (place(one), place(other)) {
        words.swap(first, second);
    }
    words.into_iter().map(quoted).collect::<Vec<_>>().join(" ")
}

/// A word as a shell takes it literally.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "_-./=,:+@%".contains(c);
    if word.chars().all(is_plain) { word.into() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{refuse, with};

    #[test]
    fn a_model_after_its_measurements_is_refused() {
        let is_refused = |model, data| refuse(Path::new(model), Path::new(data)).is_err();
        assert!(is_refused("run.csv.gz", "arm.toml") && is_refused("run.mcap", "robot.urdf"));
        assert!(!is_refused("arm.toml", "run.csv") && !is_refused("arm.toml", "arm.toml"));
        let given = ["diagnose", "run.csv", "my arm.toml", "-o", "new.toml"].map(str::to_owned);
        assert_eq!(with(&given, "my arm.toml", "run.csv"), "diagnose 'my arm.toml' run.csv -o new.toml");
        let given = ["diagnose", "-o", "arm.toml", "run.csv", "arm.toml", "--where", "t>=4"].map(str::to_owned);
        assert_eq!(with(&given, "arm.toml", "run.csv"), "diagnose -o arm.toml arm.toml run.csv --where 't>=4'");
    }
}
