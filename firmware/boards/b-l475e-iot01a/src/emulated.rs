//! Whether the image runs in QEMU.
use stm32_metapac::FLASH;

/// True in QEMU, which models no flash controller: the option register reads 0 there and never on silicon.
pub fn emulated() -> bool {
    FLASH.optr().read().0 == 0
}
