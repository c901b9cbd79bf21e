//! The converter on the model of its registers: order of the start, times, values.

use super::{Factory, Measured, measure, start};
use crate::clocks;
use crate::tests::model;

const FACTORY: Factory = Factory { reference: 1655, sensor: [1037, 1380] };

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
        let measured = measure(&FACTORY);
        // A code of the reference is 2 mV, one of the sensor a quarter of a degree; both round down.
        assert!(measured.supply_mv.unwrap().abs_diff(supply_mv) <= 3, "{measured:?}");
        assert!((measured.celsius.unwrap() - celsius).abs() <= 1, "{measured:?}");
        assert_eq!(measure(&FACTORY), measured, "again");
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
    assert_eq!(measure(&FACTORY), Measured::default());
    assert!(model::now_us() - before_us < 1_000);
    started(3300.0, 25.0);
    assert_eq!(measure(&Factory { reference: 0, sensor: [0, 0] }).celsius, None);
}
