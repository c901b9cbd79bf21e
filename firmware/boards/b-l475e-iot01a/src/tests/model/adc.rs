//! The converter ADC1 and what all converters share: RM0351, chapter 18.

const ADEN: u32 = 1 << 0;
const ADSTART: u32 = 1 << 2;
const ADVREGEN: u32 = 1 << 28;
const DEEPPWD: u32 = 1 << 29;
const ADCAL: u32 = 1 << 31;
const ADRDY: u32 = 1 << 0;
const EOC: u32 = 1 << 2;
const VREFEN: u32 = 1 << 22;
const CH17SEL: u32 = 1 << 23;
/// Start of the regulator, ns (DS10969, `t_ADCVREG_STUP`).
const REGULATOR_NS: u64 = 20_000;
/// A calibration takes 116 clocks of the converter (18.4.8), of 20 MHz.
const CALIBRATION_NS: u64 = 116 * 50;
/// After it ADEN has to wait for four clocks (18.4.9).
const AFTER_CALIBRATION_NS: u64 = 4 * 50;
/// 640.5 clocks of sampling and 12.5 of conversion (18.4.16).
const CONVERSION_NS: u64 = 653 * 50;
/// Start of the sensor, ns (DS10969, `t_START`).
const SENSOR_NS: u64 = 120_000;

pub(crate) struct Adc {
    /// What the reference and the sensor convert to.
    pub(crate) reference: u32,
    pub(crate) sensor: u32,
    /// No flag ever comes.
    pub(crate) is_dead: bool,
    cr: u32,
    isr: u32,
    ccr: u32,
    smpr: [u32; 2],
    sqr1: u32,
    regulated_ns: Option<u64>,
    calibrated_ns: Option<u64>,
    sensor_ns: u64,
    converted_ns: Option<u64>,
}

impl Adc {
    pub(super) fn new() -> Self {
        Self {
            reference: 1655,
            sensor: 1037,
            is_dead: false,
            cr: DEEPPWD,
            isr: 0,
            ccr: 0,
            smpr: [0; 2],
            sqr1: 0,
            regulated_ns: None,
            calibrated_ns: None,
            sensor_ns: 0,
            converted_ns: None,
        }
    }

    pub(super) fn pass(&mut self, now_ns: u64) {
        if self.is_dead {
            return;
        }
        if self.calibrated_ns.is_some_and(|at| now_ns >= at) {
            self.cr &= !ADCAL;
        }
        if self.converted_ns.is_some_and(|at| now_ns >= at) {
            self.converted_ns = None;
            self.cr &= !ADSTART;
            self.isr |= EOC;
        }
    }

    pub(super) fn load(&mut self, offset: usize) -> u32 {
        match offset {
            0x00 => self.isr,
            0x08 => self.cr,
            0x14 | 0x18 => self.smpr[(offset - 0x14) / 4],
            0x40 => {
                self.isr &= !EOC;
                if self.sqr1 >> 6 & 0x1f == 0 { self.reference } else { self.sensor }
            }
            0x308 => self.ccr,
            _ => panic!("ADC register {offset:#x} is not modelled"),
        }
    }

    pub(super) fn store(&mut self, offset: usize, value: u32, now_ns: u64) {
        match offset {
            0x00 => self.isr &= !value,
            0x08 => self.control(value, now_ns),
            0x14 | 0x18 => {
                assert!(self.cr & ADSTART == 0, "sampling times are written between conversions (18.6.6)");
                self.smpr[(offset - 0x14) / 4] = value;
            }
            0x30 => {
                assert!(self.cr & ADSTART == 0, "the sequence is written between conversions (18.6.11)");
                self.sqr1 = value;
            }
            0x308 => {
                assert!(self.cr & (ADEN | ADCAL | ADSTART) == 0, "the clock is chosen while all are off (18.6.3)");
                self.sensor_ns = now_ns + SENSOR_NS;
                self.ccr = value;
            }
            _ => panic!("ADC register {offset:#x} is not modelled"),
        }
    }

    /// Most bits are set by software and cleared by the converter: to write 0 has no effect.
    fn control(&mut self, value: u32, now_ns: u64) {
        if value & DEEPPWD == 0 {
            self.cr &= !DEEPPWD;
        }
        let set = value & !self.cr;
        if set & ADVREGEN != 0 {
            assert!(self.cr & DEEPPWD == 0, "the regulator starts after the end of deep power-down (18.4.6)");
            self.regulated_ns = Some(now_ns + REGULATOR_NS);
        }
        let is_regulated = self.regulated_ns.is_some_and(|at| now_ns >= at);
        if set & ADCAL != 0 {
            assert!(is_regulated && self.cr & ADEN == 0, "a calibration needs the regulator, and ADEN = 0 (18.4.8)");
            assert_eq!(self.ccr >> 16 & 3, 3, "80 MHz over four: 20 MHz, as the times of this model");
            self.calibrated_ns = Some(now_ns + CALIBRATION_NS);
        }
        if set & ADEN != 0 {
            let may = self.calibrated_ns.is_some_and(|at| now_ns >= at + AFTER_CALIBRATION_NS);
            assert!(may, "ADEN four clocks after a calibration (18.4.9)");
            self.isr |= if self.is_dead { 0 } else { ADRDY };
        }
        if set & ADSTART != 0 {
            self.begin(now_ns);
        }
        self.cr |= set;
    }

    fn begin(&mut self, now_ns: u64) {
        assert!(self.cr & ADEN != 0 && self.isr & ADRDY != 0, "a conversion needs ADRDY (18.4.9)");
        assert_eq!(self.sqr1 & 0xf, 0, "a sequence of one");
        let (input, sampling) = match self.sqr1 >> 6 & 0x1f {
            0 => (VREFEN, self.smpr[0] & 7),
            17 => (CH17SEL, self.smpr[1] >> 21 & 7),
            channel => panic!("channel {channel} is not modelled"),
        };
        assert!(self.ccr & input != 0 && now_ns >= self.sensor_ns, "the input is on, and has had its start (DS10969)");
        assert_eq!(sampling, 7, "32 µs of sampling: the sensor needs 5 µs (DS10969)");
        self.converted_ns = Some(now_ns + CONVERSION_NS);
    }
}
