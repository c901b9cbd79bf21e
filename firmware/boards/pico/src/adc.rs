//! Supply of the board and temperature of the chip, by the converter, in turn: the control tick fetches what it began 5 ms before. RP2040 data sheet, 4.9; Pico data sheet, 4.4.
//!
//! # Model
//!
//! V = code · 3.3 V / 4096. The supply VSYS is 3 V at GP29. T = 27 °C − (V − 0.706 V) / 1.721 mV/°C, which a part misses by some
//! degrees, and by 4 °C for each per cent that the 3.3 V are wrong.
use core::ops::RangeInclusive;

use darm_firmware::hardware::Converted;
use embassy_rp::pac;

/// Inputs of the converter: VSYS over 3, and the sensor of the chip.
const SUPPLY: u8 = 3;
const SENSOR: u8 = 4;
/// The pin of the first.
const SUPPLY_PIN: usize = 29;
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

/// The two conversions in turn.
#[derive(Default)]
pub(crate) struct Converter {
    /// The input whose conversion was begun; `None` before the first one.
    input: Option<u8>,
}

impl Converter {
    /// Fetches what was begun by the call before, and begins the next conversion, of 2 µs.
    pub(crate) fn convert(&mut self) -> Option<Converted> {
        let cs = pac::ADC.cs().read();
        let code = (cs.ready() && !cs.err()).then(|| u32::from(pac::ADC.result().read().result()));
        let before = self.input.replace(if self.input == Some(SUPPLY) { SENSOR } else { SUPPLY });
        pac::ADC.cs().modify(|w| {
            w.set_ainsel(self.input.unwrap_or(SUPPLY));
            w.set_start_once(true);
        });
        Some(match before? {
            SUPPLY => Converted::SupplyMv(code.map_or(0, supply_mv)),
            _ => Converted::ChipCelsius(code.and_then(celsius)),
        })
    }
}

/// Supply of the board, mV.
fn supply_mv(code: u32) -> u16 {
    (code * (3 * 3300) / 4096) as u16
}

/// Temperature of the chip, °C.
fn celsius(code: u32) -> Option<i16> {
    if !PLAUSIBLE.contains(&code) {
        return None;
    }
    let microvolts = (code * 3_300_000u32.div_ceil(4096)) as i32;
    Some((27 - (microvolts - 706_000) / 1721) as i16)
}
