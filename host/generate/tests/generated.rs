//! Generated files are those of `tests/generated`, compile, and give what the core gives in the same numbers.
//!
//! `DARM_RENEW=1 cargo test -p darm-generate` writes the files again.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use darm_arm::arm::{Arm, ArmScratch};
use darm_core::dynamics;
use darm_core::effect::{Condition, Effect, Place};
use darm_core::real::{Mat3, Real, Vec3, real};
use darm_core::se::Pose;
use darm_core::tree::{Frames, Joint, Tree};
use darm_core::units::Word;
use darm_generate::{Module, Width, arm, c, robot, rust};
use darm_robot::description::read;
use darm_robot::robot::Robot;
use darm_robot::urdf::Locks;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

#[rustfmt::skip]
#[path = "generated/finger_f32.rs"]
mod finger_f32;
#[rustfmt::skip]
#[path = "generated/finger_f64.rs"]
mod finger_f64;
#[rustfmt::skip]
#[path = "generated/platform3_f32.rs"]
mod platform3_f32;
#[rustfmt::skip]
#[path = "generated/platform3_f64.rs"]
mod platform3_f64;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/generated")
}

fn finger() -> (Robot, Module) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/finger.xml");
    let robot = read(path.as_path(), &Locks::new()).unwrap();
    let module = robot::module(&robot, robot.tool().unwrap()).unwrap();
    (robot, module)
}

/// A platform of three legs whose extended state follows the supply, and whose first leg comes off its stop.
fn platform() -> (Arm, Module) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/platform3.toml");
    let mut arm = Arm::read(path.as_path()).unwrap();
    let supply = Effect::SupplyStroke { at: Place::Arm, gain: 0.05 };
    arm.model.effects = [supply, Effect::Play { at: Place::Actuator(0), width_m: 1e-3 }].into_iter().collect();
    let module = arm::module(&arm).unwrap();
    (arm, module)
}

/// Inverse dynamics and mass matrix of the Puma 560, which an image of the firmware counts beside those of the core.
fn puma() -> Module {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/puma560.toml");
    let robot = read(path.as_path(), &Locks::new()).unwrap();
    let mut module = robot::module(&robot, robot.tool().unwrap()).unwrap();
    module.functions.retain(|function| ["inverse_dynamics", "mass_matrix"].contains(&function.name));
    module
}

#[test]
fn the_files_are_renewed() {
    let ((_, module), (_, platform)) = (finger(), platform());
    let image = "../../../../firmware/boards/b-l475e-iot01a/src/bin/kinematics";
    let files = [
        ("platform3_f32.rs".into(), rust::file(&platform, Width::Single)),
        ("platform3_f64.rs".into(), rust::file(&platform, Width::Double)),
        ("platform3_f32.h".into(), c::file(&platform, Width::Single)),
        ("finger_f32.rs".into(), rust::file(&module, Width::Single)),
        ("finger_f64.rs".into(), rust::file(&module, Width::Double)),
        ("finger_f32.h".into(), c::file(&module, Width::Single)),
        ("finger_f64.h".into(), c::file(&module, Width::Double)),
        (format!("{image}/generated_puma560.rs"), rust::file(&puma(), Width::Single)),
    ];
    for (name, text) in files {
        let path = folder().join(&name);
        if std::env::var_os("DARM_RENEW").is_some() {
            fs::write(&path, &text).unwrap();
        }
        assert!(fs::read_to_string(&path).unwrap() == text, "{name} is not what is generated: run with DARM_RENEW=1");
    }
}

/// Mass matrix, torques and Jacobian of the core for all three joints of the finger in numbers of type `T`.
fn core<T: Real>(robot: &Robot, [q, qd, qdd]: [[T; 3]; 3]) -> ([[T; 3]; 3], [T; 3], [[T; 3]; 6]) {
    let joints: [Joint<T>; 3] = std::array::from_fn(|index| robot.joints[index].joint.cast());
    let tree = Tree::new(&joints, robot.gravity.map(real)).unwrap();
    let mut frames = Frames::default();
    tree.place(&q, &mut frames);
    let tool = robot.tool().unwrap();
    let jacobian = tree.jacobian_base(&tree.frame(tool.joint.unwrap(), &tool.pose.cast()), &frames);
    let (mut mass, mut torque) =
        (dynamics::mass_matrix(&tree, &q), dynamics::inverse_dynamics(&tree, &q, &qd, &qdd, None));
    for (index, joint) in robot.joints.iter().enumerate() {
        mass[(index, index)] += real(joint.armature);
        torque[index] += real::<T>(joint.armature) * qdd[index];
    }
    let at = |row, column| mass[(row, column)];
    (
        std::array::from_fn(|row| std::array::from_fn(|column| at(row, column))),
        torque,
        std::array::from_fn(|row| std::array::from_fn(|column| jacobian[(row, column)])),
    )
}

/// A test of one width.
macro_rules! compare {
    ($name:ident, $number:ident, $module:ident) => {
        #[test]
        fn $name() {
            let (robot, _) = finger();
            let mut random = ChaCha8Rng::seed_from_u64(2);
            // The tip follows the knuckle with 0.7: what is linear in the joints adds up.
            let reduced = |[base, knuckle, tip]: [$number; 3]| [base, knuckle + 0.7 * tip];
            let size = |all: &[$number]| all.iter().fold(0.0, |size: $number, x| size.max(x.abs()));
            // Some tens of roundings of the largest number.
            let close = |ours: &[$number], core: &[$number], size: $number| {
                let apart = ours.iter().zip(core).fold(0.0, |apart: $number, (a, b)| apart.max((a - b).abs()));
                assert!(apart <= 64.0 * $number::EPSILON * size, "{ours:?} {core:?}");
            };
            for _ in 0..200 {
                let [q, qd, qdd] = [[(); 2]; 3].map(|two| two.map(|()| random.random_range(-3.0..3.0)));
                let (mass, torque, jacobian) =
                    core(&robot, [q, qd, qdd].map(|[base, knuckle]| [base, knuckle, 0.7 * knuckle]));
                let mut ours = [0.0; 2];
                $module::inverse_dynamics(&q, &qd, &qdd, &mut ours);
                close(&ours, &reduced(torque), size(&torque));
                let mut ours = [[0.0; 2]; 2];
                $module::mass_matrix(&q, &mut ours);
                let [first, second, third] = mass.map(reduced);
                let rows = [first, [second[0] + 0.7 * third[0], second[1] + 0.7 * third[1]]];
                close(ours.as_flattened(), rows.as_flattened(), size(mass.as_flattened()));
                let (mut rotation, mut position, mut ours) = ([[0.0; 3]; 3], [0.0; 3], [[0.0; 2]; 6]);
                $module::kinematics(&q, &mut rotation, &mut position, &mut ours);
                close(ours.as_flattened(), jacobian.map(reduced).as_flattened(), 1.0);
            }
        }
    };
}

compare!(generated_rust_equals_the_core_in_double_precision, f64, finger_f64);
compare!(generated_rust_equals_the_core_in_single_precision, f32, finger_f32);

/// Calls `visit` with each word of the platform after each other one: word, word before, conditions and the core's pose.
fn each_word(mut visit: impl FnMut([u8; 3], [u8; 3], [f64; 3], Pose<f64>)) {
    let (arm, mut scratch) = (platform().0, ArmScratch::default());
    let digits = |number: u8| [0, 1, 2].map(|bit| number >> bit & 1);
    for (word, previous) in (0..64).map(|number| (digits(number % 8), digits(number / 8))) {
        let (supply, temperature_k) = (6e5 + 1e4 * f64::from(word[0] + previous[1]), 293.15);
        let [now, before] = [word, previous].map(|digits| Word::new(&digits).unwrap());
        let condition = Condition { supply, temperature_k, ..arm.model.working(now, before, &[]) };
        visit(word, previous, [supply, temperature_k, 0.0], arm.model.predict(&condition, &mut scratch).unwrap());
    }
}

/// A test of one width.
macro_rules! compare_words {
    ($name:ident, $number:ident, $module:ident) => {
        #[test]
        fn $name() {
            each_word(|word, previous, conditions, pose| {
                let (mut rotation, mut position) = ([[0.0; 3]; 3], [0.0; 3]);
                let conditions = conditions.map(|x| x as $number);
                $module::pose(&word, &previous, &conditions, &mut rotation, &mut position);
                let rotation = Mat3::from_fn(|row, column| f64::from(rotation[row][column]));
                let away = (Vec3::from(position.map(f64::from)) - pose.position).norm();
                let turned = (rotation - pose.rotation).norm();
                // Some tens of roundings of lengths up to 2 m.
                assert!(away.max(turned) < 64.0 * f64::from($number::EPSILON), "{word:?}: {away} {turned}");
            });
        }
    };
}

compare_words!(a_generated_arm_equals_the_core_in_double_precision, f64, platform3_f64);
compare_words!(a_generated_arm_equals_the_core_in_single_precision, f32, platform3_f32);

#[test]
fn a_generated_arm_in_c_equals_the_core() {
    let (mut lines, mut expected) = (String::from("float r[3][3], p[3];\n"), Vec::new());
    each_word(|word, previous, [supply, temperature_k, load_kg], pose| {
        let list = |digits: [u8; 3]| format!("(const uint8_t[]){{{}, {}, {}}}", digits[0], digits[1], digits[2]);
        lines += &format!(
            "platform3_pose({}, {}, (const float[]){{{supply:?}f, {temperature_k:?}f, {load_kg:?}f}}, r, p);\n",
            list(word),
            list(previous)
        );
        lines += "printf(\"%.9g %.9g %.9g \", (double)r[1][0], (double)p[0], (double)p[1]);\n";
        expected.extend([pose.rotation.m21, pose.position.x, pose.position.y]);
    });
    let Some(printed) = run_c("platform3_f32.h", &lines) else { return };
    let ours: Vec<f64> = printed.split_whitespace().map(|number| number.parse().unwrap()).collect();
    assert_eq!(ours.len(), expected.len());
    let apart = ours.iter().zip(&expected).fold(0.0, |apart: f64, (a, b)| apart.max((a - b).abs()));
    assert!(apart < 64.0 * f64::from(f32::EPSILON), "{apart}");
}

/// What a C program of these lines prints; `None` where the machine has no C compiler.
fn run_c(name: &str, lines: &str) -> Option<String> {
    let build = tempfile::tempdir().unwrap();
    let (source, program) = (build.path().join("main.c"), build.path().join("main"));
    fs::write(&source, format!("#include <stdio.h>\n#include \"{name}\"\nint main(void) {{\n{lines}return 0;\n}}\n"))
        .unwrap();
    let strict = ["-std=c99", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-Werror"];
    let compiler = Command::new("cc")
        .args(strict)
        .arg("-I")
        .arg(folder())
        .arg(&source)
        .arg("-o")
        .arg(&program)
        .arg("-lm")
        .output();
    let Ok(compiler) = compiler else {
        eprintln!("no C compiler: the generated C is not compared");
        return None;
    };
    assert!(compiler.status.success(), "{}", String::from_utf8_lossy(&compiler.stderr));
    Some(String::from_utf8(Command::new(program).output().unwrap().stdout).unwrap())
}

/// A test of one width: the numbers are printed with as many digits as distinguish them.
macro_rules! compare_c {
    ($name:ident, $number:ident, $kind:literal, $end:literal, $digits:literal, $module:ident) => {
        #[test]
        fn $name() {
            let (mut lines, mut ours) = (String::new(), Vec::new());
            let mut random = ChaCha8Rng::seed_from_u64(3);
            for _ in 0..16 {
                let [q, qd, qdd] = [[(); 2]; 3].map(|two| two.map(|()| random.random_range(-300.0..300.0)));
                let (mut torque, mut mass) = ([0.0; 2], [[0.0; 2]; 2]);
                $module::inverse_dynamics(&q, &qd, &qdd, &mut torque);
                $module::mass_matrix(&q, &mut mass);
                ours.extend(torque.iter().chain(mass.as_flattened()).copied());
                let list = |name: &str, [a, b]: [$number; 2]| {
                    format!(concat!("const ", $kind, " {}[2] = {{{:?}", $end, ", {:?}", $end, "}};\n"), name, a, b)
                };
                lines += &format!("{{\n{}{}{}", list("q", q), list("qd", qd), list("qdd", qdd));
                lines += &format!(
                    "{0} t[2], m[2][2];\nfinger_inverse_dynamics(q, qd, qdd, t);\nfinger_mass_matrix(q, m);\n",
                    $kind
                );
                lines += concat!("printf(\"%.", $digits, "g %.", $digits, "g \", (double)t[0], (double)t[1]);\n");
                lines +=
                    concat!("for (int k = 0; k < 4; k++) printf(\"%.", $digits, "g \", (double)m[k / 2][k % 2]);\n}\n");
            }
            let Some(printed) = run_c(concat!("finger_", stringify!($number), ".h"), &lines) else { return };
            let theirs: Vec<$number> = printed.split_whitespace().map(|number| number.parse().unwrap()).collect();
            assert_eq!(ours, theirs);
        }
    };
}

compare_c!(generated_c_equals_generated_rust_in_double_precision, f64, "double", "", 17, finger_f64);
compare_c!(generated_c_equals_generated_rust_in_single_precision, f32, "float", "f", 9, finger_f32);
