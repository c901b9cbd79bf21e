//! The watchdog: resets the chip when the control tick stops, and on request.
use darm_core::units::Micros;
use embassy_rp::pac;

/// Longest time between two control ticks.
pub(crate) const PERIOD: Micros = Micros::from_millis(50);

/// Gives the control tick this time until the watchdog resets the chip. Erratum RP2040-E1: it counts two per µs.
pub(crate) fn feed(time: Micros) {
    pac::WATCHDOG.load().write_value(pac::watchdog::regs::Load(time.0 as u32 * 2));
}

/// Starts the watchdog.
pub(crate) fn start() {
    pac::PSM.wdsel().write_value(pac::psm::regs::Wdsel(0x1_fffc));
    feed(PERIOD);
    pac::WATCHDOG.ctrl().modify(|w| w.set_enable(true));
}

/// Whether the watchdog caused the last reset because nobody fed it.
pub(crate) fn take_bite() -> bool {
    pac::WATCHDOG.reason().read().timer()
}

/// Resets all but the oscillators.
pub(crate) fn reset() -> ! {
    pac::PSM.wdsel().write_value(pac::psm::regs::Wdsel(0x1_fffc));
    pac::WATCHDOG.ctrl().write(|w| w.set_trigger(true));
    loop {
        cortex_m::asm::nop();
    }
}
