//! Pinocchio's side: a program that reads the models as numbers.

use std::error::Error;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use super::{Measured, REACHED};

/// Runs the program on the arms; of works that it does in two ways the faster counts.
pub(crate) fn measure(program: &Path, texts: &[&str]) -> Result<Measured, Box<dyn Error>> {
    let mut child = Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
    let mut input = child.stdin.take().ok_or("no standard input")?;
    writeln!(input, "{}", texts.len())?;
    for text in texts {
        input.write_all(text.as_bytes())?;
    }
    drop(input);
    let output = child.wait_with_output()?;
    if !output.status.success() {
        return Err(format!("{} failed: {}", program.display(), output.status).into());
    }
    let mut measured = Measured::new();
    for line in String::from_utf8(output.stdout)?.lines() {
        let words: Vec<_> = line.split_whitespace().collect();
        let [model, work, min, second, last] = words[..] else { continue };
        let (ns, last): (f64, f64) = (min.parse()?, last.parse()?);
        if work == "inverse-kinematics" {
            measured.insert(format!("{model} {work}"), (ns, 0.0));
            measured.insert(format!("{model} {work}-late"), (second.parse()?, 0.0));
            measured.insert(format!("{model} {REACHED}"), (last, 0.0));
            continue;
        }
        let name = format!("{model} {}", work.strip_suffix("-local").unwrap_or(work));
        let before = measured.entry(name).or_insert((ns, last));
        before.0 = before.0.min(ns);
    }
    Ok(measured)
}
