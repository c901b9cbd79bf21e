//! Recorded functions of robots give what `darm-robot` computes, which has its own recursions at run-time size.

use std::path::Path;

use darm_generate::graph::Arguments;
use darm_generate::robot::module;
use darm_generate::{Function, Module, Width, c, rust};
use darm_robot::description::read;
use darm_robot::robot::{Motion, Robot};
use darm_robot::urdf::Locks;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// The robot of an example file and its module.
fn recorded(file: &str) -> (Robot, Module) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(file);
    let robot = read(path.as_path(), &Locks::new()).unwrap();
    let module = module(&robot, robot.tool().unwrap()).unwrap();
    (robot, module)
}

fn function<'a>(module: &'a Module, name: &str) -> &'a Function {
    module.functions.iter().find(|function| function.name == name).unwrap()
}

/// The largest difference over the largest number of either.
fn apart(ours: &[f64], theirs: &[f64]) -> f64 {
    assert_eq!(ours.len(), theirs.len());
    let size = ours.iter().chain(theirs).fold(1e-3, |size: f64, x| size.max(x.abs()));
    ours.iter().zip(theirs).fold(0.0, |apart: f64, (a, b)| apart.max((a - b).abs())) / size
}

/// Revolute and prismatic joints, branches, rotors, joints that follow others, axes in any direction.
const FILES: [&str; 7] =
    ["puma560.toml", "panda.urdf", "tx40.urdf", "planar5.urdf", "finger.xml", "allegro_hand.urdf", "leap_hand.xml"];

#[test]
fn recorded_functions_are_those_of_the_robot() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for file in FILES {
        let (robot, module) = recorded(file);
        let (n, tool) = (robot.coupling().len(), robot.tool().unwrap());
        for _ in 0..4 {
            let [q, qd, qdd] =
                [3.0, 1.0, 1.0].map(|most| (0..n).map(|_| random.random_range(-most..most)).collect::<Vec<f64>>());
            let state = [&q[..], &qd, &qdd];
            let kinematics = robot.kinematics(tool, &q).unwrap();
            let equation = robot.dynamics(&Motion { state, load: None }).unwrap();
            let rotation: Vec<f64> = kinematics.pose_base_frame.rotation.transpose().iter().copied().collect();
            let position = kinematics.pose_base_frame.position.as_slice().to_vec();
            let jacobian: Vec<f64> = kinematics.jacobian_base.transpose().iter().copied().collect();
            // Some hundred roundings of numbers of the size of the largest.
            let check = |name: &str, inputs: &[&[f64]], expected: &[&[f64]]| {
                let outputs =
                    function(&module, name).evaluate(&Arguments { numbers: &inputs.concat(), ..Arguments::default() });
                assert_eq!(outputs.len(), expected.len());
                for (ours, theirs) in outputs.iter().zip(expected) {
                    assert!(apart(ours, theirs) < 1e-13, "{file} {name}: {}", apart(ours, theirs));
                }
            };
            check("forward_kinematics", &state[..1], &[&rotation, &position]);
            check("jacobian", &state[..1], &[&jacobian]);
            check("kinematics", &state[..1], &[&rotation, &position, &jacobian]);
            check("inverse_dynamics", &state, &[&equation.torque]);
            check("gravity", &state[..1], &[&equation.gravity]);
            check("mass_matrix", &state[..1], &[equation.mass.as_slice()]);
            let rotors: Vec<f64> = robot.joints.iter().map(|joint| joint.armature).collect();
            let rates = robot.coupling().rates(&qdd);
            let of_rotors: Vec<f64> = rotors.iter().zip(&rates).map(|(rotor, rate)| rotor * rate).collect();
            let of_rotors = robot.coupling().torques(&of_rotors);
            let regressor = &function(&module, "regressor")
                .evaluate(&Arguments { numbers: &state.concat(), ..Arguments::default() })[0];
            let rows = regressor.chunks(10 * robot.joints.len());
            let torque: Vec<f64> = rows
                .zip(&of_rotors)
                .map(|(row, rotor)| {
                    row.iter().zip(&module.constants[0].entries).map(|(y, p)| y * p).sum::<f64>() + rotor
                })
                .collect();
            assert!(apart(&torque, &equation.torque) < 1e-13, "{file}: {}", apart(&torque, &equation.torque));
        }
    }
}

#[test]
fn constants_are_folded() {
    // A planar arm in the xz-plane: nothing moves along y or turns about x and z, so those rows of the Jacobian are zeros.
    let (_, module) = recorded("planar5.urdf");
    let jacobian = &function(&module, "jacobian").outputs[0];
    let constant = jacobian.entries.iter().filter(|entry| entry.as_constant().is_some()).count();
    assert!(constant >= 4 * jacobian.shape[1], "{constant} of {}", jacobian.entries.len());
}

/// A name of a URDF may hold any letters.
#[test]
fn no_name_ends_a_comment() {
    let (mut robot, _) = recorded("puma560.toml");
    robot.name = "a*/b\nint c;".into();
    robot.joints[1].name = "j\nfn x".into();
    let module = module(&robot, robot.tool().unwrap()).unwrap();
    let (c, rust) = (c::file(&module, Width::Double), rust::file(&module, Width::Double));
    assert!(!c.contains("*/b") && !c.contains("\nint c;") && !rust.contains("\nfn x") && !rust.contains("\nint c;"));
}

#[test]
fn a_floating_base_is_refused() {
    let (mut robot, _) = recorded("planar5.urdf");
    robot.floating = true;
    let refusal = module(&robot, robot.tool().unwrap()).unwrap_err().to_string();
    assert!(refusal.contains("floating"), "{refusal}");
}
