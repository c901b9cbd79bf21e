//! Times the generated Rust of three robots beside the C that CasADi makes of the same numbers, in one process.
//!
//! `cargo xtask bench --generated` writes both sides into `target/generated`, compiles this file with them, and runs it
//! several times. Prints a line for each work: robot, work, our time and CasADi's in ns, and the largest difference of the
//! results over the largest of CasADi's.

use std::ffi::{c_int, c_longlong};
use std::hint::black_box;
use std::ptr;
use std::time::Instant;

#[path = "../../target/generated/panda_urdf.rs"]
mod panda_urdf;
#[path = "../../target/generated/puma560_dh.rs"]
mod puma560_dh;
#[path = "../../target/generated/ur10_urdf.rs"]
mod ur10_urdf;

/// How many postures one timing runs through.
const POSTURES: usize = 1000;
/// Passes over the postures, the sides in turn; the least time of each counts, as what else runs only adds to it.
const PASSES: usize = 200;
/// What CasADi's functions may want to work in, numbers: they say how many.
const ROOM: usize = 4096;

/// A function as CasADi writes it: arguments, results, room for integers and numbers, and a number of that room.
type Function = unsafe extern "C" fn(*const *const f64, *const *mut f64, *mut c_longlong, *mut f64, c_int) -> c_int;
/// How many arguments, results, integers and numbers it works in.
type Sizes = unsafe extern "C" fn(*mut c_longlong, *mut c_longlong, *mut c_longlong, *mut c_longlong) -> c_int;

/// Positions within ±3, velocities and accelerations within ±1.
fn postures<const N: usize>() -> Vec<[[f64; N]; 3]> {
    let mut state = N as u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    (0..POSTURES).map(|_| [3.0, 1.0, 1.0].map(|size| [(); N].map(|()| size * next()))).collect()
}

/// ns for one call.
fn time<const N: usize>(postures: &[[[f64; N]; 3]], mut run: impl FnMut(&[[f64; N]; 3])) -> f64 {
    let start = Instant::now();
    postures.iter().for_each(|posture| run(black_box(posture)));
    start.elapsed().as_secs_f64() * 1e9 / POSTURES as f64
}

/// Room that CasADi's functions work in.
struct Room {
    integers: Vec<c_longlong>,
    numbers: Vec<f64>,
}

impl Room {
    fn new() -> Self {
        Self { integers: vec![0; ROOM], numbers: vec![0.0; ROOM] }
    }

    fn suffices(&self, sizes: Sizes) -> bool {
        let (mut arguments, mut results, mut integers, mut numbers) = (0, 0, 0, 0);
        // SAFETY: the four places are valid, and the function writes nothing else.
        let status = unsafe { sizes(&mut arguments, &mut results, &mut integers, &mut numbers) };
        let fits = |size: c_longlong, room: usize| usize::try_from(size).is_ok_and(|size| size <= room);
        status == 0 && fits(arguments, 3) && fits(results, 3) && fits(integers, ROOM) && fits(numbers, ROOM)
    }

    /// Calls a function of CasADi's.
    #[inline(always)]
    fn call<const N: usize, const R: usize>(
        &mut self,
        function: Function,
        posture: &[[f64; N]; 3],
        results: &mut [Vec<f64>; R],
    ) -> c_int {
        let arguments = [posture[0].as_ptr(), posture[1].as_ptr(), posture[2].as_ptr()];
        let mut places = [ptr::null_mut(); 3];
        places.iter_mut().zip(results).for_each(|(place, result)| *place = result.as_mut_ptr());
        let (integers, numbers) = (self.integers.as_mut_ptr(), self.numbers.as_mut_ptr());
        // SAFETY: the function reads arrays of N and writes as many results as `results` has room for, which
        // the caller has from the shapes of the same function; `suffices` says that the rest is enough.
        unsafe { function(arguments.as_ptr(), places.as_ptr(), integers, numbers, 0) }
    }
}

/// What both sides wrote, and their least times, ns.
struct Outcome {
    ours_ns: f64,
    theirs_ns: f64,
    difference: f64,
}

/// Times one work of both sides. `ours` writes its results into the list; those of `theirs` have `shapes`, by columns.
fn compare<const N: usize, const R: usize>(
    (function, sizes): (Function, Sizes),
    shapes: [[usize; 2]; R],
    mut ours: impl FnMut(&[[f64; N]; 3]),
    written: impl Fn(&[[f64; N]; 3]) -> [Vec<f64>; R],
) -> Result<Outcome, String> {
    let (postures, mut room) = (postures::<N>(), Room::new());
    if !room.suffices(sizes) {
        return Err("CasADi's function needs more room".into());
    }
    let mut results = shapes.map(|[rows, columns]| vec![0.0; rows * columns]);
    let mut outcome = Outcome { ours_ns: f64::INFINITY, theirs_ns: f64::INFINITY, difference: 0.0 };
    for posture in &postures {
        if room.call(function, posture, &mut results) != 0 {
            return Err("CasADi's function failed".into());
        }
        for ((ours, theirs), [rows, columns]) in written(posture).iter().zip(&results).zip(shapes) {
            let size = theirs.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
            for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
                let away = (ours[row * columns + column] - theirs[column * rows + row]).abs() / size;
                // Not a number is the largest difference.
                let largest = outcome.difference;
                outcome.difference = if largest.is_nan() || away <= largest { largest } else { away };
            }
        }
    }
    for _ in 0..PASSES {
        outcome.ours_ns = outcome.ours_ns.min(time(&postures, &mut ours));
        let theirs_ns = time(&postures, |posture| {
            black_box(room.call(function, posture, &mut results));
            black_box(&results);
        });
        outcome.theirs_ns = outcome.theirs_ns.min(theirs_ns);
    }
    Ok(outcome)
}

fn print(robot: &str, work: &str, outcome: &Outcome) {
    let Outcome { ours_ns, theirs_ns, difference } = outcome;
    println!("{robot} {work} {ours_ns:.2} {theirs_ns:.2} {difference:e}");
}

/// The three works of one robot with this many joints.
macro_rules! robot {
    ($robot:ident, $n:literal, $kinematics:ident $inverse:ident $mass:ident, $sizes:ident $inverse_sizes:ident $mass_sizes:ident) => {{
        const N: usize = $n;
        #[link(name = "casadi", kind = "static")]
        unsafe extern "C" {
            fn $kinematics(
                a: *const *const f64,
                r: *const *mut f64,
                i: *mut c_longlong,
                w: *mut f64,
                m: c_int,
            ) -> c_int;
            fn $inverse(a: *const *const f64, r: *const *mut f64, i: *mut c_longlong, w: *mut f64, m: c_int) -> c_int;
            fn $mass(a: *const *const f64, r: *const *mut f64, i: *mut c_longlong, w: *mut f64, m: c_int) -> c_int;
            fn $sizes(a: *mut c_longlong, r: *mut c_longlong, i: *mut c_longlong, w: *mut c_longlong) -> c_int;
            fn $inverse_sizes(a: *mut c_longlong, r: *mut c_longlong, i: *mut c_longlong, w: *mut c_longlong) -> c_int;
            fn $mass_sizes(a: *mut c_longlong, r: *mut c_longlong, i: *mut c_longlong, w: *mut c_longlong) -> c_int;
        }
        // Calls, as CasADi's are.
        #[inline(never)]
        fn kinematics(
            q: &[f64; N],
            rotation: &mut [[f64; 3]; 3],
            position: &mut [f64; 3],
            jacobian: &mut [[f64; N]; 6],
        ) {
            $robot::kinematics(q, rotation, position, jacobian);
        }
        #[inline(never)]
        fn inverse_dynamics([q, qd, qdd]: &[[f64; N]; 3], torque: &mut [f64; N]) {
            $robot::inverse_dynamics(q, qd, qdd, torque);
        }
        #[inline(never)]
        fn mass_matrix(q: &[f64; N], mass: &mut [[f64; N]; N]) {
            $robot::mass_matrix(q, mass);
        }
        let name = stringify!($robot);
        let (mut rotation, mut position, mut jacobian) = ([[0.0; 3]; 3], [0.0; 3], [[0.0; N]; 6]);
        let outcome = compare(
            ($kinematics, $sizes),
            [[3, 3], [3, 1], [6, N]],
            |[q, ..]: &[[f64; N]; 3]| {
                kinematics(q, &mut rotation, &mut position, &mut jacobian);
                black_box((&rotation, &position, &jacobian));
            },
            |[q, ..]| {
                let (mut rotation, mut position, mut jacobian) = ([[0.0; 3]; 3], [0.0; 3], [[0.0; N]; 6]);
                kinematics(q, &mut rotation, &mut position, &mut jacobian);
                [rotation.as_flattened().to_vec(), position.to_vec(), jacobian.as_flattened().to_vec()]
            },
        )?;
        print(name, "kinematics", &outcome);
        let mut torque = [0.0; N];
        let outcome = compare(
            ($inverse, $inverse_sizes),
            [[N, 1]],
            |motion: &[[f64; N]; 3]| {
                inverse_dynamics(motion, &mut torque);
                black_box(&torque);
            },
            |motion| {
                let mut torque = [0.0; N];
                inverse_dynamics(motion, &mut torque);
                [torque.to_vec()]
            },
        )?;
        print(name, "inverse-dynamics", &outcome);
        let mut mass = [[0.0; N]; N];
        let outcome = compare(
            ($mass, $mass_sizes),
            [[N, N]],
            |[q, ..]: &[[f64; N]; 3]| {
                mass_matrix(q, &mut mass);
                black_box(&mass);
            },
            |[q, ..]| {
                let mut mass = [[0.0; N]; N];
                mass_matrix(q, &mut mass);
                [mass.as_flattened().to_vec()]
            },
        )?;
        print(name, "mass-matrix", &outcome);
    }};
}

fn main() -> Result<(), String> {
    robot!(
        panda_urdf, 7,
        panda_urdf_kinematics panda_urdf_inverse_dynamics panda_urdf_mass_matrix,
        panda_urdf_kinematics_work panda_urdf_inverse_dynamics_work panda_urdf_mass_matrix_work
    );
    robot!(
        ur10_urdf, 6,
        ur10_urdf_kinematics ur10_urdf_inverse_dynamics ur10_urdf_mass_matrix,
        ur10_urdf_kinematics_work ur10_urdf_inverse_dynamics_work ur10_urdf_mass_matrix_work
    );
    robot!(
        puma560_dh, 6,
        puma560_dh_kinematics puma560_dh_inverse_dynamics puma560_dh_mass_matrix,
        puma560_dh_kinematics_work puma560_dh_inverse_dynamics_work puma560_dh_mass_matrix_work
    );
    Ok(())
}
