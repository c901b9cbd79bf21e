//! The way into the loader in the chip's system memory.
use stm32_metapac::{RCC, SYSCFG};

use crate::bus;

/// Vector table of the system memory (AN2606).
pub const SYSTEM_MEMORY: u32 = 0x1FFF_0000;
/// MEM_MODE: system memory at address 0 (RM0351, 9.2.1).
const SYSTEM_AT_0: u8 = 1;

/// Maps the system memory to address 0, as a boot from it does: on chips with two banks the loader looks there which way it was
/// started, and would else jump back into the firmware (AN2606).
pub fn map() {
    bus::modify(RCC.apb2enr(), |w| w.set_syscfgen(true));
    // A clock runs two cycles after its bit is set (RM0351, 6.2.17): the read takes longer.
    bus::read(RCC.apb2enr());
    bus::modify(SYSCFG.memrmp(), |w| w.set_mem_mode(SYSTEM_AT_0));
}

#[cfg(test)]
mod tests {
    use super::map;
    use crate::tests::model;

    /// RM0351, 9.2.1: MEM_MODE and FB_MODE.
    #[test]
    fn the_system_memory_is_mapped_and_its_bank_left_alone() {
        model::power_on();
        // FB_MODE: the banks are swapped.
        model::with(|chip| chip.remap = 1 << 8);
        map();
        assert_eq!(model::with(|chip| chip.remap), 1 << 8 | 1);
    }
}
