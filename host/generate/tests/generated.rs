//! Generated files are those of `tests/generated`, compile, and give what the core gives in the same numbers.
//!
//! `DARM_RENEW=1 cargo test -p darm-generate` writes the files again.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use darm_core::dynamics;
use darm_core::real::{Real, real};
use darm_core::tree::{Frames, Joint, Tree};
use darm_generate::{Module, Width, c, robot, rust};
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

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/generated")
}

fn finger() -> (Robot, Module) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/finger.xml");
    let robot = read(path.as_path(), &Locks::new()).unwrap();
    let module = robot::module(&robot, robot.tool().unwrap()).unwrap();
    (robot, module)
}

#[test]
fn the_files_are_renewed() {
    let (_, module) = finger();
    let files = [
        ("finger_f32.rs", rust::file(&module, Width::Single)),
        ("finger_f64.rs", rust::file(&module, Width::Double)),
        ("finger_f32.h", c::file(&module, Width::Single)),
        ("finger_f64.h", c::file(&module, Width::Double)),
    ];
    for (name, text) in files {
        let path = folder().join(name);
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

/// What a C program of these lines prints; `None` where the machine has no C compiler.
fn run_c(name: &str, lines: &str) -> Option<String> {
    let build = tempfile::tempdir().unwrap();
    let (source, program) = (build.path().join("main.c"), build.path().join("main"));
    fs::write(&source, format!("#include <stdio.h>\n#include \"{name}\"\nint main(void) {{\n{lines}return 0;\n}}\n"))
        .unwrap();
    let strict = ["-std=c99", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-Werror"];
    let compiler =
        Command::new("cc").args(strict).arg("-I").arg(folder()).arg(&source).arg("-o").arg(&program).output();
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
