//! Panic and hard fault: outputs to their default in one edge, a record in memory that the reset leaves alone, reset.
//!
//! The hard fault handler leaves the stack of what failed, which may be exhausted, and starts at the top of the stack's
//! memory: it never returns, so nothing there is needed any more. What it takes from the old stack, it reads before.
//!
//! Crashes in a row are counted beside the record. After [`life::MAX_CRASHES`] the board is held: outputs disabled, the
//! console answers the bootstrap set, until a reboot by `reboot`, the reset button or power. A start that ran for
//! [`life::STEADY`] ends the row.
use core::arch::naked_asm;
use core::fmt::{self, Write};
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::addr_of_mut;

use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use darm_core::wire::bootstrap::{CrashKind, CrashRecord, MAX_TEXT};

use super::{pins, time, watchdog};
use crate::ecc::DoubleError;
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

/// Start-up code neither clears nor fills this section, so it outlives a reset. After power-on it holds noise.
#[unsafe(link_section = ".uninit.CRASH")]
static mut RECORD: MaybeUninit<Record> = MaybeUninit::uninit();

/// Crashes in a row and the complement of that number, which distinguishes it from noise. Outlives a reset as the record does.
#[unsafe(link_section = ".uninit.CRASHES")]
static mut CRASHES: MaybeUninit<[u32; 2]> = MaybeUninit::uninit();

const PANIC: u32 = 1;
const HARD_FAULT: u32 = 2;
const WATCHDOG: u32 = 3;

impl Record {
    fn new(kind: u32, (pc, lr): (u32, u32), message: fmt::Arguments) -> Self {
        let mut record =
            Self { magic: MAGIC, kind, uptime_us: time::now_us(), pc, lr, len: 0, message: [0; MAX_TEXT], check: 0 };
        // A message that does not fit is cut; there is nobody to tell.
        let _ = record.write_fmt(message);
        record.check = record.sum();
        record
    }

    /// A plain sum is enough to tell a record from noise.
    fn sum(&self) -> u32 {
        let head = [self.magic, self.kind, self.uptime_us as u32, self.pc, self.lr, self.len];
        let text = self.message.iter().fold(1u32, |sum, byte| sum.wrapping_mul(31).wrapping_add(u32::from(*byte)));
        head.iter().fold(text, |sum, word| sum.rotate_left(5).wrapping_add(*word))
    }
}

impl Write for Record {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let at = self.len as usize;
        let free = self.message.get_mut(at..).unwrap_or_default();
        let n = text.len().min(free.len());
        free[..n].copy_from_slice(&text.as_bytes()[..n]);
        self.len += n as u32;
        Ok(())
    }
}

/// How the start before this one ended, if it did not end by power. Reading it forgets it.
pub fn take() -> Option<CrashRecord> {
    let bitten = watchdog::take_bite();
    let slot = addr_of_mut!(RECORD).cast::<Record>();
    // SAFETY: every bit pattern is a `Record`; only this function at start and the handlers, which never return, touch it.
    let record = unsafe { slot.read_volatile() };
    // SAFETY: as above; a zero magic makes the record unreadable.
    unsafe { addr_of_mut!((*slot).magic).write_volatile(0) };
    if record.magic == MAGIC && record.check == record.sum() {
        let bytes = record.message.get(..record.len as usize).unwrap_or(&record.message);
        let text = bytes.utf8_chunks().next().map_or("", |chunk| chunk.valid());
        return Some(CrashRecord {
            kind: match record.kind {
                PANIC => CrashKind::Panic,
                WATCHDOG => CrashKind::Watchdog,
                _ => CrashKind::HardFault,
            },
            uptime_us: record.uptime_us,
            pc: record.pc,
            lr: record.lr,
            text: heapless::String::try_from(text).unwrap_or_default(),
        });
    }
    bitten.then(|| CrashRecord { kind: CrashKind::Watchdog, uptime_us: 0, pc: 0, lr: 0, text: heapless::String::new() })
}

/// Counts the crash of the last start, if it crashed, and returns how many there were in a row. Call once, at start.
pub fn count_crash(crashed: bool) -> u32 {
    let slot = addr_of_mut!(CRASHES).cast::<[u32; 2]>();
    // SAFETY: any bits are valid; only this file touches the slot, one word of it at a time after the start.
    let [count, complement] = unsafe { slot.read_volatile() };
    let crashes = life::crashes_in_a_row(if count == !complement { count } else { 0 }, crashed);
    set_crashes(crashes);
    crashes
}

/// Ends the row of crashes: the board has run steadily, or a person or a host reboots it.
pub fn forget_crashes() {
    set_crashes(0);
}

fn set_crashes(count: u32) {
    let slot = addr_of_mut!(CRASHES).cast::<[u32; 2]>();
    // SAFETY: as above; a reset between the two words leaves noise, which counts as none.
    unsafe { slot.write_volatile([count, !count]) }
}

/// One edge: output enable of the chain goes high. Before start it is an input with a pull-up, and stays so.
///
/// Interrupts are masked first, so that no control tick enables the outputs again before the reset.
fn outputs_off() {
    cortex_m::interrupt::disable();
    let enable = pins::CHAIN_ENABLE;
    enable.port.bsrr().write(|w| w.set_bs(usize::from(enable.index), true));
}

/// Ends a start that cannot continue, as a panic does.
pub fn give_up(why: fmt::Arguments) -> ! {
    outputs_off();
    die(Record::new(PANIC, (0, 0), why))
}

/// Ends a start in which a task no longer runs. In a handler of the highest priority in use.
pub fn end_silence(task: life::Task) -> ! {
    outputs_off();
    die(Record::new(WATCHDOG, (0, 0), format_args!("{} silent for {} ms", task.name(), life::SILENCE_LIMIT.0 / 1000)))
}

fn die(record: Record) -> ! {
    // SAFETY: interrupts are masked or of lower priority; nothing reads the record before the reset.
    unsafe { addr_of_mut!(RECORD).cast::<Record>().write_volatile(record) };
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    outputs_off();
    die(match info.location() {
        Some(place) => {
            Record::new(PANIC, (0, 0), format_args!("{}:{}: {}", short(place.file()), place.line(), info.message()))
        }
        None => Record::new(PANIC, (0, 0), format_args!("{}", info.message())),
    })
}

/// The end of a path: the start is the same for all files of a crate.
fn short(path: &str) -> &str {
    path.get(path.len().saturating_sub(18)..).unwrap_or(path)
}

unsafe extern "C" {
    /// Lowest address of the stack's memory, from `memory.x`.
    static _stack_end: u32;
}

/// Takes pc and lr from the frame that the processor has pushed, if the stack had room for it, and continues at the
/// top of the stack's memory. All code uses the main stack.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn HardFault() -> ! {
    naked_asm!(
        "mrs r2, msp",
        "movs r0, #0",
        "movs r1, #0",
        "movw r3, #:lower16:_stack_end",
        "movt r3, #:upper16:_stack_end",
        "cmp r2, r3",
        "blo 1f",
        "movw r3, #:lower16:_stack_start-32",
        "movt r3, #:upper16:_stack_start-32",
        "cmp r2, r3",
        "bhi 1f",
        "ldr r0, [r2, #24]",
        "ldr r1, [r2, #20]",
        "1:",
        // FPCCR.LSPACT = 0: the next floating-point instruction would save registers to the old stack.
        "movw r3, #0xEF34",
        "movt r3, #0xE000",
        "ldr r12, [r3]",
        "bic r12, r12, #1",
        "str r12, [r3]",
        "movw r3, #:lower16:_stack_start",
        "movt r3, #:upper16:_stack_start",
        "msr msp, r3",
        "b {on_hard_fault}",
        on_hard_fault = sym on_hard_fault,
    )
}

/// `sp` is where the frame of the fault was pushed; below the stack's memory that failed, and pc and lr are 0.
extern "C" fn on_hard_fault(pc: u32, lr: u32, sp: u32) -> ! {
    outputs_off();
    // SAFETY: reads of fault registers.
    let (cfsr, hfsr) = unsafe { ((*SCB::PTR).cfsr.read(), (*SCB::PTR).hfsr.read()) };
    let what = if sp < (&raw const _stack_end) as u32 { "stack overflow, " } else { "" };
    let text = format_args!("{what}cfsr {cfsr:#010x}, hfsr {hfsr:#010x}, sp {sp:#010x}");
    die(Record::new(HARD_FAULT, (pc, lr), text))
}

/// An interrupt that nobody handles.
#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    outputs_off();
    die(Record::new(HARD_FAULT, (0, 0), format_args!("unexpected interrupt {number}")))
}

/// Ends a start in which the code can no longer be read from the flash, or whose NMI has another cause.
pub(super) fn end_nmi(error: Option<DoubleError>) -> ! {
    outputs_off();
    let (what, offset) = match error {
        Some(DoubleError::Code { bank: 1, offset }) => ("double ECC error in bank 1", offset),
        Some(DoubleError::Code { offset, .. } | DoubleError::Data { offset }) => ("double ECC error in bank 2", offset),
        Some(DoubleError::System { offset }) => ("double ECC error in system flash", offset),
        None => ("non-maskable interrupt of no known cause", 0),
    };
    die(Record::new(HARD_FAULT, (0, 0), format_args!("{what}, offset {offset:#x}")))
}
