//! The process that emulates the RP2040: `node` with the package rp2040js, driven line by line.
//!
//! Lines are described in `host/sim/pico/emulator.mjs`. The process ends when its input does, so with this one however
//! that ends.

use std::env;
use std::fs;
use std::io::{self, BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use tempfile::TempDir;

/// Oldest version of Node.js that the package supports.
const OLDEST_NODE: u32 = 18;
/// Where `cargo xtask` installs the package, from the folder that cargo builds into.
const PACKAGE: &str = "pico-emulator/node_modules/rp2040js/dist/esm/index.js";
/// The scripts, by name.
const SCRIPTS: [(&str, &str); 7] = [
    ("emulator.mjs", include_str!("../../pico/emulator.mjs")),
    ("cache.mjs", include_str!("../../pico/cache.mjs")),
    ("chip.mjs", include_str!("../../pico/chip.mjs")),
    ("flash.mjs", include_str!("../../pico/flash.mjs")),
    ("panic.mjs", include_str!("../../pico/panic.mjs")),
    ("rom.mjs", include_str!("../../pico/rom.mjs")),
    ("usb.mjs", include_str!("../../pico/usb.mjs")),
];

/// Why there is no emulated Pico.
#[derive(Debug, thiserror::Error)]
pub enum PicoError {
    /// There is no Node.js, or one that is too old.
    #[error("Node.js {OLDEST_NODE} or newer is not installed; `cargo xtask image --board pico` installs it")]
    NoNode,
    /// The package is not there.
    #[error("the package rp2040js is not installed; `cargo xtask image --board pico` installs it")]
    NoPackage,
    /// The image is not there.
    #[error("no firmware image at {0}; build it with `cargo xtask image --board pico`")]
    NoImage(PathBuf),
    /// The process or a file failed.
    #[error("the emulator of the Pico: {0}")]
    Io(#[from] io::Error),
}

/// Finds Node.js and the package; the path of the package.
///
/// # Errors
///
/// There is no Node.js, it is too old, or the package is not installed: `cargo xtask image --board pico` installs it.
pub fn find() -> Result<PathBuf, PicoError> {
    let output = Command::new("node").arg("--version").stdin(Stdio::null()).output().map_err(|_| PicoError::NoNode)?;
    let version = String::from_utf8_lossy(&output.stdout).into_owned();
    let major = version.trim().strip_prefix('v').and_then(|version| version.split('.').next()?.parse::<u32>().ok());
    if major.is_none_or(|major| major < OLDEST_NODE) {
        return Err(PicoError::NoNode);
    }
    let starts = [env::current_dir(), env::current_exe()];
    let folders = starts.iter().flatten().flat_map(|start| start.ancestors());
    let places = folders.flat_map(|folder| [folder.join(PACKAGE), folder.join("target").join(PACKAGE)]);
    let built = env::var_os("CARGO_TARGET_DIR").map(|folder| Path::new(&folder).join(PACKAGE));
    built.into_iter().chain(places).find(|path| path.is_file()).ok_or(PicoError::NoPackage)
}

/// Why the chip does not run any more, until its power comes back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The power failed within an operation of the flash.
    Cut,
    /// It is in the loader of its boot ROM.
    Loader,
}

/// What the emulator has counted since it was asked last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Measured {
    /// Bytes of the stack that were ever in use since the start.
    pub stack_bytes: u64,
    /// Control ticks.
    pub ticks: u64,
    /// Instructions of the longest control tick.
    pub longest_instructions: u64,
    /// Clock cycles of the longest control tick, without waits of the flash.
    pub longest_cycles: u64,
    /// The same of the longest one with the waits for lines that a model of the flash's cache does not have.
    pub waiting_cycles: u64,
    /// The same as if the cache had no line at the begin of a tick.
    pub cold_cycles: u64,
    /// Operations of the flash since the start of the emulator.
    pub flash_operations: u64,
}

/// What the emulator reports.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Report {
    /// An output pin changed.
    Edge { at_ns: u64, pin: u8, high: bool },
    /// Bytes for the host.
    Console(Vec<u8>),
    /// Bytes for the servos.
    Bus(Vec<u8>),
    /// The chip starts again; what memory the reset keeps is kept.
    Reset,
    /// It does not run any more.
    Ended(Ended),
    /// Bytes of stack.
    Stack(u64),
    /// Counts of ticks, instructions, three kinds of cycles, operations.
    Ticks([u64; 6]),
    /// What a register holds.
    Word(u32),
    /// All of a step has been reported.
    Done { at_ns: u64 },
}

/// The running process.
pub(super) struct Emulator {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    _scripts: TempDir,
}

impl Emulator {
    /// Starts the image in a chip that has just got its power.
    pub(super) fn start(elf: &Path, flash: &Path) -> Result<Self, PicoError> {
        let package = find()?;
        let elf = elf.canonicalize().map_err(|_| PicoError::NoImage(elf.to_owned()))?;
        let scripts = tempfile::Builder::new().prefix("darm-pico-").tempdir()?;
        for (name, text) in SCRIPTS {
            fs::write(scripts.path().join(name), text)?;
        }
        let mut child = Command::new("node")
            .arg(scripts.path().join("emulator.mjs"))
            .args([&package, &elf, flash])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let pipe = io::Error::from(io::ErrorKind::BrokenPipe);
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else { return Err(pipe.into()) };
        Ok(Self { child, input, output: BufReader::new(output), _scripts: scripts })
    }

    /// Sends lines that have no answer.
    pub(super) fn send(&mut self, lines: &str) -> io::Result<()> {
        self.input.write_all(lines.as_bytes())
    }

    /// Sends a line and hands what is reported until it is done to `take`.
    pub(super) fn ask(&mut self, line: &str, take: &mut dyn FnMut(Report)) -> io::Result<()> {
        self.send(line)?;
        let mut text = String::new();
        loop {
            text.clear();
            if self.output.read_line(&mut text)? == 0 {
                return Err(io::Error::from(io::ErrorKind::UnexpectedEof));
            }
            let invalid = || io::Error::other(format!("the emulator printed {text:?}"));
            let report = parse(text.trim_end()).ok_or_else(invalid)?;
            let is_done = matches!(report, Report::Done { .. });
            take(report);
            if is_done {
                return Ok(());
            }
        }
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Bytes as hexadecimal digits.
pub(super) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn bytes(digits: &str) -> Option<Vec<u8>> {
    let byte = |pair: &[u8]| std::str::from_utf8(pair).ok().and_then(|pair| u8::from_str_radix(pair, 16).ok());
    digits.as_bytes().chunks(2).map(byte).collect()
}

fn parse(line: &str) -> Option<Report> {
    let mut words = line.split(' ');
    let name = words.next()?;
    let rest: Vec<&str> = words.collect();
    let number = |index: usize| rest.get(index).and_then(|word| word.parse::<u64>().ok());
    Some(match name {
        "edge" => Report::Edge { at_ns: number(0)?, pin: number(1)?.try_into().ok()?, high: number(2)? == 1 },
        "console" => Report::Console(bytes(rest.first()?)?),
        "bus" => Report::Bus(bytes(rest.first()?)?),
        "reset" => Report::Reset,
        "cut" => Report::Ended(Ended::Cut),
        "loader" => Report::Ended(Ended::Loader),
        "stack" => Report::Stack(number(0)?),
        "ticks" => Report::Ticks([number(0)?, number(1)?, number(2)?, number(3)?, number(4)?, number(5)?]),
        "word" => Report::Word(number(0)?.try_into().ok()?),
        "done" => Report::Done { at_ns: number(0)? },
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::{Report, bytes, hex, parse};

    #[test]
    fn reports_are_read() {
        assert_eq!(parse("edge 1288088 3 1"), Some(Report::Edge { at_ns: 1_288_088, pin: 3, high: true }));
        assert_eq!(parse("console 0a4f"), Some(Report::Console(vec![0x0a, 0x4f])));
        assert_eq!(parse("ticks 98 2065 3013 4013 5013 7"), Some(Report::Ticks([98, 2065, 3013, 4013, 5013, 7])));
        assert_eq!(parse("edge 1 2"), None);
        assert_eq!(parse("Error: something"), None);
    }

    #[test]
    fn bytes_and_digits_are_inverse() {
        let all: Vec<u8> = (0..=255).collect();
        assert_eq!(bytes(&hex(&all)), Some(all));
    }
}
