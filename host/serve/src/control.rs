//! Which page controls the arm: one at a time, for as long as it renews.
//!
//! ```text
//!            take                      leave                    resume, with the key
//!  nobody ─────────► a page controls ─────────► its tab changes ─────────────────────► a page controls, under another key
//!    ▲                    │  renewed no longer: LEASE   │ no page resumes: CHANGE
//!    └── release ◄────────┴─────────────────────────────┴──► nobody, and the arm is abandoned
//! ```
//!
//! A page that is left does not know whether its tab goes to another page, loads it again, or is closed. It says that it leaves;
//! the next page of the tab resumes with the key of the one before. Outputs that were switched by hand stay as they are in
//! between, for [`CHANGE`] at most: where no page resumes, or the computer sleeps, the arm is abandoned and they are switched off.
//! A tab that was duplicated has the key too: it cannot resume while the first page is there, and not afterwards, as the key
//! has changed. Time is an argument. A stop needs no control.

use std::time::{Duration, Instant};

/// How long control lasts without being renewed; pages renew once a second.
pub const LEASE: Duration = Duration::from_secs(3);
/// How long it lasts after its page was left, until the next page of the tab resumes.
pub const CHANGE: Duration = Duration::from_secs(2);

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
    holder: Option<Holder>,
    grants: u32,
    is_abandoned: bool,
}

/// A page that controls the arm.
#[derive(Clone, Copy, Debug)]
struct Holder {
    grant: Grant,
    until: Instant,
    /// The page was left, and the next one of its tab is not there yet.
    has_left: bool,
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
                self.holder = Some(Holder { grant, until: now + LEASE, has_left: false });
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
        self.holder.iter_mut().filter(|holder| !holder.has_left).for_each(|holder| holder.until = now + LEASE);
        Ok(())
    }

    /// Control for the next page of a tab, under a new key, where the page before has left.
    ///
    /// # Errors
    ///
    /// [`ControlError::Taken`]: the page before is still there, or another one has control. [`ControlError::Missing`]: no page has.
    pub fn resume(&mut self, now: Instant, key: u64, next: u64) -> Result<Grant, ControlError> {
        self.check(now, key)?;
        let holder = self.holder.as_mut().filter(|holder| holder.has_left);
        let holder = holder.ok_or(ControlError::Taken { page: self.grants })?;
        holder.grant.key = next;
        (holder.until, holder.has_left) = (now + LEASE, false);
        Ok(holder.grant)
    }

    /// Gives control back; a page that has none changes nothing.
    pub fn release(&mut self, key: u64) {
        self.holder = self.holder.take().filter(|holder| holder.grant.key != key);
    }

    /// The page is left: its tab has [`CHANGE`] to resume. A page that has no control changes nothing.
    pub fn leave(&mut self, now: Instant, key: u64) {
        if let Some(holder) = self.holder.as_mut().filter(|holder| holder.grant.key == key) {
            (holder.until, holder.has_left) = (holder.until.min(now + CHANGE), true);
        }
    }

    /// Whether control has run out since this was asked last: it was not renewed, or not resumed.
    pub fn take_abandoned(&mut self, now: Instant) -> bool {
        self.expire(now);
        std::mem::take(&mut self.is_abandoned)
    }

    fn expire(&mut self, now: Instant) {
        if self.holder.take_if(|holder| now >= holder.until).is_some() {
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
            Some(_) if self.holder.is_some_and(|holder| holder.grant.key == key) => Ok(()),
            Some(page) => Err(ControlError::Taken { page }),
            None => Err(ControlError::Missing),
        }
    }

    /// Number of the page that has control.
    pub fn holder(&self, now: Instant) -> Option<u32> {
        self.holder.filter(|holder| now < holder.until).map(|holder| holder.grant.page)
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::{CHANGE, Control, ControlError, LEASE};

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
    fn control_that_runs_out_abandons_the_arm_once() {
        let (mut control, start) = (Control::default(), Instant::now());
        control.take(start, 7).unwrap();
        control.leave(start, 8);
        assert!(!control.take_abandoned(start + CHANGE), "it has control still");
        control.release(7);
        assert!(!control.take_abandoned(start + LEASE), "a person released it");
        control.take(start, 7).unwrap();
        control.leave(start, 7);
        assert!(!control.take_abandoned(start), "its tab may go to another page");
        assert_eq!([(); 2].map(|()| control.take_abandoned(start + CHANGE)), [true, false]);
        control.take(start, 7).unwrap();
        control.take(start + LEASE, 8).unwrap();
        assert_eq!([(); 2].map(|()| control.take_abandoned(start + LEASE)), [true, false]);
        assert!(control.take_abandoned(start + 2 * LEASE));
    }

    #[test]
    fn the_next_page_of_a_tab_resumes_once_and_a_duplicated_tab_does_not() {
        let (mut control, start) = (Control::default(), Instant::now());
        let page = control.take(start, 7).unwrap().page;
        assert_eq!(control.resume(start, 7, 8), Err(ControlError::Taken { page }), "the first page is there");
        control.leave(start, 7);
        assert_eq!(control.take(start, 9), Err(ControlError::Taken { page }));
        assert!(control.resume(start, 6, 8).is_err(), "another key");
        let soon = start + CHANGE / 2;
        assert_eq!(control.resume(soon, 7, 8).map(|grant| (grant.page, grant.key)), Ok((page, 8)));
        // The former key is that of the duplicate; also a request of the former page may come late.
        control.leave(soon, 7);
        assert!(control.resume(soon, 7, 9).is_err() && control.check(soon, 7).is_err());
        assert_eq!(control.renew(soon + CHANGE, 8), Ok(()));
        control.leave(soon + CHANGE, 8);
        assert_eq!(control.resume(soon + 2 * CHANGE, 8, 9), Err(ControlError::Missing));
        assert!(control.take_abandoned(soon + 2 * CHANGE));
    }

    #[test]
    fn a_page_that_has_left_lasts_no_longer_for_its_renewals() {
        let (mut control, start) = (Control::default(), Instant::now());
        control.take(start, 7).unwrap();
        control.leave(start, 7);
        let _ = control.renew(start + CHANGE / 2, 7);
        assert!(control.take_abandoned(start + CHANGE));
    }
}
