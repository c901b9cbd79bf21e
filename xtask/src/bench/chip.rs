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
    let mut figures = counts(&image::build_bench()?)?;
    figures.extend(sizes(&image::build()?)?);
    Ok(figures)
}

/// Runs the bench image with 64 ns of virtual time an instruction; it prints `name value unit`, a line each.
fn counts(elf: &Path) -> Result<Vec<Figure>> {
    let folder = tempfile::tempdir()?;
    let output = Command::new(qemu::PROGRAM)
        .current_dir(folder.path())
        .args(["-M", "b-l475e-iot01a", "-display", "none", "-monitor", "none", "-serial", "null", "-serial", "null"])
        .args(["-icount", "shift=6,sleep=off", "-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(elf)
        .stdin(Stdio::null())
        .output()
        .context("the emulator did not start")?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    if !output.status.success() {
        bail!("the bench image failed:\n{text}");
    }
    text.lines().map(figure).collect()
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
