//! Memory that outlives a reset: how the last starts ended, how many crashed in a row, and the last events.

use core::cell::UnsafeCell;
use core::fmt::{self, Write};
use core::mem::MaybeUninit;

use darm_core::units::Micros;
use darm_core::wire::bootstrap::{CrashKind, CrashRecord, MAX_TEXT};

use crate::life;
use crate::log::LogMemory;

/// Marks a record that no start has read.
const NEW: u32 = 0x6461_726d;
/// Marks one that has been reported as the crash of the last start.
const READ: u32 = 0x7265_6164;
/// Crashes kept.
pub const CRASHES: usize = 4;

#[derive(Clone, Copy)]
#[repr(C)]
struct Record {
    magic: u32,
    /// Counts the crashes, and wraps.
    order: u32,
    kind: u32,
    uptime_us: u64,
    pc: u32,
    lr: u32,
    len: u32,
    message: [u8; MAX_TEXT],
    check: u32,
}

/// Memory that outlives a reset: the records of the last crashes, how many there were in a row with the complement of that
/// number, which distinguishes it from the noise after power-on, what writes of the flash have used up, and the last events. A board puts it where start-up code neither clears nor
/// fills:
///
/// ```
/// # use darm_firmware::kept::Kept;
/// #[unsafe(link_section = ".uninit.KEPT")]
/// static KEPT: Kept = Kept::new();
/// ```
pub struct Kept {
    records: UnsafeCell<MaybeUninit<[Record; CRASHES]>>,
    crashes: UnsafeCell<MaybeUninit<[u32; 2]>>,
    /// Two times, and their [`Kept::check`].
    missing_ms: UnsafeCell<MaybeUninit<[u32; 3]>>,
    log: UnsafeCell<MaybeUninit<LogMemory>>,
}

// SAFETY: every access is a volatile one of this module, at start before any interrupt, in a handler that never returns, of a
// record whose check fails where it is read half-written, or of a count whose halves disagree where two were mixed, which counts
// as none. The events have one owner, see `Kept::log`.
unsafe impl Sync for Kept {}

impl Kept {
    /// Memory with any content.
    pub const fn new() -> Self {
        Self {
            records: UnsafeCell::new(MaybeUninit::uninit()),
            crashes: UnsafeCell::new(MaybeUninit::uninit()),
            missing_ms: UnsafeCell::new(MaybeUninit::uninit()),
            log: UnsafeCell::new(MaybeUninit::uninit()),
        }
    }

    /// Memory whose content means nothing, for a board in a process: there memory that nobody has written must not be read.
    pub const fn blank() -> Self {
        Self {
            records: UnsafeCell::new(MaybeUninit::zeroed()),
            crashes: UnsafeCell::new(MaybeUninit::zeroed()),
            missing_ms: UnsafeCell::new(MaybeUninit::zeroed()),
            log: UnsafeCell::new(MaybeUninit::zeroed()),
        }
    }

    fn crashes(&self) -> *mut [u32; 2] {
        self.crashes.get().cast()
    }

    /// What is missing in the buckets of tables and of calibrations, see [`crate::wear`]; `None` where memory holds noise.
    pub(crate) fn missing_ms(&self) -> Option<[u32; 2]> {
        // SAFETY: any bits are valid.
        let [tables, calibrations, check] = unsafe { self.missing_ms.get().cast::<[u32; 3]>().read_volatile() };
        (check == Self::check([tables, calibrations])).then_some([tables, calibrations])
    }

    /// Sets it. From the dispatcher only.
    pub(crate) fn set_missing_ms(&self, missing_ms: [u32; 2]) {
        let [tables, calibrations] = missing_ms;
        let words = [tables, calibrations, Self::check(missing_ms)];
        // SAFETY: the pointer is that of a static; a reset between two words leaves noise, which the check finds.
        unsafe { self.missing_ms.get().cast::<[u32; 3]>().write_volatile(words) }
    }

    fn check([tables, calibrations]: [u32; 2]) -> u32 {
        !(tables.rotate_left(16) ^ calibrations)
    }

    /// The memory of the events.
    ///
    /// # Safety
    ///
    /// Called once: nothing else may refer to it.
    #[expect(clippy::mut_from_ref, reason = "the caller promises to be the only one")]
    pub unsafe fn log(&'static self) -> &'static mut LogMemory {
        // SAFETY: any content is a memory of events, and the caller promises that nothing else refers to it.
        unsafe { (*self.log.get()).assume_init_mut() }
    }

    fn slot(&self, order: u32) -> *mut Record {
        self.records.get().cast::<Record>().wrapping_add(order as usize % CRASHES)
    }

    /// The valid record in a slot.
    fn record(&self, order: u32) -> Option<&Record> {
        // SAFETY: every bit pattern is a `Record`, the pointer lies in `self`, and who writes a record never returns or is the
        // start, which reads no more.
        let record = unsafe { &*self.slot(order) };
        record.is_valid().then_some(record)
    }

    /// The record of the last crash.
    fn newest(&self) -> Option<&Record> {
        let is_newer = |a: &Record, b: &Record| (b.order.wrapping_sub(a.order) as i32) > 0;
        (0..CRASHES as u32).filter_map(|slot| self.record(slot)).reduce(|a, b| if is_newer(a, b) { b } else { a })
    }

    fn set_record(&self, record: Record) {
        // SAFETY: interrupts are masked, or the start has not begun any; the pointer is that of a static.
        unsafe { self.slot(record.order).write_volatile(record) };
    }

    /// The order of the next crash.
    fn next(&self) -> u32 {
        self.newest().map_or(0, |record| record.order.wrapping_add(1))
    }

    /// Crashes in a row at the last start; 0 where memory holds noise.
    fn crashes_in_a_row(&self) -> u32 {
        // SAFETY: any bits are valid.
        let [count, complement] = unsafe { self.crashes().read_volatile() };
        if count == !complement { count } else { 0 }
    }

    /// Whether the last start was held after crashes.
    fn was_recovering(&self) -> bool {
        life::start_after(self.crashes_in_a_row()) == life::Start::Recovery
    }

    fn set_crashes(&self, count: u32) {
        // SAFETY: the pointer is that of a static; a reset between the two words leaves noise, which counts as none.
        unsafe { self.crashes().write_volatile([count, !count]) }
    }
}

impl Default for Kept {
    fn default() -> Self {
        Self::new()
    }
}

/// Where a start ended.
#[derive(Clone, Copy)]
pub struct Registers {
    /// The program counter, 0 where it is not known.
    pub pc: u32,
    /// The link register, 0 where it is not known.
    pub lr: u32,
}

impl Registers {
    /// Those of an end that no exception reported.
    pub const UNKNOWN: Self = Self { pc: 0, lr: 0 };
}

const fn number(kind: CrashKind) -> u32 {
    match kind {
        CrashKind::Panic => 1,
        CrashKind::HardFault => 2,
        CrashKind::Watchdog => 3,
    }
}

impl Record {
    fn new(order: u32, kind: CrashKind, uptime: Micros, at: Registers) -> Self {
        let (kind, uptime_us) = (number(kind), uptime.0);
        let Registers { pc, lr } = at;
        Self { magic: NEW, order, kind, uptime_us, pc, lr, len: 0, message: [0; MAX_TEXT], check: 0 }
    }

    fn saying(mut self, message: fmt::Arguments) -> Self {
        // A message that does not fit is cut; there is nowhere to report it.
        let _ = self.write_fmt(message);
        self.marked(NEW)
    }

    /// With this mark and a check.
    fn marked(mut self, magic: u32) -> Self {
        self.magic = magic;
        self.check = self.sum();
        self
    }

    fn is_valid(&self) -> bool {
        [NEW, READ].contains(&self.magic) && self.check == self.sum()
    }

    fn decode(&self) -> CrashRecord {
        let bytes = self.message.get(..self.len as usize).unwrap_or(&self.message);
        let text = bytes.utf8_chunks().next().map_or("", |chunk| chunk.valid());
        let kinds = [CrashKind::Panic, CrashKind::Watchdog];
        CrashRecord {
            kind: kinds.into_iter().find(|kind| number(*kind) == self.kind).unwrap_or(CrashKind::HardFault),
            uptime_us: self.uptime_us,
            pc: self.pc,
            lr: self.lr,
            text: heapless::String::try_from(text).unwrap_or_default(),
        }
    }

    /// A plain sum is enough to distinguish a record from noise.
    fn sum(&self) -> u32 {
        let head = [self.magic, self.order, self.kind, self.uptime_us as u32, self.pc, self.lr, self.len];
        let text = self.message.iter().fold(1u32, |sum, byte| sum.wrapping_mul(31).wrapping_add(u32::from(*byte)));
        head.iter().fold(text, |sum, word| sum.rotate_left(5).wrapping_add(*word))
    }
}

impl Write for Record {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let free = self.message.get_mut(self.len as usize..).unwrap_or_default();
        for (to, from) in free.iter_mut().zip(text.bytes()) {
            *to = from;
            self.len = self.len.saturating_add(1);
        }
        Ok(())
    }
}

/// How the start before this one ended, if it did not end by power. It is reported once as that, and stays among the
/// [`past`] ones. `bitten`: the watchdog caused the reset. A held board whose console is reset by the watchdog keeps the record of
/// the crash that led there. Call once, at start, before [`count_crash`].
pub fn take(kept: &Kept, bitten: bool) -> Option<CrashRecord> {
    let record = match kept.newest() {
        Some(record) if record.magic == NEW || bitten && kept.was_recovering() => *record,
        _ if bitten => Record::new(kept.next(), CrashKind::Watchdog, Micros(0), Registers::UNKNOWN),
        _ => return None,
    };
    kept.set_record(record.marked(READ));
    Some(record.decode())
}

/// An earlier crash: 0 is the last one, 3 the oldest that is kept.
pub fn past(kept: &Kept, back: u8) -> Option<CrashRecord> {
    let order = kept.newest()?.order.wrapping_sub(back.into());
    kept.record(order).filter(|record| record.order == order).map(Record::decode)
}

/// Counts the crash of the last start, if it crashed, and returns how many there were in a row. Call once, at start.
pub fn count_crash(kept: &Kept, crashed: bool) -> u32 {
    let crashes = life::crashes_in_a_row(kept.crashes_in_a_row(), crashed);
    kept.set_crashes(crashes);
    crashes
}

/// Ends the row of crashes: the board has run steadily, or a person or a host reboots it.
pub fn forget_crashes(kept: &Kept) {
    kept.set_crashes(0);
}

/// Keeps how this start ended, for [`take`] at the next one. In a handler that never returns, with interrupts masked. Not inlined:
/// the analysis of the image ends here, see `xtask/src/image/lists.rs`.
#[inline(never)]
pub(crate) fn keep(kept: &Kept, kind: CrashKind, uptime: Micros, at: Registers, message: fmt::Arguments) {
    kept.set_record(Record::new(kept.next(), kind, uptime, at).saying(message));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Memory full of noise, as after power-on.
    fn noise() -> Kept {
        let kept = Kept::new();
        // SAFETY: any bits are valid in all of it.
        unsafe { kept.records.get().write_bytes(0x5a, 1) };
        kept
    }

    fn crash(kept: &Kept, uptime_us: u64) {
        let at = Registers { pc: 1, lr: 2 };
        keep(kept, CrashKind::Panic, Micros(uptime_us), at, format_args!("number {uptime_us}"));
    }

    #[test]
    fn blank_memory_means_nothing() {
        let kept = Kept::blank();
        assert_eq!((kept.missing_ms(), take(&kept, false), past(&kept, 0)), (None, None, None));
    }

    #[test]
    fn what_writes_have_used_up_is_kept_and_noise_is_none() {
        let kept = Kept::new();
        // SAFETY: any bits are valid.
        unsafe { kept.missing_ms.get().write_bytes(0x5a, 1) };
        assert_eq!(kept.missing_ms(), None);
        kept.set_missing_ms([60_000, 7]);
        assert_eq!(kept.missing_ms(), Some([60_000, 7]));
    }

    #[test]
    fn a_crash_is_that_of_the_last_start_once_and_stays_in_the_past() {
        let kept = noise();
        assert_eq!((take(&kept, false), past(&kept, 0)), (None, None));
        crash(&kept, 7);
        let text = heapless::String::try_from("number 7").unwrap();
        let expected = CrashRecord { kind: CrashKind::Panic, uptime_us: 7, pc: 1, lr: 2, text };
        assert_eq!(take(&kept, false), Some(expected.clone()));
        assert_eq!((take(&kept, false), past(&kept, 0)), (None, Some(expected)));
    }

    #[test]
    fn a_bite_without_a_record_is_kept_and_one_behind_a_record_adds_nothing() {
        let kept = noise();
        assert_eq!(take(&kept, true).map(|record| record.kind), Some(CrashKind::Watchdog));
        assert_eq!(past(&kept, 0).map(|record| record.kind), Some(CrashKind::Watchdog));
        crash(&kept, 1);
        assert_eq!(take(&kept, true).map(|record| record.kind), Some(CrashKind::Panic));
        assert_eq!(past(&kept, 2), None);
    }

    #[test]
    fn a_held_board_that_the_watchdog_resets_keeps_the_record_of_its_crash() {
        let kept = noise();
        let start = |bitten| {
            let crash = take(&kept, bitten);
            (crash.as_ref().map(|record| record.kind), count_crash(&kept, crash.is_some()))
        };
        for count in 1..=life::MAX_CRASHES {
            crash(&kept, count.into());
            assert_eq!(start(false), (Some(CrashKind::Panic), count));
        }
        assert_eq!(start(true), (Some(CrashKind::Panic), life::MAX_CRASHES + 1));
        assert_eq!(past(&kept, 0).map(|record| record.uptime_us), Some(life::MAX_CRASHES.into()));
        forget_crashes(&kept);
        assert_eq!(start(true), (Some(CrashKind::Watchdog), 1));
    }

    #[test]
    fn the_last_four_crashes_are_kept() {
        let kept = noise();
        (0..6).for_each(|uptime_us| crash(&kept, uptime_us));
        let uptimes: Vec<_> = (0..u8::MAX).map_while(|back| past(&kept, back)).map(|record| record.uptime_us).collect();
        assert_eq!(uptimes, [5, 4, 3, 2]);
    }

    #[test]
    fn a_record_that_a_reset_has_cut_is_none_and_those_before_it_stay() {
        let kept = noise();
        (0..2).for_each(|uptime_us| crash(&kept, uptime_us));
        // SAFETY: as above.
        unsafe { (&raw mut (*kept.slot(1)).pc).write_volatile(9) };
        assert_eq!(past(&kept, 0).map(|record| record.uptime_us), Some(0));
    }
}
