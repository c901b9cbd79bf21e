//! One step of the set-up: a command with a time limit that says what it does and, when it fails, what to do by hand.

use std::io::{self, Read};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

/// Runs `command` to its end, or kills it at `limit`. What it prints is shown only when it fails.
///
/// # Errors
///
/// The command does not start, exits with an error, or takes longer than `limit`. The error says `by_hand`: what a
/// person can do.
pub fn run(what: &str, command: &mut Command, limit: Duration, by_hand: &str) -> Result<()> {
    eprintln!("set-up: {what}");
    let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = child.with_context(|| format!("{what}: {:?} did not start; {by_hand}", command.get_program()))?;
    let (stdout, stderr) = (drain(child.stdout.take()), drain(child.stderr.take()));
    let status = wait(&mut child, limit).with_context(|| format!("{what}: waiting for it failed; {by_hand}"))?;
    let said = [stdout, stderr].map(|thread| thread.join().unwrap_or_default()).concat();
    match status {
        Some(status) if status.success() => Ok(()),
        Some(status) => bail!("{what} failed ({status}); {by_hand}\n{}", said.trim_end()),
        None => bail!("{what} took longer than {} s; {by_hand}\n{}", limit.as_secs(), said.trim_end()),
    }
}

/// Reads a pipe to its end beside the command, so that it never blocks on a full one.
fn drain(pipe: Option<impl Read + Send + 'static>) -> thread::JoinHandle<String> {
    thread::spawn(move || {
        let mut text = Vec::new();
        if let Some(mut pipe) = pipe {
            let _ = pipe.read_to_end(&mut text);
        }
        String::from_utf8_lossy(&text).into_owned()
    })
}

fn wait(child: &mut Child, limit: Duration) -> io::Result<Option<std::process::ExitStatus>> {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if start.elapsed() > limit {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        thread::sleep(Duration::from_millis(20));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_that_hangs_is_killed_and_says_what_to_do() {
        let limit = Duration::from_millis(100);
        let error = run("waiting", Command::new("sleep").arg("60"), limit, "wait yourself").unwrap_err();
        assert!(error.to_string().contains("took longer") && error.to_string().contains("wait yourself"));
    }

    #[test]
    fn a_step_that_fails_shows_what_it_printed() {
        let mut command = Command::new("sh");
        let error = run("failing", command.args(["-c", "echo no disk >&2; exit 3"]), Duration::from_secs(9), "buy one");
        let text = error.unwrap_err().to_string();
        assert!(text.contains("buy one") && text.contains("no disk"), "{text}");
    }
}
