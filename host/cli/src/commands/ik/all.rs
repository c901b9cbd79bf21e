//! `darm ik --all`: all postures that reach a target, as a list and as a plot.

use darm_papers::convergence;
use darm_robot::ik::Method;
use darm_robot::ik::configurations::Configurations;
use darm_robot::robot::{Robot, RobotFrame};
use serde::Serialize;

use super::{ALL_STARTS, Ik, Target};
use crate::commands::subject::Coordinate;
use crate::output_file::{self, Syntax};
use crate::ui::{Answer, Ui, columns, number};

/// All postures that were found.
#[derive(Serialize)]
pub(super) struct All {
    name: String,
    frame: String,
    joints: Vec<String>,
    #[serde(flatten)]
    found: Configurations,
    #[serde(skip)]
    shown: Vec<Coordinate>,
}

impl All {
    pub(super) fn new(robot: &Robot, frame: &RobotFrame, found: Configurations, shown: Vec<Coordinate>) -> Self {
        let joints = shown.iter().map(|joint| joint.name.clone()).collect();
        Self { name: robot.name.clone(), frame: frame.name.clone(), joints, found, shown }
    }
}

impl Ik {
    /// Finds all postures from this one on, and plots them where a file is named for it.
    pub(super) fn all_postures(
        &self,
        robot: &Robot,
        frame: &RobotFrame,
        target: &Target,
        q: &[f64],
        ui: Ui,
    ) -> anyhow::Result<Configurations> {
        let options = self.options(target, Method::LevenbergMarquardt.usual_steps(), ALL_STARTS);
        let spinner = ui.spinner("searching for postures");
        let found = robot.configurations(frame, &target.pose, q, &options, self.count)?;
        spinner.finish_and_clear();
        if let Some(path) = &self.plot {
            let svg = convergence::postures(robot, frame, &found)?;
            output_file::write_text(path, Syntax::Svg, &svg)?;
        }
        Ok(found)
    }
}

impl Answer for All {
    fn text(&self) -> String {
        let Configurations { freedom, postures, starts, reached } = &self.found;
        if postures.is_empty() {
            return format!("no posture found: none of {starts} starts reached the target");
        }
        let units = self.shown.iter().map(|joint| format!("{}, {}", joint.name, joint.unit()));
        let head = ["posture", "starts"].into_iter().map(str::to_owned).chain(units).collect();
        let rows = postures.iter().enumerate().map(|(index, posture)| {
            let q = posture.q.iter().zip(&self.shown).map(|(q, joint)| number(joint.shown(*q), 3));
            [(index + 1).to_string(), posture.met.to_string()].into_iter().chain(q).collect()
        });
        let table = columns(&std::iter::once(head).chain(rows).collect::<Vec<_>>());
        let what = match freedom {
            0 => format!("{} isolated postures", postures.len()),
            1 => format!("a sample of {} postures: the arm has 1 degree of freedom of self-motion", postures.len()),
            n => format!("a sample of {} postures: the arm has {n} degrees of freedom of self-motion", postures.len()),
        };
        format!("{what}; {reached} of {starts} starts reached the target\n{table}")
    }
}
