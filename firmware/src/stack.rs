//! How much of the stack was ever in use: its memory is painted at the start, and what is not paint was in use.

use darm_core::wire::health::StackUse;

/// The byte that no firmware writes all over its stack. The emulator of the Pico paints with it too.
const PAINT: u32 = u32::from_le_bytes([0x5c; 4]);
/// Words below the stack pointer that are left alone: what painting itself pushes.
const MARGIN: usize = 64;

/// The memory of a stack that grows down.
pub struct StackMemory {
    bottom: *mut u32,
    top: *mut u32,
}

impl StackMemory {
    /// The memory between two addresses of words.
    ///
    /// # Safety
    ///
    /// All of it can be read, and it is the stack's alone.
    pub const unsafe fn new(bottom: *mut u32, top: *mut u32) -> Self {
        Self { bottom, top }
    }

    /// Paints what is free. Call first of all.
    ///
    /// # Safety
    ///
    /// `pointer` is the stack pointer, and no other code uses the stack meanwhile.
    #[inline(always)]
    pub unsafe fn paint(&self, pointer: *mut u32) {
        let end = pointer.wrapping_sub(MARGIN);
        let mut word = self.bottom;
        while word < end {
            // SAFETY: from the bottom of the stack's memory to below the stack pointer nothing is in use.
            unsafe { word.write_volatile(PAINT) };
            word = word.wrapping_add(1);
        }
    }

    /// How much was ever in use since it was painted.
    pub fn usage(&self) -> StackUse {
        let mut word = self.bottom;
        // SAFETY: this reads inside the stack's memory.
        while word < self.top && unsafe { word.read_volatile() } == PAINT {
            word = word.wrapping_add(1);
        }
        let bytes = |from: *mut u32| (self.top as usize).saturating_sub(from as usize) as u32;
        StackUse { used: bytes(word), size: bytes(self.bottom) }
    }
}

#[cfg(test)]
mod tests {
    use super::StackMemory;
    use darm_core::wire::health::StackUse;

    #[test]
    fn what_is_not_paint_was_in_use() {
        let mut memory = [7u32; 256];
        let bottom = memory.as_mut_ptr();
        let at = |words: usize| bottom.wrapping_add(words);
        // SAFETY: the memory is that of the array, and nothing else uses it.
        let stack = unsafe { StackMemory::new(bottom, at(256)) };
        assert_eq!(stack.usage(), StackUse { used: 1024, size: 1024 });
        // SAFETY: as above.
        unsafe { stack.paint(at(200)) };
        assert_eq!(stack.usage(), StackUse { used: 4 * (256 - 136), size: 1024 });
        // SAFETY: inside the array.
        unsafe { at(50).write_volatile(0) };
        assert_eq!(stack.usage().used, 4 * (256 - 50));
    }
}
