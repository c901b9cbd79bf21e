//! B-L475E-IOT01A: the one place that knows the chip. The same image is used on silicon and in QEMU's machine of that
//! name.
//!
//! | file       | holds                                                             |
//! |------------|-------------------------------------------------------------------|
//! | `pins`     | the pin table                                                     |
//! | `clocks`   | 80 MHz from the internal oscillator, peripheral clocks            |
//! | `gpio`     | outputs of the solenoid chain, limit switches                     |
//! | `uart`     | two USARTs with queues filled and emptied by interrupts           |
//! | `time`     | SysTick as the clock of all tasks                                 |
//! | `systick`  | the handler of SysTick: counts time, requests the control tick    |
//! | `flash`    | bank 2 as NOR flash; a file of the host in QEMU                   |
//! | `watchdog` | resets the chip when the control tick, or a task it looks after, stops |
//! | `crash`    | panic and fault: outputs off, a record for the next boot, reset   |
//! | `restart`  | reset into the firmware or into the chip's loader                 |
//! | `tasks`    | the control tick, the two tasks, and what they own                |
//! | `mask`     | the critical section                                              |
//! | `measure`  | longest tick and longest masked stretch, in the bench image only  |
//!
//! Priorities, most urgent first: SysTick, control tick, USARTs, the executor of all else.
pub mod clocks;
pub mod crash;
pub mod flash;
pub mod gpio;
mod mask;
#[cfg(feature = "bench")]
pub mod measure;
pub mod pins;
pub mod restart;
mod systick;
pub mod tasks;
pub mod time;
pub mod uart;
pub mod watchdog;

use darm_core::units::DeviceId;
use stm32_metapac::{FLASH, Interrupt, UID};

/// Interrupt that the control tick borrows; its peripheral (touch sensing) is not used.
pub const CONTROL: Interrupt = Interrupt::TSC;
/// Interrupt that the executor of everything else borrows; its peripheral (single wire protocol) is not used.
pub const COMMON: Interrupt = Interrupt::SWPMI1;

/// True in QEMU, which models no flash controller: the option register reads 0 there and never on silicon.
pub fn emulated() -> bool {
    FLASH.optr().read().0 == 0
}

/// Name of the board as it identifies itself.
pub const NAME: &str = "B-L475E-IOT01A";

/// The chip's unique number; QEMU has none, and there it spells what it is.
pub fn device() -> DeviceId {
    if emulated() {
        return DeviceId(*b"qemu-stm32l4");
    }
    let mut id = DeviceId::default();
    for (bytes, word) in id.0.chunks_exact_mut(4).zip(0..) {
        bytes.copy_from_slice(&UID.uid(word).read().to_le_bytes());
    }
    id
}

/// Sets the priorities of all interrupts in use. Call once, before any of them is unmasked.
pub fn prioritise() {
    use cortex_m::peripheral::scb::SystemHandler;
    // SAFETY: called once at start, with interrupts of these numbers still masked; nothing else owns the NVIC or SCB.
    unsafe {
        let mut core = cortex_m::Peripherals::steal();
        core.SCB.set_priority(SystemHandler::SysTick, 0x20);
        core.NVIC.set_priority(CONTROL, 0x40);
        core.NVIC.set_priority(Interrupt::USART1, 0x80);
        core.NVIC.set_priority(Interrupt::USART2, 0x80);
        core.NVIC.set_priority(COMMON, 0xE0);
    }
}
