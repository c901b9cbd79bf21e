//! What every board with a Cortex-M core does alike: it paints its stack, sleeps, and knows how much it uses of both.
//!
//! All code uses the main stack, in the memory that the board's `board.x` gives it.

use darm_core::wire::health::Health;

use crate::hardware::Hardware;
use crate::load::Load;
use crate::stack::StackMemory;

/// How busy the core is.
static LOAD: Load = Load::new();

/// The memory of the stack.
#[inline(always)]
fn stack() -> StackMemory {
    unsafe extern "C" {
        static mut _stack_end: u32;
        static mut _stack_start: u32;
    }
    // SAFETY: the linker gives this memory to the stack.
    unsafe { StackMemory::new(&raw mut _stack_end, &raw mut _stack_start) }
}

/// Paints what is free of the stack. Call first of all in `main`.
#[inline(always)]
pub fn paint_stack() -> StackMemory {
    let stack = stack();
    // SAFETY: what interrupts this has left the stack when this continues.
    unsafe { stack.paint(cortex_m::register::msp::read() as *mut u32) };
    stack
}

/// Sleeps until interrupts have something to do, and lets them; counts the time. For ever in `main`.
pub fn sleep<H: Hardware>() {
    cortex_m::interrupt::disable();
    LOAD.sleep(&H::CLOCK, cortex_m::asm::wfi);
    // SAFETY: this is no critical section.
    unsafe { cortex_m::interrupt::enable() };
    // What waits runs now.
    cortex_m::asm::isb();
}

/// Load and stack; a board adds what else it knows of itself.
pub fn health() -> Health {
    Health { load_permille: LOAD.permille(), stack: Some(stack().usage()), ..Health::default() }
}
