//! Starting again: into the firmware, or into the loader in the chip's system memory.
use core::mem::MaybeUninit;
use core::ptr::addr_of_mut;

use cortex_m::peripheral::SCB;
use darm_core::wire::bootstrap::RebootTarget;

use crate::loader;

const MAGIC: u32 = 0x6c6f_6164;

/// Outlives the reset; start-up code leaves this section alone.
#[unsafe(link_section = ".uninit.LOADER")]
static mut WISH: MaybeUninit<u32> = MaybeUninit::uninit();

/// Resets the chip on request; output pins go back to their pull-ups, which hold the outputs off.
pub fn restart(into: RebootTarget) -> ! {
    let wish = match into {
        RebootTarget::Application => 0,
        RebootTarget::Loader => MAGIC,
    };
    // SAFETY: one word that only this file touches.
    unsafe { addr_of_mut!(WISH).cast::<u32>().write_volatile(wish) };
    SCB::sys_reset()
}

/// Continues into the loader when the last [`restart`] requested it. Call first of all, while the chip is as after
/// reset.
///
/// QEMU has no loader: there the firmware starts.
pub fn enter_loader_if_asked() {
    let slot = addr_of_mut!(WISH).cast::<u32>();
    // SAFETY: one word that only this file touches; any value of it is valid.
    let asked = unsafe { slot.read_volatile() } == MAGIC;
    // SAFETY: as above.
    unsafe { slot.write_volatile(0) };
    if asked && !crate::emulated::emulated() {
        loader::map();
        // SAFETY: nothing has started yet, and the loader's vector table lies at this address on every chip of the line.
        unsafe { cortex_m::asm::bootload(loader::SYSTEM_MEMORY as *const u32) }
    }
}
