//! Which page controls the arm: one at a time, for as long as it renews.
//!
//! A page that was closed, or whose computer sleeps, renews no longer and loses control after [`LEASE`]: it has abandoned the
//! arm, and what it moved by hand is switched off. Time is an argument. A stop needs no control.

use std::time::{Duration, Instant};

/// How long control lasts without being renewed; pages renew once a second.
pub const LEASE: Duration = Duration::from_secs(3);

/// Control as a page gets it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grant {
    /// Number of the grant, which every page may see: "page 3 controls the arm".
    pub page: u32,
    /// What the page shows with each order; no other page learns it.
    pub key: u64,
}

/// Why a page does not have control.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ControlError {
    /// Another page has it.
    #[error("page {page} controls the arm; release control there, or close that page")]
    Taken {
        /// Its number.
        page: u32,
    },
    /// The page has none, or has it no longer.
    #[error("this page does not control the arm; take control first")]
    Missing,
}

/// Who controls the arm.
#[derive(Debug, Default)]
pub struct Control {
    holder: Option<(Grant, Instant)>,
    grants: u32,
    is_abandoned: bool,
}

impl Control {
    /// Gives control to a page, under a key that it shows from now on.
    ///
    /// # Errors
    ///
    /// [`ControlError::Taken`]: another page has it.
    pub fn take(&mut self, now: Instant, key: u64) -> Result<Grant, ControlError> {
        self.expire(now);
        match self.holder(now) {
            Some(page) => Err(ControlError::Taken { page }),
            None => {
                self.grants += 1;
                let grant = Grant { page: self.grants, key };
                self.holder = Some((grant, now + LEASE));
                Ok(grant)
            }
        }
    }

    /// Keeps control for another [`LEASE`].
    ///
    /// # Errors
    ///
    /// As [`check`](Self::check).
    pub fn renew(&mut self, now: Instant, key: u64) -> Result<(), ControlError> {
        self.check(now, key)?;
        self.holder.iter_mut().for_each(|(_, until)| *until = now + LEASE);
        Ok(())
    }

    /// Gives control back; a page that has none changes nothing.
    pub fn release(&mut self, key: u64) {
        self.holder = self.holder.take().filter(|(grant, _)| grant.key != key);
    }

    /// Gives control back because the page is closed; a page that has none changes nothing.
    pub fn leave(&mut self, key: u64) {
        self.is_abandoned |= self.holder.is_some_and(|(grant, _)| grant.key == key);
        self.release(key);
    }

    /// Whether a page has left with control, or has not renewed it, since this was asked last.
    pub fn take_abandoned(&mut self, now: Instant) -> bool {
        self.expire(now);
        std::mem::take(&mut self.is_abandoned)
    }

    fn expire(&mut self, now: Instant) {
        if self.holder.take_if(|(_, until)| now >= *until).is_some() {
            self.is_abandoned = true;
        }
    }

    /// Whether the page with this key has control.
    ///
    /// # Errors
    ///
    /// [`ControlError::Taken`]: another page has it. [`ControlError::Missing`]: no page has.
    pub fn check(&self, now: Instant, key: u64) -> Result<(), ControlError> {
        match self.holder(now) {
            Some(_) if self.holder.is_some_and(|(grant, _)| grant.key == key) => Ok(()),
            Some(page) => Err(ControlError::Taken { page }),
            None => Err(ControlError::Missing),
        }
    }

    /// Number of the page that has control.
    pub fn holder(&self, now: Instant) -> Option<u32> {
        self.holder.filter(|(_, until)| now < *until).map(|(grant, _)| grant.page)
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::{Control, ControlError, LEASE};

    #[test]
    fn one_page_at_a_time_has_control_until_it_releases_it_or_renews_no_longer() {
        let (mut control, start) = (Control::default(), Instant::now());
        assert_eq!(control.check(start, 7), Err(ControlError::Missing));
        let first = control.take(start, 7).unwrap();
        assert_eq!(control.take(start, 8), Err(ControlError::Taken { page: first.page }));
        assert_eq!((control.check(start, 7), control.check(start, 8).is_err()), (Ok(()), true));
        control.release(8);
        assert_eq!(control.holder(start), Some(first.page));
        let late = start + LEASE - Duration::from_millis(1);
        control.renew(late, 7).unwrap();
        assert_eq!(control.holder(late + LEASE / 2), Some(first.page));
        assert_eq!(control.check(late + LEASE, 7), Err(ControlError::Missing));
        assert_eq!(control.renew(late + LEASE, 7), Err(ControlError::Missing));
        let second = control.take(late + LEASE, 8).unwrap();
        assert_ne!(second.page, first.page);
        control.release(8);
        assert_eq!(control.holder(late + LEASE), None);
    }

    #[test]
    fn a_page_that_leaves_or_renews_no_longer_abandons_the_arm_once() {
        let (mut control, start) = (Control::default(), Instant::now());
        control.take(start, 7).unwrap();
        control.leave(8);
        assert!(!control.take_abandoned(start), "it has control still");
        control.release(7);
        assert!(!control.take_abandoned(start), "a person released it");
        control.take(start, 7).unwrap();
        control.leave(7);
        assert_eq!([(); 2].map(|()| control.take_abandoned(start)), [true, false]);
        control.take(start, 7).unwrap();
        control.take(start + LEASE, 8).unwrap();
        assert_eq!([(); 2].map(|()| control.take_abandoned(start + LEASE)), [true, false]);
        assert!(control.take_abandoned(start + 2 * LEASE));
    }
}
