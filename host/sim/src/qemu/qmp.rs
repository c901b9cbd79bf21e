//! The emulator's control socket: start the stopped machine, ask for the name of a pseudo terminal, reset.

use std::io::{self, BufRead as _, BufReader, Write as _};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

use serde_json::{Value, json};

/// Why the emulator did not execute a command.
#[derive(Debug, thiserror::Error)]
pub enum QmpError {
    /// The socket failed or gave no answer.
    #[error("the emulator's control socket failed: {0}")]
    Socket(#[from] io::Error),
    /// The answer is not what the protocol foresees.
    #[error("the emulator refused `{command}`: {answer}")]
    Refused {
        /// The command.
        command: &'static str,
        /// The emulator's words.
        answer: String,
    },
}

/// A connection to the control socket.
pub struct Qmp {
    stream: UnixStream,
    reader: BufReader<UnixStream>,
}

impl Qmp {
    /// Connects and leaves the negotiation mode.
    ///
    /// # Errors
    ///
    /// Nobody listens on the socket, or as [`command`](Self::command).
    pub fn connect(path: &Path) -> Result<Self, QmpError> {
        let stream = UnixStream::connect(path)?;
        stream.set_read_timeout(Some(Duration::from_secs(20)))?;
        let reader = BufReader::new(stream.try_clone()?);
        let mut qmp = Self { stream, reader };
        qmp.command("qmp_capabilities")?;
        Ok(qmp)
    }

    /// Sends a command without arguments; greetings and events before the answer are passed over.
    ///
    /// # Errors
    ///
    /// [`QmpError::Socket`]: the socket is closed, fails or gives no answer in time. [`QmpError::Refused`]: the
    /// emulator refuses the command.
    pub fn command(&mut self, command: &'static str) -> Result<Value, QmpError> {
        let request = json!({ "execute": command });
        self.stream.write_all(format!("{request}\n").as_bytes())?;
        loop {
            let mut line = String::new();
            if self.reader.read_line(&mut line)? == 0 {
                return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
            }
            let mut message: Value = serde_json::from_str(&line).unwrap_or(Value::Null);
            if message.get("error").is_some() {
                return Err(QmpError::Refused { command, answer: message["error"]["desc"].to_string() });
            }
            if message.get("return").is_some() {
                return Ok(message["return"].take());
            }
        }
    }

    /// The path of the pseudo terminal behind a serial port of the machine.
    ///
    /// # Errors
    ///
    /// As [`command`](Self::command).
    pub fn pty(&mut self, label: &str) -> Result<Option<String>, QmpError> {
        let devices = self.command("query-chardev")?;
        let device = devices.as_array().into_iter().flatten().find(|device| device["label"] == label);
        let name = device.and_then(|device| device["filename"].as_str());
        Ok(name.and_then(|name| name.strip_prefix("pty:")).map(str::to_owned))
    }
}
