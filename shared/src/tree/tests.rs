//! Trees in postures that can be checked by hand.

extern crate std;
