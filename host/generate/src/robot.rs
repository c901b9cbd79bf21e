//! The functions of a robot: kinematics and dynamics of the core, recorded for its joints.

use darm_core::dynamics::{self, Regressor};
use darm_core::real::{Mat3, Vec3, real};
use darm_core::se::Pose;
use darm_core::tree::{Body, Frames, Link, LinkFrame, Symmetric, Tree, TreeError, Turn};
use darm_robot::robot::{Coupling, Robot, RobotFrame};

use crate::function::{Constant, Function, Input, Module};
use crate::recording::{Signature, Written, recorded_function};
use crate::scalar::{RecordError, Recorded};

/// Joints that a generated file can have: code without loops of more would be slower than the general one.
pub const MAX_JOINTS: usize = 32;

/// Why there is no file for a robot.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RobotRefusal {
    /// The robot has no joint.
    #[error("{0} has no joint that moves: there is nothing to generate")]
    NoJoint(String),
    /// The robot has too many.
    #[error("{robot} has {joints} joints, straight-line code is written for up to {MAX_JOINTS}; fix some with --lock")]
    Joints {
        /// Name of the robot.
        robot: String,
        /// How many it has.
        joints: usize,
    },
    /// The base floats.
    #[error("{0} has a floating base, generated code is for a fixed one; fix the joint of its root in the file")]
    Floating(String),
    /// Its joints are no tree.
    #[error(transparent)]
    Tree(#[from] TreeError),
    /// The core's code cannot be recorded.
    #[error("{function}: {reason}")]
    Record {
        /// The function that is recorded.
        function: &'static str,
        /// Why it cannot be.
        reason: RecordError,
    },
}

/// The functions of `robot` for its frame `tool`.
///
/// # Errors
///
/// The robot has no or too many joints, a floating base, or joints that are no tree.
pub fn module(robot: &Robot, tool: &RobotFrame) -> Result<Module, RobotRefusal> {
    if robot.floating {
        return Err(RobotRefusal::Floating(robot.name.clone()));
    }
    match robot.joints.len() {
        0 => Err(RobotRefusal::NoJoint(robot.name.clone())),
        1..=8 => of_size::<8>(robot, tool),
        9..=MAX_JOINTS => of_size::<MAX_JOINTS>(robot, tool),
        joints => Err(RobotRefusal::Joints { robot: robot.name.clone(), joints }),
    }
}

/// A robot as the recording reads it, with N joints of which the first count.
struct Subject<'a, const N: usize> {
    robot: &'a Robot,
    tree: Tree<Recorded, N>,
    tool: LinkFrame<Recorded>,
    coupling: Coupling,
}

/// One number, of the joints' positions and their rates.
type State<const N: usize> = [[Recorded; N]; 3];

fn of_size<const N: usize>(robot: &Robot, tool: &RobotFrame) -> Result<Module, RobotRefusal> {
    let tree = robot.tree::<N>()?;
    let at = tool.in_tree(&tree);
    let subject = Subject {
        robot,
        tree: recorded(&tree),
        tool: LinkFrame { link: at.link, pose: pose(&at.pose) },
        coupling: robot.coupling(),
    };
    let parameters = (0..robot.joints.len()).flat_map(|link| parameters(&tree, link)).collect();
    Ok(Module {
        name: robot.name.clone(),
        about: about(robot, tool, &subject.coupling),
        constants: vec![Constant {
            name: "PARAMETERS",
            about: "Ten inertial parameters of each link in the frame of its joint: m (kg), m·c_x, m·c_y, m·c_z (kg·m), I_xx, \
                    I_xy, I_yy, I_xz, I_yz, I_zz about the frame's origin (kg·m²)."
                .into(),
            columns: 10,
            entries: parameters,
        }],
        functions: subject.functions()?,
    })
}

/// What the file says of the robot.
fn about(robot: &Robot, tool: &RobotFrame, coupling: &Coupling) -> Vec<String> {
    let coordinates: Vec<_> = coupling.coordinates().iter().map(|&joint| robot.joints[joint].name.as_str()).collect();
    let mut lines = vec![
        format!("Kinematics and dynamics of {}.", robot.name),
        format!("Coordinates, base first: {}.", coordinates.join(", ")),
        format!("Tool: {}. Gravity: {:?} m/s² in the frame of the base.", tool.name, robot.gravity.as_slice()),
        "Positions in rad or m, velocities and accelerations in rad or m per s and s², torques in N·m, forces in N. Angular parts \
         come before linear ones. The inertia of rotors is included, friction is not."
            .into(),
    ];
    let followers = robot.joints.iter().filter_map(|joint| {
        let mimic = joint.mimic?;
        let other = &robot.joints[mimic.joint].name;
        Some(format!(
            "Joint {} follows {other}: {:?} times its position plus {:?}.",
            joint.name, mimic.factor, mimic.offset
        ))
    });
    lines.extend(followers);
    lines
}

impl<const N: usize> Subject<'_, N> {
    fn functions(&self) -> Result<Vec<Function>, RobotRefusal> {
        let n = self.coupling.len();
        let list = |name, about: &str| Input { name, len: n, about: about.into() };
        let q = || vec![list("q", "positions, rad or m")];
        let motion = || {
            vec![
                list("q", "positions, rad or m"),
                list("qd", "velocities, rad/s or m/s"),
                list("qdd", "accelerations, rad/s² or m/s²"),
            ]
        };
        let torque = |entries| {
            vec![Written { name: "torque", shape: vec![n], about: "of each coordinate, N·m or N".into(), entries }]
        };
        let function = |name, about: &str, reads, code: &dyn Fn(&State<N>) -> Vec<Written>| {
            recorded_function(Signature { name, about: about.into(), digits: 0, inputs: reads }, None, |read| {
                code(&self.state(read))
            })
            .map_err(|reason| RobotRefusal::Record { function: name, reason })
        };
        Ok(vec![
            function("forward_kinematics", "Pose of the tool in the frame of the base.", q(), &|[q, ..]| self.pose(q))?,
            function("jacobian", "Jacobian of the tool along the axes of the base.", q(), &|[q, ..]| {
                vec![self.jacobian(&self.frames(q))]
            })?,
            function(
                "kinematics",
                "Pose of the tool in the frame of the base, and its Jacobian along the axes of the base.",
                q(),
                &|[q, ..]| {
                    let frames = self.frames(q);
                    let mut written = written_pose(&frames.pose(&self.tool));
                    written.push(self.jacobian(&frames));
                    written
                },
            )?,
            function("inverse_dynamics", "Torques of a motion.", motion(), &|[q, qd, qdd]| {
                let mut torques = dynamics::inverse_dynamics(&self.tree, q, qd, qdd, None);
                for ((torque, joint), qdd) in torques.iter_mut().zip(&self.robot.joints).zip(qdd) {
                    *torque += *qdd * real(joint.armature);
                }
                torque(self.torques(&torques))
            })?,
            function("gravity", "Torques that hold the robot against gravity.", q(), &|[q, ..]| {
                torque(self.torques(&dynamics::gravity(&self.tree, &self.frames(q))))
            })?,
            function("mass_matrix", "Mass matrix.", q(), &|[q, ..]| vec![self.mass_matrix(q)])?,
            function(
                "regressor",
                "Regressor: its product with PARAMETERS is the torque of the motion without the inertia of rotors.",
                motion(),
                &|state| vec![self.regressor(state)],
            )?,
        ])
    }

    /// Positions, velocities and accelerations of all joints from those of the coordinates.
    fn state(&self, read: &[Vec<Recorded>]) -> State<N> {
        let rows = self.coupling.rows();
        std::array::from_fn(|order| {
            std::array::from_fn(|joint| match (rows.get(joint), read.get(order)) {
                (Some(row), Some(list)) => {
                    let offset = if order == 0 { row.offset } else { 0.0 };
                    list[row.coordinate] * real(row.factor) + real(offset)
                }
                _ => real(0.0),
            })
        })
    }

    fn frames(&self, q: &[Recorded; N]) -> Frames<Recorded, N> {
        let mut frames = Frames::default();
        self.tree.place(q, &mut frames);
        frames
    }

    fn pose(&self, q: &[Recorded; N]) -> Vec<Written> {
        written_pose(&self.tree.pose(&self.tool, q))
    }

    fn jacobian(&self, frames: &Frames<Recorded, N>) -> Written {
        let joints = self.tree.jacobian_base(&self.tool, frames);
        let rows = (0..6).flat_map(|row| self.torques(&std::array::from_fn(|joint| joints[(row, joint)])));
        Written {
            name: "jacobian",
            shape: vec![6, self.coupling.len()],
            about: "angular velocity (rows 0 to 2, rad/s) and velocity (rows 3 to 5, m/s) of the tool per rad/s or m/s"
                .into(),
            entries: rows.collect(),
        }
    }

    /// Cᵀ τ: what is linear in the joints, at the coordinates.
    fn torques(&self, joints: &[Recorded; N]) -> Vec<Recorded> {
        let mut sums = vec![real(0.0); self.coupling.len()];
        for (row, value) in self.coupling.rows().iter().zip(joints) {
            sums[row.coordinate] += *value * real(row.factor);
        }
        sums
    }

    fn mass_matrix(&self, q: &[Recorded; N]) -> Written {
        let mut joints = dynamics::mass_matrix(&self.tree, q);
        for (index, joint) in self.robot.joints.iter().enumerate() {
            joints[(index, index)] += real(joint.armature);
        }
        let n = self.coupling.len();
        // Cᵀ M, whose rows are those of the coordinates, then its product with C.
        let columns: Vec<_> =
            (0..N).map(|column| self.torques(&std::array::from_fn(|row| joints[(row, column)]))).collect();
        let rows = (0..n).flat_map(|row| self.torques(&std::array::from_fn(|column| columns[column][row])));
        Written {
            name: "mass",
            shape: vec![n, n],
            about: "symmetric, kg·m² of coordinates that turn, kg of those that slide".into(),
            entries: rows.collect(),
        }
    }

    fn regressor(&self, [q, qd, qdd]: &State<N>) -> Written {
        let mut of_joints: Box<Regressor<Recorded, N>> = Box::new([[[real(0.0); 10]; N]; N]);
        dynamics::regressor(&self.tree, &self.frames(q), [q, qd, qdd], &mut of_joints);
        let (n, links) = (self.coupling.len(), self.robot.joints.len());
        let mut entries = vec![real(0.0); n * links * 10];
        for (joint, row) in self.coupling.rows().iter().enumerate() {
            let sums = &mut entries[row.coordinate * links * 10..][..links * 10];
            for (sum, entry) in sums.iter_mut().zip(of_joints[joint].as_flattened()) {
                *sum += *entry * real(row.factor);
            }
        }
        Written {
            name: "regressor",
            shape: vec![n, links, 10],
            about: "torque per inertial parameter of each link, in the order of PARAMETERS".into(),
            entries,
        }
    }
}

/// The inertial parameters of a link, without what is a rounding of zero.
fn parameters<const N: usize>(tree: &Tree<f64, N>, link: usize) -> [f64; 10] {
    let [mass, first @ .., xx, xy, yy, xz, yz, zz] = tree.parameters(link);
    let (first, second) = (without_rounding(first), without_rounding([xx, xy, yy, xz, yz, zz]));
    let ([x, y, z], [xx, xy, yy, xz, yz, zz]) = (first, second);
    [mass, x, y, z, xx, xy, yy, xz, yz, zz]
}

/// Numbers of one kind: those that are a rounding of the largest one are zero.
fn without_rounding<const K: usize>(numbers: [f64; K]) -> [f64; K] {
    let largest = numbers.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    numbers.map(|x| if x.abs() <= 8.0 * f64::EPSILON * largest { 0.0 } else { x })
}

pub(crate) fn written_pose(pose: &Pose<Recorded>) -> Vec<Written> {
    let rotation = pose.rotation.transpose().iter().copied().collect();
    vec![
        Written { name: "rotation", shape: vec![3, 3], about: "axes of the tool as columns".into(), entries: rotation },
        Written {
            name: "position",
            shape: vec![3],
            about: "origin of the tool, m".into(),
            entries: pose.position.iter().copied().collect(),
        },
    ]
}

/// Where a direction is that of an axis but for rounding, it is the axis.
fn snapped(x: f64, scale: f64) -> Recorded {
    let tiny = 8.0 * f64::EPSILON;
    let nearest = (x / scale).round();
    let is_exact = nearest.abs() <= 1.0 && (x / scale - nearest).abs() <= tiny;
    real(if is_exact { nearest * scale } else { x })
}

fn turned(matrix: &Mat3<f64>) -> Mat3<Recorded> {
    matrix.map(|x| snapped(x, 1.0))
}

fn vector(v: &Vec3<f64>) -> Vec3<Recorded> {
    Vec3::from(without_rounding((*v).into()).map(real))
}

fn pose(pose: &Pose<f64>) -> Pose<Recorded> {
    Pose { rotation: turned(&pose.rotation), position: vector(&pose.position) }
}

fn body(body: &Body<f64>) -> Body<Recorded> {
    let i = &body.inertia;
    let [xx, xy, yy, xz, yz, zz] = without_rounding([i.xx, i.xy, i.yy, i.xz, i.yz, i.zz]).map(real);
    Body { mass: real(body.mass), moment: vector(&body.moment), inertia: Symmetric { xx, xy, yy, xz, yz, zz } }
}

fn turn(turn: &Turn<f64>) -> Turn<Recorded> {
    match turn {
        Turn::None => Turn::None,
        Turn::Quarter => Turn::Quarter,
        Turn::QuarterBack => Turn::QuarterBack,
        Turn::AboutX { cosine, sine } => Turn::AboutX { cosine: snapped(*cosine, 1.0), sine: snapped(*sine, 1.0) },
        Turn::Full(matrix) => Turn::Full(turned(matrix)),
    }
}

/// The tree in recorded numbers.
fn recorded<const N: usize>(tree: &Tree<f64, N>) -> Tree<Recorded, N> {
    let link = |link: &Link<f64>| Link {
        parent: link.parent,
        kind: link.kind,
        turn: turn(&link.turn),
        origin: vector(&link.origin),
        offset: snapped(link.offset, std::f64::consts::FRAC_PI_2),
        body: body(&link.body),
        turned: turned(&link.turned),
    };
    Tree { links: tree.links.each_ref().map(link), base: body(&tree.base), gravity: vector(&tree.gravity) }
}
