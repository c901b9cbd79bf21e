//! `darm stop` while another program holds the board's port: when the pins are safe, and what the exit code says.
//!
//! The real image in the emulator plays a program; the lines are seen at its pins. `DARM_STOPS` sets how often, else once
//! for each program that can hold the port. Where the emulator, the image or `darm` is missing the test is not run, see `emulator::missing`.

mod emulator;

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use darm_arm::arm::Arm;
use darm_arm::wired_arm::WiredArm;
use darm_sim::follow::Follower;
use darm_sim::in_process::MemoryFlash;
use darm_sim::plant::Plant;
use darm_sim::qemu::{self, Console, Machine, Qemu};
use emulator::Ready;

/// Longest wait for the program to begin: a loaded machine is slow.
const LIMIT: Duration = Duration::from_secs(60);
/// What `darm stop` promises.
const SAFE_WITHIN_S: f64 = 1.0;
/// The pins are seen through a socket and a thread: an edge may be seen so much later than it came.
const SEEN_WITHIN_S: f64 = 0.1;
const WORDS: &str = "000010000000 000001000000 000011000000 000000100000 000010100000 000001100000";

/// The program that holds the port.
#[derive(Clone, Copy, Debug)]
enum Holder {
    Console,
    Play,
    Record,
    /// A program that knows nothing of darm and takes what the board says.
    Reader,
}

/// A board with a table, and a folder that `darm` works and keeps its state in.
struct Rig {
    folder: tempfile::TempDir,
    follower: Follower,
    qemu: Qemu,
    darm: PathBuf,
    _lock: File,
}

/// How one stop went; times from the start of its process.
struct Stop {
    /// When the last line was seen to go low.
    safe_after_s: f64,
    ended_after_s: f64,
    code: Option<i32>,
}

impl Rig {
    fn start() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let Ready { elf, lock } = emulator::ready()?;
        let darm = emulator::target().join("debug/darm");
        if !darm.exists() {
            return emulator::missing(&format!("no {}; build it with `cargo build -p darm`", darm.display()));
        }
        let arm = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/planar4.toml");
        let WiredArm { profile, wiring, .. } = WiredArm::new(Arm::read(&arm).unwrap()).unwrap();
        let machine = Machine::new(elf, folder.path().to_owned(), Console::Pty);
        std::fs::write(folder.path().join(qemu::FLASH_FILE), MemoryFlash::with_profile(&profile.image()).bytes())
            .unwrap();
        let mut qemu = Qemu::start(&machine).unwrap();
        let follower = Follower::start(&qemu, &wiring, Plant::new(&wiring, &[])).unwrap();
        qemu.resume().unwrap();
        let rig = Self { folder, follower, qemu, darm, _lock: lock };
        let table = format!("table {} --dwell 1.5 -o six.darm --words {WORDS}", arm.display());
        rig.succeeds(&mut rig.command(&table));
        rig.succeeds(&mut rig.at_port("upload six.darm"));
        std::fs::write(rig.folder.path().join("pictures.csv"), "time_s,x_m,y_m,angle_deg\n0,0,0,0\n").unwrap();
        Some(rig)
    }

    fn command(&self, line: &str) -> Command {
        let mut command = Command::new(&self.darm);
        command.args(line.split_whitespace()).current_dir(self.folder.path());
        command.env("XDG_STATE_HOME", self.folder.path().join("state"));
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command
    }

    fn at_port(&self, line: &str) -> Command {
        let mut command = self.command(line);
        command.args(["--port", self.qemu.console_port()]);
        command
    }

    fn succeeds(&self, command: &mut Command) {
        let status = command.stderr(Stdio::inherit()).status().unwrap();
        assert!(status.success(), "{command:?}: {status}");
    }

    /// Lets a program run, and its port be held.
    fn hold(&self, holder: Holder) -> Child {
        // When nobody has its pty open, QEMU looks for somebody new once a second: a serial line is never deaf like that.
        let cable = File::open(self.qemu.console_port()).unwrap();
        if matches!(holder, Holder::Console | Holder::Reader) {
            self.succeeds(&mut self.at_port("play --detach"));
        }
        let mut command = match holder {
            Holder::Console => self.at_port("console"),
            Holder::Play => self.at_port("play"),
            Holder::Record => self.at_port("record six.darm --camera pictures.csv -o run.csv --force"),
            Holder::Reader => {
                let mut command = Command::new("cat");
                command.arg(self.qemu.console_port()).stdout(Stdio::null());
                command
            }
        };
        let child = command.stdin(Stdio::piped()).spawn().unwrap();
        let start = Instant::now();
        while self.follower.lines() == 0 {
            assert!(start.elapsed() < LIMIT, "no line went high");
            std::thread::sleep(Duration::from_millis(1));
        }
        // The console and the reader open the port in this time.
        std::thread::sleep(Duration::from_millis(200));
        drop(cable);
        child
    }

    fn stop(&self) -> Stop {
        let start = Instant::now();
        let mut child = self.at_port("stop").spawn().unwrap();
        std::thread::scope(|scope| {
            let ended = scope.spawn(move || (child.wait().unwrap().code(), start.elapsed().as_secs_f64()));
            let safe_after_s = self.safe_after_s(start);
            let (code, ended_after_s) = ended.join().unwrap();
            Stop { safe_after_s, ended_after_s, code }
        })
    }

    /// Ctrl-C in the program that holds the port.
    fn interrupt(&self, mut child: Child) -> Stop {
        let start = Instant::now();
        let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        let safe_after_s = self.safe_after_s(start);
        let code = child.wait().unwrap().code();
        Stop { safe_after_s, ended_after_s: start.elapsed().as_secs_f64(), code }
    }

    fn safe_after_s(&self, start: Instant) -> f64 {
        while self.follower.lines() != 0 {
            if start.elapsed().as_secs_f64() > 2.0 * SAFE_WITHIN_S {
                return f64::INFINITY;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        start.elapsed().as_secs_f64()
    }
}

#[test]
fn stop_gets_through_while_another_program_holds_the_port() {
    let Some(rig) = Rig::start() else { return };
    let holders = [Holder::Console, Holder::Play, Holder::Record, Holder::Reader];
    let count = std::env::var("DARM_STOPS").map_or(holders.len(), |count| count.parse().unwrap());
    let (mut safe, mut confirmed, mut honest, mut longest_s) = (0, 0, 0, 0.0_f64);
    for number in 0..count {
        let holder = holders[number % holders.len()];
        let mut child = rig.hold(holder);
        let stop = rig.stop();
        let _ = child.kill();
        child.wait().unwrap();
        let Stop { safe_after_s, ended_after_s, code } = stop;
        println!("{holder:?}: safe after {safe_after_s:.3} s, exit code {code:?} after {ended_after_s:.3} s");
        longest_s = longest_s.max(safe_after_s);
        safe += usize::from(safe_after_s <= SAFE_WITHIN_S);
        confirmed += usize::from(code == Some(0));
        // 0 says that the board has confirmed, 5 that nobody has heard it.
        let is_low = safe_after_s <= ended_after_s + SEEN_WITHIN_S;
        honest += usize::from(code == Some(0) && is_low || code == Some(5));
    }
    println!("FIGURE stop: tries with another program at the port = {count} tries");
    println!("FIGURE stop: pins not safe within 1 s = {} tries", count - safe);
    println!("FIGURE stop: longest time to safe pins = {longest_s} s");
    println!("FIGURE stop: confirmed by the board = {confirmed} tries");
    println!("FIGURE stop: exit codes that say what is not so = {} tries", count - honest);
    assert_eq!((safe, honest), (count, count));
}

#[test]
fn ctrl_c_stops_the_arm() {
    let Some(rig) = Rig::start() else { return };
    for holder in [Holder::Play, Holder::Record] {
        let Stop { safe_after_s, ended_after_s, code } = rig.interrupt(rig.hold(holder));
        println!("{holder:?}: safe after {safe_after_s:.3} s, exit code {code:?} after {ended_after_s:.3} s");
        assert!(safe_after_s <= SAFE_WITHIN_S, "{holder:?}");
        // 6 says that the board has confirmed the stop.
        assert_eq!(code, Some(6), "{holder:?}");
    }
}
