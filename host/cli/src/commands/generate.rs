//! `darm generate`: straight-line Rust or C for one robot or arm.

use std::path::PathBuf;

use darm_generate::{Width, arm, c, robot, rust};
use serde::Serialize;

use super::subject::{Subject, SubjectArgs, frame_of};
use crate::failure::Usage;
use crate::ui::{Answer, Ui};

const EXAMPLES: &str = "\
Examples:
  darm generate puma560.toml --rust > puma560.rs            # f64, no_std, no dependency
  darm generate panda.urdf --rust --f32 --frame panda_hand_tcp > panda.rs   # for a chip
  darm generate tx40.urdf --c > tx40.h                      # a C99 header
  darm generate finger.xml --c --f32 > finger.h             # MJCF, with its rotors
  darm generate puma560.toml --c --function mass_matrix --function gravity > puma560.h
  darm generate planar4.toml --rust --f32 > planar4.rs      # an arm: pose of a word

The file of a robot has forward_kinematics, jacobian, kinematics (both), inverse_dynamics, gravity, mass_matrix and regressor, each \
without loops and branches, and says the shape and the unit of every argument. Its results are those of `darm-core` but for \
rounding. What depends on an angle beyond 1e5 rad (--f32: 6434 rad) is not a number. The file of an arm has pose, and says by how much it may \
differ from the iterations of `darm-core`.";

/// Write straight-line Rust or C of the kinematics and dynamics of one robot, or of the pose of an arm
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Generate {
    /// Arm file, Denavit-Hartenberg table, robot as URDF or MJCF, or its calibrated model from `darm diagnose`
    #[arg(value_name = "MODEL")]
    file: PathBuf,
    /// Write a module of Rust
    #[arg(long, required_unless_present = "c", conflicts_with = "c")]
    rust: bool,
    /// Write a header of C
    #[arg(long)]
    c: bool,
    /// Numbers of 32 bits; default: 64
    #[arg(long)]
    f32: bool,
    /// Write this function alone; may be given several times
    #[arg(long = "function", value_name = "NAME")]
    functions: Vec<String>,
    /// Tool frame of a robot: the name of a link; default: the last one
    #[arg(long, value_name = "LINK")]
    frame: Option<String>,
    /// Fix a joint at a position, in deg or mm; the numbers of the joints after it move up
    #[arg(long = "lock", value_name = "JOINT=Q", allow_hyphen_values = true)]
    locks: Vec<String>,
    /// Read one tree of a URDF or MJCF: the one that begins with this link or body
    #[arg(long, value_name = "BODY")]
    root: Option<String>,
}

#[derive(Serialize)]
struct Source {
    source: String,
}

impl Generate {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let subject = SubjectArgs {
            file: self.file.clone(),
            q: None,
            word: None,
            postures: None,
            locks: self.locks.clone(),
            root: self.root.clone(),
            floating: false,
        };
        let mut module = match subject.subject()? {
            Subject::Robot(robot) => robot::module(&robot, frame_of(&robot, self.frame.as_deref())?)?,
            Subject::Arm(_) if self.frame.is_some() => {
                return Err(Usage("--frame needs a robot; an arm file has one tool".into()).into());
            }
            Subject::Arm(arm) => arm::module(&arm)?,
        };
        for name in &self.functions {
            if !module.functions.iter().any(|function| function.name == name) {
                let names: Vec<_> = module.functions.iter().map(|function| function.name).collect();
                return Err(Usage(format!("--function {name}: the functions are {}", names.join(", "))).into());
            }
        }
        if !self.functions.is_empty() {
            module.functions.retain(|function| self.functions.iter().any(|name| function.name == name));
        }
        let width = if self.f32 { Width::Single } else { Width::Double };
        let source = if self.rust { rust::file(&module, width) } else { c::file(&module, width) };
        ui.print(&Source { source })
    }
}

impl Answer for Source {
    fn text(&self) -> String {
        self.source.trim_end().to_owned()
    }
}
