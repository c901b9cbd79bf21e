//! The critical section: masks all interrupts. In the bench image it also keeps its longest duration.
use cortex_m::{interrupt, register::primask};
use critical_section::{Impl, RawRestoreState, set_impl};

struct Mask;
set_impl!(Mask);

// SAFETY: one core; with PRIMASK set no other code runs, and it is restored to what it was.
unsafe impl Impl for Mask {
    unsafe fn acquire() -> RawRestoreState {
        let was_active = primask::read().is_active();
        interrupt::disable();
        #[cfg(feature = "bench")]
        if was_active {
            count::begin();
        }
        was_active
    }

    unsafe fn release(was_active: RawRestoreState) {
        if was_active {
            #[cfg(feature = "bench")]
            count::end();
            // SAFETY: the outermost section ends here, as the caller promises.
            unsafe { interrupt::enable() }
        }
    }
}

#[cfg(feature = "bench")]
mod count {
    use core::sync::atomic::{AtomicU32, Ordering};
    use cortex_m::peripheral::SYST;

    static BEGAN: AtomicU32 = AtomicU32::new(0);
    static LONGEST: AtomicU32 = AtomicU32::new(0);

    pub(super) fn begin() {
        BEGAN.store(SYST::get_current(), Ordering::Relaxed);
    }

    pub(super) fn end() {
        let cycles = crate::board::time::cycles_between(BEGAN.load(Ordering::Relaxed), SYST::get_current());
        if cycles > LONGEST.load(Ordering::Relaxed) {
            LONGEST.store(cycles, Ordering::Relaxed);
        }
    }

    /// Core cycles of the longest stretch so far; starts anew.
    pub fn longest_masked_cycles() -> u32 {
        LONGEST.swap(0, Ordering::Relaxed)
    }
}
#[cfg(feature = "bench")]
pub use count::longest_masked_cycles;
