//! Links and joints of a URDF as a tree: which joints stand on each link, and which link each joint moves.

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use super::elements::{Kind, Named, Wrong};
use super::fault::UrdfFault;
use crate::assembly::{Following, Followings};
use crate::xml::Element;

/// Links and joints by their numbers in the file.
pub(super) struct Hierarchy<'a> {
    pub(super) links: Vec<Named<'a>>,
    pub(super) joints: Vec<Named<'a>>,
    pub(super) root: usize,
    /// The joints on each link.
    pub(super) children: Vec<Vec<usize>>,
    /// The link that each joint moves.
    pub(super) child_of: Vec<usize>,
    /// Whether all links have to be on the root.
    pub(super) is_complete: bool,
}

impl<'a> Hierarchy<'a> {
    pub(super) fn of(robot: Element<'a>, root: Option<&str>) -> Result<Self, Wrong> {
        let (links, joints) = (named(robot, "link")?, named(robot, "joint")?);
        let numbers: HashMap<_, _> = links.iter().enumerate().map(|(index, link)| (link.name, index)).collect();
        let mut children = vec![Vec::new(); links.len()];
        let mut child_of = Vec::with_capacity(joints.len());
        let mut moved_by: Vec<Option<&str>> = vec![None; links.len()];
        for (index, joint) in joints.iter().enumerate() {
            let link = |link: &str| {
                let unknown = || UrdfFault::UnknownLink { joint: joint.name.into(), link: link.into() };
                numbers.get(link).copied().ok_or_else(|| joint.wrong(unknown()))
            };
            let (parent, child) = (link(joint.link("parent")?)?, link(joint.link("child")?)?);
            if let Some(first) = moved_by[child].replace(joint.name) {
                let (first, second) = (first.to_owned(), joint.name.to_owned());
                return Err(joint.wrong(UrdfFault::TwoParents { link: links[child].name.into(), first, second }));
            }
            children[parent].push(index);
            child_of.push(child);
        }
        if let Some(root) = root.filter(|_| !links.is_empty()) {
            let unknown = || {
                let known = links.iter().map(|link| link.name.to_owned()).collect();
                (robot.span(), UrdfFault::UnknownRoot { root: root.into(), known })
            };
            let root = numbers.get(root).copied().ok_or_else(unknown)?;
            return Ok(Self { links, joints, root, children, child_of, is_complete: false });
        }
        let roots: Vec<_> = (0..links.len()).filter(|&link| moved_by[link].is_none()).collect();
        match roots[..] {
            _ if links.is_empty() => Err((robot.span(), UrdfFault::Empty)),
            [root] => Ok(Self { links, joints, root, children, child_of, is_complete: true }),
            _ => {
                let roots = roots.iter().map(|&root| links[root].name.to_owned()).collect();
                Err((robot.span(), UrdfFault::Roots { roots }))
            }
        }
    }

    /// The joints on the root.
    fn in_tree(&self) -> impl Iterator<Item = &Named<'a>> {
        let mut ahead = self.children[self.root].clone();
        // A loop has no way from the root, but where the root is in it.
        let mut left = self.joints.len();
        std::iter::from_fn(move || {
            let joint = ahead.pop().filter(|_| left > 0)?;
            left -= 1;
            ahead.extend(&self.children[self.child_of[joint]]);
            Some(&self.joints[joint])
        })
    }

    /// The joints that mimic others. `Err`: one mimics itself, or what does not move.
    pub(super) fn mimics(&self) -> Result<(Followings, HashMap<&'a str, Range<usize>>), Wrong> {
        let moving: BTreeMap<_, _> = self
            .in_tree()
            .filter(|joint| matches!(joint.kind(), Ok(Kind::Moving { .. })))
            .map(|joint| (joint.name, *joint))
            .collect();
        let (mut mimics, mut places) = (Followings::new(), HashMap::new());
        for joint in moving.values() {
            let Some((following, place)) = joint.mimic()? else { continue };
            let Following { joint: other, .. } = &following;
            if !moving.contains_key(other.as_str()) {
                let known = moving.keys().map(|name| (*name).to_owned()).collect();
                let fault = UrdfFault::UnknownMimic { joint: joint.name.into(), other: other.clone(), known };
                return Err((place, fault));
            }
            places.insert(joint.name, place);
            mimics.insert(joint.name.to_owned(), following);
        }
        Ok((mimics, places))
    }
}

/// The children of this tag, by names that differ.
pub(super) fn named<'a>(robot: Element<'a>, tag: &'static str) -> Result<Vec<Named<'a>>, Wrong> {
    let (mut found, mut names) = (Vec::new(), HashMap::new());
    for element in robot.children().filter(|child| child.tag() == tag) {
        let named = Named::new(element)?;
        if names.insert(named.name, ()).is_some() {
            return Err(named.wrong(UrdfFault::Duplicate { element: tag, name: named.name.into() }));
        }
        found.push(named);
    }
    Ok(found)
}
