//! Joints that equality constraints couple, and the constraints that are left to whoever simulates.

use std::collections::{HashMap, HashSet};

use super::classes::{Classes, MAIN, Settled};
use super::fault::{MjcfFault, Wrong};
use super::files::Part;
use crate::assembly::{Following, Followings, Locks};

/// What the equality constraints of a model come to.
#[derive(Default)]
pub(super) struct Coupled {
    pub(super) followings: Followings,
    /// Joints that a constraint holds at a position.
    pub(super) constant: Locks,
    pub(super) warnings: Vec<String>,
}

/// The reference positions of the joints that can follow, by name, in rad or m.
pub(super) type References<'a> = HashMap<&'a str, f64>;

/// Reads the constraints: q₁ − ref₁ = a₀ + a₁·(q₂ − ref₂) is a joint that follows another.
pub(super) fn coupled<'a>(
    root: Part<'a>,
    classes: &'a Classes<'a>,
    references: &References<'a>,
    outside: &HashSet<&str>,
) -> Result<Coupled, Wrong> {
    if let Some(default) = classes.elements().find(|part| part.tag() == "equality" && part.value("active").is_some()) {
        return Err(default.unsupported("a default of active", "give it to each constraint"));
    }
    let mut coupled = Coupled::default();
    for part in root.named("equality").flat_map(Part::children) {
        let constraint = classes.settle(part, MAIN)?;
        if constraint.value("active") == Some("false") {
            continue;
        }
        match part.tag() {
            "joint" => {
                let joints = ["joint1", "joint2"].map(|name| part.value(name));
                match joints.into_iter().flatten().find(|joint| outside.contains(joint)) {
                    None => coupled.add(constraint, references)?,
                    Some(_) if joints.into_iter().flatten().all(|joint| outside.contains(joint)) => {}
                    Some(joint) => {
                        let at = part.place();
                        let text = format!("{at}: `{joint}` is not in the tree that is read: <joint> is not enforced");
                        coupled.warnings.push(text);
                    }
                }
            }
            tag => coupled.warnings.push(format!("{}: <{tag}> is not enforced; its joints move freely", part.place())),
        }
    }
    Ok(coupled)
}

impl Coupled {
    fn add(&mut self, constraint: Settled<'_>, references: &References<'_>) -> Result<(), Wrong> {
        let part = constraint.part;
        let reference = |name: &str| {
            let unknown = MjcfFault::Unknown { what: "hinge or slide joint", name: name.into() };
            references.get(name).copied().ok_or_else(|| part.wrong(unknown))
        };
        let missing = || part.wrong(MjcfFault::Missing { element: "joint".into(), attribute: "joint1" });
        let joint = part.value("joint1").ok_or_else(missing)?;
        let first = reference(joint)?;
        let mut polynomial = constraint.list("polycoef")?;
        polynomial.extend([0.0, 1.0, 0.0, 0.0, 0.0].into_iter().skip(polynomial.len()));
        let (offset, factor) = (polynomial[0], polynomial[1]);
        if polynomial.iter().skip(2).any(|coefficient| *coefficient != 0.0) {
            let at = part.place();
            self.warnings.push(format!("{at}: `{joint}` follows by no straight line: it is not enforced"));
            return Ok(());
        }
        if self.followings.contains_key(joint) || self.constant.contains_key(joint) {
            return Err(part.wrong(MjcfFault::Follows { joint: joint.into() }));
        }
        match part.value("joint2") {
            Some(other) => {
                let offset = first + offset - factor * reference(other)?;
                self.followings.insert(joint.into(), Following { joint: other.into(), factor, offset });
            }
            None => drop(self.constant.insert(joint.into(), first + offset)),
        }
        Ok(())
    }
}
