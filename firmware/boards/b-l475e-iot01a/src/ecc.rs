//! What a failed error check of the flash means: pure functions of the chip's ECC register.
//!
//! RM0351, 3.7.7: bits 0 to 18 are the address in the bank, bit 19 the bank, bit 20 the system flash, bit 30 an error that was
//! corrected, bit 31 a double error that was detected and could not be. The address is that of the first error since both flags
//! were cleared.
use darm_firmware::store::FLASH_BYTES;

const ADDRESS: u32 = 0x7_FFFF;
const BANK_2: u32 = 1 << 19;
const SYSTEM: u32 = 1 << 20;
const DOUBLE: u32 = 1 << 31;

/// Where a double error is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DoubleError {
    /// In the slots and records: a word torn by a power cut. The checksum above finds it.
    Data {
        /// Bytes from the start of bank 2.
        offset: u32,
    },
    /// In the data, which are being read, though the address is elsewhere: it may be that of a corrected error before, and a power
    /// cut during programming or an erase can leave a wrong one for the next read of the word. Checksums decide what is read;
    /// an address that was believed would end every start at the same word.
    Hidden,
    /// In the code or outside everything the firmware uses: nothing that runs can be trusted.
    Code {
        /// Bank, 1 or 2.
        bank: u8,
        /// Bytes from the start of the bank.
        offset: u32,
    },
    /// In the loader or the option bytes.
    System {
        /// Bytes from the start of the bank.
        offset: u32,
    },
}

/// Reads the ECC register, `is_reading` while the data are read; `None` without a double error.
pub const fn double_error(eccr: u32, is_reading: bool) -> Option<DoubleError> {
    let offset = eccr & ADDRESS;
    if eccr & DOUBLE == 0 {
        None
    } else if eccr & (SYSTEM | BANK_2) == BANK_2 && (offset as usize) < FLASH_BYTES {
        Some(DoubleError::Data { offset })
    } else if is_reading {
        Some(DoubleError::Hidden)
    } else if eccr & SYSTEM != 0 {
        Some(DoubleError::System { offset })
    } else if eccr & BANK_2 == 0 {
        Some(DoubleError::Code { bank: 1, offset })
    } else {
        Some(DoubleError::Code { bank: 2, offset })
    }
}

#[cfg(test)]
mod tests {
    use super::DoubleError;
    use darm_firmware::store::FLASH_BYTES;

    const DETECTED: u32 = 0x8000_0000;
    const CORRECTED: u32 = 0x4000_0000;

    /// While the data are not read.
    fn double_error(eccr: u32) -> Option<DoubleError> {
        super::double_error(eccr, false)
    }

    /// RM0351, 3.7.7: bank in bit 19, system flash in bit 20.
    #[test]
    fn only_the_data_of_bank_2_survives() {
        let last = FLASH_BYTES as u32 - 8;
        assert_eq!(double_error(DETECTED | 0x8_0000 | last), Some(DoubleError::Data { offset: last }));
        assert_eq!(double_error(DETECTED | 0x8_0000), Some(DoubleError::Data { offset: 0 }));
        let beyond = FLASH_BYTES as u32;
        assert_eq!(double_error(DETECTED | 0x8_0000 | beyond), Some(DoubleError::Code { bank: 2, offset: beyond }));
        assert_eq!(double_error(DETECTED | 0x1234), Some(DoubleError::Code { bank: 1, offset: 0x1234 }));
        assert_eq!(double_error(DETECTED | 0x10_0008), Some(DoubleError::System { offset: 8 }));
        assert_eq!(double_error(DETECTED | 0x18_0008), Some(DoubleError::System { offset: 8 }));
    }

    /// RM0351, 3.7.7: ECCC is bit 30, ECCD bit 31.
    #[test]
    fn a_corrected_error_is_no_double_error() {
        assert_eq!(double_error(CORRECTED | 0x1234), None);
        assert_eq!(double_error(0), None);
    }

    /// RM0351, 3.7.7: the address is that of the first error, corrected or not.
    #[test]
    fn a_double_error_while_data_are_read_is_theirs_whatever_its_address() {
        for eccr in [DETECTED | 0x1234, DETECTED | CORRECTED | 0x1234, DETECTED | 0x10_0008] {
            assert_eq!(super::double_error(eccr, true), Some(DoubleError::Hidden));
        }
        assert_eq!(super::double_error(DETECTED | 0x8_1234, true), Some(DoubleError::Data { offset: 0x1234 }));
        assert_eq!(double_error(DETECTED | CORRECTED | 0x1234), Some(DoubleError::Code { bank: 1, offset: 0x1234 }));
    }
}
