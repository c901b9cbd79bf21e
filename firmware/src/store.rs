//! tmp
/// x
pub const FLASH_BYTES: usize = 144 * 1024;
