//! Handlers of what ends a start: panic, hard fault, unknown interrupt.
//!
//! After a stack overflow there is no room for a handler: the processor locks up, and the watchdog resets it.
use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};
use darm_core::wire::bootstrap::CrashKind;
use darm_firmware::crash::{Registers, end, panicked};

use crate::board::Board;

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    panicked::<Board>(info)
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    end::<Board>(
        CrashKind::HardFault,
        Registers { pc: frame.pc(), lr: frame.lr() },
        format_args!("psr {:#010x}", frame.xpsr()),
    )
}

/// An interrupt that nobody handles.
#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    end::<Board>(CrashKind::HardFault, Registers::UNKNOWN, format_args!("unexpected interrupt {number}"))
}
