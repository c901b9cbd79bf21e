//! The output chain by PIO: 64 lines leave in two words, highest first, while the processor does something else.
//!
//! At 12.5 cycles a step and 4 steps a bit a bit takes 400 ns; all 64, with the latch, 26 µs.

use embassy_rp::gpio::{Drive, Level, Output};
use embassy_rp::peripherals::{PIN_2, PIN_3, PIN_4, PIN_5, PIO0};
use embassy_rp::pio::{Config, Direction, InterruptHandler, Pio, ShiftConfig, ShiftDirection, StateMachine};
use embassy_rp::{Peri, bind_interrupts, pac};
use fixed::FixedU32;
use fixed::types::extra::U8;

/// Output enable of the chain, active low.
pub(crate) const ENABLE: usize = 5;

bind_interrupts!(struct Irqs {
    PIO0_IRQ_0 => InterruptHandler<PIO0>;
});

/// Flag of the PIO that is set when the latch has shown the lines.
const SHOWN: u8 = 1 << 0;
/// Looks at the flag at most so often: about 100 µs.
const LOOKS: u32 = 2000;

/// The chain.
pub(crate) struct Chain {
    machine: StateMachine<'static, PIO0, 0>,
    enable: Output<'static>,
}

/// Output enable, high. Its pull-up and the inputs of eight chips take more than the 2 mA that the hardware layer leaves: at 12 mA a low
/// level stays below 0.4 V also with a wrong pull-up of 330 Ω. The pin is read back, so its input needs the hysteresis that the
/// hardware layer takes away.
fn take_enable(pin: Peri<'static, PIN_5>) -> Output<'static> {
    let mut enable = Output::new(pin, Level::High);
    enable.set_drive_strength(Drive::_12mA);
    pac::PADS_BANK0.gpio(ENABLE).modify(|w| w.set_schmitt(true));
    enable
}

type Lines = (Peri<'static, PIN_2>, Peri<'static, PIN_3>, Peri<'static, PIN_4>);

impl Chain {
    /// Takes data, clock and latch, and output enable, which it drives high first of all.
    pub(crate) fn new(pio: Peri<'static, PIO0>, (data, clock, latch): Lines, enable: Peri<'static, PIN_5>) -> Self {
        let enable = take_enable(enable);
        let Pio { mut common, sm0: mut machine, .. } = Pio::new(pio, Irqs);
        let program = pio::pio_asm!(
            ".side_set 2", // clock, latch
            ".wrap_target",
            "    set x, 31      side 0b00",
            "bits:",
            "    out pins, 1    side 0b00 [1]", // waits here for the next word
            "    nop            side 0b01 [1]",
            "    out pins, 1    side 0b00 [1]",
            "    jmp x-- bits   side 0b01 [1]",
            "    irq set 0      side 0b10 [1]",
            ".wrap",
        );
        let [data, clock, latch] = [common.make_pio_pin(data), common.make_pio_pin(clock), common.make_pio_pin(latch)];
        let mut config = Config::default();
        config.use_program(&common.load_program(&program.program), &[&clock, &latch]);
        config.set_out_pins(&[&data]);
        config.shift_out = ShiftConfig { threshold: 32, direction: ShiftDirection::Left, auto_fill: true };
        config.clock_divider = FixedU32::<U8>::from_bits(12 << 8 | 128);
        machine.set_config(&config);
        machine.set_pin_dirs(Direction::Out, &[&data, &clock, &latch]);
        // Empties the output shift register, so that the first word is the first that leaves.
        machine.restart();
        machine.set_enable(true);
        Self { machine, enable }
    }

    /// Whether the lines that were shifted last have not reached the latch: the state machine does not run, or had no room
    /// for them. Call at least 30 µs after [`Chain::shift`].
    pub(crate) fn is_stuck(&self) -> bool {
        pac::PIO0.irq().read().irq() & SHOWN == 0 || pac::PIO0.fdebug().read().txover() & 1 != 0
    }

    /// Shifts and latches 64 lines.
    pub(crate) fn shift(&mut self, lines: u64) {
        pac::PIO0.irq().write(|w| w.set_irq(SHOWN));
        self.machine.tx().push((lines >> 32) as u32);
        self.machine.tx().push(lines as u32);
    }

    /// Enables the outputs once the latch shows the lines that were shifted last, or disables them at once.
    pub(crate) fn set_enabled(&mut self, enabled: bool) {
        if !enabled {
            self.enable.set_high();
        } else if self.await_latch() {
            self.enable.set_low();
        }
    }

    /// Waits until the latch shows the lines that were shifted last; whether it does.
    #[inline(always)]
    pub(crate) fn await_latch(&self) -> bool {
        (0..LOOKS).any(|_| pac::PIO0.irq().read().irq() & SHOWN != 0)
    }
}
