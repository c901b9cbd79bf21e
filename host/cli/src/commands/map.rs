//! `darm map`: density of the reachable frames, and holes.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context as _;
use darm_arm::arm::Arm;
use darm_arm::reach::map::{Map as Density, Place, Resolution, holes};
use serde::Serialize;

use super::servos::ServoArgs;
use crate::failure::Usage;
use crate::output_file::{self, Syntax};
use crate::overwrite::OutputFile;
use crate::pages::density;
use crate::ui::{Answer, Ui};
use darm_measure::csv_text::csv_text;

const EXAMPLES: &str = "\
Examples:
  darm map planar4.toml                                   # in cells of 20 mm and 10 deg
  darm map planar4.toml --plot map.svg -o map.csv
  darm map spatial6.toml --cell 200 --angle 30 --view yz --plot side.svg

The CSV has one line per cell of position: x_m,y_m,z_m, number of words, number of cells of orientation. The last is empty \
where position and orientation together have too many cells to count.";

/// Map the density of reachable frames over position and orientation, without enumerating all words
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Map {
    /// The arm
    #[arg(value_name = "ARM.toml")]
    arm: PathBuf,
    /// Edge of a cell of position, in mm
    #[arg(long, value_name = "MM", default_value_t = 20.0)]
    cell: f64,
    /// Edge of a cell of orientation, in degrees
    #[arg(long, value_name = "DEG", default_value_t = 10.0)]
    angle: f64,
    #[command(flatten)]
    servos: ServoArgs,
    /// Plot the density, summed along the line of sight
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<OutputFile>,
    /// Plane of the plot; default: xy for a planar arm, else xz
    #[arg(long, value_enum)]
    view: Option<View>,
    /// Write the densities
    #[arg(short, long, value_name = "FILE.csv")]
    output: Option<OutputFile>,
}

/// Plane of a plot.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum View {
    Xy,
    Xz,
    Yz,
}

#[derive(Serialize)]
struct Reached {
    words: f64,
    /// Cells of position and orientation; null where they are too many to count.
    cells: Option<f64>,
    positions: usize,
    orientations: usize,
    low_m: [f64; 3],
    high_m: [f64; 3],
    #[serde(flatten)]
    region: Region,
    hole_cells: usize,
    densest_m: [f64; 3],
    densest_words: f64,
    took_s: f64,
}

/// Size of the reachable region and of its holes: an area for a planar arm, else a volume.
#[derive(Serialize)]
#[serde(untagged)]
enum Region {
    Area { region_m2: f64, holes_m2: f64 },
    Volume { region_m3: f64, holes_m3: f64 },
}

impl Region {
    fn new(planar: bool, cell_m: f64, cells: usize, hole_cells: usize) -> Self {
        let size = |cells: usize, power: i32| cell_m.powi(power) * cells as f64;
        match planar {
            true => Self::Area { region_m2: size(cells, 2), holes_m2: size(hole_cells, 2) },
            false => Self::Volume { region_m3: size(cells, 3), holes_m3: size(hole_cells, 3) },
        }
    }

    /// Region, holes and unit.
    fn shown(&self) -> (f64, f64, &'static str) {
        match *self {
            Self::Area { region_m2, holes_m2 } => (region_m2, holes_m2, "m^2"),
            Self::Volume { region_m3, holes_m3 } => (region_m3, holes_m3, "m^3"),
        }
    }
}

impl Map {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let arm = Arm::read(&self.arm)?;
        let fine = |size: f64, low: f64, high: f64| size.is_finite() && (low..=high).contains(&size);
        if !fine(self.cell, 0.1, 1e4) || !fine(self.angle, 0.1, 180.0) {
            return Err(Usage("--cell must be 0.1 to 10000 mm, --angle 0.1 to 180 deg".to_owned()).into());
        }
        let resolution = Resolution::new(1e-3 * self.cell, self.angle.to_radians());
        let servos_rad = self.servos.rad(&arm)?;
        let start = Instant::now();
        let bar = ui.progress_bar("stages", 100, "%");
        let go_on = |share| {
            bar.set_position((100.0 * share) as u64);
            true
        };
        let map = Density::new(&arm, &servos_rad, resolution, go_on)?;
        bar.finish_and_clear();
        let planar = arm.model.chain.is_planar();
        let spots = map.spots();
        let holes = holes(&spots, planar);
        let at = |place: &Place| place.map(|number| f64::from(number) * resolution.cell_m);
        let bound = |pick: fn(f64, f64) -> f64, start: f64| {
            spots.keys().fold([start; 3], |bound, place| std::array::from_fn(|axis| pick(bound[axis], at(place)[axis])))
        };
        let densest = spots
            .iter()
            .max_by(|a, b| a.1.words.total_cmp(&b.1.words))
            .context("no word has a pose; check the geometry of the arm")?;
        if let Some(path) = &self.plot {
            let axes = match self.view {
                Some(View::Xy) => [0, 1],
                Some(View::Xz) => [0, 2],
                Some(View::Yz) => [1, 2],
                None => [0, if planar { 1 } else { 2 }],
            };
            output_file::write_text(path, Syntax::Svg, &density::svg(&spots, axes, resolution.cell_m))?;
        }
        if let Some(path) = &self.output {
            let head = ["x_m", "y_m", "z_m", "words", "orientations"].map(str::to_owned);
            let rows = spots.iter().map(|(place, spot)| {
                let [x, y, z] = at(place).map(|number| format!("{number:.6}"));
                let orientations = spot.orientations.map_or_else(String::new, |count| count.to_string());
                [x, y, z, spot.words.to_string(), orientations]
            });
            output_file::write_text(path, Syntax::Csv, &csv_text(std::iter::once(head).chain(rows)))?;
        }
        ui.print(&Reached {
            words: map.words(),
            cells: map.n_cells(),
            positions: spots.len(),
            orientations: map.orientations.len(),
            low_m: bound(f64::min, f64::INFINITY),
            high_m: bound(f64::max, f64::NEG_INFINITY),
            region: Region::new(planar, resolution.cell_m, spots.len(), holes.len()),
            hole_cells: holes.len(),
            densest_m: at(densest.0),
            densest_words: densest.1.words,
            took_s: start.elapsed().as_secs_f64(),
        })
    }
}

impl Answer for Reached {
    fn text(&self) -> String {
        let cells = self.cells.map_or("more cells than can be counted".to_owned(), |cells| format!("{cells:.0} cells"));
        let (region, holes, unit) = self.region.shown();
        let corner = |corner: [f64; 3]| corner.map(|x| format!("{x:.2}")).join(", ");
        format!(
            "{:.0} words in {cells}: {} positions, {} orientations; {:.1} s\n\
             reach    {region:.4} {unit}, from ({}) to ({}) m\n\
             holes    {holes:.4} {unit} in {} enclosed unreachable cells\n\
             densest  {:.0} words at ({}) m",
            self.words,
            self.positions,
            self.orientations,
            self.took_s,
            corner(self.low_m),
            corner(self.high_m),
            self.hole_cells,
            self.densest_words,
            corner(self.densest_m)
        )
    }
}
