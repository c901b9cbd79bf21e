//! On the chip: exact instruction counts of a bench image in the emulator, and the sizes of the image.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use darm::qemu;

use crate::figures::Figure;
use crate::image;
use crate::setup::{self, Emulator};

/// Counts and sizes.
pub(super) fn measure() -> Result<Vec<Figure>> {
    if let Emulator::Absent(why) = setup::emulator() {
        bail!("instructions are counted in the emulator, and there is none: {why}");
    }
    let bench = image::build_bench()?;
    // What is exact, and what happens when the emulator runs as fast as the machine lets it.
    let mut figures = run(&bench, &["-icount", "shift=6,sleep=off"], |name| !name.starts_with(LATENESS))?;
    figures.extend(run(&bench, &[], |name| name.starts_with(LATENESS))?);
    figures.extend(sizes(&image::build()?)?);
    Ok(figures)
}

/// How the names of those figures begin that mean something where the emulator runs freely, and only there.
const LATENESS: &str = "lateness.";

/// Runs the bench image, with 64 ns of virtual time an instruction or freely; it prints `name value unit`, a line each.
fn run(elf: &Path, clock: &[&str], wanted: impl Fn(&str) -> bool) -> Result<Vec<Figure>> {
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
    text.lines().filter(|line| wanted(line)).map(figure).collect()
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

/// Flash and RAM of the image, from the section headers of its ELF.
fn sizes(elf: &Path) -> Result<Vec<Figure>> {
    use object::{Object as _, ObjectSection as _};
    let bytes = std::fs::read(elf).with_context(|| format!("{} cannot be read", elf.display()))?;
    let file = object::File::parse(&*bytes).with_context(|| format!("{} is no ELF", elf.display()))?;
    let size = |names: &[&str]| {
        let sections = file.sections().filter(|section| section.name().is_ok_and(|name| names.contains(&name)));
        sections.map(|section| section.size()).sum::<u64>() as f64
    };
    Ok(vec![
        Figure::new("flash of the image", size(&[".vector_table", ".text", ".rodata", ".data"]), "bytes")?,
        Figure::new("RAM of the image without its stack", size(&[".data", ".bss", ".uninit"]), "bytes")?,
    ])
}
