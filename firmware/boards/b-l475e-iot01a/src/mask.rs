//! The critical section: masks all interrupts.
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
            crate::measure::begin_masked();
        }
        was_active
    }

    unsafe fn release(was_active: RawRestoreState) {
        if was_active {
            #[cfg(feature = "bench")]
            crate::measure::end_masked();
            // SAFETY: the outermost section ends here, as the caller promises.
            unsafe { interrupt::enable() }
        }
    }
}
