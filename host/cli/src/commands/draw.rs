//! `darm draw`: a picture of an arm in one posture.

use std::path::PathBuf;

use anyhow::Context as _;
use darm_arm::arm::ArmScratch;
use darm_arm::draw::{Scene, svg};
use serde::Serialize;

use super::subject::{Given, Posture, Subject, frame_of};
use crate::failure::Usage;
use crate::voice::{Answer, Voice};

const EXAMPLES: &str = "\
Examples:
  darm draw planar4.toml --word 010110011101 -o arm.svg
  darm draw panda.urdf --q 0,30,0,-90,0,120,45,20,20 --frame panda_hand_tcp -o panda.svg
  darm draw puma560.toml --q 0,45,-90,0,30,0 --no-names -o puma.svg

Legs are blue when they are extended, joints orange when they turn and blue when they slide; the circle is \
the centre of mass, red, green and blue the axes of the tool. A planar arm has one view, any other four.";

/// Draw an arm or robot as SVG
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Draw {
    #[command(flatten)]
    given: Given,
    /// The picture
    #[arg(short, long, value_name = "FILE.svg")]
    output: PathBuf,
    /// Frame of a robot that is taken as the tool
    #[arg(long, value_name = "LINK")]
    frame: Option<String>,
    /// Leave out the names of joints or stages
    #[arg(long)]
    no_names: bool,
}

#[derive(Serialize)]
struct Drawn {
    output: PathBuf,
    views: usize,
}

impl Draw {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let subject = self.given.subject()?;
        let (postures, notes) = self.given.postures(&subject)?;
        notes.iter().for_each(|note| voice.note(note));
        let [posture] = &postures[..] else {
            return Err(Usage(format!("{} postures make no picture, give one", postures.len())).into());
        };
        let scene = self.scene(&subject, posture)?;
        let views = if scene.is_planar { 1 } else { 4 };
        std::fs::write(&self.output, svg(&scene, !self.no_names))
            .with_context(|| format!("cannot write {}", self.output.display()))?;
        voice.tell(&Drawn { output: self.output.clone(), views })
    }

    fn scene(&self, subject: &Subject, posture: &Posture) -> anyhow::Result<Scene> {
        match subject {
            Subject::Robot(robot) => Ok(Scene::of_robot(robot, frame_of(robot, self.frame.as_deref())?, &posture.q)?),
            Subject::Arm(arm) => {
                let mut scratch = ArmScratch::default();
                arm.model.predict(&arm.model.nominal(posture.word, &posture.q), &mut scratch)?;
                Ok(Scene::of_arm(arm, &scratch, posture.word.iter()))
            }
        }
    }
}

impl Answer for Drawn {
    fn text(&self) -> String {
        format!("{} view{} in {}", self.views, if self.views == 1 { "" } else { "s" }, self.output.display())
    }
}
