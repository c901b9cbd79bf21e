//! `darm generate`: straight-line Rust or C for one robot.

use std::path::PathBuf;

use darm_generate::{Width, c, robot, rust};
use serde::Serialize;

use super::subject::{SubjectArgs, frame_of};
use crate::ui::{Answer, Ui};

const EXAMPLES: &str = "\
Examples:
  darm generate puma560.toml --rust > puma560.rs            # f64, no_std, no dependency
  darm generate panda.urdf --rust --f32 --frame panda_hand_tcp > panda.rs   # for a chip
  darm generate tx40.urdf --c > tx40.h                      # a C99 header
  darm generate finger.xml --c --f32 > finger.h             # an MJCF, with the inertia of its rotors

The file has forward_kinematics, jacobian, kinematics (both), inverse_dynamics, gravity, mass_matrix and regressor, each \
without loops and branches, and says the shape and the unit of every argument. Its results are those of `darm-core` but for \
rounding. Angles beyond 1e5 rad (--f32: 6434 rad) give what is not a number.";

/// Write straight-line Rust or C of the kinematics and dynamics of one robot
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Generate {
    /// Robot as URDF or MJCF, Denavit-Hartenberg table, or its calibrated model from `darm diagnose`
    #[arg(value_name = "ROBOT")]
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
    /// Tool frame: the name of a link; default: the last one
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
        let robot = subject.subject()?.into_robot("generate")?;
        let module = robot::module(&robot, frame_of(&robot, self.frame.as_deref())?)?;
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
