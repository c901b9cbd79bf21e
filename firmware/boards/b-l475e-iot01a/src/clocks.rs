//! Clocks: 80 MHz from the 16 MHz internal oscillator through the PLL; power to the peripherals in use.
use stm32_metapac::rcc::vals::{Pllm, Plln, Pllr, Pllsrc, Sw};
use stm32_metapac::{FLASH, RCC};

/// Core, bus and SysTick clock.
pub const HCLK_HZ: u32 = 80_000_000;

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

/// Brings the core to [`HCLK_HZ`] and clocks the ports, the USARTs and SYSCFG. RM0351, chapters 3.3.3 and 6.
///
/// # Errors
///
/// The oscillator, the PLL or the switch to it did not come up in time: see [`ClockError`].
pub fn start() -> Result<(), ClockError> {
    FLASH.acr().modify(|w| {
        w.set_prften(true);
        w.set_latency(4);
    });
    // The latency is in force once it reads back; QEMU keeps 0, so the wait has an end.
    holds(100, || FLASH.acr().read().latency() == 4);
    RCC.cr().modify(|w| w.set_hsion(true));
    require(ClockError::Oscillator, || RCC.cr().read().hsirdy())?;
    RCC.cr().modify(|w| w.set_pllon(false));
    require(ClockError::Pll, || !RCC.cr().read().pllrdy())?;
    RCC.pllcfgr().write(|w| {
        w.set_pllsrc(Pllsrc::HSI);
        w.set_pllm(Pllm::DIV2);
        w.set_plln(Plln::MUL20);
        w.set_pllr(Pllr::DIV2);
        w.set_pllren(true);
    });
    RCC.cr().modify(|w| w.set_pllon(true));
    require(ClockError::Pll, || RCC.cr().read().pllrdy())?;
    RCC.cfgr().modify(|w| w.set_sw(Sw::PLL1_R));
    require(ClockError::Switch, || RCC.cfgr().read().sws() == Sw::PLL1_R)?;
    RCC.ahb2enr().modify(|w| {
        w.set_gpioaen(true);
        w.set_gpioben(true);
        w.set_gpiocen(true);
        w.set_gpioden(true);
    });
    RCC.apb2enr().modify(|w| {
        w.set_usart1en(true);
        w.set_syscfgen(true);
    });
    RCC.apb1enr1().modify(|w| w.set_usart2en(true));
    Ok(())
}

fn require(error: ClockError, condition: impl FnMut() -> bool) -> Result<(), ClockError> {
    if holds(100_000, condition) { Ok(()) } else { Err(error) }
}

fn holds(tries: u32, mut condition: impl FnMut() -> bool) -> bool {
    (0..tries).any(|_| condition())
}
