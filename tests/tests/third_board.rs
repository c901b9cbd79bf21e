//! The image of the Olimex STM32-H405 in QEMU, whose machine has neither pins nor a flash: what the page "Add a board" promises
//! of a board that only began. Its pins are not looked at here, nor anywhere else.
//!
//! `cargo xtask test` installs the emulator and builds the image; without them see `emulator::missing`.

#[expect(dead_code, reason = "the images of other boards are started elsewhere")]
mod emulator;
#[expect(dead_code, reason = "servos and frames of modules are tested on the other boards")]
#[path = "bench/tables.rs"]
mod tables;

use std::time::{Duration, Instant};

use darm_core::output::{ActuatorWiring, Coil, CoilLimit, Drive, Wiring};
use darm_core::sequencer::{Command, Event, Phase};
use darm_core::units::{ModelHash, Word};
use darm_device::client::{Client, TimedEvent};
use darm_device::in_process::MemoryFlash;
use darm_device::qemu::qtest::Qtest;
use darm_device::qemu::{Console, Machine, Qemu};
use darm_firmware::sparse_flash::{MAGIC, PAGE};
use emulator::Ready;
use tables::{profile, stepped, table};

/// Where `memory.x` of the board puts the model of the flash.
const FLASH_MODEL: u32 = 0x1000_4000;
const MODEL_BYTES: usize = 48 * 1024;
/// Longest wait for anything: a loaded machine is slow, not wrong.
const LIMIT: Duration = Duration::from_secs(60);

/// Twelve valves without switches: there are no pins.
fn wiring() -> Wiring {
    let mut wiring = Wiring::default();
    for index in 0..12 {
        let drive = Drive::Hold { line: index };
        let limit = CoilLimit { duty_percent: 100, ..drive.default_limit() };
        wiring.coils.push(Coil { output: index, drive, limit }).unwrap();
        wiring.actuators.push(ActuatorWiring { states: 2, switch: None, travel_ms: 200 }).unwrap();
    }
    wiring
}

/// The pages of a flash as the board keeps them: a magic, then number and bytes of each that is not blank.
fn model(flash: &[u8]) -> Vec<u8> {
    let mut model = MAGIC.to_le_bytes().to_vec();
    for (number, page) in flash.chunks(PAGE).enumerate().filter(|(_, page)| page.iter().any(|byte| *byte != 0xff)) {
        model.extend((number as u16).to_le_bytes());
        model.extend(page);
    }
    // The numbers of the pages that follow are free ones.
    model.resize(MODEL_BYTES, 0xff);
    model
}

#[track_caller]
fn events_until(client: &mut Client, is_last: impl Fn(Event) -> bool) -> Vec<TimedEvent> {
    let (start, mut happened) = (Instant::now(), Vec::<TimedEvent>::new());
    while !happened.iter().any(|timed| is_last(timed.event)) {
        assert!(start.elapsed() < LIMIT, "waited in vain, so far {happened:?}");
        let from = happened.last().map_or(0, |last| last.number + 1);
        happened.extend(client.events(from).unwrap());
    }
    happened
}

#[test]
fn a_board_that_only_began_identifies_itself_stores_a_table_and_plays_it() {
    let Some(Ready { elf, lock: _lock }) = emulator::ready_for("olimex-stm32-h405") else { return };
    let (folder, wiring) = (tempfile::tempdir().unwrap(), wiring());
    let machine =
        Machine { board: "olimex-stm32-h405", ..Machine::new(elf, folder.path().to_owned(), Console::Socket) };
    let mut qemu = Qemu::start(&machine).unwrap();
    let (mut memory, _edges) = Qtest::connect(&qemu.pins_socket()).unwrap();
    let flash = MemoryFlash::with_profile(&profile(&wiring).image());
    for (word, at) in model(&flash.bytes()).chunks_exact(4).zip((FLASH_MODEL..).step_by(4)) {
        memory.write_u32(at, u32::from_le_bytes(word.try_into().unwrap())).unwrap();
    }
    qemu.resume().unwrap();
    let mut client = Client::connect(darm_device::link::open(qemu.console_port()).unwrap()).unwrap();
    assert_eq!(client.identity().board, "STM32-H405");
    assert_eq!(client.last_crash().unwrap(), None);
    let words = stepped(8);
    assert_eq!(client.upload(&table(&wiring, &words, ModelHash(7)), &mut |_| {}).unwrap(), 8);
    client.command(Command::Play).unwrap();
    let happened = events_until(&mut client, |event| event == Event::Finished);
    let row = |timed: &TimedEvent| match timed.event {
        Event::Row { word, .. } => Some(word),
        _ => None,
    };
    assert_eq!(happened.iter().filter_map(row).collect::<Vec<Word>>(), words);
    let status = client.status().unwrap();
    assert_eq!((status.phase, status.model), (Phase::Idle, Some(ModelHash(7))));
    let boots = client.hello().unwrap().boots;
    assert_eq!(client.say_hello().unwrap().boots, boots, "it has not restarted");
}
