//! Which of a file is the robot: joints that are fixed on the command line, and the root of its tree.

use darm_core::actuator::JointKind;
use darm_diagnose::linearise::model::Model;
use darm_diagnose::model_file::{Chosen, LockedJoint};
use darm_robot::description;
use darm_robot::robot::Robot;
use darm_robot::source::Source;
use darm_robot::urdf::{Locks, Selection};

use super::Coordinate;
use crate::failure::Usage;

/// Options `--lock JOINT=Q` and `--root BODY`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Part<'a> {
    pub(crate) locks: &'a [String],
    pub(crate) root: Option<&'a str>,
}

impl<'a> Part<'a> {
    /// The robot of a file with these joints fixed.
    pub(crate) fn robot_of(self, source: &Source) -> anyhow::Result<Robot> {
        let free = description::of_source(source, &self.selection(Locks::new()))?;
        free.ignored.iter().for_each(|ignored| eprintln!("note: {ignored}"));
        if self.locks.is_empty() {
            return Ok(free);
        }
        Ok(description::of_source(source, &self.selection(self.fixed(&free)?))?)
    }

    /// The model of a file that is no arm of words with these joints fixed, and what was chosen.
    pub(crate) fn model_of(self, source: &Source) -> anyhow::Result<(Model, Chosen)> {
        let model = Model::of_source(source, &self.selection(Locks::new()))?;
        let root = self.root.map(str::to_owned);
        if let Some(robot) = model.what.robot() {
            robot.ignored.iter().for_each(|ignored| eprintln!("note: {ignored}"));
        } else if root.is_some() {
            return Err(Usage("--root needs a model with a robot".into()).into());
        }
        if self.locks.is_empty() {
            return Ok((model, Chosen { locked: Vec::new(), root }));
        }
        let free = model.what.robot().ok_or_else(|| Usage("--lock needs a model with a robot".into()))?;
        let (locks, locked) = (self.fixed(free)?, self.joints(free)?);
        Ok((Model::of_source(source, &self.selection(locks))?, Chosen { locked, root }))
    }

    fn selection(self, locks: Locks) -> Selection {
        Selection { locks, root: self.root.map(str::to_owned) }
    }

    fn fixed(self, free: &Robot) -> Result<Locks, Usage> {
        self.coordinates(free)?
            .into_iter()
            .map(|(joint, value)| Ok((joint.name.clone(), joint.typed(value)?)))
            .collect()
    }

    fn joints(self, free: &Robot) -> Result<Vec<LockedJoint>, Usage> {
        let locked = |(joint, value): (Coordinate, &str)| {
            // Without the digits that the way through radians adds: 30 deg, not 29.999999999999996.
            let position = (joint.shown(joint.typed(value)?) * 1e9).round() / 1e9;
            Ok(LockedJoint { is_revolute: joint.kind == JointKind::Revolute, name: joint.name, position })
        };
        self.coordinates(free)?.into_iter().map(locked).collect()
    }

    /// The joints with the text of their position. A name that the robot does not have is left to the reader of the file.
    fn coordinates(self, free: &Robot) -> Result<Vec<(Coordinate, &'a str)>, Usage> {
        let coordinate = |text: &'a String| {
            let wrong = || Usage(format!("--lock {text}: give JOINT=Q in deg or mm, such as --lock finger=0"));
            let (name, value) = text.split_once('=').ok_or_else(wrong)?;
            let joint = free.joints.iter().find(|joint| joint.name == name);
            let kind = joint.map_or(JointKind::Revolute, |joint| joint.joint.axis.kind);
            Ok((Coordinate { name: name.to_owned(), kind }, value))
        };
        self.locks.iter().map(coordinate).collect()
    }
}
