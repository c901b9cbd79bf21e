//! The watchdog: resets the chip when the control tick stops, and on request.
use darm_core::units::Micros;
use embassy_rp::pac;

/// Longest time between two control ticks.
pub(crate) const PERIOD: Micros = Micros::from_millis(50);

/// In scratch register 4 while the firmware has the watchdog. The boot ROM resets by the watchdog as well, after it has written
/// an image over USB; it leaves 0 or its own number there (RP2040 data sheet, 2.8.1.1 and 4.7).
const OURS: u32 = 0x6461_726d;

/// Gives the control tick this time until the watchdog resets the chip. Erratum RP2040-E1: it counts two per µs.
pub(crate) fn feed(time: Micros) {
    pac::WATCHDOG.load().write_value(pac::watchdog::regs::Load(time.0 as u32 * 2));
}

/// Starts the watchdog. It and the timer run on while a debugger has the processor (RP2040 data sheet, 4.6.5 and 4.7.6).
pub(crate) fn start() {
    pac::PSM.wdsel().write_value(pac::psm::regs::Wdsel(0x1_fffc));
    feed(PERIOD);
    pac::WATCHDOG.scratch4().write_value(OURS);
    // A debugger that halts the processor, or has halted it and was lost, would stop both with the outputs as they are.
    pac::TIMER.dbgpause().write_value(pac::timer::regs::Dbgpause(0));
    pac::WATCHDOG.ctrl().modify(|w| {
        w.set_pause_jtag(false);
        w.set_pause_dbg0(false);
        w.set_pause_dbg1(false);
        w.set_enable(true);
    });
}

/// Whether the watchdog caused the last reset because this firmware did not feed it. Call once, at start.
pub(crate) fn take_bite() -> bool {
    let was_ours = pac::WATCHDOG.scratch4().read() == OURS;
    pac::WATCHDOG.scratch4().write_value(0);
    was_ours && pac::WATCHDOG.reason().read().timer()
}

/// Resets all but the oscillators.
pub(crate) fn reset() -> ! {
    pac::PSM.wdsel().write_value(pac::psm::regs::Wdsel(0x1_fffc));
    pac::WATCHDOG.ctrl().write(|w| w.set_trigger(true));
    loop {
        cortex_m::asm::nop();
    }
}
