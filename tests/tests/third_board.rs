//! The image of the Olimex STM32-H405 in QEMU, whose machine has neither pins nor a flash: what the page "Add a board" promises
//! of a board that only began. Its pins are not looked at here, nor anywhere else.
//!
//! `cargo xtask test` installs the emulator and builds the image; without them see `emulator::missing`.

#[expect(dead_code, unused_imports, reason = "what needs pins is tested on the other boards")]
mod bench;
mod emulator;

use bench::{events_until, profile, row_words, stepped, table, wiring};
use darm_core::sequencer::{Command, Event, Phase};
use darm_core::units::ModelHash;
use darm_device::client::Client;
use darm_firmware::sparse_flash::{MAGIC, PAGE};
use darm_sim::in_process::MemoryFlash;
use darm_sim::qemu::qtest::Qtest;
use darm_sim::qemu::{Console, Machine, Qemu};
use emulator::Ready;

/// Where `board.x` of the board puts the model of the flash.
const FLASH_MODEL: u32 = 0x1000_4000;
const MODEL_BYTES: usize = 48 * 1024;

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

#[test]
fn a_board_that_only_began_identifies_itself_stores_a_table_and_plays_it() {
    let Some(Ready { elf, lock: _lock }) = emulator::ready_for("olimex-stm32-h405") else { return };
    let (folder, mut wiring) = (tempfile::tempdir().unwrap(), wiring(false));
    // There are no pins for them.
    wiring.actuators.iter_mut().for_each(|actuator| actuator.switch = None);
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
    assert_eq!(row_words(&happened), words);
    let status = client.status().unwrap();
    assert_eq!((status.phase, status.model), (Phase::Idle, Some(ModelHash(7))));
    let health = client.health().unwrap().unwrap();
    assert!(health.stack.is_some_and(|stack| stack.used > 1024 && stack.used < stack.size), "{health:?}");
    assert!(health.load_permille.is_some() && health.console.is_none() && health.supply_mv.is_none(), "{health:?}");
    let boots = client.hello().unwrap().boots;
    assert_eq!(client.say_hello().unwrap().boots, boots, "it has not restarted");
}
