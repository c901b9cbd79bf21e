//! The option bytes that matter here, as they are in force: read at any time, written by a person with a debugger only.
//! RM0351, 3.4.1. Why each should be as it is: `docs/hardware.md`.
use darm_core::wire::health::ChipOptions;
use stm32_metapac::FLASH;
use stm32_metapac::flash::regs::Optr;

use crate::bus;

/// Readout protection level 0: a debugger may do anything.
const UNPROTECTED: u8 = 0xAA;

/// Reads them.
pub fn read() -> ChipOptions {
    decode(bus::read(FLASH.optr()))
}

fn decode(options: Optr) -> ChipOptions {
    ChipOptions {
        brown_out_mv: brown_out_mv(options.bor_lev()),
        debugger_allowed: options.rdp() == UNPROTECTED,
        // Set, a reset leaves the SRAM2 alone.
        keeps_on_times: options.sram2_rst(),
    }
}

/// Level at which a falling supply resets the chip (DS10969, "Embedded reset and power control block characteristics").
const fn brown_out_mv(level: u8) -> u16 {
    match level {
        0 => 1_700,
        1 => 2_000,
        2 => 2_200,
        3 => 2_500,
        _ => 2_800,
    }
}

#[cfg(test)]
mod tests {
    use super::read;
    use crate::tests::model;
    use darm_core::wire::health::ChipOptions;

    /// RM0351, 3.4.1 "User and read protection option bytes": 0xFFEFF8AA as delivered.
    #[test]
    fn a_chip_as_delivered_has_the_lowest_level_and_keeps_its_memory() {
        model::power_on();
        let delivered = ChipOptions { brown_out_mv: 1_700, debugger_allowed: true, keeps_on_times: true };
        assert_eq!(read(), delivered);
    }

    /// RM0351, 3.4.1: BOR_LEV, RDP and SRAM2_RST.
    #[test]
    fn level_4_is_2_8_v_and_protection_shows() {
        model::power_on();
        model::with(|chip| chip.flash.optr = 0xfdef_fc00);
        let expected = ChipOptions { brown_out_mv: 2_800, debugger_allowed: false, keeps_on_times: false };
        assert_eq!(read(), expected);
    }
}
