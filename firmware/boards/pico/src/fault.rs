//! Handlers of what ends a start: panic, hard fault, unknown interrupt.
//!
//! The hard fault handler disables the outputs first of all, without a stack. Then it leaves the stack of what failed, which may
//! be exhausted, and starts at the top of the stack's memory: it never returns, so nothing there is needed any more. What it
//! takes from the old stack, it reads before, where the stack pointer is within that memory.
use core::arch::naked_asm;
use core::panic::PanicInfo;

use cortex_m_rt::exception;
use darm_core::wire::bootstrap::CrashKind;
use darm_firmware::crash::{Registers, end, panicked};

use crate::board::Board;
use crate::chain::ENABLE;

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    panicked::<Board>(info)
}

unsafe extern "C" {
    /// Lowest address of the stack's memory, from `board.x`.
    static _stack_end: u32;
}

/// The register that sets output pins (RP2040 data sheet, 2.3.1.7, `GPIO_OUT_SET`).
const SET_PINS: u32 = 0xd000_0014;

/// Raises output enable. Takes pc and lr from the frame that the processor has pushed, if the stack had room for it, and continues at the
/// top of the stack's memory. All code uses the main stack.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn HardFault() -> ! {
    naked_asm!(
        "movs r0, #1",
        "lsls r0, r0, #{enable}",
        "ldr r3, 5f",
        "str r0, [r3]",
        "mrs r2, msp",
        "movs r0, #0",
        "movs r1, #0",
        "ldr r3, 2f",
        "cmp r2, r3",
        "blo 1f",
        "ldr r3, 6f",
        "cmp r2, r3",
        "bhi 1f",
        "ldr r0, [r2, #24]",
        "ldr r1, [r2, #20]",
        "1:",
        "ldr r3, 3f",
        "msr msp, r3",
        "ldr r3, 4f",
        "bx r3",
        ".align 2",
        "2: .word _stack_end",
        "3: .word _stack_start",
        "4: .word {on_hard_fault}",
        "5: .word {set_pins}",
        "6: .word _stack_start - 32",
        enable = const ENABLE,
        set_pins = const SET_PINS,
        on_hard_fault = sym on_hard_fault,
    )
}

/// `sp` is where the frame of the fault was pushed; below the stack's memory that failed. Outside of it pc and lr are 0.
extern "C" fn on_hard_fault(pc: u32, lr: u32, sp: u32) -> ! {
    let what = if sp < (&raw const _stack_end) as u32 { "stack overflow, " } else { "" };
    end::<Board>(CrashKind::HardFault, Registers { pc, lr }, format_args!("{what}sp {sp:#010x}"))
}

/// An interrupt that nobody handles.
#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    end::<Board>(CrashKind::HardFault, Registers::UNKNOWN, format_args!("unexpected interrupt {number}"))
}
