//! Faults of the processor and of tasks in the real image: what a board does when its own software fails.
//!
//! The test socket writes RAM and system registers while the image runs, so the flashed image itself is made to fail.
//! Without the emulator or the image see `emulator::missing`.

mod emulator;

use std::fs::File;
use std::time::{Duration, Instant};

use darm_core::sequencer::Event;
use darm_core::wire::PROTOCOL;
use darm_core::wire::bootstrap::{self, CrashKind, CrashRecord};
use darm_device::client::Client;
use darm_sim::qemu::qtest::Qtest;
use darm_sim::qemu::{Console, Machine, Qemu};
use emulator::Ready;

/// Longest wait for anything: a loaded machine is slow.
const LIMIT: Duration = Duration::from_secs(60);
/// SRAM1 beyond the image's variables: 1 KiB for a vector table and a few instructions.
const SCRATCH: u32 = 0x2001_7C00;
const CODE: u32 = SCRATCH + 0x200;
/// Vector table offset register.
const VTOR: u32 = 0xE000_ED08;
const VECTORS: usize = 16 + 82;
const SYSTICK: u32 = 15;
/// `push {r0-r7}`, then a branch to it.
const PUSH_FOR_EVER: u32 = 0xE7FD_B4FF;
/// Interrupt clear-enable register 2, and the interrupt in it that runs the console and the servo bus.
const ICER2: u32 = 0xE000_E188;
const COMMON: u32 = 1 << (76 - 64);

/// Interrupt control and state register, and its bit that raises the NMI.
const ICSR: u32 = 0xE000_ED04;
const NMIPENDSET: u32 = 1 << 31;

struct Board {
    qemu: Qemu,
    qtest: Qtest,
    _folder: tempfile::TempDir,
    _lock: File,
}

impl Board {
    /// Boots a blank board without a plant. `None`, reported, where it cannot run.
    fn start() -> Option<Self> {
        let Ready { elf, lock } = emulator::ready()?;
        let folder = tempfile::tempdir().unwrap();
        let mut qemu = Qemu::start(&Machine::new(elf, folder.path().to_owned(), Console::Socket)).unwrap();
        let (qtest, _) = Qtest::connect(&qemu.pins_socket()).unwrap();
        qemu.resume().unwrap();
        Some(Self { qemu, qtest, _folder: folder, _lock: lock })
    }

    fn connect(&self) -> Client {
        Client::connect(darm_device::link::open(self.qemu.console_port()).unwrap()).unwrap()
    }

    /// Lets the next SysTick run instructions that push until the stack is exhausted.
    fn overflow_the_stack(&mut self) {
        let vectors = self.qtest.read_bytes(0x0800_0000, 4 * VECTORS).unwrap();
        for (word, at) in vectors.chunks_exact(4).zip((SCRATCH..).step_by(4)) {
            self.qtest.write_u32(at, u32::from_le_bytes(word.try_into().unwrap())).unwrap();
        }
        self.qtest.write_u32(CODE, PUSH_FOR_EVER).unwrap();
        self.qtest.write_u32(SCRATCH + 4 * SYSTICK, CODE | 1).unwrap();
        self.qtest.write_u32(VTOR, SCRATCH).unwrap();
    }

    /// Waits until the processor has reset after [`Board::overflow_the_stack`].
    #[track_caller]
    fn wait_for_reset(&mut self) {
        let start = Instant::now();
        while self.qtest.read_u32(VTOR).unwrap() == SCRATCH {
            assert!(start.elapsed() < LIMIT, "no reset; the emulator: {:?}", self.qemu.complaints());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Waits for a start that reads a crash record.
    #[track_caller]
    fn crash_record(&mut self) -> CrashRecord {
        let start = Instant::now();
        loop {
            assert!(self.qemu.is_running(), "the emulator ended: {}", self.qemu.complaints());
            let link = darm_device::link::open(self.qemu.console_port()).unwrap();
            if let Ok(Some(crash)) = Client::connect(link).and_then(|mut client| client.last_crash()) {
                return crash;
            }
            assert!(start.elapsed() < LIMIT, "no crash record; the emulator: {:?}", self.qemu.complaints());
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

#[test]
fn a_stack_overflow_is_recorded_and_the_board_starts_again() {
    let Some(mut board) = Board::start() else { return };
    assert_eq!(board.connect().last_crash().unwrap(), None);
    board.overflow_the_stack();
    let record = board.crash_record();
    assert_eq!(record.kind, CrashKind::HardFault);
    assert!(record.text.starts_with("stack overflow"), "{}", record.text);
}

#[test]
fn a_console_that_stops_resets_the_board() {
    let Some(mut board) = Board::start() else { return };
    assert_eq!(board.connect().last_crash().unwrap(), None);
    board.qtest.write_u32(ICER2, COMMON).unwrap();
    let record = board.crash_record();
    assert_eq!(record.kind, CrashKind::Watchdog);
    assert!(record.text.starts_with("console silent"), "{}", record.text);
}

#[test]
fn three_crashes_in_a_row_hold_the_board_until_a_reboot() {
    let Some(mut board) = Board::start() else { return };
    for crashes in 0..3 {
        assert_eq!(board.connect().version().protocol, PROTOCOL, "after {crashes} crashes");
        board.overflow_the_stack();
        board.wait_for_reset();
    }
    let mut held = board.connect();
    assert_eq!(held.version().protocol, 0);
    held.stop_at_once().unwrap();
    assert!(held.status().is_err(), "a held board answers the bootstrap set alone");
    assert_eq!(held.last_crash().unwrap().map(|record| record.kind), Some(CrashKind::HardFault));
    held.reboot(bootstrap::RebootTarget::Application).unwrap();
    drop(held);
    let start = Instant::now();
    while board.connect().version().protocol != PROTOCOL {
        assert!(start.elapsed() < LIMIT, "the board is still held");
    }
    let mut client = board.connect();
    assert_eq!(client.last_crash().unwrap(), None);
    let kinds: Vec<CrashKind> = client.past_crashes().unwrap().iter().map(|crash| crash.kind).collect();
    assert_eq!(kinds, [CrashKind::HardFault; 3], "crashes outlive resets");
    let booted = client.past_events().unwrap().iter().filter(|(_, event)| *event == Event::Booted).count();
    assert_eq!(booted, 3, "events outlive resets; a held board has none");
}

#[test]
fn a_non_maskable_interrupt_without_a_flash_error_is_fatal() {
    let Some(mut board) = Board::start() else { return };
    assert_eq!(board.connect().last_crash().unwrap(), None);
    board.qtest.write_u32(ICSR, NMIPENDSET).unwrap();
    let record = board.crash_record();
    assert_eq!(record.kind, CrashKind::HardFault);
    assert!(record.text.starts_with("non-maskable interrupt"), "{}", record.text);
}
