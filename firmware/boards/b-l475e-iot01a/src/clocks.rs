//! Clocks: 80 MHz through the PLL, from the MSI locked to the board's 32 kHz crystal, else from the HSI16; power to the
//! peripherals in use.
//!
//! | source | error | when |
//! |---|---|---|
//! | MSI in PLL mode | that of the crystal, some 20 ppm | the crystal runs |
//! | HSI16 | 1 % from 0 to 85 °C (DS10969, "HSI16 oscillator characteristics") | it is missing or does not start |
//! | MSI alone | 4 % over temperature (DS10969, "MSI oscillator characteristics") | it stopped after the start |
//!
//! The crystal continues through a reset, as the backup domain does; after power-on it takes two seconds, for which the start
//! waits with the outputs disabled. Its clock security system notices when it stops, and ends the PLL mode (RM0351, 6.2.11).
use stm32_metapac::rcc::vals::{Lsedrv, Pllm, Plln, Pllr, Pllsrc, Rtcsel, Sw};
use stm32_metapac::{FLASH, PWR, RCC};

use crate::bus;

/// Core, bus and SysTick clock.
pub const HCLK_HZ: u32 = 80_000_000;
/// Core clock after reset: the MSI.
const RESET_HZ: u32 = 4_000_000;
/// Longest start of the crystal: 2 s typically (DS10969, "LSE oscillator characteristics").
const CRYSTAL_MS: u32 = 2_500;
/// Time in which the MSI locks to 1 % (DS10969, "MSI oscillator characteristics", PLL mode), ms.
const LOCK_MS: u32 = 3;

/// What did not come up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ClockError {
    /// The 16 MHz oscillator.
    Oscillator,
    /// The PLL did not stop or did not lock.
    Pll,
    /// The core stayed on its old clock.
    Switch,
}

/// What the core's clock comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The MSI, locked to the crystal.
    Crystal,
    /// The HSI16: the crystal has not started.
    Hsi16,
    /// The MSI alone: the crystal has stopped since.
    Msi,
}

/// Brings the core to [`HCLK_HZ`] and clocks the ports, the USARTs, their DMA controller and SYSCFG. RM0351, chapters 3.3.3
/// and 6. To be called once, while the core runs as after reset.
///
/// # Errors
///
/// The oscillator, the PLL or the switch to it did not come up in time: see [`ClockError`].
pub fn start() -> Result<(), ClockError> {
    bus::modify(FLASH.acr(), |w| {
        w.set_prften(true);
        w.set_latency(4);
    });
    // The latency is in force once it reads back; QEMU keeps 0, so the wait has an end.
    holds(100, 1, || bus::read(FLASH.acr()).latency() == 4);
    if start_crystal() {
        bus::modify(RCC.cr(), |w| w.set_msipllen(true));
        bus::delay(LOCK_MS * (RESET_HZ / 1000));
        start_pll(Pllsrc::MSI, Pllm::DIV1, Plln::MUL40)?;
    } else {
        bus::modify(RCC.cr(), |w| w.set_hsion(true));
        require(ClockError::Oscillator, || bus::read(RCC.cr()).hsirdy())?;
        start_pll(Pllsrc::HSI, Pllm::DIV2, Plln::MUL20)?;
    }
    start_peripherals();
    Ok(())
}

/// What the core's clock comes from now.
pub fn source() -> Source {
    if bus::read(RCC.pllcfgr()).pllsrc() != Pllsrc::MSI {
        Source::Hsi16
    } else if bus::read(RCC.cr()).msipllen() {
        Source::Crystal
    } else {
        Source::Msi
    }
}

/// Starts the 32 kHz crystal, unless it runs since before the reset; whether it runs. RM0351, 6.2.6 and 6.4.29.
///
/// QEMU has no power controller: the backup domain stays closed there, and the crystal counts as missing.
fn start_crystal() -> bool {
    bus::modify(RCC.apb1enr1(), |w| w.set_pwren(true));
    bus::modify(PWR.cr1(), |w| w.set_dbp(true));
    if !holds(100, 1, || bus::read(PWR.cr1()).dbp()) {
        return false;
    }
    if bus::read(RCC.bdcr()).lsecssd() {
        // A crystal that has failed starts again only after a reset of its domain (RM0351, 6.2.11), of which nothing is used.
        bus::modify(RCC.bdcr(), |w| w.set_bdrst(true));
        bus::modify(RCC.bdcr(), |w| w.set_bdrst(false));
    }
    if !bus::read(RCC.bdcr()).lseon() {
        bus::modify(RCC.bdcr(), |w| {
            w.set_lsedrv(Lsedrv::MEDIUM_HIGH);
            w.set_lseon(true);
        });
    }
    if !holds(CRYSTAL_MS, RESET_HZ / 1000, || bus::read(RCC.bdcr()).lserdy()) {
        return false;
    }
    guard_crystal();
    true
}

/// Has the chip notice when the crystal stops. Needs a clock of the RTC, which is chosen once and outlives resets.
fn guard_crystal() {
    if bus::read(RCC.bdcr()).rtcsel() == Rtcsel::DISABLE {
        bus::modify(RCC.bdcr(), |w| w.set_rtcsel(Rtcsel::LSE));
    }
    if bus::read(RCC.bdcr()).rtcsel() == Rtcsel::LSE {
        bus::modify(RCC.bdcr(), |w| w.set_lsecsson(true));
    }
}

/// Sets the PLL up while it is off, and switches to half its output. RM0351, 6.2.5 and 6.2.8.
fn start_pll(source: Pllsrc, divider: Pllm, multiplier: Plln) -> Result<(), ClockError> {
    bus::modify(RCC.cr(), |w| w.set_pllon(false));
    require(ClockError::Pll, || !bus::read(RCC.cr()).pllrdy())?;
    bus::write(RCC.pllcfgr(), |w| {
        w.set_pllsrc(source);
        w.set_pllm(divider);
        w.set_plln(multiplier);
        w.set_pllr(Pllr::DIV2);
        w.set_pllren(true);
    });
    bus::modify(RCC.cr(), |w| w.set_pllon(true));
    require(ClockError::Pll, || bus::read(RCC.cr()).pllrdy())?;
    bus::modify(RCC.cfgr(), |w| w.set_sw(Sw::PLL1_R));
    require(ClockError::Switch, || bus::read(RCC.cfgr()).sws() == Sw::PLL1_R)
}

fn start_peripherals() {
    bus::modify(RCC.ahb1enr(), |w| w.set_dma1en(true));
    bus::modify(RCC.ahb2enr(), |w| {
        w.set_gpioaen(true);
        w.set_gpioben(true);
        w.set_gpiocen(true);
        w.set_gpioden(true);
    });
    bus::modify(RCC.apb2enr(), |w| {
        w.set_usart1en(true);
        w.set_syscfgen(true);
    });
    bus::modify(RCC.apb1enr1(), |w| w.set_usart2en(true));
    // A clock runs two cycles after its bit is set (RM0351, 6.2.17): the read takes longer.
    bus::read(RCC.apb1enr1());
}

fn require(error: ClockError, condition: impl FnMut() -> bool) -> Result<(), ClockError> {
    if holds(100_000, 1, condition) { Ok(()) } else { Err(error) }
}

/// Whether a condition comes true, looked at this often with at least this number of cycles between two looks.
fn holds(tries: u32, cycles: u32, mut condition: impl FnMut() -> bool) -> bool {
    (0..tries).any(|_| {
        let holds = condition();
        if !holds {
            bus::delay(cycles);
        }
        holds
    })
}

#[cfg(test)]
mod tests;
