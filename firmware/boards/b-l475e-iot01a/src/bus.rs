//! How the drivers reach registers and memory: on the chip a volatile access, in tests on a PC the models in `tests/model`.
//!
//! On the chip every function is one instruction or two, as without this module.
#[cfg(target_os = "none")]
use chip as access;
use stm32_metapac::common::{Access, Read, Reg, Write};

#[cfg(not(target_os = "none"))]
use crate::tests::model as access;

/// Reads a register.
#[inline(always)]
pub fn read<T: Copy, A: Read>(register: Reg<T, A>) -> T {
    access::load(address(&register))
}

/// Writes a register, from its value with all bits 0.
#[inline(always)]
pub fn write<T: Copy + Default, A: Write>(register: Reg<T, A>, set: impl FnOnce(&mut T)) {
    let mut value = T::default();
    set(&mut value);
    write_value(register, value);
}

/// Writes a register.
#[inline(always)]
pub fn write_value<T: Copy, A: Write>(register: Reg<T, A>, value: T) {
    access::store(address(&register), value);
}

/// Reads a register and writes it changed.
#[inline(always)]
pub fn modify<T: Copy, A: Read + Write>(register: Reg<T, A>, change: impl FnOnce(&mut T)) {
    let mut value = read(register);
    change(&mut value);
    write_value(register, value);
}

/// Reads a byte of the flash.
#[inline(always)]
pub(crate) fn load_byte(address: usize) -> u8 {
    access::load_byte(address)
}

/// Notes whether the data in the flash are being read, for the NMI of a failed check.
#[inline(always)]
pub(crate) fn note_reading(is_reading: bool) {
    access::note_reading(is_reading);
}

/// Whether they are.
#[inline(always)]
pub(crate) fn is_reading() -> bool {
    access::is_reading()
}

/// Writes a word of the flash. Its controller says whether that has an effect.
#[inline(always)]
pub(crate) fn store_word(address: usize, word: u32) {
    access::store(address, word);
}

/// The address of memory as the DMA controller sees it.
#[inline(always)]
pub(crate) fn dma_address(memory: &'static [core::sync::atomic::AtomicU8]) -> u32 {
    access::dma_address(memory)
}

/// Waits at least this many cycles of the core.
#[inline(always)]
pub(crate) fn delay(cycles: u32) {
    access::delay(cycles);
}

/// Lasts two cycles at least.
#[inline(always)]
pub(crate) fn pause() {
    access::pause();
}

#[inline(always)]
fn address<T: Copy, A: Access>(register: &Reg<T, A>) -> usize {
    register.as_ptr() as usize
}

#[cfg(target_os = "none")]
mod chip {
    use core::sync::atomic::{AtomicBool, AtomicU8, Ordering};

    static IS_READING: AtomicBool = AtomicBool::new(false);

    #[inline(always)]
    pub(super) fn note_reading(is_reading: bool) {
        IS_READING.store(is_reading, Ordering::SeqCst);
    }

    #[inline(always)]
    pub(super) fn is_reading() -> bool {
        IS_READING.load(Ordering::SeqCst)
    }

    #[inline(always)]
    pub(super) fn load<T: Copy>(address: usize) -> T {
        // SAFETY: the address is that of a register of the chip, or of its flash, and aligned for its type.
        unsafe { (address as *const T).read_volatile() }
    }

    #[inline(always)]
    pub(super) fn store<T: Copy>(address: usize, value: T) {
        // SAFETY: as above.
        unsafe { (address as *mut T).write_volatile(value) }
    }

    #[inline(always)]
    pub(super) fn load_byte(address: usize) -> u8 {
        load(address)
    }

    #[inline(always)]
    pub(super) fn dma_address(memory: &'static [AtomicU8]) -> u32 {
        memory.as_ptr() as u32
    }

    #[inline(always)]
    pub(super) fn delay(cycles: u32) {
        cortex_m::asm::delay(cycles);
    }

    #[inline(always)]
    pub(super) fn pause() {
        cortex_m::asm::nop();
        cortex_m::asm::nop();
    }
}
