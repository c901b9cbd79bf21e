//! Which page or program controls the arm: one at a time, for as long as it renews.
//!
//! ```text
//!            take                      leave                    resume, with the key
//!  nobody ─────────► a page controls ─────────► its tab changes ─────────────────────► a page controls, under another key
//!    ▲                    │  renewed no longer: LEASE   │ no page resumes: CHANGE
//!    └── release ◄────────┴─────────────────────────────┴──► nobody, and the arm is abandoned
//! ```
//!
//! Another page may ask for control: for [`ASK`] the page that has it can hand it over, and what was switched by hand stays as it is. A
//! program has control from its first order until it ends; no page can ask it.
//!
//! A page that is left does not know whether its tab goes to another page, loads it again, or is closed. It says that it leaves;
//! the next page of the tab resumes with the key of the one before. Outputs that were switched by hand stay as they are in
//! between, for [`CHANGE`] at most: where no page resumes, or the computer sleeps, the arm is abandoned and they are switched off.
//! A tab that was duplicated has the key too: it cannot resume while the first page is there, and not afterwards, as the key
//! has changed. Time is an argument. A stop needs no control.

use std::time::{Duration, Instant};

use serde::Serialize;

/// How long control lasts without being renewed; pages renew once a second.
pub const LEASE: Duration = Duration::from_secs(3);
/// How long it lasts after its page was left, until the next page of the tab resumes.
pub const CHANGE: Duration = Duration::from_secs(2);

/// How long a page that asks waits for control.
pub const ASK: Duration = Duration::from_secs(30);

/// Number of a grant, which every page may see: "page 3 controls the arm". It grows with each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct GrantNumber(pub u32);

/// Control as a page gets it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grant {
    /// Its number, which the next page of a tab keeps.
    pub number: GrantNumber,
    /// What the page shows with each order; no other page learns it.
    pub key: u64,
}

/// Why a page does not have control.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ControlError {
    /// Another page has it.
    #[error("{name} controls the arm; ask for control, or release it there")]
    Taken {
        /// What it is called.
        name: String,
    },
    /// A program has it.
    #[error("{name} controls the arm; end it first")]
    TakenByProgram {
        /// Its command.
        name: String,
    },
    /// Another page asks for it already.
    #[error("{name} asks for control already; try again in half a minute")]
    Asked {
        /// What it is called.
        name: String,
    },
    /// The page has none, or has it no longer.
    #[error("this page does not control the arm; take control first")]
    Missing,
    /// Control cannot be handed over.
    #[error("no page asks for control any more")]
    NobodyAsks,
}

/// Who controls the arm. It is asked and changed [at](Self::at) a time.
#[derive(Debug, Default)]
pub struct Control {
    holder: Option<Holder>,
    asking: Option<Holder>,
    /// Of the latest.
    number: GrantNumber,
    is_abandoned: bool,
}

/// A page or program that controls the arm, or asks for it.
#[derive(Clone, Debug)]
pub struct Holder {
    /// Its grant.
    pub grant: Grant,
    /// What it is called.
    pub name: String,
    /// Whether it is a program.
    pub is_program: bool,
    until: Instant,
    /// The page was left, and the next one of its tab is not there yet.
    has_left: bool,
}

impl Holder {
    fn error(&self) -> ControlError {
        let name = self.name.clone();
        if self.is_program { ControlError::TakenByProgram { name } } else { ControlError::Taken { name } }
    }
}

impl Control {
    /// Control at this time: what has run out by then is gone before anything is asked or changed.
    pub fn at(&mut self, now: Instant) -> ControlAt<'_> {
        self.asking.take_if(|asking| now >= asking.until);
        if self.holder.take_if(|holder| now >= holder.until).is_some() {
            self.is_abandoned = true;
        }
        ControlAt { control: self, now }
    }
}

/// Control at one time.
#[derive(Debug)]
pub struct ControlAt<'a> {
    control: &'a mut Control,
    now: Instant,
}

impl ControlAt<'_> {
    /// Gives control to a page of this name, under a key that it shows from now on; without a name it has its number.
    ///
    /// # Errors
    ///
    /// Another page or a program has it.
    pub fn take(&mut self, key: u64, name: &str) -> Result<Grant, ControlError> {
        self.hold(key, name, false)
    }

    /// Gives control to a program, or leaves it there.
    ///
    /// # Errors
    ///
    /// A page or another program has it.
    pub fn take_as_program(&mut self, key: u64, name: &str) -> Result<(), ControlError> {
        if self.renew(key).is_ok() { Ok(()) } else { self.hold(key, name, true).map(drop) }
    }

    fn hold(&mut self, key: u64, name: &str, is_program: bool) -> Result<Grant, ControlError> {
        if let Some(holder) = &self.control.holder {
            return Err(holder.error());
        }
        let holder = Holder { is_program, ..self.next(self.now + LEASE, key, name) };
        let grant = holder.grant;
        (self.control.holder, self.control.asking) = (Some(holder), None);
        Ok(grant)
    }

    fn next(&mut self, until: Instant, key: u64, name: &str) -> Holder {
        let number = GrantNumber(self.control.number.0 + 1);
        self.control.number = number;
        let name = if name.is_empty() { format!("page {}", number.0) } else { name.to_owned() };
        Holder { grant: Grant { number, key }, name, is_program: false, until, has_left: false }
    }

    /// Asks the page with control to hand it over. The grant is what the page will have then; at once where nobody has control.
    ///
    /// # Errors
    ///
    /// A program has control, or another page has asked.
    pub fn ask(&mut self, key: u64, name: &str) -> Result<Grant, ControlError> {
        match (&self.control.holder, &self.control.asking) {
            (None, _) => self.take(key, name),
            (Some(holder), _) if holder.is_program => Err(holder.error()),
            (Some(_), Some(asking)) => Err(ControlError::Asked { name: asking.name.clone() }),
            (Some(_), None) => {
                let asking = self.next(self.now + ASK, key, name);
                let grant = asking.grant;
                self.control.asking = Some(asking);
                Ok(grant)
            }
        }
    }

    /// Gives the control of the page with this key to the page that asks.
    ///
    /// # Errors
    ///
    /// As [`check`](Self::check), or [`ControlError::NobodyAsks`].
    pub fn hand_over(&mut self, key: u64) -> Result<(), ControlError> {
        self.check(key)?;
        let asking = self.control.asking.take().ok_or(ControlError::NobodyAsks)?;
        self.control.holder = Some(Holder { until: self.now + LEASE, ..asking });
        Ok(())
    }

    /// What the page that asks for control is called.
    pub fn asking(&self) -> Option<&str> {
        self.control.asking.as_ref().map(|asking| asking.name.as_str())
    }

    /// The page with control hands nothing over, or the page that asks wants it no longer.
    pub fn refuse(&mut self, key: u64) {
        let is_asker = self.control.asking.as_ref().is_some_and(|asking| asking.grant.key == key);
        if is_asker || self.check(key).is_ok() {
            self.control.asking = None;
        }
    }

    /// The program has gone with its control; one that has none changes nothing.
    pub fn abandon(&mut self, key: u64) {
        self.control.is_abandoned |= self.control.holder.take_if(|holder| holder.grant.key == key).is_some();
    }

    /// Keeps control for another [`LEASE`].
    ///
    /// # Errors
    ///
    /// As [`check`](Self::check).
    pub fn renew(&mut self, key: u64) -> Result<(), ControlError> {
        self.check(key)?;
        self.control
            .holder
            .iter_mut()
            .filter(|holder| !holder.has_left)
            .for_each(|holder| holder.until = self.now + LEASE);
        Ok(())
    }

    /// Control for the next page of a tab, under a new key, where the page before has left.
    ///
    /// # Errors
    ///
    /// The page before is still there, or another one has control; [`ControlError::Missing`]: no page has.
    pub fn resume(&mut self, key: u64, next: u64) -> Result<Grant, ControlError> {
        self.check(key)?;
        let holder = self.control.holder.as_mut().ok_or(ControlError::Missing)?;
        if !holder.has_left {
            return Err(holder.error());
        }
        holder.grant.key = next;
        (holder.until, holder.has_left) = (self.now + LEASE, false);
        Ok(holder.grant)
    }

    /// Gives control back; a page that has none changes nothing.
    pub fn release(&mut self, key: u64) {
        self.control.holder = self.control.holder.take().filter(|holder| holder.grant.key != key);
    }

    /// The page is left: its tab has [`CHANGE`] to resume. A page that has no control changes nothing.
    pub fn leave(&mut self, key: u64) {
        if let Some(holder) = self.control.holder.as_mut().filter(|holder| holder.grant.key == key) {
            (holder.until, holder.has_left) = (holder.until.min(self.now + CHANGE), true);
        }
    }

    /// Whether control has run out since this was asked last: it was not renewed, or not resumed.
    pub fn take_abandoned(&mut self) -> bool {
        std::mem::take(&mut self.control.is_abandoned)
    }

    /// Whether the page with this key has control.
    ///
    /// # Errors
    ///
    /// Another page or a program has it; [`ControlError::Missing`]: no page has.
    pub fn check(&self, key: u64) -> Result<(), ControlError> {
        match self.holder() {
            Some(holder) if holder.grant.key == key => Ok(()),
            Some(holder) => Err(holder.error()),
            None => Err(ControlError::Missing),
        }
    }

    /// The page or program that has control.
    pub fn holder(&self) -> Option<&Holder> {
        self.control.holder.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::{ASK, CHANGE, Control, ControlError, LEASE};

    fn name_of_holder(control: &mut Control, now: Instant) -> Option<String> {
        control.at(now).holder().map(|holder| holder.name.clone())
    }

    #[test]
    fn one_page_at_a_time_has_control_until_it_releases_it_or_renews_no_longer() {
        let (mut control, start) = (Control::default(), Instant::now());
        assert_eq!(control.at(start).check(7), Err(ControlError::Missing));
        let first = control.at(start).take(7, "").unwrap();
        assert_eq!(
            control.at(start).take(8, ""),
            Err(ControlError::Taken { name: format!("page {}", first.number.0) })
        );
        assert_eq!((control.at(start).check(7), control.at(start).check(8).is_err()), (Ok(()), true));
        control.at(start).release(8);
        assert_eq!(name_of_holder(&mut control, start).as_deref(), Some("page 1"));
        let late = start + LEASE - Duration::from_millis(1);
        control.at(late).renew(7).unwrap();
        assert_eq!(name_of_holder(&mut control, late + LEASE / 2).as_deref(), Some("page 1"));
        assert_eq!(control.at(late + LEASE).check(7), Err(ControlError::Missing));
        assert_eq!(control.at(late + LEASE).renew(7), Err(ControlError::Missing));
        let second = control.at(late + LEASE).take(8, "").unwrap();
        assert_ne!(second.number, first.number);
        control.at(late + LEASE).release(8);
        assert_eq!(name_of_holder(&mut control, late + LEASE), None);
    }

    #[test]
    fn control_that_runs_out_abandons_the_arm_once() {
        let (mut control, start) = (Control::default(), Instant::now());
        control.at(start).take(7, "").unwrap();
        control.at(start).leave(8);
        assert!(!control.at(start + CHANGE).take_abandoned(), "it has control still");
        control.at(start).release(7);
        assert!(!control.at(start + LEASE).take_abandoned(), "a person released it");
        control.at(start).take(7, "").unwrap();
        control.at(start).leave(7);
        assert!(!control.at(start).take_abandoned(), "its tab may go to another page");
        assert_eq!([(); 2].map(|()| control.at(start + CHANGE).take_abandoned()), [true, false]);
        control.at(start).take(7, "").unwrap();
        control.at(start + LEASE).take(8, "").unwrap();
        assert_eq!([(); 2].map(|()| control.at(start + LEASE).take_abandoned()), [true, false]);
        assert!(control.at(start + 2 * LEASE).take_abandoned());
    }

    #[test]
    fn the_next_page_of_a_tab_resumes_once_and_a_duplicated_tab_does_not() {
        let (mut control, start) = (Control::default(), Instant::now());
        let number = control.at(start).take(7, "").unwrap().number;
        let page = number.0;
        assert_eq!(
            control.at(start).resume(7, 8),
            Err(ControlError::Taken { name: format!("page {page}") }),
            "the first page is there"
        );
        control.at(start).leave(7);
        assert_eq!(control.at(start).take(9, ""), Err(ControlError::Taken { name: format!("page {page}") }));
        assert!(control.at(start).resume(6, 8).is_err(), "another key");
        let soon = start + CHANGE / 2;
        assert_eq!(control.at(soon).resume(7, 8).map(|grant| (grant.number, grant.key)), Ok((number, 8)));
        // The former key is that of the duplicate; also a request of the former page may come late.
        control.at(soon).leave(7);
        assert!(control.at(soon).resume(7, 9).is_err() && control.at(soon).check(7).is_err());
        assert_eq!(control.at(soon + CHANGE).renew(8), Ok(()));
        control.at(soon + CHANGE).leave(8);
        assert_eq!(control.at(soon + 2 * CHANGE).resume(8, 9), Err(ControlError::Missing));
        assert!(control.at(soon + 2 * CHANGE).take_abandoned());
    }

    #[test]
    fn a_page_that_has_left_lasts_no_longer_for_its_renewals() {
        let (mut control, start) = (Control::default(), Instant::now());
        control.at(start).take(7, "").unwrap();
        control.at(start).leave(7);
        let _ = control.at(start + CHANGE / 2).renew(7);
        assert!(control.at(start + CHANGE).take_abandoned());
    }

    #[test]
    fn control_goes_to_the_page_that_has_asked_when_it_is_handed_over() {
        let (mut control, start) = (Control::default(), Instant::now());
        control.at(start).take(7, "bench").unwrap();
        let grant = control.at(start).ask(8, "phone").unwrap();
        assert_eq!(control.at(start).asking(), Some("phone"));
        assert_eq!(control.at(start).ask(9, "other"), Err(ControlError::Asked { name: "phone".to_owned() }));
        assert!(control.at(start).check(8).is_err() && control.at(start).hand_over(8).is_err(), "it has only asked");
        control.at(start).hand_over(7).unwrap();
        assert_eq!(name_of_holder(&mut control, start).as_deref(), Some("phone"));
        assert_eq!(control.at(start).holder().map(|holder| holder.grant), Some(grant));
        assert_eq!((control.at(start).check(8), control.at(start).asking()), (Ok(()), None));
        assert_eq!(control.at(start).check(7), Err(ControlError::Taken { name: "phone".to_owned() }));
        assert!(!control.at(start).take_abandoned(), "what was switched by hand stays");
        assert_eq!(control.at(start).hand_over(8), Err(ControlError::NobodyAsks));
    }

    #[test]
    fn who_has_asked_waits_half_a_minute_or_until_somebody_refuses() {
        let (mut control, start) = (Control::default(), Instant::now());
        control.at(start).take(7, "bench").unwrap();
        control.at(start).ask(8, "phone").unwrap();
        control.at(start).refuse(9);
        assert_eq!(control.at(start).asking(), Some("phone"), "neither of the two");
        control.at(start).refuse(7);
        assert_eq!(control.at(start).asking(), None);
        control.at(start).ask(8, "phone").unwrap();
        (1..=ASK.as_secs()).for_each(|s| control.at(start + Duration::from_secs(s)).renew(7).unwrap());
        assert_eq!(control.at(start + ASK).hand_over(7), Err(ControlError::NobodyAsks));
        control.at(start + ASK).release(7);
        assert_eq!(
            control
                .at(start + ASK)
                .ask(8, "phone")
                .map(|grant| control.at(start + ASK).holder().unwrap().grant == grant),
            Ok(true)
        );
    }

    #[test]
    fn a_program_has_control_until_it_ends_and_then_the_arm_is_abandoned() {
        let (mut control, start) = (Control::default(), Instant::now());
        control.at(start).take_as_program(5, "`darm record`").unwrap();
        let taken = ControlError::TakenByProgram { name: "`darm record`".to_owned() };
        assert_eq!(control.at(start).take(8, ""), Err(taken.clone()));
        assert_eq!(control.at(start).ask(8, ""), Err(taken));
        assert_eq!(control.at(start + LEASE / 2).take_as_program(5, "`darm record`"), Ok(()));
        assert!(control.at(start).take_as_program(6, "another").is_err());
        control.at(start).abandon(6);
        assert!(!control.at(start).take_abandoned());
        control.at(start).abandon(5);
        assert_eq!((control.at(start).take_abandoned(), name_of_holder(&mut control, start)), (true, None));
    }
}
