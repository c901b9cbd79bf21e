//! Supply and temperature of the chip, by the converter ADC1 and the values that the factory measured of this chip. RM0351,
//! chapter 18; DS10969, "Internal voltage reference" and "Temperature sensor".
//!
//! # Model
//!
//! The factory converted its reference (c₀ at 30 °C) and its sensor (c₁ at 30 °C, c₂ at 110 °C) at a supply of 3.0 V. Now the
//! reference gives r and the sensor s:
//!
//! supply = 3.0 V · c₀ / r,  T = 30 °C + 80 °C · (s · supply / 3.0 V − c₁) / (c₂ − c₁)
use darm_firmware::hardware::Converted;
use stm32_metapac::adc::vals::SampleTime;
use stm32_metapac::{ADC1, ADC123_COMMON, RCC};

use crate::bus;
use crate::clocks::HCLK_HZ;

/// Channels of ADC1 (RM0351, 18.4.11).
const REFERENCE: u8 = 0;
const SENSOR: u8 = 17;
/// A clock of a quarter of the core's: 20 MHz (RM0351, 18.6.3, CKMODE).
const QUARTER: u8 = 3;
/// Switches the sensor on (RM0351, 18.6.3). The crate of the registers has exchanged it with the bit of the battery.
const CH17SEL: u32 = 1 << 23;
const CYCLES_PER_US: u32 = HCLK_HZ / 1_000_000;
/// Start of the voltage regulator (DS10969, `t_ADCVREG_STUP`).
const REGULATOR_US: u32 = 20;
/// Start of the sensor, the slower of the two (DS10969, `t_START`).
const SENSOR_US: u32 = 120;
/// Longest wait for a flag. A calibration takes 6 µs.
const LONGEST_US: u32 = 200;
/// Supply at which the factory measured, mV.
const FACTORY_MV: u32 = 3_000;

/// What the factory converted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Factory {
    /// The reference, at 30 °C.
    pub reference: u16,
    /// The sensor at 30 °C and at 110 °C.
    pub sensor: [u16; 2],
}

/// Powers the converter, calibrates and enables it. Once, at the clock of [`HCLK_HZ`]; whether it is ready. RM0351, 18.4.6,
/// 18.4.8 and 18.4.9.
pub fn start() -> bool {
    bus::modify(RCC.ahb2enr(), |w| w.set_adcen(true));
    // A clock runs two cycles after its bit is set (RM0351, 6.2.17): the read takes longer.
    bus::read(RCC.ahb2enr());
    bus::modify(ADC123_COMMON.ccr(), |w| {
        w.set_ckmode(QUARTER);
        w.set_vrefen(true);
        w.0 |= CH17SEL;
    });
    bus::modify(ADC1.cr(), |w| w.set_deeppwd(false));
    bus::modify(ADC1.cr(), |w| w.set_advregen(true));
    bus::delay(REGULATOR_US.max(SENSOR_US) * CYCLES_PER_US);
    bus::modify(ADC1.cr(), |w| w.set_adcal(true));
    if !holds(|| !bus::read(ADC1.cr()).adcal()) {
        return false;
    }
    // ADEN has to wait for four clocks of the converter after a calibration (RM0351, 18.4.9).
    bus::delay(CYCLES_PER_US);
    bus::write(ADC1.isr(), |w| w.set_adrdy(true));
    bus::modify(ADC1.cr(), |w| w.set_aden(true));
    // The longest sampling: the reference needs 4 µs, the sensor 5 µs.
    bus::modify(ADC1.smpr(0), |w| w.set_smp(REFERENCE.into(), SampleTime::CYCLES640_5));
    bus::modify(ADC1.smpr(1), |w| w.set_smp(usize::from(SENSOR - 10), SampleTime::CYCLES640_5));
    holds(|| bus::read(ADC1.isr()).adrdy())
}

/// The two conversions in turn: the control tick fetches what it began 5 ms before. A conversion takes 33 µs.
pub struct Converter {
    factory: Factory,
    /// The channel whose conversion was begun; `None` before the first one.
    channel: Option<u8>,
    /// Supply that was measured last, mV; 0 where the converter gave nothing.
    supply_mv: u16,
}

impl Converter {
    /// Nothing begun. With the values of the factory.
    pub const fn new(factory: Factory) -> Self {
        Self { factory, channel: None, supply_mv: 0 }
    }

    /// Fetches what was begun by the call before, and begins the next conversion.
    pub fn convert(&mut self) -> Option<Converted> {
        let code = fetch();
        let before = self.channel.replace(if self.channel == Some(REFERENCE) { SENSOR } else { REFERENCE });
        begin(self.channel.unwrap_or(REFERENCE));
        Some(match before? {
            REFERENCE => {
                self.supply_mv = code.and_then(|code| supply_mv(code, &self.factory)).unwrap_or(0);
                Converted::SupplyMv(self.supply_mv)
            }
            _ => Converted::ChipCelsius(code.and_then(|code| celsius(code, self.supply_mv, &self.factory))),
        })
    }
}

/// Nothing where the converter has not started, or is still at work.
fn begin(channel: u8) {
    let control = bus::read(ADC1.cr());
    if control.aden() && !control.adstart() {
        bus::write(ADC1.sqr1(), |w| w.set_sq(0, channel));
        bus::modify(ADC1.cr(), |w| w.set_adstart(true));
    }
}

/// Reading the value ends the flag (RM0351, 18.6.1).
fn fetch() -> Option<u32> {
    bus::read(ADC1.isr()).eoc().then(|| u32::from(bus::read(ADC1.dr()).regular_data()))
}

fn supply_mv(code: u32, factory: &Factory) -> Option<u16> {
    (FACTORY_MV * u32::from(factory.reference)).checked_div(code).and_then(|supply| u16::try_from(supply).ok())
}

fn celsius(code: u32, supply_mv: u16, factory: &Factory) -> Option<i16> {
    if supply_mv == 0 {
        return None;
    }
    let [at_30, at_110] = factory.sensor.map(i32::from);
    let at_factory = (code * u32::from(supply_mv) / FACTORY_MV) as i32;
    let above = (80 * (at_factory - at_30)).checked_div(at_110 - at_30)?;
    i16::try_from(30 + above).ok()
}

fn holds(condition: impl Fn() -> bool) -> bool {
    (0..LONGEST_US).any(|_| {
        let holds = condition();
        if !holds {
            bus::delay(CYCLES_PER_US);
        }
        holds
    })
}

/// What the factory wrote into the system memory of this chip (DS10969, "Internal voltage reference calibration values" and
/// "Temperature sensor calibration values").
#[cfg(target_os = "none")]
pub fn factory() -> Factory {
    let word = |address: usize| {
        // SAFETY: the system memory of the chip is always readable, and these are aligned half-words of it.
        unsafe { (address as *const u16).read_volatile() }
    };
    Factory { reference: word(0x1fff_75aa), sensor: [word(0x1fff_75a8), word(0x1fff_75ca)] }
}

#[cfg(test)]
mod tests;
