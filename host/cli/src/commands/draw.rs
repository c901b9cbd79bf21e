//! `darm draw`: drawing of an arm in one posture.

use std::path::PathBuf;

use darm_arm::arm::ArmScratch;
use darm_arm::draw::{Scene, svg};
use serde::Serialize;

use super::subject::{Posture, Subject, SubjectArgs, frame_of};
use crate::failure::Usage;
use crate::output_file::{self, Syntax};
use crate::overwrite::OutputFile;
use crate::ui::{Answer, Ui};

const EXAMPLES: &str = "\
Examples:
  darm draw planar4.toml --word 010110011101 -o arm.svg
  darm draw panda.urdf --q 0,30,0,-90,0,120,45,20 --frame panda_hand_tcp -o panda.svg
  darm draw puma560.toml --q 0,45,-90,0,30,0 --no-names --no-dimensions -o puma.svg

Extended legs are blue, revolute joints orange, prismatic joints blue; the circle is the centre of mass; red, green and \
blue are the axes of the tool. Lengths are in mm between joints or anchors, of a leg with the number of its actuator; the angle of a \
module is that of its top plate against its base plate. A planar arm has one view, any other arm four.";

/// Draw an arm or robot as SVG
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Draw {
    #[command(flatten)]
    subject: SubjectArgs,
    /// SVG file to write
    #[arg(short, long, value_name = "FILE.svg")]
    output: OutputFile,
    /// Frame of a robot to draw as the tool: the name of a link
    #[arg(long, value_name = "LINK")]
    frame: Option<String>,
    /// Omit the names of joints or stages
    #[arg(long)]
    no_names: bool,
    /// Omit lengths and angles
    #[arg(long)]
    no_dimensions: bool,
}

#[derive(Serialize)]
struct Drawn {
    output: PathBuf,
    views: usize,
}

impl Draw {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let subject = self.subject.subject()?;
        let (postures, notes) = self.subject.postures(&subject)?;
        notes.iter().for_each(|note| ui.note(note));
        let [posture] = &postures[..] else {
            return Err(Usage(format!("{} postures given; give one", postures.len())).into());
        };
        let scene = self.scene(&subject, posture)?;
        let ends = scene.lines.iter().flat_map(|line| [line.from, line.to]).chain(scene.com);
        if ends.flat_map(|point| [point.x, point.y, point.z]).any(|number| !number.is_finite()) {
            anyhow::bail!("the drawing has a number that is not finite; give positions and a model of a usual size");
        }
        let views = if scene.is_planar { 1 } else { 4 };
        output_file::write_text(&self.output, Syntax::Svg, &svg(&scene, !self.no_names))?;
        ui.print(&Drawn { output: self.output.to_path_buf(), views })
    }

    fn scene(&self, subject: &Subject, posture: &Posture) -> anyhow::Result<Scene> {
        match subject {
            Subject::Robot(robot) => {
                let tool = frame_of(robot, self.frame.as_deref())?;
                let mut scene = Scene::of_robot(robot, tool, &posture.q)?;
                if !self.no_dimensions {
                    scene.add_dimensions_of_robot(robot, tool, &posture.q)?;
                }
                Ok(scene)
            }
            Subject::Arm(arm) => {
                let mut scratch = ArmScratch::default();
                arm.model.predict(&arm.working_condition(posture.word, &posture.q), &mut scratch)?;
                let mut scene = Scene::of_arm(arm, &scratch, posture.word.iter());
                if !self.no_dimensions {
                    scene.add_dimensions_of_arm(arm, &scratch);
                }
                Ok(scene)
            }
        }
    }
}

impl Answer for Drawn {
    fn text(&self) -> String {
        format!("{} view{} in {}", self.views, if self.views == 1 { "" } else { "s" }, self.output.display())
    }
}
