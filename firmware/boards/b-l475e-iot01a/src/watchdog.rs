//! Independent watchdog: resets the chip when the control tick stops. QEMU does not model it and ignores the writes.
//! RM0351, chapter 36.
use stm32_metapac::iwdg::vals::{Key, Pr};
use stm32_metapac::{IWDG, RCC};

use crate::bus;

/// 32 kHz / 4 = 8 kHz; 400 counts = 50 ms, 47 to 55 ms over the spread of the oscillator (29.5 to 34 kHz, DS10969).
const RELOAD: u16 = 400;
/// Looks at the status until an update must have ended: five cycles of the slowest oscillator are 170 µs.
const UPDATE_TRIES: u32 = 100_000;

/// Starts the watchdog; from here on it cannot be stopped. The order is that of RM0351, 36.3.2.
pub fn start() {
    bus::write(IWDG.kr(), |w| w.set_key(Key::START));
    bus::write(IWDG.kr(), |w| w.set_key(Key::ENABLE));
    bus::write(IWDG.pr(), |w| w.set_pr(Pr::DIVIDE_BY4));
    bus::write(IWDG.rlr(), |w| w.set_rl(RELOAD));
    // A feed before the updates have ended would load the value of the reset, ten times as long.
    let _updated = (0..UPDATE_TRIES).any(|_| bus::read(IWDG.sr()).0 == 0);
    feed();
}

/// Gives another 50 ms. From the control tick only.
#[inline(always)]
pub fn feed() {
    bus::write(IWDG.kr(), |w| w.set_key(Key::RESET));
}

/// What caused a reset: flags, as more than one may be set. RM0351, 6.4.30.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cause {
    /// The supply fell below the level of the option bytes, or came up.
    pub supply: bool,
    /// The independent watchdog.
    pub watchdog: bool,
    /// The firmware.
    pub firmware: bool,
}

/// What caused the last reset; forgets it.
pub fn take_cause() -> Cause {
    let flags = bus::read(RCC.csr());
    bus::modify(RCC.csr(), |w| w.set_rmvf(true));
    Cause { supply: flags.borrstf(), watchdog: flags.iwdgrstf(), firmware: flags.sftrstf() }
}

#[cfg(test)]
mod tests;
