//! What the tests of all drivers use, models of the chip; the store on the driver of the flash.
pub(crate) mod model;
mod store_cuts;
