//! The start of the clocks against the model. Sections are those of RM0351.

use stm32_metapac::rcc::vals::Sw;
use stm32_metapac::{FLASH, PWR, RCC, USART1};

use super::{ClockError, HCLK_HZ, Source, source, start};
use crate::bus;
use crate::tests::model::{self, Crystal, rcc};

fn hclk_hz() -> f64 {
    model::with(|chip| chip.rcc.hclk_hz())
}

/// 6.4.1: MSIPLLEN locks the MSI to the crystal.
#[test]
fn a_crystal_that_runs_gives_80_mhz_with_its_own_error() {
    model::power_on();
    model::with(|chip| chip.rcc.msi_error = 1.03);
    assert_eq!(start(), Ok(()));
    assert_eq!((hclk_hz(), source()), (f64::from(HCLK_HZ), Source::Crystal));
    assert!((2_000_000..2_010_000).contains(&model::now_us()), "it takes two seconds to start");
}

/// 6.1.3: a system reset leaves the backup domain alone.
#[test]
fn a_crystal_that_runs_since_before_the_reset_costs_no_time() {
    model::power_on();
    assert_eq!(start(), Ok(()));
    model::with(|chip| chip.rcc.reset(rcc::IWDGRSTF));
    let before_us = model::now_us();
    assert_eq!(start(), Ok(()));
    assert_eq!(source(), Source::Crystal);
    assert!(model::now_us() - before_us < 5_000);
}

/// 6.4.4: the PLL takes the HSI16 as well.
#[test]
fn without_a_crystal_the_hsi16_gives_80_mhz_and_is_reported() {
    model::power_on();
    model::with(|chip| chip.rcc.crystal = Crystal::Dead);
    assert_eq!(start(), Ok(()));
    assert_eq!((hclk_hz(), source()), (f64::from(HCLK_HZ), Source::Hsi16));
    assert!(model::now_us() < 2_700_000, "a missing crystal does not hold the start up for ever");
}

/// 6.2.11: the clock security system ends the PLL mode. The core runs on, on the MSI alone.
#[test]
fn a_crystal_that_stops_is_reported_and_started_again_by_a_reset() {
    model::power_on();
    assert_eq!(start(), Ok(()));
    model::with(|chip| {
        chip.rcc.msi_error = 0.97;
        chip.rcc.stop_crystal();
    });
    assert_eq!(source(), Source::Msi);
    assert!((hclk_hz() / f64::from(HCLK_HZ) - 0.97).abs() < 1e-9);
    model::with(|chip| {
        chip.rcc.reset(0);
        chip.rcc.crystal = Crystal::StartsIn(500);
    });
    assert_eq!(start(), Ok(()));
    assert_eq!(source(), Source::Crystal);
}

/// 6.4.1: HSIRDY and PLLRDY say whether an oscillator runs.
#[test]
fn what_does_not_come_up_is_named() {
    for (broken, crystal, error) in [
        (1 << 10, Crystal::Dead, ClockError::Oscillator),
        (1 << 25, Crystal::Dead, ClockError::Pll),
        (1 << 25, Crystal::StartsIn(1), ClockError::Pll),
    ] {
        model::power_on();
        model::with(|chip| (chip.rcc.broken, chip.rcc.crystal) = (broken, crystal));
        assert_eq!(start(), Err(error));
    }
}

/// 3.3.3: one wait state for each 16 MHz.
#[test]
#[should_panic(expected = "wait states")]
fn the_model_refuses_a_switch_up_before_the_wait_states() {
    model::power_on();
    model::with(|chip| chip.rcc.crystal = Crystal::Dead);
    assert_eq!(start(), Ok(()));
    bus::modify(RCC.cfgr(), |w| w.set_sw(Sw::HSI));
    bus::modify(FLASH.acr(), |w| w.set_latency(3));
    bus::modify(RCC.cfgr(), |w| w.set_sw(Sw::PLL1_R));
}

#[test]
#[should_panic(expected = "cannot be stopped (6.2.8")]
fn the_model_refuses_to_stop_the_clock_in_use() {
    model::power_on();
    bus::modify(RCC.cr(), |w| w.set_msion(false));
}

#[test]
#[should_panic(expected = "while it is off (6.2.5)")]
fn the_model_refuses_to_set_up_a_running_pll() {
    model::power_on();
    assert_eq!(start(), Ok(()));
    bus::modify(RCC.pllcfgr(), |w| w.set_pllren(false));
}

/// 6.4.1: MSIPLLEN needs LSERDY.
#[test]
#[should_panic(expected = "MSIPLLEN needs a crystal that is ready")]
fn the_model_refuses_pll_mode_without_a_crystal() {
    model::power_on();
    bus::modify(RCC.cr(), |w| w.set_msipllen(true));
}

/// 5.4.1: DBP opens the backup domain.
#[test]
#[should_panic(expected = "write-protected until DBP is set")]
fn the_model_refuses_the_backup_domain_while_it_is_closed() {
    model::power_on();
    bus::modify(RCC.apb1enr1(), |w| w.set_pwren(true));
    assert!(!bus::read(PWR.cr1()).dbp());
    bus::modify(RCC.bdcr(), |w| w.set_lseon(true));
}

#[test]
#[should_panic(expected = "has no clock (6.2.17)")]
fn the_model_refuses_a_peripheral_without_its_clock() {
    model::power_on();
    bus::read(USART1.isr());
}
