//! Memory that outlives a reset: how the last start ended, and how many crashed in a row.

use core::cell::UnsafeCell;
use core::fmt::{self, Write};
use core::mem::MaybeUninit;

use darm_core::units::Micros;
use darm_core::wire::bootstrap::{CrashKind, CrashRecord, MAX_TEXT};

use crate::life;

const MAGIC: u32 = 0x6461_726d;

#[derive(Clone, Copy)]
#[repr(C)]
struct Record {
    magic: u32,
    kind: u32,
    uptime_us: u64,
    pc: u32,
    lr: u32,
    len: u32,
    message: [u8; MAX_TEXT],
    check: u32,
}

/// Memory that outlives a reset: the record of a crash, and how many there were in a row with the complement of that
/// number, which distinguishes it from the noise after power-on. A board puts it where start-up code neither clears nor
/// fills:
///
/// ```
/// # use darm_firmware::kept::Kept;
/// #[unsafe(link_section = ".uninit.KEPT")]
/// static KEPT: Kept = Kept::new();
/// ```
pub struct Kept {
    record: UnsafeCell<MaybeUninit<Record>>,
    crashes: UnsafeCell<MaybeUninit<[u32; 2]>>,
}

// SAFETY: every access is a volatile one of this module, at start before any interrupt, in a handler that never returns, or
// of a count whose halves disagree where two were mixed, which counts as none.
unsafe impl Sync for Kept {}

impl Kept {
    /// Memory with any content.
    pub const fn new() -> Self {
        Self { record: UnsafeCell::new(MaybeUninit::uninit()), crashes: UnsafeCell::new(MaybeUninit::uninit()) }
    }

    fn crashes(&self) -> *mut [u32; 2] {
        self.crashes.get().cast()
    }

    fn record(&self) -> *mut Record {
        self.record.get().cast()
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
    fn new(kind: CrashKind, uptime: Micros, at: Registers, message: fmt::Arguments) -> Self {
        let (kind, uptime_us) = (number(kind), uptime.0);
        let Registers { pc, lr } = at;
        let mut record = Self { magic: MAGIC, kind, uptime_us, pc, lr, len: 0, message: [0; MAX_TEXT], check: 0 };
        // A message that does not fit is cut; there is nowhere to report it.
        let _ = record.write_fmt(message);
        record.check = record.sum();
        record
    }

    /// A plain sum is enough to distinguish a record from noise.
    fn sum(&self) -> u32 {
        let head = [self.magic, self.kind, self.uptime_us as u32, self.pc, self.lr, self.len];
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

/// How the start before this one ended, if it did not end by power. Reading it forgets it. `bitten`: the watchdog caused
/// the reset. Call once, at start.
pub fn take(kept: &Kept, bitten: bool) -> Option<CrashRecord> {
    let slot = kept.record();
    // SAFETY: every bit pattern is a `Record`; only this function at start and the handlers, which never return, touch it.
    let record = unsafe { slot.read_volatile() };
    // SAFETY: as above; a zero magic makes the record unreadable.
    unsafe { (&raw mut (*slot).magic).write_volatile(0) };
    if record.magic == MAGIC && record.check == record.sum() {
        let bytes = record.message.get(..record.len as usize).unwrap_or(&record.message);
        let text = bytes.utf8_chunks().next().map_or("", |chunk| chunk.valid());
        let kinds = [CrashKind::Panic, CrashKind::Watchdog];
        return Some(CrashRecord {
            kind: kinds.into_iter().find(|kind| number(*kind) == record.kind).unwrap_or(CrashKind::HardFault),
            uptime_us: record.uptime_us,
            pc: record.pc,
            lr: record.lr,
            text: heapless::String::try_from(text).unwrap_or_default(),
        });
    }
    bitten.then(|| CrashRecord { kind: CrashKind::Watchdog, uptime_us: 0, pc: 0, lr: 0, text: heapless::String::new() })
}

/// Counts the crash of the last start, if it crashed, and returns how many there were in a row. Call once, at start.
pub fn count_crash(kept: &Kept, crashed: bool) -> u32 {
    // SAFETY: any bits are valid.
    let [count, complement] = unsafe { kept.crashes().read_volatile() };
    let crashes = life::crashes_in_a_row(if count == !complement { count } else { 0 }, crashed);
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
    let record = Record::new(kind, uptime, at, message);
    // SAFETY: interrupts are masked or of lower priority; nothing reads the record before the reset.
    unsafe { kept.record().write_volatile(record) };
}
