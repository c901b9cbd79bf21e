//! How long current has flowed through each output: the memory that limits of on-time and duty need.
//!
//! # Model
//!
//! The on-time of an output over a sliding window W is the sum of 16 closed buckets of W/16 and of the bucket that is
//! being filled. A closed bucket keeps its on-time in 1/255 of a bucket, rounded up. So the meter never counts too
//! little, and too much by at most one bucket and 1/255 of the window.
//!
//! One [`DutyMeter`] belongs to one output of the board, whatever table drives it. The board keeps its meters in memory
//! that survives a reset; each has its own checksum, and one that is not valid counts as [exhausted](DutyMeter::exhaust).
#![cfg_attr(not(test), deny(clippy::indexing_slicing, clippy::arithmetic_side_effects, clippy::unwrap_used))]

use serde::{Deserialize, Serialize};

use crate::output::{CoilLimit, MAX_COILS};
use crate::units::Micros;

/// Spans of current that the meters count in one tick, at most: of a coil whose current begins and ends between two of its turns
/// there are three.
pub(crate) const SPANS_A_TICK: usize = 12;
/// Spans of one meter, at most.
pub(crate) const SPANS: usize = 3;

/// Ticks in which each meter of this number of outputs has its turn, whatever has switched.
pub(crate) const fn turn_ticks(n_outputs: usize) -> u32 {
    n_outputs.div_ceil(SPANS_A_TICK / SPANS) as u32
}

/// Which limit an output would exceed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Breach {
    /// On for longer than `max_on_ms` without a pause.
    OnTooLong,
    /// On for more than its share of the window.
    Duty,
}

/// Time from one control tick to the next.
pub const TICK: Micros = Micros::from_millis(1);
/// Tolerated lateness of a tick: an on-time counts as too long only beyond it, and a rehearsal leaves room for it.
pub const LATENESS: Micros = Micros::from_millis(2);
const LATE_US: u32 = LATENESS.0 as u32;

/// On-time of one output over a sliding window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct DutyMeter {
    /// On-time of each closed bucket, in 1/255 of a bucket.
    closed: [u8; Self::BUCKETS],
    /// Sum of the closed buckets.
    closed_sum: u16,
    /// The oldest closed bucket: the next to be replaced.
    oldest: u8,
    unused: u8,
    /// Time in the bucket that is being filled.
    filled_us: u32,
    /// On-time in it.
    filled_on_us: u32,
    /// On-time since the last pause.
    on_us: u32,
    check: u32,
}

/// The limit of an output in the units in which its meter counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeterLimit {
    /// Length of a bucket: at most 225 s. 0 where nothing is counted.
    bucket_us: u32,
    /// What 1/255 of a bucket counts as.
    unit_us: u32,
    /// On-time that a window allows: at most an hour; `u32::MAX` where duty is not limited.
    allowed_us: u32,
    /// Longest on-time without a pause.
    max_on_us: u32,
}

impl MeterLimit {
    /// Allows nothing and counts nothing: the limit of an output that does not exist.
    pub const NONE: Self = Self { bucket_us: 0, unit_us: 0, allowed_us: 0, max_on_us: 0 };

    /// The limit as a profile or a table has it.
    pub const fn of(limit: &CoilLimit) -> Self {
        let bucket_us = limit.window_ms.saturating_mul(125) / 2;
        let unlimited = limit.duty_percent >= 100;
        let share_us = limit.window_ms.saturating_mul(10).saturating_mul(limit.duty_percent as u32);
        Self {
            bucket_us,
            unit_us: (bucket_us / DutyMeter::UNITS).saturating_add(1),
            allowed_us: if unlimited { u32::MAX } else { share_us },
            max_on_us: limit.max_on_ms.saturating_mul(1000),
        }
    }

    /// The limit for a rehearsal: a program that keeps it keeps the complete limit although ticks are late by `lateness`,
    /// and, `after_use`, although buckets close at other times than in the rehearsal.
    #[must_use]
    pub const fn rehearsed(self, lateness: Micros, after_use: bool) -> Self {
        let late_us = lateness.0 as u32;
        let shifted_us = self.unit_us.saturating_mul(DutyMeter::ALL_BUCKETS).saturating_add(self.bucket_us);
        let margin_us = if after_use { late_us.saturating_add(shifted_us) } else { late_us };
        let allowed_us = if self.is_duty_limited() { self.allowed_us.saturating_sub(margin_us) } else { u32::MAX };
        Self { allowed_us, max_on_us: self.max_on_us.saturating_sub(late_us), ..self }
    }

    /// Longest on-time without a pause.
    pub const fn max_on(&self) -> Micros {
        Micros(self.max_on_us as u64)
    }

    const fn is_duty_limited(&self) -> bool {
        self.allowed_us < u32::MAX
    }
}

impl DutyMeter {
    const BUCKETS: usize = 16;
    /// The closed ones and the one that is being filled.
    const ALL_BUCKETS: u32 = Self::BUCKETS as u32 + 1;
    /// On-time of a closed bucket that was on throughout.
    const FULL: u8 = 255;
    /// Units of on-time in a bucket.
    const UNITS: u32 = Self::FULL as u32;

    /// Lets `span` pass with the output on or off, and reports the first limit that was exceeded.
    ///
    /// # Errors
    ///
    /// [`Breach::OnTooLong`]: the output has been on for longer than its pulse. [`Breach::Duty`]: it has been on for
    /// too long within its window.
    #[inline(always)]
    pub fn pass(&mut self, span: Micros, on: bool, limit: &MeterLimit) -> Result<(), Breach> {
        if limit.bucket_us == 0 || !on && self.is_empty() {
            return Ok(());
        }
        let span_us = u32::try_from(span.0).unwrap_or(u32::MAX);
        if span_us < limit.bucket_us.saturating_sub(self.filled_us) {
            self.fill(span_us, on);
        } else {
            self.advance(span_us, on, limit.bucket_us);
        }
        self.on_us = if on { self.on_us.saturating_add(span_us) } else { 0 };
        self.check = self.sum();
        if !on {
            Ok(())
        } else if self.on_us > limit.max_on_us.saturating_add(LATE_US) {
            Err(Breach::OnTooLong)
        } else if self.used_us(limit) > limit.allowed_us {
            Err(Breach::Duty)
        } else {
            Ok(())
        }
    }

    /// The same for a span of any length with the output on. The most is counted just before a bucket closes and an old one
    /// drops out of the window: it looks there, and not only at the end.
    ///
    /// # Errors
    ///
    /// As [`pass`](Self::pass), at any moment of the span.
    pub fn pass_on(&mut self, span: Micros, limit: &MeterLimit) -> Result<(), Breach> {
        let mut left = span;
        // After that the window is on throughout.
        for _ in 0..Self::ALL_BUCKETS {
            let before_close = Micros(limit.bucket_us.saturating_sub(self.filled_us).saturating_sub(1).into());
            if left <= before_close {
                break;
            }
            self.pass_apart(before_close, limit)?;
            self.pass_apart(Micros(1), limit)?;
            left = left - before_close - Micros(1);
        }
        self.pass_apart(left, limit)
    }

    /// One copy of [`DutyMeter::pass`] apart from that of the control tick.
    #[inline(never)]
    fn pass_apart(&mut self, span: Micros, limit: &MeterLimit) -> Result<(), Breach> {
        self.pass(span, true, limit)
    }

    /// Counts so much on-time beside what time passes.
    pub fn charge(&mut self, on: Micros) {
        self.filled_on_us = self.filled_on_us.saturating_add(u32::try_from(on.0).unwrap_or(u32::MAX));
        self.check = self.sum();
    }

    /// The window holds no on-time. An empty meter does not track time while its output is off: its bucket begins when
    /// current flows again.
    pub const fn is_empty(&self) -> bool {
        self.closed_sum == 0 && self.filled_on_us == 0
    }

    /// On-time that is left in the present window, in microseconds; a complete window where duty is not limited.
    pub fn left_us(&self, limit: &MeterLimit) -> u32 {
        if limit.is_duty_limited() {
            limit.allowed_us.saturating_sub(self.used_us(limit))
        } else {
            limit.bucket_us.saturating_mul(Self::BUCKETS as u32)
        }
    }

    /// Time off after which nothing is counted any more, in microseconds; 0 where duty is not limited.
    pub fn recovery_us(&self, limit: &MeterLimit) -> u32 {
        if !limit.is_duty_limited() {
            return 0;
        }
        if self.filled_on_us > 0 {
            return limit.bucket_us.saturating_mul(Self::ALL_BUCKETS).saturating_sub(self.filled_us);
        }
        let (newer, older) = self.closed.split_at_checked(self.oldest.into()).unwrap_or((&self.closed, &[]));
        let mut newest_first = newer.iter().rev().chain(older.iter().rev());
        newest_first.position(|on| *on > 0).map_or(0, |age| {
            let buckets = Self::BUCKETS.saturating_sub(age) as u32;
            limit.bucket_us.saturating_mul(buckets).saturating_sub(self.filled_us)
        })
    }

    /// Counts as if the output had just been used to its limit.
    pub fn exhaust(&mut self, limit: &MeterLimit) {
        *self = Self::default();
        let full = limit.allowed_us.div_ceil(limit.bucket_us.max(1)) as usize;
        for on in self.closed.iter_mut().rev().take(full) {
            *on = Self::FULL;
            self.closed_sum = self.closed_sum.saturating_add(Self::FULL.into());
        }
        self.check = self.sum();
    }

    /// Whether the bytes can be a meter's: after power-up they are noise.
    pub fn is_valid(&self) -> bool {
        let closed_sum: u16 = self.closed.iter().map(|on| u16::from(*on)).sum();
        self.check == self.sum() && self.closed_sum == closed_sum && usize::from(self.oldest) < Self::BUCKETS
    }

    /// On-time in the present window, never too little.
    fn used_us(&self, limit: &MeterLimit) -> u32 {
        u32::from(self.closed_sum).saturating_mul(limit.unit_us).saturating_add(self.filled_on_us)
    }

    /// A span that ends in the present bucket.
    fn fill(&mut self, span_us: u32, on: bool) {
        self.filled_us = self.filled_us.saturating_add(span_us);
        if on {
            self.filled_on_us = self.filled_on_us.saturating_add(span_us);
        }
    }

    /// A span that closes buckets: now and then. Kept apart, so that the rest stays short.
    #[inline(never)]
    fn advance(&mut self, span_us: u32, on: bool, bucket_us: u32) {
        let mut left_us = span_us.saturating_sub(self.fill_up(on, bucket_us));
        // Nothing older than one window and a bucket can matter.
        for _ in 0..Self::ALL_BUCKETS {
            if left_us < bucket_us || !on && self.is_empty() {
                break;
            }
            left_us = left_us.saturating_sub(self.fill_up(on, bucket_us));
        }
        if on || !self.is_empty() {
            self.fill(left_us.min(bucket_us.saturating_sub(1)), on);
        }
    }

    /// Fills the present bucket and closes it; the time that took.
    fn fill_up(&mut self, on: bool, bucket_us: u32) -> u32 {
        let room_us = bucket_us.saturating_sub(self.filled_us);
        if on {
            self.filled_on_us = self.filled_on_us.saturating_add(room_us);
        }
        self.close_bucket(bucket_us);
        room_us
    }

    fn close_bucket(&mut self, bucket_us: u32) {
        let (bucket_us, full) = (bucket_us.max(1), Self::UNITS);
        // The chip divides 32 bits in one instruction, 64 bits in hundreds.
        let on = match self.filled_on_us.checked_mul(full) {
            Some(product) => product.div_ceil(bucket_us),
            None => u64::from(self.filled_on_us).saturating_mul(full.into()).div_ceil(bucket_us.into()) as u32,
        };
        let on = on.min(full) as u8;
        if let Some(oldest) = self.closed.get_mut(usize::from(self.oldest)) {
            self.closed_sum = self.closed_sum.saturating_sub(u16::from(*oldest)).saturating_add(u16::from(on));
            *oldest = on;
        }
        let next = self.oldest.saturating_add(1);
        self.oldest = if usize::from(next) < Self::BUCKETS { next } else { 0 };
        self.filled_us = 0;
        self.filled_on_us = 0;
    }

    /// Checksum of everything else, the closed buckets by their sum: enough to distinguish a meter from noise, cheap enough for
    /// every change.
    fn sum(&self) -> u32 {
        let head = u32::from(self.closed_sum) << 16 | u32::from(self.oldest) << 8 | u32::from(self.unused);
        [head, self.filled_us, self.filled_on_us, self.on_us]
            .iter()
            .fold(0x6461_726d, |sum: u32, word| sum.rotate_left(9).wrapping_add(*word))
    }
}

/// The meters of all outputs of a board, and the profile that their windows belong to.
#[derive(Clone, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct DutyMeters {
    /// The meter of output `o` is number `o`.
    pub meters: [DutyMeter; MAX_COILS],
    /// First bytes of the digest of the profile that was in force.
    pub profile: u64,
}

impl Default for DutyMeters {
    fn default() -> Self {
        Self { meters: [DutyMeter::default(); MAX_COILS], profile: 0 }
    }
}

#[cfg(test)]
mod tests;
