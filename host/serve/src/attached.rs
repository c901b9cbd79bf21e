//! Who is at the board: the pages that are open, and the programs that use the port of the server.

use std::time::{Duration, Instant};

use darm_device::client::sharing::Guest;
use serde::{Deserialize, Serialize};

/// A page says once a second that it is there; one that has not for this time has gone.
pub(crate) const PRESENCE: Duration = Duration::from_secs(3);
/// Pages that are listed at most: whoever says more often under other numbers that it is there fills no memory.
const MAX_PAGES: usize = 32;

/// A random number that a page gives itself: the pages of a tab, one after the other, are one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(transparent)]
pub(crate) struct PageId(pub(crate) u32);

/// A page or program, as pages show it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct AttachedView {
    /// What it is called.
    pub name: String,
    /// Whether it is a program.
    pub is_program: bool,
}

/// The list.
#[derive(Debug, Default)]
pub(crate) struct Attached {
    pages: Vec<SeenPage>,
    programs: Vec<Guest>,
}

#[derive(Debug)]
struct SeenPage {
    id: PageId,
    /// What it calls itself.
    given: String,
    /// What it is called by others: `given`, with a number behind it where another page calls itself so.
    name: String,
    seen: Instant,
}

impl Attached {
    /// A page is there, under this name. Whether the list has changed.
    pub(crate) fn see(&mut self, now: Instant, id: PageId, name: &str) -> bool {
        let before = self.pages.len();
        self.pages.retain(|page| now < page.seen + PRESENCE);
        let has_gone = self.pages.len() < before;
        let is_full = self.pages.len() >= MAX_PAGES;
        match self.pages.iter_mut().find(|page| page.id == id) {
            Some(page) if page.given == name => {
                page.seen = now;
                has_gone
            }
            None if is_full => has_gone,
            Some(_) | None => {
                self.pages.retain(|page| page.id != id);
                let numbered = (2..).map(|number| format!("{name} ({number})"));
                let mut names = std::iter::once(name.to_owned()).chain(numbered);
                let is_free = |wanted: &String| self.pages.iter().all(|page| page.name != *wanted);
                let unique = names.find(is_free).unwrap_or_else(|| name.to_owned());
                self.pages.push(SeenPage { id, given: name.to_owned(), name: unique, seen: now });
                true
            }
        }
    }

    /// What this page is called.
    pub(crate) fn name(&self, id: PageId) -> Option<String> {
        self.pages.iter().find(|page| page.id == id).map(|page| page.name.clone())
    }

    pub(crate) fn arrive(&mut self, guest: &Guest) {
        self.programs.push(guest.clone());
    }

    pub(crate) fn leave(&mut self, guest: &Guest) {
        self.programs.retain(|other| other.key != guest.key);
    }

    /// The list for pages: pages first, in the order of their arrival.
    pub(crate) fn view(&self, now: Instant) -> Vec<AttachedView> {
        let pages = self.pages.iter().filter(|page| now < page.seen + PRESENCE);
        let pages = pages.map(|page| AttachedView { name: page.name.clone(), is_program: false });
        let programs = self.programs.iter().map(|guest| AttachedView { name: guest.name.clone(), is_program: true });
        pages.chain(programs).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use darm_device::client::sharing::Guest;

    use super::{Attached, MAX_PAGES, PRESENCE, PageId};

    #[test]
    fn pages_are_listed_while_they_say_that_they_are_there_and_programs_until_they_leave() {
        let (mut attached, start) = (Attached::default(), Instant::now());
        let guest = Guest { key: 9, name: "`darm record`".to_owned(), process: None };
        assert!(attached.see(start, PageId(1), "phone"));
        assert!(!attached.see(start, PageId(1), "phone") && attached.see(start, PageId(1), "bench"));
        attached.arrive(&guest);
        let names = |attached: &Attached, at| attached.view(at).into_iter().map(|one| one.name).collect::<Vec<_>>();
        assert_eq!(names(&attached, start), ["bench", "`darm record`"]);
        assert_eq!(names(&attached, start + PRESENCE), ["`darm record`"]);
        assert!(
            attached.see(start + PRESENCE, PageId(2), "other") && attached.see(start + PRESENCE, PageId(3), "other")
        );
        assert_eq!(names(&attached, start + PRESENCE), ["other", "other (2)", "`darm record`"]);
        assert!(
            attached.see(start + PRESENCE, PageId(3), "third") && attached.name(PageId(3)).as_deref() == Some("third")
        );
        attached.leave(&guest);
        assert_eq!(names(&attached, start + PRESENCE), ["other", "third"]);
        for id in 4..100 {
            attached.see(start + PRESENCE, PageId(id), "flood");
        }
        assert_eq!(names(&attached, start + PRESENCE).len(), MAX_PAGES);
    }
}
