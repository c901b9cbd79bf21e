//! The converter on the model of its registers: order of the start, times, values.

use darm_firmware::hardware::Converted;

use super::{Converter, Factory, bus, start};
use crate::clocks;
use crate::tests::model;

const FACTORY: Factory = Factory { reference: 1655, sensor: [1037, 1380] };

/// What the control tick gets in this number of calls, 5 ms apart.
fn converted(factory: Factory, calls: usize) -> Vec<Option<Converted>> {
    let mut converter = Converter::new(factory);
    let call = |_| {
        let converted = converter.convert();
        bus::delay(5_000 * super::CYCLES_PER_US);
        converted
    };
    (0..calls).map(call).collect()
}

/// A chip at this supply and temperature whose converter has started.
fn started(supply_mv: f64, celsius: f64) {
    model::power_on();
    clocks::start().unwrap();
    let at_factory = 1037.0 + (celsius - 30.0) * (1380.0 - 1037.0) / 80.0;
    model::with(|chip| {
        chip.adc.reference = (1655.0 * 3000.0 / supply_mv) as u32;
        chip.adc.sensor = (at_factory * 3000.0 / supply_mv) as u32;
    });
    assert!(start());
}

/// RM0351, 18.4.6 "ADC Deep-Power-Down mode and voltage regulator", 18.4.8 "Calibration", 18.4.9 "ADC on-off control".
#[test]
fn supply_and_temperature_come_from_the_values_of_the_factory() {
    for (supply_mv, celsius) in [(3300, 25), (3000, 30), (2800, 85), (3300, -20)] {
        started(supply_mv.into(), celsius.into());
        let converted = converted(FACTORY, 5);
        let [None, Some(Converted::SupplyMv(mv)), Some(Converted::ChipCelsius(Some(chip))), ..] = converted[..] else {
            panic!("{converted:?}")
        };
        // A code of the reference is 2 mV, one of the sensor a quarter of a degree; both round down.
        assert!(mv.abs_diff(supply_mv) <= 3 && (chip - celsius).abs() <= 1, "{converted:?}");
        assert_eq!(converted[1..3], converted[3..], "again");
    }
}

/// What is not there is not measured: no converter that answers, no values of the factory.
/// 18.6.1: ADRDY says that the converter is ready.
#[test]
fn a_converter_that_does_not_answer_measures_nothing_in_bounded_time() {
    model::power_on();
    clocks::start().unwrap();
    model::with(|chip| chip.adc.is_dead = true);
    let before_us = model::now_us();
    assert!(!start());
    assert!(model::now_us() - before_us < 1_000);
    let nothing = [None, Some(Converted::SupplyMv(0)), Some(Converted::ChipCelsius(None))];
    assert_eq!(converted(FACTORY, 3), nothing);
    started(3300.0, 25.0);
    assert_eq!(converted(Factory::default(), 3), nothing);
}
