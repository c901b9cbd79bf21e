//! The density of frames beside enumeration and beside random words, of position and orientation together, too.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Mutex;

use anyhow::{Context, Result};
use darm_arm::arm::{Arm, ArmScratch};
use darm_arm::reach::map::{Map, Place, Resolution, holes};
use darm_core::real::Vec3;
use darm_core::se::{Pose, rotation_log};
use darm_core::units::Word;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::reach::{Tables, best_of, spatial};
use darm_figures::figure::Figure;
use xtask::setup;

/// Random words beside the map of 64⁶.
const SAMPLES: usize = 10_000_000;
/// Edge of fine cells, m.
const FINE_M: f64 = 5e-3;
/// Cells that are added in order to time it, and how often: the best time counts.
const ADDED: usize = 1 << 25;
const ADDED_RUNS: usize = 5;
/// Frames of the last stages that are formed one by one, as in `darm map`.
const EXACT: usize = 1 << 18;
/// Edge of the cubes that densities are compared on, m: complete cells, and 2¹⁵ words leave few to a smaller one.
const COARSE_M: f64 = 0.4;
/// The same for 64⁶ words, and of position and orientation together, where the cubes of rotation vectors are of this many
/// cells.
const COARSE_SPATIAL_M: f64 = 0.1;
const COARSE_JOINT_M: f64 = 0.2;
const COARSE_JOINT_CELLS: i32 = 4;
/// Cells of the maps of planar arms, mm, and how many arms.
const CELLS_MM: [f64; 3] = [80.0, 40.0, 20.0];
const PLANAR_ARMS: usize = 8;

/// Counts, times and distances.
pub(super) fn measure(seed: u64) -> Result<Vec<Figure>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    // First: the memory of a process does not fall.
    let mut figures = fine()?;
    figures.extend(planar(&mut random)?);
    figures.extend(spatial_map(&mut random)?);
    Ok(figures)
}

/// Shares of all words by cubes.
#[derive(Default)]
struct Shares(HashMap<[i32; 3], f64>);

impl Shares {
    /// Cells of `cell_m` lie around integer multiples of it; the walls of the cubes are walls of cells.
    fn add(&mut self, position: &Vec3<f64>, edge_m: f64, cell_m: f64, share: f64) {
        *self.0.entry(cube(position, edge_m, cell_m)).or_default() += share;
    }

    /// The same of cells, of which a thousand million are looked up by runs in one cube, not each.
    fn add_cells(&mut self, cells: impl Iterator<Item = (Place, f64)>, edge_m: f64, cell_m: f64, words: f64) {
        let mut run: Option<([i32; 3], f64)> = None;
        let mut add = |(cube, count): ([i32; 3], f64)| *self.0.entry(cube).or_default() += count / words;
        for (place, count) in cells {
            let cube = cube(&Vec3::from(place).map(|number| f64::from(number) * cell_m), edge_m, cell_m);
            match &mut run {
                Some((at, sum)) if *at == cube => *sum += count,
                _ => run.replace((cube, count)).into_iter().for_each(&mut add),
            }
        }
        run.into_iter().for_each(add);
    }

    /// The L1 distance of two densities: 0 of equal ones, 2 of those that share nothing.
    fn distance(&self, other: &Self) -> f64 {
        let of = |shares: &Self, cube: &[i32; 3]| shares.0.get(cube).copied().unwrap_or(0.0);
        let both: f64 = self.0.iter().map(|(cube, share)| (share - of(other, cube)).abs()).sum();
        both + other.0.iter().filter(|(cube, _)| !self.0.contains_key(*cube)).map(|(_, share)| share).sum::<f64>()
    }
}

fn cube(position: &Vec3<f64>, edge_m: f64, cell_m: f64) -> [i32; 3] {
    position.map(|x| ((x + 0.5 * cell_m) / edge_m).floor() as i32).into()
}

/// Shares by cubes of positions, for each cube of rotation vectors.
type Joint = BTreeMap<[i32; 3], Shares>;

/// The cube of cells of rotation vectors.
fn coarse(cell: [i32; 3]) -> [i32; 3] {
    cell.map(|number| number.div_euclid(COARSE_JOINT_CELLS))
}

/// The L1 distance of two joint densities.
fn apart(one: &Joint, other: &Joint) -> f64 {
    let none = Shares::default();
    let cubes: BTreeSet<_> = one.keys().chain(other.keys()).collect();
    cubes.into_iter().map(|cube| one.get(cube).unwrap_or(&none).distance(other.get(cube).unwrap_or(&none))).sum()
}

/// The most memory that this process has had so far; 0 where the system does not report it.
fn peak_memory_gib() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kib = peak.and_then(|peak| peak.trim().trim_end_matches("kB").trim().parse::<f64>().ok());
    kib.unwrap_or(0.0) / f64::from(1 << 20)
}

fn of_map(map: &Map, edge_m: f64) -> Shares {
    let mut shares = Shares::default();
    let cells = map.spots().into_iter().map(|(place, spot)| (place, spot.words));
    shares.add_cells(cells, edge_m, map.resolution.cell_m, map.words());
    shares
}

/// Fine cells: 2¹⁸ words of an arm in space, and its holes.
fn fine() -> Result<Vec<Figure>> {
    let arm = Arm::read(&setup::root().join("examples/spatial3.toml"))?;
    let resolution = Resolution::new(FINE_M, 10f64.to_radians());
    let run = || -> Result<usize> {
        let map = Map::new(&arm, &[], resolution, |_| true)?;
        Ok(holes(&map.spots(), false).len())
    };
    let (enclosed, took_ms) = best_of(1, run);
    enclosed?;
    Ok(vec![
        Figure::new("map of 2^18 words, cells of 5 mm: time", 1e-3 * took_ms, "s")?,
        Figure::new("map of 2^18 words, cells of 5 mm: memory", 1024.0 * peak_memory_gib(), "MiB")?,
    ])
}

/// The time of adding as many cells in the order of memory, s: a part of them is timed.
fn in_order_s(cells: f64) -> f64 {
    let words = vec![1.0; ADDED];
    let mut sums = vec![0.0; ADDED];
    let (_, ms) = best_of(ADDED_RUNS, || {
        sums.iter_mut().zip(&words).for_each(|(sum, words)| *sum += words);
        std::hint::black_box(&mut sums);
    });
    1e-3 * ms * cells / ADDED as f64
}

/// Five planar modules: 2¹⁵ words, enumerated; means of arms whose legs are a little off, for those of equal modules
/// end on a lattice.
fn planar(random: &mut ChaCha8Rng) -> Result<Vec<Figure>> {
    let (mut lost, mut apart) = (0.0, CELLS_MM.map(|_| 0.0));
    for _ in 0..PLANAR_ARMS {
        let arm = planar_arm(random)?;
        let (mut positions, mut scratch) = (Vec::new(), ArmScratch::default());
        let words = 1u32 << arm.n_actuators();
        for bits in 0..words {
            let digits: Vec<u8> = (0..arm.n_actuators()).map(|k| (bits >> k & 1) as u8).collect();
            positions.push(arm.model.chain.pose_base_tool(&Word::new(&digits)?, &[], &mut scratch)?.position);
        }
        for (apart, cell_mm) in apart.iter_mut().zip(CELLS_MM) {
            let resolution = Resolution { cell_m: 1e-3 * cell_mm, cell_rad: 2e-3 * cell_mm, max_exact: 1 };
            let map = Map::with_layers(&arm, &[], resolution, |_| true, |_| ())?;
            let mut exact = Shares::default();
            positions.iter().for_each(|at| exact.add(at, COARSE_M, resolution.cell_m, 1.0 / f64::from(words)));
            lost += (map.words() - f64::from(words)).abs();
            *apart += of_map(&map, COARSE_M).distance(&exact) / PLANAR_ARMS as f64;
        }
    }
    let mut figures = vec![Figure::new("map, 2^15 planar words: words lost or made", lost, "")?];
    for (apart, cell_mm) in apart.iter().zip(CELLS_MM) {
        figures.push(Figure::new(&format!("map, 2^15 planar words, cells of {cell_mm} mm: L1 distance"), *apart, "")?);
    }
    Ok(figures)
}

fn planar_arm(random: &mut ChaCha8Rng) -> Result<Arm> {
    let mut arm = Arm::read(&setup::root().join("examples/planar4.toml"))?;
    let module = arm.model.chain.stages[0];
    arm.model.chain.stages.push(module).ok().context("the arm has too many stages")?;
    for stage in &mut arm.model.chain.stages {
        for leg in 0..3 {
            let lengths = stage.leg_mut(leg).map(|leg| &mut leg.length_m).context("a module has three legs")?;
            lengths.iter_mut().for_each(|length| *length += random.random_range(-0.03..0.03));
        }
    }
    Ok(arm)
}

/// Shares of random words by cubes of positions, and jointly with cubes of rotation vectors.
fn random_words(tables: &Tables, resolution: &Resolution, random: &mut ChaCha8Rng) -> (Shares, Joint) {
    let modules = tables.modules();
    let (mut sampled, mut joint_sampled) = (Shares::default(), Joint::default());
    for _ in 0..SAMPLES {
        let frame =
            |module: &darm_core::nearest::Module<f64>| module.frames[random.random_range(0..module.frames.len())].pose;
        let pose = modules.iter().map(frame).fold(Pose::identity(), |pose, next| pose * next);
        sampled.add(&pose.position, COARSE_SPATIAL_M, resolution.cell_m, 1.0 / SAMPLES as f64);
        let turn = (rotation_log(&pose.rotation) / resolution.cell_rad).map(|cells| cells.round() as i32);
        let shares = joint_sampled.entry(coarse(turn.into())).or_default();
        shares.add(&pose.position, COARSE_JOINT_M, resolution.cell_m, 1.0 / SAMPLES as f64);
    }
    (sampled, joint_sampled)
}

/// 64⁶ words at 20 mm and 10°, beside random words.
fn spatial_map(random: &mut ChaCha8Rng) -> Result<Vec<Figure>> {
    let arm = spatial(random)?;
    let resolution = Resolution::new(0.02, 10f64.to_radians());
    let (map, took_ms) = best_of(1, || Map::new(&arm, &[], resolution, |_| true));
    let map = map?;
    let memory_gib = peak_memory_gib();
    let tables = Tables::new(&arm);
    let (sampled, joint_sampled) = random_words(&tables, &resolution, random);
    let (joint, words) = (Mutex::new(Joint::default()), map.words());
    Map::with_layers(
        &arm,
        &[],
        Resolution { max_exact: EXACT, ..resolution },
        |_| true,
        |layer| {
            let mut own = Shares::default();
            own.add_cells(layer.cells(), COARSE_JOINT_M, resolution.cell_m, words);
            if let Ok(mut joint) = joint.lock() {
                let shares = joint.entry(coarse(layer.orientation.map(i32::from))).or_default();
                own.0.into_iter().for_each(|(cube, share)| *shares.0.entry(cube).or_default() += share);
            }
        },
    )?;
    let joint = joint.into_inner().unwrap_or_default();
    let joint_apart = apart(&joint, &joint_sampled);
    let counted: f64 = joint.values().flat_map(|shares| shares.0.values()).sum();
    let density = of_map(&map, COARSE_SPATIAL_M);
    // The mean absolute deviation of a share p counted n times is √(2p(1 − p)/(πn)).
    let by_chance = |share: &f64| (2.0 * share * (1.0 - share) / (std::f64::consts::PI * SAMPLES as f64)).sqrt();
    let lost = (map.words() / 64f64.powi(6) - 1.0).abs();
    Ok(vec![
        Figure::new("map of 64^6: time", took_ms * 1e-3, "s")?,
        Figure::new(
            "map of 64^6: time over adding as many cells in order",
            took_ms * 1e-3 / in_order_s(map.moved),
            "",
        )?,
        Figure::new("map of 64^6: memory", memory_gib, "GiB")?,
        Figure::new("map of 64^6: cells of position and orientation", map.n_cells().unwrap_or(0.0), "")?,
        Figure::new("map of 64^6: words of the joint density lost or made, relative", (counted - 1.0).abs(), "")?,
        Figure::new("map of 64^6: L1 distance of the joint density to random words", joint_apart, "")?,
        Figure::new(
            "map of 64^6: L1 distance of the joint density by chance alone",
            joint.values().flat_map(|shares| shares.0.values()).map(by_chance).sum(),
            "",
        )?,
        Figure::new("map of 64^6: words lost or made, relative", lost, "")?,
        Figure::new("map of 64^6: positions reached", map.spots().len() as f64, "")?,
        Figure::new("map of 64^6: L1 distance to random words", density.distance(&sampled), "")?,
        Figure::new("map of 64^6: L1 distance by chance alone", density.0.values().map(by_chance).sum(), "")?,
    ])
}
