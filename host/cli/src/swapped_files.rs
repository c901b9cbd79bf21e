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

/// Whether a file is a model by the end of its name.
pub(crate) fn is_model(path: &Path) -> bool {
    MODELS.iter().any(|end| path.to_string_lossy().ends_with(end))
}

/// The words of a command line with two arguments exchanged; the value of an option is none of them.
fn with(given: &[String], one: &str, other: &str) -> String {
    let mut words: Vec<&str> = given.iter().map(String::as_str).collect();
    if let (Some(first), Some(second)) = (place(given, one), place(given, other)) {
        words.swap(first, second);
    }
    words.into_iter().map(quoted).collect::<Vec<_>>().join(" ")
}

/// The options of the command line: without the command, these arguments, `--json` and those `flags`.
pub(crate) fn options_without(arguments: &[&Path], flags: &[&str]) -> Vec<String> {
    let given: Vec<String> = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned()).collect();
    options(given, arguments, flags)
}

fn options(given: Vec<String>, arguments: &[&Path], flags: &[&str]) -> Vec<String> {
    let is_option = |word: &String| word != "--json" && !flags.contains(&word.as_str());
    let mut words: Vec<String> = given.into_iter().filter(is_option).skip(1).collect();
    for argument in arguments.iter().map(|argument| argument.to_string_lossy()) {
        if let Some(at) = place(&words, &argument) {
            words.remove(at);
        }
    }
    words
}

/// Where an argument is among the words of a command line; the value of an option is none.
fn place(words: &[String], argument: &str) -> Option<usize> {
    let is_value = |k: usize| k > 0 && words[k - 1].starts_with('-');
    let places = || (0..words.len()).filter(|&k| words[k] == argument);
    places().find(|&k| !is_value(k)).or(places().next())
}

/// A word as a shell takes it literally.
pub(crate) fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "_-./=,:+@%".contains(c);
    if word.chars().all(is_plain) { word.into() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{options, refuse, with};

    #[test]
    fn options_are_all_that_is_no_argument() {
        let given = ["--json", "bundle", "a.zip", "--force", "m.toml", "--where", "m.toml", "run.csv", "--seed", "2"];
        let files = ["a.zip", "m.toml", "run.csv"].map(Path::new);
        let options = options(given.map(str::to_owned).to_vec(), &files, &["--force"]);
        assert_eq!(options, ["--where", "m.toml", "--seed", "2"]);
    }

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
