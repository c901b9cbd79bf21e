//! The emulator's test socket: pin edges come out, inputs go in.
//!
//! QEMU's `-qtest` protocol is lines of text: every command is answered by one line `OK …` or `FAIL …`, in order; once a
//! device's outputs are intercepted, `IRQ raise N` and `IRQ lower N` come between the answers. Only one device can be
//! intercepted in the life of the emulator. Source: QEMU, `docs/devel/testing/qtest.rst` and `system/qtest.c`.

use std::io::{self, BufRead as _, BufReader, Write as _};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread;
use std::time::Duration;

use darm_device::clock::host_now_s;

/// Longest wait for an answer; the emulator answers within microseconds unless its machine is starved.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(20);

/// An output pin of the intercepted device changed its level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Host time of the arrival.
    pub at_s: f64,
    /// Number of the pin within its bank.
    pub pin: u8,
    /// The new level.
    pub high: bool,
}

/// Why the emulator's test socket gave no answer.
#[derive(Debug, thiserror::Error)]
pub enum QtestError {
    /// The socket failed or was closed.
    #[error("the emulator's test socket failed: {0}")]
    Socket(#[from] io::Error),
    /// The emulator has ended.
    #[error("the emulator has ended")]
    Ended,
    /// No answer in time.
    #[error("the emulator gave no answer to `{command}`")]
    Silent {
        /// The command without its answer.
        command: String,
    },
    /// The emulator refused the command.
    #[error("the emulator refused `{command}`: {answer}")]
    Refused {
        /// The command.
        command: String,
        /// The emulator's words.
        answer: String,
    },
}

/// A connection to the test socket. Edges arrive in a channel, so that one thread can wait for them while it sends.
pub struct Qtest {
    stream: UnixStream,
    answers: Receiver<String>,
}

impl Qtest {
    /// Connects; edges come out of the second value from the moment a device is intercepted.
    ///
    /// # Errors
    ///
    /// Nobody listens on the socket, or the thread that reads it cannot start.
    pub fn connect(path: &Path) -> Result<(Self, Receiver<Edge>), QtestError> {
        let stream = UnixStream::connect(path)?;
        let reader = BufReader::new(stream.try_clone()?);
        let (answer_tx, answers) = mpsc::channel();
        let (edge_tx, edges) = mpsc::channel();
        thread::Builder::new().name("qtest".into()).spawn(move || sort_lines(reader, &answer_tx, &edge_tx))?;
        Ok((Self { stream, answers }, edges))
    }

    /// Reports the output edges of one device from now on.
    ///
    /// # Errors
    ///
    /// The emulator has ended, does not answer in time, or refuses the command: there is no such device.
    pub fn intercept_outputs(&mut self, device: &str) -> Result<(), QtestError> {
        self.command(&format!("irq_intercept_out {device}")).map(drop)
    }

    /// Drives an input pin of a GPIO bank.
    ///
    /// # Errors
    ///
    /// The emulator has ended, does not answer in time, or refuses the command: there is no such device or pin.
    pub fn set_input(&mut self, device: &str, pin: u8, high: bool) -> Result<(), QtestError> {
        self.command(&format!("set_irq_in {device} unnamed-gpio-in {pin} {}", u8::from(high))).map(drop)
    }

    /// Reads a 32-bit word of the board's memory or a register.
    ///
    /// # Errors
    ///
    /// The emulator has ended, does not answer in time, or answers with what is not a number.
    pub fn read_u32(&mut self, address: u32) -> Result<u32, QtestError> {
        let command = format!("readl {address:#x}");
        let answer = self.command(&command)?;
        let digits = answer.trim().trim_start_matches("0x");
        let value =
            u64::from_str_radix(digits, 16).map_err(|_| QtestError::Refused { command, answer: answer.clone() })?;
        Ok(value as u32)
    }

    /// Writes a 32-bit word of the board's memory or a register.
    ///
    /// # Errors
    ///
    /// The emulator has ended, does not answer in time, or refuses the command.
    pub fn write_u32(&mut self, address: u32, value: u32) -> Result<(), QtestError> {
        self.command(&format!("writel {address:#x} {value:#x}")).map(drop)
    }

    /// Reads a stretch of the board's memory.
    ///
    /// # Errors
    ///
    /// The emulator has ended, does not answer in time, or answers with what are not bytes.
    pub fn read_bytes(&mut self, address: u32, count: usize) -> Result<Vec<u8>, QtestError> {
        let command = format!("read {address:#x} {count:#x}");
        let answer = self.command(&command)?;
        let digits = answer.trim().trim_start_matches("0x").as_bytes();
        let byte = |pair: &[u8]| std::str::from_utf8(pair).ok().and_then(|pair| u8::from_str_radix(pair, 16).ok());
        digits.chunks(2).map(byte).collect::<Option<_>>().ok_or(QtestError::Refused { command, answer: answer.clone() })
    }

    /// Sends one command and returns what is behind its `OK`.
    fn command(&mut self, command: &str) -> Result<String, QtestError> {
        self.stream.write_all(format!("{command}\n").as_bytes())?;
        let answer = self.answers.recv_timeout(ANSWER_TIMEOUT).map_err(|e| match e {
            RecvTimeoutError::Disconnected => QtestError::Ended,
            RecvTimeoutError::Timeout => QtestError::Silent { command: command.to_owned() },
        })?;
        match answer.strip_prefix("OK") {
            Some(value) => Ok(value.trim().to_owned()),
            None => Err(QtestError::Refused { command: command.to_owned(), answer }),
        }
    }
}

impl Drop for Qtest {
    fn drop(&mut self) {
        // Wakes the reading thread; the emulator may be gone already.
        let _ = self.stream.shutdown(std::net::Shutdown::Both);
    }
}

/// Parts answers from edges until the socket closes or nobody listens.
fn sort_lines(reader: BufReader<UnixStream>, answers: &Sender<String>, edges: &Sender<Edge>) {
    for line in reader.lines().map_while(Result::ok) {
        // Nobody needs to follow the edges; answers without a listener end the thread.
        if let Some(edge) = parse_edge(&line, host_now_s()) {
            let _ = edges.send(edge);
        } else if !line.starts_with("IRQ") && answers.send(line).is_err() {
            return;
        }
    }
}

/// Reads `IRQ raise 5` or `IRQ lower 5`.
fn parse_edge(line: &str, at_s: f64) -> Option<Edge> {
    let (direction, pin) = line.strip_prefix("IRQ ")?.split_once(' ')?;
    let high = match direction {
        "raise" => true,
        "lower" => false,
        _ => return None,
    };
    Some(Edge { at_s, pin: pin.trim().parse().ok()?, high })
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead as _, BufReader, Write as _};
    use std::os::unix::net::UnixListener;
    use std::time::Duration;

    use super::{Edge, Qtest, QtestError, parse_edge};

    #[test]
    fn edges_are_read() {
        assert_eq!(parse_edge("IRQ raise 5", 1.0), Some(Edge { at_s: 1.0, pin: 5, high: true }));
        assert_eq!(parse_edge("IRQ lower 15", 2.0), Some(Edge { at_s: 2.0, pin: 15, high: false }));
        assert_eq!(parse_edge("OK 0x0", 0.0), None);
    }

    #[test]
    fn answers_and_edges_are_parted() {
        let dir = tempfile::tempdir().unwrap();
        let listener = UnixListener::bind(dir.path().join("q")).unwrap();
        let (mut qtest, edges) = Qtest::connect(&dir.path().join("q")).unwrap();
        let emulator = std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            let mut lines = BufReader::new(stream.try_clone().unwrap()).lines();
            assert_eq!(lines.next().unwrap().unwrap(), "readl 0x10");
            stream.write_all(b"IRQ raise 7\nOK 0x00000000deadbeef\nIRQ lower 7\n").unwrap();
            lines.next();
            stream.write_all(b"FAIL no such device\n").unwrap();
        });
        assert_eq!(qtest.read_u32(0x10).unwrap(), 0xdead_beef);
        let edge = |high| (7, high);
        for high in [true, false] {
            let seen = edges.recv_timeout(Duration::from_secs(5)).unwrap();
            assert_eq!((seen.pin, seen.high), edge(high));
        }
        assert!(matches!(qtest.set_input("/nowhere", 1, true), Err(QtestError::Refused { .. })));
        emulator.join().unwrap();
    }
}
