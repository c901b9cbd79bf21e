//! How often the flash may be written: anybody with the port can ask for it, and each page bears a number of erasures.
//!
//! # Model
//!
//! A bucket of `burst` tokens, one more each `interval_ms`; a write takes one. It is kept as the time at which it is full again
//! (the generic cell rate algorithm, ITU-T I.371): `full_at = max(full_at, now) + interval`, refused where that is more than
//! `burst` intervals ahead.
//!
//! A reset fills no bucket, or a program that restarts the board between two writes would pass: what is missing stays in memory that
//! outlives it ([`Kept`](crate::kept::Kept)), as it was at the last write. Where that memory holds noise the supply was off: whoever does
//! that has the board in hand, and the bucket is full, so that the first uploads are not refused.

use darm_core::units::Micros;

/// What is written may be written this often.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rate {
    /// From one write to the next, in the long run.
    interval_ms: u32,
    /// Writes that may follow each other at once.
    burst: u32,
}

/// Zero offsets: records of 112 bytes together, that is 146 calibrations for one erasure of all eight pages of records. 10 000 of these
/// (DS10969, "Flash memory endurance") last for 169 days at this rate; six servos are calibrated one by one without waiting.
pub(crate) const CALIBRATIONS: Rate = Rate { interval_ms: 10_000, burst: 6 };

/// Tables: each begin and its first chunk erase a page of the slot that is free, the same one until a table is committed. 10 000
/// erasures of it (DS10969) last for 7 days at this rate, 100 000 of the Pico's W25Q16JV for 70 days, where 10 minutes were enough
/// for 10 000. The burst is 2 % of them: a person who uploads a table every 20 s does so for 100 minutes, and `darm calibrate`, whose
/// programs last longer than a minute, is never refused.
pub(crate) const TABLES: Rate = Rate { interval_ms: 60_000, burst: 200 };

impl Rate {
    const fn span(&self) -> Micros {
        Micros::from_millis(self.interval_ms.saturating_mul(self.burst))
    }
}

/// Tokens of one kind of write.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bucket {
    rate: Rate,
    full_at: Micros,
}

impl Bucket {
    /// Full.
    pub(crate) const fn full(rate: Rate) -> Self {
        Self { rate, full_at: Micros(0) }
    }

    /// At the start, with what is missing from before.
    pub(crate) fn with_missing(rate: Rate, missing_ms: u32) -> Self {
        Self { rate, full_at: Micros::from_millis(missing_ms).min(rate.span()) }
    }

    /// Takes a token, or says after which time there is one.
    pub(crate) fn take(&mut self, now: Micros) -> Result<(), u32> {
        let full_at = self.full_at.max(now) + Micros::from_millis(self.rate.interval_ms);
        let wait = full_at - (now + self.rate.span());
        if wait > Micros(0) {
            return Err(wait.0.div_ceil(1000) as u32);
        }
        self.full_at = full_at;
        Ok(())
    }

    /// Time until it is full.
    pub(crate) fn missing_ms(&self, now: Micros) -> u32 {
        (self.full_at - now).0.div_ceil(1000) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::{Bucket, CALIBRATIONS, Micros, Rate, TABLES};

    /// Writes of somebody who tries each 10 ms for this time, with a reset each `reset_ms`.
    fn writes(rate: Rate, span_ms: u32, reset_ms: u32) -> u32 {
        let (mut bucket, mut start_ms) = (Bucket::full(rate), 0);
        let mut writes = 0;
        for at_ms in (0..span_ms).step_by(10) {
            if at_ms - start_ms >= reset_ms {
                bucket = Bucket::with_missing(rate, bucket.missing_ms(Micros::from_millis(at_ms - start_ms)));
                start_ms = at_ms;
            }
            writes += u32::from(bucket.take(Micros::from_millis(at_ms - start_ms)).is_ok());
        }
        writes
    }

    #[test]
    fn no_more_writes_pass_than_burst_and_rate_allow_over_resets_too() {
        for reset_ms in [u32::MAX, 7_000, 500] {
            assert_eq!(writes(CALIBRATIONS, 600_000, reset_ms), 6 + 59, "reset each {reset_ms} ms");
            assert_eq!(writes(TABLES, 600_000, reset_ms), 200 + 9, "reset each {reset_ms} ms");
        }
    }

    #[test]
    fn after_the_time_that_a_refusal_names_the_next_write_passes() {
        let mut bucket = Bucket::full(CALIBRATIONS);
        (0..6).for_each(|at| assert_eq!(bucket.take(Micros(at)), Ok(())));
        let Err(wait_ms) = bucket.take(Micros(6)) else { panic!("the bucket is empty") };
        assert_eq!(wait_ms, 10_000);
        assert!(bucket.take(Micros::from_millis(wait_ms - 1)).is_err());
        assert_eq!(bucket.take(Micros::from_millis(wait_ms)), Ok(()));
    }

    #[test]
    fn what_a_reset_finds_in_memory_is_at_most_an_empty_bucket() {
        let mut bucket = Bucket::with_missing(CALIBRATIONS, u32::MAX);
        assert_eq!(bucket.take(Micros(0)), Err(10_000));
    }
}
