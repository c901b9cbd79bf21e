//! Supply of the board and temperature of the chip, by the converter. RP2040 data sheet, 4.9; Pico data sheet, 4.4.
//!
//! # Model
//!
//! V = code · 3.3 V / 4096. The supply VSYS is 3 V at GP29. T = 27 °C − (V − 0.706 V) / 1.721 mV/°C, which a part misses by some
//! degrees, and by 4 °C for each per cent that the 3.3 V are wrong.
use core::ops::RangeInclusive;

use embassy_rp::pac;

/// Inputs of the converter: VSYS over 3, and the sensor of the chip.
const SUPPLY: u8 = 3;
const SENSOR: u8 = 4;
/// The pin of the first.
const SUPPLY_PIN: usize = 29;
/// A conversion takes 2 µs.
const LOOKS: u32 = 10_000;
/// Codes at which the sensor is plausible: 127 °C to −73 °C.
const PLAUSIBLE: RangeInclusive<u32> = 662..=1090;

/// Powers the converter and its sensor. A pin that it reads has neither pulls nor a digital input.
pub(crate) fn start() {
    pac::PADS_BANK0.gpio(SUPPLY_PIN).modify(|w| {
        w.set_ie(false);
        w.set_od(true);
        w.set_pue(false);
        w.set_pde(false);
    });
    pac::ADC.cs().write(|w| {
        w.set_en(true);
        w.set_ts_en(true);
    });
}

/// One conversion; `None` where the converter does not answer or reports an error. From the console alone.
fn convert(input: u8) -> Option<u32> {
    let is_ready = || (0..LOOKS).any(|_| pac::ADC.cs().read().ready());
    if !is_ready() {
        return None;
    }
    pac::ADC.cs().modify(|w| w.set_ainsel(input));
    pac::ADC.cs().modify(|w| w.set_start_once(true));
    (is_ready() && !pac::ADC.cs().read().err()).then(|| u32::from(pac::ADC.result().read().result()))
}

/// Supply of the board, mV.
pub(crate) fn supply_mv() -> Option<u16> {
    convert(SUPPLY).map(|code| (code * (3 * 3300) / 4096) as u16)
}

/// Temperature of the chip, °C.
pub(crate) fn celsius() -> Option<i16> {
    let code = convert(SENSOR).filter(|code| PLAUSIBLE.contains(code))?;
    let microvolts = (code * 3_300_000u32.div_ceil(4096)) as i32;
    Some((27 - (microvolts - 706_000) / 1721) as i16)
}
