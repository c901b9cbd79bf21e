//! Commands that come while another has the port: who of them may change something.

use std::sync::{Mutex, MutexGuard, PoisonError};

use darm_device::client::sharing::{Guest, Rights};

/// What a command that has the port does with the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// It moves the arm or stores something on the board: guests read and stop.
    Controls,
    /// It reads: the first guest that changes something has control until it ends.
    Watches,
}

/// The rights of guests at the port of a command.
pub(crate) struct CommandRights {
    /// The command itself, where it has control.
    holder: Option<String>,
    guest: Mutex<Option<Guest>>,
}

impl CommandRights {
    /// The rights at the port of this command, `name`.
    pub(crate) fn new(role: Role, name: String) -> Self {
        Self { holder: (role == Role::Controls).then_some(name), guest: Mutex::default() }
    }

    fn guest(&self) -> MutexGuard<'_, Option<Guest>> {
        self.guest.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Rights for CommandRights {
    fn arrive(&self, _: &Guest) {}

    fn stay(&self, _: &Guest) {}

    fn take_control(&self, guest: &Guest) -> Result<(), String> {
        let mut controls = self.guest();
        match self.holder.as_ref().or(controls.as_ref().map(|other| &other.name)) {
            Some(name) if controls.as_ref() != Some(guest) => Err(format!("{name} controls the arm; end it first")),
            Some(_) | None => {
                *controls = Some(guest.clone());
                Ok(())
            }
        }
    }

    fn leave(&self, guest: &Guest) {
        self.guest().take_if(|other| other == guest);
    }
}

#[cfg(test)]
mod tests {
    use darm_device::client::sharing::{Guest, Rights as _};

    use super::{CommandRights, Role};

    #[test]
    fn one_guest_at_a_time_changes_something_and_none_while_the_command_does() {
        let guest = |key, name: &str| Guest { key, name: name.to_owned(), process: None };
        let (play, table) = (guest(1, "`darm play`"), guest(2, "`darm upload`"));
        let rights = CommandRights::new(Role::Watches, "`darm status --watch`".to_owned());
        assert_eq!([(); 2].map(|()| rights.take_control(&play)), [Ok(()), Ok(())]);
        assert_eq!(rights.take_control(&table).unwrap_err(), "`darm play` controls the arm; end it first");
        rights.leave(&table);
        assert!(rights.take_control(&table).is_err());
        rights.leave(&play);
        assert_eq!(rights.take_control(&table), Ok(()));
        let rights = CommandRights::new(Role::Controls, "`darm record`".to_owned());
        assert_eq!(rights.take_control(&play).unwrap_err(), "`darm record` controls the arm; end it first");
    }
}
