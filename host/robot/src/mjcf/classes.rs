//! Default classes: attributes that elements of a class have where they do not say otherwise.

use std::collections::HashMap;

use super::fault::{MjcfFault, Wrong};
use super::files::Part;
use crate::xml::Attribute;

/// The class of elements that name none.
pub(super) const MAIN: &str = "main";

/// All default classes of a model.
pub(super) struct Classes<'a> {
    classes: HashMap<&'a str, Class<'a>>,
}

#[derive(Default)]
struct Class<'a> {
    parent: Option<&'a str>,
    /// Elements that give defaults; of two with one tag the later counts.
    elements: Vec<Part<'a>>,
}

/// An element with the attributes of its class.
#[derive(Clone, Copy)]
pub(super) struct Settled<'a> {
    pub(super) part: Part<'a>,
    classes: &'a Classes<'a>,
    class: &'a str,
}

impl<'a> Classes<'a> {
    pub(super) fn of(root: Part<'a>) -> Result<Self, Wrong> {
        let mut classes = HashMap::from([(MAIN, Class::default())]);
        let mut ahead: Vec<(Part<'a>, Option<&'a str>)> = root.named("default").map(|part| (part, None)).collect();
        ahead.reverse();
        while let Some((part, parent)) = ahead.pop() {
            let missing = || part.wrong(MjcfFault::Missing { element: "default".into(), attribute: "class" });
            let name = match parent {
                None => MAIN,
                Some(_) => part.value("class").ok_or_else(missing)?,
            };
            let class: &mut Class<'a> = classes.entry(name).or_default();
            class.parent = parent;
            let mut inner: Vec<_> = Vec::new();
            for child in part.children() {
                match child.tag() {
                    "default" => inner.push((child, Some(name))),
                    _ => class.elements.push(child),
                }
            }
            ahead.extend(inner.into_iter().rev());
        }
        Ok(Self { classes })
    }

    /// The class that an element names, or else this one.
    pub(super) fn class(&self, part: Part<'a>, key: &str, class: &'a str) -> Result<&'a str, Wrong> {
        let Some(attribute) = part.attribute(key) else { return Ok(class) };
        match self.classes.get_key_value(attribute.value.as_str()) {
            Some(_) => Ok(&attribute.value),
            None => {
                let unknown = MjcfFault::Unknown { what: "default class", name: attribute.value.clone() };
                Err(Wrong { span: attribute.span.clone(), ..part.wrong(unknown) })
            }
        }
    }

    /// An element in a body or list whose class is this one.
    pub(super) fn settle(&'a self, part: Part<'a>, class: &'a str) -> Result<Settled<'a>, Wrong> {
        Ok(Settled { part, classes: self, class: self.class(part, "class", class)? })
    }

    /// Elements that give defaults.
    pub(super) fn elements(&self) -> impl Iterator<Item = Part<'a>> {
        self.classes.values().flat_map(|class| class.elements.iter().copied())
    }
}

impl<'a> Settled<'a> {
    /// An attribute of the element or of its classes, the innermost first.
    fn all(self, name: &str) -> impl Iterator<Item = (Part<'a>, &'a Attribute)> {
        let own = self.part.attribute(name).map(|attribute| (self.part, attribute));
        let class = |name: &&'a str| self.classes.classes.get(*name).and_then(|class| class.parent);
        let classes = std::iter::successors(Some(self.class), class);
        let elements = classes.filter_map(|class| self.classes.classes.get(class));
        let name = name.to_owned();
        let defaults = elements.flat_map(move |class| {
            let of_tag = class.elements.iter().rev().filter(move |element| element.tag() == self.part.tag());
            let name = name.clone();
            of_tag.filter_map(move |element| Some((*element, element.attribute(&name)?))).collect::<Vec<_>>()
        });
        own.into_iter().chain(defaults)
    }

    /// The text of an attribute.
    pub(super) fn value(self, name: &str) -> Option<&'a str> {
        self.all(name).next().map(|(_, attribute)| attribute.value.as_str())
    }

    /// Whether the element or a class of it has the attribute.
    pub(super) fn has(self, name: &str) -> bool {
        self.all(name).next().is_some()
    }

    /// One number.
    pub(super) fn number(self, name: &str) -> Result<Option<f64>, Wrong> {
        let Some((part, attribute)) = self.all(name).next() else { return Ok(None) };
        let number = attribute.numbers().and_then(|numbers| numbers.first().copied());
        number.map(Some).ok_or_else(|| part.wrong_value(attribute, "a finite number"))
    }

    /// As many numbers.
    pub(super) fn numbers<const N: usize>(self, name: &str) -> Result<Option<[f64; N]>, Wrong> {
        let Some((part, attribute)) = self.all(name).next() else { return Ok(None) };
        let wrong = || match N {
            2 => part.wrong_value(attribute, "two finite numbers"),
            3 => part.wrong_value(attribute, "three finite numbers"),
            4 => part.wrong_value(attribute, "four finite numbers"),
            _ => part.wrong_value(attribute, "six finite numbers"),
        };
        attribute.numbers().and_then(|numbers| numbers.try_into().ok()).map(Some).ok_or_else(wrong)
    }

    /// A list whose first numbers an inner class may replace, and the others stay.
    pub(super) fn list(self, name: &str) -> Result<Vec<f64>, Wrong> {
        let mut list = Vec::new();
        for (part, attribute) in self.all(name) {
            let wrong = || part.wrong_value(attribute, "finite numbers");
            list.extend(attribute.numbers().ok_or_else(wrong)?.into_iter().skip(list.len()));
        }
        Ok(list)
    }

    /// The fault that an attribute is not what it should be.
    pub(super) fn wrong_value(self, name: &str, expected: &'static str) -> Wrong {
        match self.all(name).next() {
            Some((part, attribute)) => part.wrong_value(attribute, expected),
            None => self.part.wrong(MjcfFault::Missing { element: self.part.tag().into(), attribute: expected }),
        }
    }
}
