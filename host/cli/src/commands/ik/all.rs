//! `darm ik --all`: every posture that reaches a target, told apart, and as one picture.

use anyhow::Context as _;
use darm_papers::convergence;
use darm_robot::ik::Method;
use darm_robot::ik::configurations::Configurations;
use darm_robot::robot::{Robot, RobotFrame};
use serde::Serialize;

use super::{ALL_STARTS, Ik, Target};
use crate::commands::subject::Coordinate;
use crate::voice::{Answer, Voice, columns, number};

#[derive(Serialize)]
struct All {
    name: String,
    frame: String,
    joints: Vec<String>,
    #[serde(flatten)]
    found: Configurations,
    #[serde(skip)]
    shown: Vec<Coordinate>,
}

impl Ik {
    /// Finds all postures, says them and draws them.
    pub(super) fn tell_all(
        &self,
        robot: &Robot,
        frame: &RobotFrame,
        target: &Target,
        q: &[f64],
        shown: Vec<Coordinate>,
        voice: Voice,
    ) -> anyhow::Result<()> {
        let options = self.options(target, Method::LevenbergMarquardt.usual_steps(), ALL_STARTS);
        let wheel = voice.wheel("searching for postures");
        let found = robot.configurations(frame, &target.pose, q, &options, self.most)?;
        wheel.finish_and_clear();
        if let Some(path) = &self.picture {
            let svg = convergence::postures(robot, frame, &found)?;
            std::fs::write(path, svg).with_context(|| format!("cannot write {}", path.display()))?;
        }
        let joints = shown.iter().map(|joint| joint.name.clone()).collect();
        voice.tell(&All { name: robot.name.clone(), frame: frame.name.clone(), joints, found, shown })
    }
}

impl Answer for All {
    fn text(&self) -> String {
        let Configurations { freedom, postures, starts, reached } = &self.found;
        if postures.is_empty() {
            return format!("no posture: none of {starts} starts reached the target");
        }
        let units = self.shown.iter().map(|joint| format!("{}, {}", joint.name, joint.unit()));
        let head = ["", "met"].into_iter().map(str::to_owned).chain(units).collect();
        let rows = postures.iter().enumerate().map(|(index, posture)| {
            let q = posture.q.iter().zip(&self.shown).map(|(q, joint)| number(joint.shown(*q), 3));
            [(index + 1).to_string(), posture.met.to_string()].into_iter().chain(q).collect()
        });
        let table = columns(&std::iter::once(head).chain(rows).collect::<Vec<_>>());
        let what = match freedom {
            0 => format!("{} postures, each by itself", postures.len()),
            1 => format!(
                "a sample of {} postures: the arm can move along a line without moving the frame",
                postures.len()
            ),
            n => format!(
                "a sample of {} postures: the arm can move in {n} ways without moving the frame",
                postures.len()
            ),
        };
        format!("{what}; {reached} of {starts} starts reached the target\n{table}")
    }
}
