//! The driver against the model of the controller. Sections are those of RM0351.

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{NorFlash as _, ReadNorFlash as _};
use stm32_metapac::FLASH;

use super::{Bank2, FlashError, PAGE_BYTES, corrected_errors, double_errors, on_nmi};
use crate::bus;
use crate::ecc::DoubleError;
use crate::tests::model::{self, BANK_2, Ecc, ModelClock, flash};

const WORD: [u8; 8] = [1, 2, 3, 4, 5, 6, 7, 8];
/// A page in use, not the first.
const PAGE: u32 = 3 * PAGE_BYTES as u32;

fn bank() -> Bank2<ModelClock> {
    model::power_on();
    Bank2::new(ModelClock)
}

fn write(bank: &mut Bank2<ModelClock>, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
    block_on(bank.write(offset, bytes))
}

fn read<const N: usize>(bank: &mut Bank2<ModelClock>, offset: u32) -> [u8; N] {
    let mut bytes = [0; N];
    block_on(bank.read(offset, &mut bytes)).expect("the controller rests");
    bytes
}

fn is_at_rest() -> bool {
    model::with(|chip| chip.flash.is_at_rest() && chip.flash.is_cached())
}

/// 3.3.6 and 3.3.7: a page is erased at once, a double word programmed.
#[test]
fn what_is_written_reads_back_and_goes_with_its_page() {
    let mut bank = bank();
    write(&mut bank, PAGE, &WORD.repeat(3)).expect("an erased page");
    assert_eq!(read(&mut bank, PAGE + 8), WORD);
    write(&mut bank, 0, &WORD).expect("an erased page");
    block_on(bank.erase(PAGE, PAGE + PAGE_BYTES as u32)).expect("no page is protected");
    assert_eq!((read(&mut bank, PAGE + 8), read(&mut bank, 0)), ([0xff; 8], WORD));
    assert!(is_at_rest());
}

/// 3.3.6: BKER and PNB select the page.
#[test]
fn the_last_page_is_that_of_bank_2() {
    let mut bank = bank();
    let end = bank.capacity() as u32;
    write(&mut bank, end - 8, &WORD).expect("an erased page");
    assert_eq!(model::with(|chip| chip.flash.raw(end as usize - 8, 8).to_vec()), WORD);
    block_on(bank.erase(end - PAGE_BYTES as u32, end)).expect("no page is protected");
    assert_eq!(read(&mut bank, end - 8), [0xff; 8]);
    assert_eq!(write(&mut bank, end, &WORD), Err(FlashError::Bounds));
    assert_eq!(write(&mut bank, 4, &WORD), Err(FlashError::Bounds));
    assert!(is_at_rest());
}

/// 3.3.4: the data cache does not notice what is written. A driver that leaves it on, or does not reset it, reads old bytes.
#[test]
fn the_data_cache_never_shows_what_was_there_before() {
    let mut bank = bank();
    assert_eq!(read(&mut bank, PAGE), [0xff; 8]);
    write(&mut bank, PAGE, &WORD).expect("an erased page");
    assert_eq!(read(&mut bank, PAGE), WORD);
    block_on(bank.erase(PAGE, PAGE + PAGE_BYTES as u32)).expect("no page is protected");
    assert_eq!(read(&mut bank, PAGE), [0xff; 8]);
}

/// 3.5.3 "Write protection": WRPERR.
#[test]
fn a_protected_page_is_reported_and_keeps_its_bytes() {
    let mut bank = bank();
    write(&mut bank, PAGE, &WORD).expect("an erased page");
    model::with(|chip| chip.flash.protected[1] = 3 << 16 | 3);
    let refused = Err(FlashError::Controller { flags: flash::WRPERR });
    assert_eq!(write(&mut bank, PAGE + 8, &WORD), refused);
    assert_eq!(block_on(bank.erase(PAGE, PAGE + PAGE_BYTES as u32)), refused);
    assert_eq!(read(&mut bank, PAGE), WORD);
    assert!(is_at_rest());
    write(&mut bank, 0, &WORD).expect("the error does not outlast its operation");
}

/// 3.3.7: a programmed double word takes nothing but zeros: PROGERR.
#[test]
fn a_second_write_is_reported_unless_it_is_all_zeros() {
    let mut bank = bank();
    write(&mut bank, PAGE, &WORD).expect("an erased page");
    assert_eq!(write(&mut bank, PAGE, &[7; 8]), Err(FlashError::Controller { flags: flash::PROGERR }));
    assert_eq!(read(&mut bank, PAGE), WORD);
    write(&mut bank, PAGE, &[0; 8]).expect("zeros go over anything");
    assert_eq!(read(&mut bank, PAGE), [0; 8]);
}

/// 3.7.5 names these flags. Some have no cause in what the driver does: the model raises each at the end of an operation.
#[test]
fn each_error_flag_is_reported_and_cleared() {
    let flags = [
        flash::OPERR,
        flash::PROGERR,
        flash::WRPERR,
        flash::PGAERR,
        flash::SIZERR,
        flash::PGSERR,
        flash::MISERR,
        flash::FASTERR,
        flash::RDERR,
        flash::OPTVERR,
    ];
    for flags in flags {
        let mut bank = bank();
        model::with(|chip| chip.flash.next_errors = flags);
        assert_eq!(write(&mut bank, PAGE, &WORD), Err(FlashError::Controller { flags }));
        model::with(|chip| chip.flash.next_errors = flags);
        assert_eq!(block_on(bank.erase(0, PAGE_BYTES as u32)), Err(FlashError::Controller { flags }));
        assert!(is_at_rest());
        write(&mut bank, PAGE, &WORD).expect("the error does not outlast its operation");
    }
}

/// Steps 1 and 2 of 3.3.6 and 3.3.7: flags of somebody else's operation would fail ours with PGSERR.
#[test]
fn flags_that_were_left_behind_do_no_harm() {
    let mut bank = bank();
    bus::store_word(BANK_2, 1);
    assert_eq!(bus::read(FLASH.sr()).0 & flash::PGSERR, flash::PGSERR, "a write without PG");
    write(&mut bank, PAGE, &WORD).expect("the flag is cleared first");
}

/// 3.7.5: what raises PGAERR, PGSERR and FASTERR. EOP and OPERR come with their interrupts only.
#[test]
fn the_model_raises_what_the_manual_says() {
    model::power_on();
    let open = |extra: u32| {
        bus::modify(FLASH.acr(), |w| w.set_dcen(false));
        bus::write_value(FLASH.sr(), stm32_metapac::flash::regs::Sr(0xffff));
        if bus::read(FLASH.cr()).lock() {
            bus::write_value(FLASH.keyr(), 0x4567_0123);
            bus::write_value(FLASH.keyr(), 0xcdef_89ab);
        }
        bus::modify(FLASH.cr(), |w| w.0 = w.0 & 0xc000_0000 | extra);
    };
    let flags = || bus::read(FLASH.sr()).0 & 0xffff;
    const PG: u32 = 1;
    open(PG);
    bus::store_word(BANK_2 + 4, 0);
    assert_eq!(flags(), flash::PGAERR, "the second half first");
    open(PG);
    bus::store_word(BANK_2, 0);
    bus::store_word(BANK_2 + 12, 0);
    assert_eq!(flags(), flash::PGAERR, "two halves of two double words");
    open(1 << 18);
    bus::store_word(BANK_2, 0);
    assert_eq!(flags(), flash::FASTERR, "fast programming without its rows");
    open(PG | 1 << 1);
    bus::store_word(BANK_2, 0);
    assert_eq!(flags(), flash::PGSERR, "PG and PER");
    open(PG | 1 << 24 | 1 << 25);
    bus::store_word(BANK_2, 0);
    bus::store_word(BANK_2 + 4, 0);
    model::pass_us(100);
    assert_eq!(flags(), flash::EOP);
    open(PG | 1 << 25);
    bus::store_word(BANK_2, 1);
    bus::store_word(BANK_2 + 4, 1);
    assert_eq!(flags(), flash::PROGERR | flash::OPERR);
}

#[test]
fn a_controller_that_never_ends_is_reported_and_left_alone() {
    let mut bank = bank();
    model::with(|chip| chip.flash.hangs = true);
    let before_us = model::now_us();
    assert_eq!(write(&mut bank, PAGE, &WORD), Err(FlashError::Busy));
    assert!((100_000..110_000).contains(&(model::now_us() - before_us)));
    // A read would stall the core, and the cache must stay off (erratum): the model panics otherwise.
    assert_eq!(block_on(bank.read(0, &mut [0])), Err(FlashError::Busy));
    assert_eq!(block_on(bank.erase(0, PAGE_BYTES as u32)), Err(FlashError::Busy));
    assert!(!model::with(|chip| chip.flash.is_cached()));
    model::with(|chip| chip.flash.hangs = false);
    write(&mut bank, 0, &WORD).expect("it has ended after all");
    assert!(is_at_rest());
}

/// 3.3.5 "Unlocking the Flash memory": after a wrong key the controller is locked until reset.
#[test]
#[should_panic(expected = "locked until the next reset (3.3.5)")]
fn the_model_refuses_keys_after_a_wrong_one() {
    let mut bank = bank();
    model::with(|chip| chip.flash.lock_up());
    let _ = write(&mut bank, PAGE, &WORD);
}

/// The erratum of the data cache on read while write.
#[test]
#[should_panic(expected = "erratum")]
fn the_model_refuses_a_write_with_the_data_cache_on() {
    model::power_on();
    bus::write_value(FLASH.keyr(), 0x4567_0123);
    bus::write_value(FLASH.keyr(), 0xcdef_89ab);
    bus::modify(FLASH.cr(), |w| w.set_pg(true));
    bus::store_word(BANK_2, 0);
    bus::store_word(BANK_2 + 4, 0);
}

#[test]
#[should_panic(expected = "only while it is off (3.7.1)")]
fn the_model_refuses_to_reset_a_cache_that_is_on() {
    model::power_on();
    bus::modify(FLASH.acr(), |w| w.set_dcrst(true));
}

#[test]
#[should_panic(expected = "stalls the core (3.7.6)")]
fn the_model_refuses_a_write_of_cr_while_busy() {
    let mut bank = bank();
    model::with(|chip| chip.flash.hangs = true);
    let _ = write(&mut bank, PAGE, &WORD);
    bus::modify(FLASH.cr(), |w| w.set_lock(true));
}

/// A dropped future leaves its mode selected and the cache off; the next operation waits for none of it, but for BSY (3.7.5).
#[test]
fn a_dropped_erase_does_not_spoil_the_next_write() {
    let mut bank = bank();
    {
        let mut erase = core::pin::pin!(bank.erase(PAGE, PAGE + PAGE_BYTES as u32));
        let waker = core::task::Waker::noop();
        assert!(erase.as_mut().poll(&mut core::task::Context::from_waker(waker)).is_pending());
    }
    assert_eq!(write(&mut bank, 0, &WORD), Err(FlashError::Busy));
    model::pass_us(25_000);
    write(&mut bank, 0, &WORD).expect("the erase has ended");
    assert!(is_at_rest());
}

/// 3.3.2 and 3.7.7: a corrected bit is counted, and its flag does not hide the next one.
#[test]
fn corrected_bits_are_counted() {
    let mut bank = bank();
    let before = corrected_errors();
    model::with(|chip| chip.flash.wrong.extend([(0, Ecc::Corrected), (64, Ecc::Corrected)]));
    assert_eq!(read(&mut bank, 0), [0xff; 8]);
    assert_eq!(read(&mut bank, 64), [0xff; 8]);
    assert_eq!(read(&mut bank, 8), [0xff; 8]);
    // Another test may count as well.
    assert!(corrected_errors() - before >= 2);
    assert_eq!(bus::read(FLASH.eccr()).0 & 0xc000_0000, 0);
}

/// 3.3.2: two wrong bits raise the NMI. In the data the reader gets the bytes, and zeros may go over them (3.3.7).
#[test]
fn a_torn_word_is_noted_and_can_be_overwritten() {
    let mut bank = bank();
    model::with(|chip| chip.flash.wrong.insert(PAGE as usize, Ecc::Detected));
    let (before, _) = double_errors();
    assert_eq!(read(&mut bank, PAGE), [0xff; 8]);
    assert!(double_errors().0 > before);
    assert_eq!(bus::read(FLASH.eccr()).0 & 0xc000_0000, 0);
    assert_eq!(write(&mut bank, PAGE, &WORD), Err(FlashError::Controller { flags: flash::PROGERR }));
    write(&mut bank, PAGE, &[0; 8]).expect("zeros go over a torn word");
    let nmis = model::with(|chip| chip.flash.nmis);
    assert_eq!(read(&mut bank, PAGE), [0; 8]);
    assert_eq!(model::with(|chip| chip.flash.nmis), nmis);
}

/// 3.7.7: the register keeps the address of the corrected error of the code.
#[test]
fn a_torn_word_is_noted_behind_a_corrected_error_of_the_code() {
    let mut bank = bank();
    model::with(|chip| {
        chip.flash.is_code_weak = true;
        chip.flash.wrong.insert(PAGE as usize, Ecc::Detected);
    });
    for start in 1..=3 {
        assert_eq!(read(&mut bank, PAGE), [0xff; 8], "start {start}");
        model::with(|chip| chip.flash.restart());
    }
    assert_eq!(bus::read(FLASH.eccr()).0 & 0xc000_0000, 0);
    write(&mut bank, PAGE, &[0; 8]).expect("zeros go over a torn word");
}

/// 3.7.7: the address of a double error.
#[test]
fn a_torn_word_outside_the_data_is_fatal() {
    let beyond = bank().capacity();
    model::with(|chip| {
        chip.flash.wrong.insert(beyond, Ecc::Detected);
        chip.flash.read(BANK_2 + beyond)
    });
    assert_eq!(on_nmi(), Err(Some(DoubleError::Code { bank: 2, offset: beyond as u32 })));
    model::power_on();
    assert_eq!(on_nmi(), Err(None), "an NMI of another cause");
}
