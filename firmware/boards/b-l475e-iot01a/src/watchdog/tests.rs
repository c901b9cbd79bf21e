//! The watchdog against its model. Sections are those of RM0351.

use stm32_metapac::IWDG;
use stm32_metapac::iwdg::vals::Key;

use super::{Cause, feed, start, take_cause};
use crate::bus;
use crate::tests::model::{self, rcc, watchdog::LSI_HZ};

/// How long after the last feed this chip's watchdog bites, ms.
fn bites_after_ms(lsi_hz: f64) -> f64 {
    model::power_on();
    model::with(|chip| chip.watchdog.lsi_hz = lsi_hz);
    start();
    for _ in 0..100 {
        model::pass_us(1_000);
        feed();
    }
    let fed_ns = model::with(|chip| chip.now_ns);
    let bitten = || model::with(|chip| chip.watchdog.bitten_at_ns);
    assert_eq!(bitten(), None, "it bites although it is fed");
    while bitten().is_none() {
        model::pass_us(10);
    }
    (bitten().unwrap_or(0) - fed_ns) as f64 * 1e-6
}

/// 36.4.2: prescaler and reload; DS10969 for the LSI.
#[test]
fn it_bites_47_to_55_ms_after_the_last_feed() {
    let [slow, fast] = LSI_HZ.map(bites_after_ms);
    assert!(47.0 <= fast && slow <= 55.0, "{fast} to {slow} ms");
}

/// 36.4.4: a feed while RVU is set loads the old value, here that of the reset: 512 ms.
#[test]
fn the_first_period_is_as_short_as_the_others() {
    model::power_on();
    start();
    model::pass_us(60_000);
    assert!(model::with(|chip| chip.watchdog.bitten_at_ns).is_some());
}

/// 36.4.4: RVU is set until the LSI has taken the value.
#[test]
fn a_watchdog_that_never_updates_does_not_hold_the_start_up() {
    model::power_on();
    model::with(|chip| chip.watchdog.lsi_hz = 1.0);
    start();
    assert!(bus::read(IWDG.sr()).0 & 2 != 0, "RVU");
}

/// 6.4.30: the flags stay until RMVF.
#[test]
fn the_cause_of_a_reset_is_read_once() {
    model::power_on();
    assert_eq!(take_cause(), Cause { supply: true, watchdog: false, firmware: false });
    model::with(|chip| chip.rcc.reset(rcc::IWDGRSTF));
    assert_eq!(take_cause(), Cause { supply: false, watchdog: true, firmware: false });
    assert_eq!(take_cause(), Cause { supply: false, watchdog: false, firmware: false });
}

/// 36.3.2 "Window option": a feed above the window resets as well.
#[test]
fn a_feed_before_the_window_bites() {
    model::power_on();
    start();
    bus::write(IWDG.kr(), |w| w.set_key(Key::ENABLE));
    bus::write(IWDG.winr(), |w| w.set_win(200));
    model::pass_us(1_000);
    feed();
    assert!(model::with(|chip| chip.watchdog.bitten_at_ns).is_some());
}

#[test]
#[should_panic(expected = "36.3.5")]
fn the_model_refuses_values_without_the_key() {
    model::power_on();
    start();
    bus::write(IWDG.rlr(), |w| w.set_rl(1));
}

/// 36.4.4: a value may change only while its flag is clear.
#[test]
#[should_panic(expected = "PVU, RVU or WVU is set")]
fn the_model_refuses_a_value_while_the_last_one_is_updated() {
    model::power_on();
    start();
    bus::write(IWDG.kr(), |w| w.set_key(Key::ENABLE));
    bus::write(IWDG.rlr(), |w| w.set_rl(1));
    bus::write(IWDG.rlr(), |w| w.set_rl(2));
}
