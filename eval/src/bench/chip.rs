//! On the chip: exact instruction counts of two images in the emulator, and the sizes of the image.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use darm_arm::arm::{Arm, ArmScratch};
use darm_core::real::{Mat3, Vec3};
use darm_core::se::Pose;
use darm_sim::qemu;

use darm_figures::figure::Figure;
use xtask::image;
use xtask::setup::{self, Emulator};

/// Counts and sizes.
pub(super) fn measure() -> Result<Vec<Figure>> {
    if let Emulator::Absent(why) = setup::emulator() {
        bail!("instructions are counted in the emulator, and there is none: {why}");
    }
    let (kinematics, tasks) = (image::build_kinematics()?, image::build_bench()?);
    // What is exact, and what happens when the emulator runs as fast as the machine lets it.
    let exact = run(&kinematics, EXACT)? + &run(&tasks, EXACT)?;
    let (poses, exact): (Vec<&str>, Vec<&str>) =
        exact.lines().filter(|line| !line.starts_with(LATENESS)).partition(|line| line.starts_with(POSE));
    let mut figures = exact.into_iter().map(figure).collect::<Result<Vec<_>>>()?;
    let [general, of_one] = [GENERAL, OF_ONE].map(|functions| image::code_bytes(&kinematics, functions));
    figures.extend(generated(&figures, general?, of_one?)?);
    figures.extend(corrected(&poses)?);
    let free = run(&tasks, &[])?;
    figures.extend(free.lines().filter(|line| line.starts_with(LATENESS)).map(figure).collect::<Result<Vec<_>>>()?);
    for (name, bytes) in image::sizes(&image::build()?)? {
        figures.push(Figure::new(name, bytes, "bytes")?);
    }
    Ok(figures)
}

/// The clock of the emulator with which counts are exact: 64 ns of virtual time an instruction.
const EXACT: &[&str] = &["-icount", "shift=6,sleep=off"];

/// The works that there is generated code for.
const GENERATED: [&str; 2] = ["inverse dynamics", "mass matrix"];

/// Functions that do them: for any arm, and for the Puma 560 alone.
const GENERAL: [&str; 2] = ["torques", "mass"];
const OF_ONE: [&str; 2] = ["generated_torques", "generated_mass"];

/// Generated code beside the general one: instructions of both as a ratio, and the bytes of code.
fn generated(counted: &[Figure], general: [u32; 2], of_one: [u32; 2]) -> Result<Vec<Figure>> {
    let count = |name: String| {
        let found = counted.iter().find(|figure| figure.name == name);
        found.map(|figure| figure.value).with_context(|| format!("{name:?} was not counted"))
    };
    let mut figures = Vec::new();
    for ((work, general), of_one) in GENERATED.into_iter().zip(general).zip(of_one) {
        let ratio = count(format!("Puma 560: generated {work}"))? / count(format!("Puma 560: {work}"))?;
        let ratio = (ratio * 1000.0).round() / 1000.0;
        figures.push(Figure::new(
            &format!("Puma 560: generated {work} over the general one"),
            ratio,
            "of the instructions",
        )?);
        figures.push(Figure::new(&format!("code for any arm: {work}"), general.into(), "bytes")?);
        figures.push(Figure::new(&format!("code for the Puma 560: generated {work}"), of_one.into(), "bytes")?);
    }
    Ok(figures)
}

/// How the names of those figures begin that mean something where the emulator runs freely, and only there.
const LATENESS: &str = "lateness.";

/// How the names of the poses begin that a corrected model predicts: `pose.WORD.INDEX`, the rotation by rows, the position.
const POSE: &str = "pose.";

/// How far the poses that the chip predicts in `f32` with the effects of a diagnosed arm are from the host's.
fn corrected(lines: &[&str]) -> Result<Vec<Figure>> {
    let arm = Arm::read(&setup::root().join("tests/data/corrected/corrected.toml"))?;
    let (mut farthest_m, mut share): (f64, f64) = (0.0, 0.0);
    for lines in lines.chunks(12) {
        let number = |line: &&str| line.split(' ').nth(1).and_then(|number| number.parse().ok());
        let numbers: Vec<f64> = lines.iter().map(number).collect::<Option<_>>().context("a pose has numbers")?;
        let pose = Pose {
            rotation: Mat3::from_row_slice(numbers.get(..9).context("a pose is short")?),
            position: Vec3::from_column_slice(numbers.get(9..12).context("a pose is short")?),
        };
        let word = lines.first().and_then(|line| line.split('.').nth(1)).context("a pose has a word")?.parse()?;
        let condition = arm.model.working(word, arm.rest(), &[]);
        let exact = arm.model.predict(&condition, &mut ArmScratch::default())?;
        let away_m = exact.distance(&pose, arm.length_scale_m);
        farthest_m = farthest_m.max(away_m);
        share = share.max(away_m / arm.single_precision_bound_m(&condition)?);
    }
    Ok(vec![
        Figure::new("corrected model: poses compared with the host's", lines.len() as f64 / 12.0, "")?,
        Figure::new("corrected model: farthest from the host's", 1e6 * farthest_m, "um")?,
        Figure::new("corrected model: the same over what rounding allows", share, "")?,
    ])
}

/// Runs an image, with exact counts or freely; it prints `name value unit`, a line each.
fn run(elf: &Path, clock: &[&str]) -> Result<String> {
    let folder = tempfile::tempdir()?;
    let output = Command::new(qemu::PROGRAM)
        .current_dir(folder.path())
        .args(["-M", "b-l475e-iot01a", "-display", "none", "-monitor", "none", "-serial", "null", "-serial", "null"])
        .args(clock)
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(elf)
        .stdin(Stdio::null())
        .output()
        .context("the emulator did not start")?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    if !output.status.success() {
        bail!("the bench image failed:\n{text}");
    }
    Ok(text)
}

fn figure(line: &str) -> Result<Figure> {
    let mut words: Vec<&str> = line.split_whitespace().collect();
    let unit = words.pop().with_context(|| format!("{line:?} has no unit"))?;
    let value = words.pop().and_then(|value| value.parse().ok());
    Figure::new(
        &words.join(" ").replace('_', " ").replace('.', ": "),
        value.with_context(|| format!("{line:?} has no value"))?,
        unit,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generated_code_is_compared_with_the_general_one_of_the_same_work() {
        let lines = ["Puma_560.inverse_dynamics 2000", "Puma_560.mass_matrix 3000"];
        let generated_lines = ["Puma_560.generated_inverse_dynamics 1000", "Puma_560.generated_mass_matrix 600"];
        let counted = |lines: &[&str]| -> Vec<Figure> {
            lines.iter().map(|line| figure(&format!("{line} instructions")).unwrap()).collect()
        };
        let all = counted(&[lines, generated_lines].concat());
        let values: Vec<f64> = generated(&all, [1, 2], [3, 4]).unwrap().iter().map(|figure| figure.value).collect();
        assert_eq!(values, [0.5, 1.0, 3.0, 0.2, 2.0, 4.0]);
        assert!(generated(&counted(&lines), [0; 2], [0; 2]).is_err(), "a work that was not counted");
    }
}
