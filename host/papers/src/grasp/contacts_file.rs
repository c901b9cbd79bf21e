//! Contacts that a hand is to make, as a file.
//!
//! | key | meaning |
//! | --- | --- |
//! | `format` | version of this format: 1 |
//! | `[[contact]]` | four of them |
//! | `finger` ? | which finger makes it; of all or of none, and then the assignment is found |
//! | `point_mm` | where the fingertip touches, in the world |
//! | `direction` | which way it pushes, normal to the object's boundary and into it |

use std::ops::Range;
use std::path::Path;

use darm_core::real::Vec3;
use serde::Deserialize;
use toml::Spanned;

use super::contact::{Contact, Contacts};
use super::fault::{ContactFault, ContactsError};
use super::hand::Hand;
use super::layout::FINGERS;
use darm_robot::source::{Number, Source};

const FORMAT: u32 = 1;

/// What a file of contacts asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// The contacts: in the order of the fingers where these are named, else in that of the file.
    pub contacts: Contacts,
    /// Whether the file names the fingers.
    pub is_assigned: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTask {
    format: Spanned<u32>,
    #[serde(default)]
    contact: Vec<Spanned<RawContact>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawContact {
    finger: Option<Spanned<String>>,
    point_mm: [Number; 3],
    direction: Spanned<[Number; 3]>,
}

/// What is wrong, and where in the file.
type Wrong = (Range<usize>, ContactFault);

/// Reads the contacts that a hand is to make.
///
/// # Errors
///
/// The file cannot be read; or as [`parse_contacts`].
pub fn read_contacts(path: &Path, hand: &Hand) -> Result<Task, ContactsError> {
    contacts(&Source::read(path)?, hand)
}

/// The contacts that `text` describes; `path` only serves messages.
///
/// # Errors
///
/// The text is not TOML of this format; there are not as many contacts as fingers; some of them name a finger and
/// others none, or a finger is unknown or named twice; or a contact has no direction. The error names line and column.
pub fn parse_contacts(path: &Path, text: &str, hand: &Hand) -> Result<Task, ContactsError> {
    contacts(&Source::of_text(path, text), hand)
}

fn contacts(source: &Source, hand: &Hand) -> Result<Task, ContactsError> {
    let raw: RawTask = source.parse()?;
    if *raw.format.get_ref() != FORMAT {
        return Err(source.wrong(raw.format.span(), ContactFault::Format { found: *raw.format.get_ref() }));
    }
    task(&raw, hand).map_err(|(span, fault)| source.wrong(span, fault))
}

fn task(raw: &RawTask, hand: &Hand) -> Result<Task, Wrong> {
    let count = || (raw.format.span(), ContactFault::Count { found: raw.contact.len() });
    let listed: Vec<_> = raw.contact.iter().map(|contact| one_contact(contact.get_ref())).collect::<Result<_, _>>()?;
    let listed: Contacts = listed.try_into().map_err(|_| count())?;
    let named = raw.contact.iter().filter(|contact| contact.get_ref().finger.is_some()).count();
    if named == 0 {
        return Ok(Task { contacts: listed, is_assigned: false });
    }
    let mut contacts = [None; FINGERS];
    for (raw, contact) in raw.contact.iter().zip(listed) {
        let Some(finger) = &raw.get_ref().finger else { return Err((raw.span(), ContactFault::Unnamed)) };
        let index = hand.fingers.iter().position(|known| known.name == *finger.get_ref());
        let index = index.ok_or_else(|| {
            let known = hand.fingers.iter().map(|finger| finger.name.clone()).collect();
            (finger.span(), ContactFault::UnknownFinger { finger: finger.get_ref().clone(), known })
        })?;
        if contacts[index].replace(contact).is_some() {
            return Err((finger.span(), ContactFault::Twice { finger: finger.get_ref().clone() }));
        }
    }
    // Four contacts of four different fingers: there is one for each.
    let contacts = std::array::from_fn(|i| contacts[i].unwrap_or(listed[i]));
    Ok(Task { contacts, is_assigned: true })
}

fn one_contact(raw: &RawContact) -> Result<Contact, Wrong> {
    let direction = Vec3::from(raw.direction.get_ref().map(|number| number.0));
    let length = direction.amax();
    if length == 0.0 {
        return Err((raw.direction.span(), ContactFault::NoDirection));
    }
    // Divided by its largest number first: the square of a huge one overflows.
    let direction = (direction / length).normalize();
    Ok(Contact { point: Vec3::from(raw.point_mm.map(|number| 1e-3 * number.0)), direction })
}
