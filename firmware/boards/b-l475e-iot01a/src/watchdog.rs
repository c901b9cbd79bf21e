//! Independent watchdog: resets the chip when the control tick stops. QEMU does not model it and ignores the writes.
use stm32_metapac::iwdg::vals::{Key, Pr};
use stm32_metapac::{IWDG, RCC};

/// 32 kHz / 4 = 8 kHz; 400 counts = 50 ms, 47 to 59 ms over the spread of the oscillator.
const RELOAD: u16 = 400;

/// Starts the watchdog; from here on it cannot be stopped.
pub fn start() {
    IWDG.kr().write(|w| w.set_key(Key::START));
    IWDG.kr().write(|w| w.set_key(Key::ENABLE));
    IWDG.pr().write(|w| w.set_pr(Pr::DIVIDE_BY4));
    IWDG.rlr().write(|w| w.set_rl(RELOAD));
    feed();
}

/// Gives another 50 ms. From the control tick only.
pub fn feed() {
    IWDG.kr().write(|w| w.set_key(Key::RESET));
}

/// Whether the watchdog caused the last reset; forgets it.
pub fn take_bite() -> bool {
    let bitten = RCC.csr().read().iwdgrstf();
    RCC.csr().modify(|w| w.set_rmvf(true));
    bitten
}
