//! `darm map`: where the tool of an arm can be, how densely, and where it cannot.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context as _;
use darm::report::density;
use darm_arm::arm::Arm;
use darm_arm::reach::map::{Map as Density, Place, Resolution, holes};
use serde::Serialize;

use super::path::servos_rad;
use crate::failure::Usage;
use crate::voice::{Answer, Voice};

const EXAMPLES: &str = "\
Examples:
  darm map planar4.toml                                   what is reached, in cells of 20 mm and 10 deg
  darm map spatial6.toml --picture map.svg --csv map.csv
  darm map spatial6.toml --cell 50 --angle 20 --view yz --picture side.svg

The CSV has a line for each position: x_m,y_m,z_m, words that end there, cells of orientations reached. \
The last is empty where position and orientation together make too many cells to be counted.";

/// Map the density of reachable frames over position and orientation, without forming every word
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Map {
    /// The arm
    #[arg(value_name = "ARM.toml")]
    arm: PathBuf,
    /// Edge of a cell of positions, in mm
    #[arg(long, value_name = "MM", default_value_t = 20.0)]
    cell: f64,
    /// Edge of a cell of orientations, in degrees
    #[arg(long, value_name = "DEG", default_value_t = 10.0)]
    angle: f64,
    /// Servo angles, in degrees; 0 where left out
    #[arg(long, value_name = "DEG", num_args = 1.., allow_negative_numbers = true)]
    servos: Vec<f64>,
    /// Write a picture: how many words end over each square, summed along the line of sight
    #[arg(long, value_name = "FILE.svg")]
    picture: Option<PathBuf>,
    /// Plane of the picture; xy of a planar arm, else xz
    #[arg(long, value_enum)]
    view: Option<View>,
    /// Write the data
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
}

/// Plane of a picture.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum View {
    Xy,
    Xz,
    Yz,
}

#[derive(Serialize)]
struct Reached {
    words: f64,
    /// Cells of position and orientation; null where they are too many to be counted.
    cells: Option<f64>,
    positions: usize,
    orientations: usize,
    low_m: [f64; 3],
    high_m: [f64; 3],
    /// m³, of a planar arm m².
    region: f64,
    holes: f64,
    hole_cells: usize,
    planar: bool,
    densest_m: [f64; 3],
    densest_words: f64,
    took_s: f64,
}

impl Map {
    pub(crate) fn run(&self, voice: Voice) -> anyhow::Result<()> {
        let arm = Arm::read(&self.arm)?;
        let fine = |size: f64, least: f64, most: f64| size.is_finite() && (least..=most).contains(&size);
        if !fine(self.cell, 0.1, 1e4) || !fine(self.angle, 0.1, 180.0) {
            return Err(
                Usage("--cell has to be within 0.1 and 10000 mm, --angle within 0.1 and 180 deg".to_owned()).into()
            );
        }
        let resolution = Resolution { cell_m: 1e-3 * self.cell, cell_rad: self.angle.to_radians() };
        let servos_rad = servos_rad(&arm, &self.servos)?;
        let start = Instant::now();
        let bar = voice.bar("stages", 100, "%");
        let map = Density::new(&arm, &servos_rad, resolution, |share| bar.set_position((100.0 * share) as u64))?;
        bar.finish_and_clear();
        let planar = arm.model.chain.is_planar();
        let spots = map.spots();
        let holes = holes(&spots, planar);
        let at = |place: &Place| place.map(|number| f64::from(number) * resolution.cell_m);
        let bound = |pick: fn(f64, f64) -> f64, start: f64| {
            spots.keys().fold([start; 3], |bound, place| std::array::from_fn(|axis| pick(bound[axis], at(place)[axis])))
        };
        let cell = resolution.cell_m.powi(if planar { 2 } else { 3 });
        let densest = spots.iter().max_by(|a, b| a.1.words.total_cmp(&b.1.words)).context("no word has a pose")?;
        if let Some(path) = &self.picture {
            let axes = match self.view {
                Some(View::Xy) => [0, 1],
                Some(View::Xz) => [0, 2],
                Some(View::Yz) => [1, 2],
                None => [0, if planar { 1 } else { 2 }],
            };
            write(path, &density::svg(&spots, axes, resolution.cell_m))?;
        }
        if let Some(path) = &self.csv {
            let mut text = "x_m,y_m,z_m,words,orientations\n".to_owned();
            for (place, spot) in &spots {
                let [x, y, z] = at(place);
                let orientations = spot.orientations.map_or_else(String::new, |count| count.to_string());
                writeln!(text, "{x:.6},{y:.6},{z:.6},{},{orientations}", spot.words)?;
            }
            write(path, &text)?;
        }
        voice.tell(&Reached {
            words: map.words(),
            cells: map.n_cells(),
            positions: spots.len(),
            orientations: map.orientations.len(),
            low_m: bound(f64::min, f64::INFINITY),
            high_m: bound(f64::max, f64::NEG_INFINITY),
            region: cell * spots.len() as f64,
            holes: cell * holes.len() as f64,
            hole_cells: holes.len(),
            planar,
            densest_m: at(densest.0),
            densest_words: densest.1.words,
            took_s: start.elapsed().as_secs_f64(),
        })
    }
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}

impl Answer for Reached {
    fn text(&self) -> String {
        let cells = self.cells.map_or("more cells than are counted".to_owned(), |cells| format!("{cells:.0} cells"));
        let unit = if self.planar { "m^2" } else { "m^3" };
        let corner = |corner: [f64; 3]| corner.map(|x| format!("{x:.2}")).join(", ");
        format!(
            "{:.0} words end in {cells}: {} positions, {} orientations; {:.1} s\n\
             reach    {:.4} {unit}, from ({}) to ({}) m\n\
             holes    {:.4} {unit} in {} cells that no way leads to from outside\n\
             densest  {:.0} words about ({}) m",
            self.words,
            self.positions,
            self.orientations,
            self.took_s,
            self.region,
            corner(self.low_m),
            corner(self.high_m),
            self.holes,
            self.hole_cells,
            self.densest_words,
            corner(self.densest_m)
        )
    }
}
