//! Times our kinematics and dynamics beside Pinocchio's on the same models and postures, and prints the ratios.
//!
//! Arguments: the folder with the golden data, and the other side's program (`pinocchio.cpp`, built header-only).

mod models;

use std::collections::HashMap;
use std::error::Error;
use std::hint::black_box;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use darm_core::dynamics;
use darm_core::tree::Frames;

use models::{Arm, POSTURES};

/// Repetitions of which the least time counts.
const RUNS: usize = 60;
/// How often the sides take turns.
const ROUNDS: usize = 3;

/// One quantity of one arm: nanoseconds and a sum of results, by which the two sides are compared.
struct Row {
    name: String,
    ns: f64,
    sum: f64,
}

fn time<const N: usize>(rows: &mut Vec<Row>, arm: &Arm<N>, work: &str, mut run: impl FnMut(&[[f64; N]; 3]) -> f64) {
    let mut least = f64::INFINITY;
    let mut sum = 0.0;
    for _ in 0..RUNS {
        sum = 0.0;
        let start = Instant::now();
        for posture in &arm.postures {
            sum += run(black_box(posture));
        }
        least = least.min(start.elapsed().as_secs_f64() * 1e9 / POSTURES as f64);
    }
    rows.push(Row { name: format!("{} {work}", arm.name), ns: least, sum });
}

fn ours<const N: usize>(rows: &mut Vec<Row>, arm: &Arm<N>) {
    let (tree, tool) = (black_box(&arm.tree), black_box(&arm.tool));
    let mut frames = Frames::default();
    time(rows, arm, "pose", |[q, ..]| black_box(tree.pose(tool, q)).position.sum());
    time(rows, arm, "jacobian", |[q, ..]| {
        tree.place(q, &mut frames);
        let jacobian = black_box(tree.jacobian_base(tool, &frames));
        jacobian[(3, 0)] + jacobian[(2, N - 1)] + jacobian[(4, N / 2)]
    });
    time(rows, arm, "inverse-dynamics", |[q, qd, qdd]| {
        black_box(dynamics::inverse_dynamics(tree, q, qd, qdd, None)).iter().sum()
    });
    time(rows, arm, "gravity", |[q, ..]| {
        tree.place(q, &mut frames);
        black_box(dynamics::gravity(tree, &frames)).iter().sum()
    });
    time(rows, arm, "mass-matrix", |[q, ..]| {
        let mass = black_box(dynamics::mass_matrix(tree, q));
        mass[(0, 0)] + mass[(0, N - 1)] + mass[(N / 2, N / 2)]
    });
    time(rows, arm, "com-jacobian", |[q, ..]| {
        tree.place(q, &mut frames);
        let (com, jacobian) = black_box(dynamics::com_jacobian(tree, &frames));
        com.sum() + jacobian[(0, 0)] + jacobian[(2, N - 1)]
    });
    time(rows, arm, "forward-dynamics", |[q, qd, torque]| {
        black_box(dynamics::forward_dynamics(tree, q, qd, torque)).map_or(0.0, |qdd| qdd[0])
    });
    let mut y = [[[0.0; 10]; N]; N];
    time(rows, arm, "regressor", |[q, qd, qdd]| {
        tree.place(q, &mut frames);
        dynamics::regressor(tree, &frames, [q, qd, qdd], &mut y);
        let y = black_box(&y);
        y[0][0][0] + y[0][N - 1][9] + y[N - 1][N - 1][6]
    });
}

/// The other side's rows by name.
fn theirs(program: &Path, texts: &[&str]) -> Result<HashMap<String, (f64, f64)>, Box<dyn Error>> {
    let mut child = Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
    let mut input = child.stdin.take().ok_or("no standard input")?;
    writeln!(input, "{}", texts.len())?;
    for text in texts {
        input.write_all(text.as_bytes())?;
    }
    drop(input);
    let output = child.wait_with_output()?;
    let mut rows = HashMap::new();
    for line in String::from_utf8(output.stdout)?.lines() {
        let words: Vec<_> = line.split_whitespace().collect();
        if let [model, work, least, _, sum] = words[..] {
            rows.insert(format!("{model} {work}"), (least.parse()?, sum.parse()?));
        }
    }
    Ok(rows)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1);
    let (Some(folder), program) = (arguments.next(), arguments.next()) else {
        return Err("usage: peers GOLDEN_FOLDER [PROGRAM]".into());
    };
    let folder = Path::new(&folder);
    let panda = models::read::<7>(folder, "panda_urdf", 1)?;
    let ur10 = models::read::<6>(folder, "ur10_urdf", 2)?;
    let puma = models::read::<6>(folder, "puma560_dh", 3)?;
    let texts = [panda.text.as_str(), &ur10.text, &puma.text];
    let (mut rows, mut peer): (Vec<Row>, HashMap<String, (f64, f64)>) = Default::default();
    // In turns, so that both sides meet the machine's quiet moments.
    for _ in 0..ROUNDS {
        let mut again = Vec::new();
        ours(&mut again, &panda);
        ours(&mut again, &ur10);
        ours(&mut again, &puma);
        for (index, row) in again.into_iter().enumerate() {
            match rows.get_mut(index) {
                Some(before) => before.ns = before.ns.min(row.ns),
                None => rows.push(row),
            }
        }
        if let Some(program) = &program {
            for (name, (ns, sum)) in theirs(Path::new(program), &texts)? {
                let before = peer.entry(name).or_insert((ns, sum));
                before.0 = before.0.min(ns);
            }
        }
    }
    println!("{:<34} {:>9} {:>9} {:>6}", "", "ours, ns", "Pinocchio", "ratio");
    for Row { name, ns, sum } in &rows {
        let Some((least, theirs)) = peer.get(name) else {
            println!("{name:<34} {ns:>9.0}");
            continue;
        };
        let local = peer.get(&format!("{name}-local")).map_or(*least, |(local, _)| local.min(*least));
        let agree = (sum - theirs).abs() <= 1e-9 * (1.0 + theirs.abs()) * POSTURES as f64;
        let remark = if agree { "" } else { "  RESULTS DIFFER" };
        println!("{name:<34} {ns:>9.0} {local:>9.0} {:>6.2}{remark}", ns / local);
    }
    Ok(())
}
