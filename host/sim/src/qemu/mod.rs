//! The emulator: the image that is flashed, running in QEMU `b-l475e-iot01a` with its pins, ports and flash in reach.
//!
//! | way in or out  | QEMU                                   | what                                             |
//! |----------------|----------------------------------------|--------------------------------------------------|
//! | console        | first `-serial`, Unix socket or pty    | the port that a user's cable is plugged in        |
//! | servo bus      | second `-serial`, Unix socket          | [`crate::plant::servo_bus`] answers on it         |
//! | pins           | `-qtest`                               | [`qtest`]: edges of one bank out, inputs in       |
//! | control        | `-qmp`                                 | [`qmp`]: the machine waits until all are connected |
//! | flash          | `flash.img` in QEMU's working folder   | survives a kill, as the chip's flash survives a cut |
//!
//! The machine is created stopped and started by [`Qemu::resume`], so that no edge and no byte is lost.

pub mod board;
pub mod qmp;
pub mod qtest;
mod version;

use std::fs;
use std::io;
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use darm_firmware::store::FLASH_BYTES;
use tempfile::TempDir;

use qmp::{Qmp, QmpError};
pub use version::{OLDEST, PROGRAM, Version, VersionError, find};

/// The file that represents the flash that the firmware uses.
pub const FLASH_FILE: &str = "flash.img";
/// Longest wait for the emulator to open its sockets.
const START_TIMEOUT: Duration = Duration::from_secs(30);

/// Why there is no emulated board.
#[derive(Debug, thiserror::Error)]
pub enum QemuError {
    /// There is no emulator, or one that is too old.
    #[error(transparent)]
    Version(#[from] VersionError),
    /// The image is not there.
    #[error("no firmware image at {0}; build it with `cargo xtask image`")]
    NoImage(PathBuf),
    /// The emulator ended while it started.
    #[error("{PROGRAM} ended at once: {stderr}")]
    Ended {
        /// Its own words.
        stderr: String,
    },
    /// A socket did not open in time.
    #[error("{PROGRAM} did not open {socket} within 30 s: {stderr}")]
    Silent {
        /// Which socket.
        socket: &'static str,
        /// The emulator's own words.
        stderr: String,
    },
    /// The control socket failed.
    #[error(transparent)]
    Control(#[from] QmpError),
    /// A file or the process failed.
    #[error("{PROGRAM}: {0}")]
    Io(#[from] io::Error),
}

/// What is behind the board's console port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Console {
    /// A Unix socket: whoever connects next has the port, as with a cable.
    Socket,
    /// A pseudo terminal, which serial programs open as a port.
    Pty,
}

/// A board to be emulated.
#[derive(Clone, Debug)]
pub struct Machine {
    /// The emulator's name of the board.
    pub board: &'static str,
    /// The image, the very ELF that is flashed.
    pub elf: PathBuf,
    /// The folder of the flash file, which is made blank when there is none.
    pub folder: PathBuf,
    /// What is behind the console port.
    pub console: Console,
}

impl Machine {
    /// The first board, `b-l475e-iot01a`.
    pub fn new(elf: PathBuf, folder: PathBuf, console: Console) -> Self {
        Self { board: "b-l475e-iot01a", elf, folder, console }
    }
}

/// A running emulator. It ends with this value, and with this process however that ends.
pub struct Qemu {
    child: Child,
    sockets: TempDir,
    qmp: Qmp,
    console: String,
    _keeper: Keeper,
}

impl Qemu {
    /// Starts the emulator with the machine stopped before its first instruction.
    ///
    /// # Errors
    ///
    /// The emulator is missing or too old, the image is missing, the emulator ends while it starts, a socket does not
    /// open in time, or a file or process fails.
    pub fn start(machine: &Machine) -> Result<Self, QemuError> {
        find()?;
        let elf = machine.elf.canonicalize().map_err(|_| QemuError::NoImage(machine.elf.clone()))?;
        make_flash(&machine.folder)?;
        // Not in the machine's folder: the path of a Unix socket holds at most 107 bytes.
        let sockets = tempfile::Builder::new().prefix("darm-").tempdir()?;
        let command = command(&elf, machine, sockets.path())?;
        let (mut child, keeper) = Keeper::spawn(command)?;
        let started = Self::connect(&mut child, machine.console, sockets.path());
        match started {
            Ok((qmp, console)) => Ok(Self { child, sockets, qmp, console, _keeper: keeper }),
            Err(error) => {
                end(&mut child);
                Err(error)
            }
        }
    }

    fn connect(child: &mut Child, console: Console, sockets: &Path) -> Result<(Qmp, String), QemuError> {
        for socket in ["control", "pins", "bus"] {
            wait_for_socket(child, sockets, socket)?;
        }
        let mut qmp = Qmp::connect(&sockets.join("control"))?;
        let console = match console {
            Console::Socket => {
                wait_for_socket(child, sockets, "console")?;
                format!("unix:{}", sockets.join("console").display())
            }
            Console::Pty => {
                qmp.pty("serial0")?.ok_or(QemuError::Silent { socket: "console", stderr: stderr(sockets) })?
            }
        };
        Ok((qmp, console))
    }

    /// The port of the board's console, to be opened with [`darm_device::link::open`].
    pub fn console_port(&self) -> &str {
        &self.console
    }

    /// Path of the test socket, for [`qtest::Qtest::connect`].
    pub fn pins_socket(&self) -> PathBuf {
        self.sockets.path().join("pins")
    }

    /// Connects to the board's servo bus.
    ///
    /// # Errors
    ///
    /// The socket of the bus cannot be opened: the emulator has ended.
    pub fn connect_servo_bus(&self) -> io::Result<UnixStream> {
        UnixStream::connect(self.sockets.path().join("bus"))
    }

    /// Lets the machine run, after everything that must not miss its first moments is connected.
    ///
    /// # Errors
    ///
    /// The emulator has ended, does not answer in time, or refuses the command.
    pub fn resume(&mut self) -> Result<(), QmpError> {
        self.qmp.command("cont").map(drop)
    }

    /// Stops the machine's time.
    ///
    /// # Errors
    ///
    /// As [`resume`](Self::resume).
    pub fn pause(&mut self) -> Result<(), QmpError> {
        self.qmp.command("stop").map(drop)
    }

    /// Presses the board's reset button; RAM keeps what the image does not load.
    ///
    /// # Errors
    ///
    /// As [`resume`](Self::resume).
    pub fn reset(&mut self) -> Result<(), QmpError> {
        self.qmp.command("system_reset").map(drop)
    }

    /// Whether the emulator still runs.
    pub fn is_running(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// Cuts the board's power: the emulator gets no chance to tidy up.
    pub fn cut_power(&mut self) {
        end(&mut self.child);
    }

    /// What the emulator itself has complained about.
    pub fn complaints(&self) -> String {
        stderr(self.sockets.path())
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        end(&mut self.child);
    }
}

/// Makes a blank flash file where there is none.
fn make_flash(folder: &Path) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    let file = folder.join(FLASH_FILE);
    if file.exists() { Ok(()) } else { fs::write(file, vec![0xff; FLASH_BYTES]) }
}

fn command(elf: &Path, machine: &Machine, sockets: &Path) -> io::Result<Command> {
    let socket = |name: &str| format!("unix:{},server=on,wait=off", sockets.join(name).display());
    let console = match machine.console {
        Console::Socket => socket("console"),
        Console::Pty => "pty".to_owned(),
    };
    let mut command = Command::new(PROGRAM);
    command
        .args(["-M", machine.board, "-display", "none", "-monitor", "none", "-S"])
        .args(["-serial", &console, "-serial", &socket("bus")])
        .args(["-qtest", &socket("pins"), "-qtest-log", "/dev/null", "-qmp", &socket("control")])
        .args(["-semihosting-config", "enable=on,target=native"])
        .arg("-kernel")
        .arg(elf)
        .current_dir(&machine.folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(fs::File::create(sockets.join("stderr"))?);
    Ok(command)
}

/// The thread that started the emulator.
///
/// The kernel kills the emulator when the *thread* that started it ends: so that thread lives as long as this value,
/// and ends with the process however that ends.
struct Keeper {
    release: Option<mpsc::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Keeper {
    fn spawn(mut command: Command) -> io::Result<(Child, Self)> {
        let die_with_parent = || {
            let signal = rustix::process::Signal::KILL;
            rustix::process::set_parent_process_death_signal(Some(signal)).map_err(io::Error::from)
        };
        // SAFETY: between fork and exec the closure makes one system call and neither allocates nor takes a lock.
        unsafe { command.pre_exec(die_with_parent) };
        let (release, released) = mpsc::channel::<()>();
        let (child_tx, child_rx) = mpsc::channel();
        let thread = thread::Builder::new().name("qemu-keeper".into()).spawn(move || {
            let _ = child_tx.send(command.spawn());
            let _ = released.recv();
        })?;
        let child = child_rx.recv().map_err(io::Error::other)??;
        Ok((child, Self { release: Some(release), thread: Some(thread) }))
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        self.release.take();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Waits until the emulator has made a socket.
fn wait_for_socket(child: &mut Child, sockets: &Path, socket: &'static str) -> Result<(), QemuError> {
    let start = Instant::now();
    while !sockets.join(socket).exists() {
        if child.try_wait()?.is_some() {
            return Err(QemuError::Ended { stderr: stderr(sockets) });
        }
        if start.elapsed() > START_TIMEOUT {
            return Err(QemuError::Silent { socket, stderr: stderr(sockets) });
        }
        thread::sleep(Duration::from_millis(2));
    }
    Ok(())
}

/// The emulator's error output so far.
fn stderr(sockets: &Path) -> String {
    fs::read_to_string(sockets.join("stderr")).unwrap_or_default().trim().to_owned()
}

/// Ends the emulator; it may have ended already.
fn end(child: &mut Child) {
    let _ = child.kill();
    let _ = child.wait();
}
