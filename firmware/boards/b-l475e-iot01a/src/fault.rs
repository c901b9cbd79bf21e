//! Handlers of what ends a start: panic, hard fault, unknown interrupt, error check of the flash.
//!
//! The hard fault handler disables the outputs first of all, without a stack. Then it leaves the stack of what failed, which may be
//! exhausted, and starts at the top of the stack's
//! memory: it never returns, so nothing there is needed any more. What it takes from the old stack, it reads before.
use core::arch::naked_asm;
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use darm_core::wire::bootstrap::CrashKind;
use darm_firmware::crash::{Registers, end, panicked};

use crate::bank2;
use crate::board::Board;
use crate::ecc::DoubleError;

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    panicked::<Board>(info)
}

unsafe extern "C" {
    /// Lowest address of the stack's memory, from `board.x`.
    static _stack_end: u32;
}

/// Raises output enable. Takes pc and lr from the frame that the processor has pushed, if the stack had room for it, and continues at the
/// top of the stack's memory. All code uses the main stack.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn HardFault() -> ! {
    naked_asm!(
        // GPIOA_BSRR, bit of PA15: output enable.
        "movw r3, #0x0018",
        "movt r3, #0x4800",
        "movw r0, #0x8000",
        "str r0, [r3]",
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
    // SAFETY: reads of fault registers.
    let (cfsr, hfsr) = unsafe { ((*SCB::PTR).cfsr.read(), (*SCB::PTR).hfsr.read()) };
    let what = if sp < (&raw const _stack_end) as u32 { "stack overflow, " } else { "" };
    let text = format_args!("{what}cfsr {cfsr:#010x}, hfsr {hfsr:#010x}, sp {sp:#010x}");
    end::<Board>(CrashKind::HardFault, Registers { pc, lr }, text)
}

/// An interrupt that nobody handles.
#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    end::<Board>(CrashKind::HardFault, Registers::UNKNOWN, format_args!("unexpected interrupt {number}"))
}

/// The error check of a flash word failed. Fatal unless the word is in the data, which has checksums.
#[exception]
unsafe fn NonMaskableInt() {
    if let Err(fatal) = bank2::on_nmi() {
        end_nmi(fatal);
    }
}

/// Ends a start in which the code can no longer be read from the flash, or whose NMI has another cause.
fn end_nmi(error: Option<DoubleError>) -> ! {
    let (what, offset) = match error {
        Some(DoubleError::Code { bank: 1, offset }) => ("double ECC error in bank 1", offset),
        Some(DoubleError::Code { offset, .. } | DoubleError::Data { offset }) => ("double ECC error in bank 2", offset),
        Some(DoubleError::System { offset }) => ("double ECC error in system flash", offset),
        Some(DoubleError::Hidden) | None => ("non-maskable interrupt of no known cause", 0),
    };
    end::<Board>(CrashKind::HardFault, Registers::UNKNOWN, format_args!("{what}, offset {offset:#x}"))
}
