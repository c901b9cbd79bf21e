//! Hostile runs: power cuts in the emulator, damaged frames and lines on the PC, a port that another program holds, a live page that is killed. The tests run them short, this runs them long.

use std::process::Command;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use darm_figures::figure::Figure;
use darm_figures::items::{self, Spread};
use darm_figures::shard::Shard;
use serde::{Deserialize, Serialize};
use xtask::image::{self, Board};
use xtask::setup::{self, Emulator};
use xtask::step;

const BUILD_LIMIT: Duration = Duration::from_secs(1800);

/// Cuts the power at seeded moments, sends damaged frames, stops through a port that is held, kills the live page; prints the counts
#[derive(clap::Args)]
pub(crate) struct Faults {
    #[command(flatten)]
    job: Job,
    #[command(flatten)]
    spread: Spread,
}

/// How often each fault is injected.
#[derive(clap::Args, Serialize, Deserialize)]
pub(crate) struct Job {
    /// Kill the emulator this many times during uploads and stores, and start it again on the same flash
    #[arg(long, value_name = "COUNT")]
    kills: Option<u64>,
    /// Send this many random and mutated frames and lines to the decoder and the dispatcher
    #[arg(long, value_name = "COUNT")]
    frames: Option<u64>,
    /// Stop the arm this many times while another program holds the port
    #[arg(long, value_name = "COUNT")]
    stops: Option<u64>,
    /// Stop a board in this process this many times with each form of a stop in each state, and print the longest times to safe pins,
    /// to the servos' orders and to the answer, in virtual ms
    #[arg(long, value_name = "COUNT")]
    stop_times: Option<u64>,
    /// Cut the power of the Pico within each operation of an upload this many times, each time with another noise; prints
    /// its longest control tick, stack, sizes and upload rate too
    #[arg(long, value_name = "COUNT")]
    pico: Option<u64>,
    /// Cut the power this many times within an operation of the flash of the B-L475E-IOT01A, while its driver stores on a model of
    /// the controller: QEMU has none
    #[arg(long, value_name = "COUNT")]
    store: Option<u64>,
    /// Kill `darm serve` this many times while tables are played, and look whether its history has every run that ended
    #[arg(long, value_name = "COUNT")]
    serve: Option<u64>,
    /// Attack `darm serve`: files that name others, files that expand, uploads that trickle, and a flood of connections for this
    /// many seconds, with stops of a page with control and by new connections
    #[arg(long, value_name = "SECONDS")]
    attack: Option<u64>,
    /// Keep the live page of an arm of 64^6 words open for this many seconds: time on the processor of `darm serve`, time until
    /// the page can be used in Chromium, size of what is embedded
    #[arg(long, value_name = "SECONDS")]
    page: Option<u64>,
}

/// A test that injects faults, as often as a variable says.
struct Injection {
    name: &'static str,
    arguments: &'static [&'static str],
    variable: &'static str,
    /// Most faults of one item.
    batch: u64,
}

const KILLS: Injection = Injection {
    name: "kills",
    arguments: &["--package", "darm-tests", "--test", "qemu", "power_cuts"],
    variable: "DARM_KILLS",
    batch: 50,
};
const FRAMES: Injection = Injection {
    name: "frames",
    arguments: &["--package", "darm-firmware", "--lib", "frames"],
    variable: "DARM_FRAMES",
    batch: 100_000,
};
const STOPS: Injection = Injection {
    name: "stops",
    arguments: &["--package", "darm-tests", "--test", "stop", "stop_gets_through"],
    variable: "DARM_STOPS",
    batch: 20,
};

const STOP_TIMES: Injection = Injection {
    name: "stop-times",
    arguments: &["--package", "darm-sim", "--lib", "every_form_of_a_stop"],
    variable: "DARM_STOP_TIMES",
    batch: u64::MAX,
};

const PICO: Injection = Injection {
    name: "pico",
    arguments: &["--package", "darm-tests", "--test", "pico"],
    variable: "DARM_PICO_NOISES",
    batch: u64::MAX,
};

const STORE: Injection = Injection {
    name: "store",
    arguments: &["--package", "darm-b-l475e-iot01a", "--lib", "store_cuts"],
    variable: "DARM_STORE_CUTS",
    batch: 500,
};

const SERVE: Injection = Injection {
    name: "serve",
    arguments: &["--package", "darm", "--test", "cli", "serve_kills"],
    variable: "DARM_SERVE_KILLS",
    batch: 50,
};

const ATTACK: Injection = Injection {
    name: "attack",
    arguments: &["--package", "darm-serve", "--test", "serve", "attack_figures"],
    variable: "DARM_ATTACK_SECONDS",
    batch: u64::MAX,
};

/// No fault: what an open page costs.
const PAGE: Injection = Injection {
    name: "page",
    arguments: &["--package", "darm", "--package", "darm-serve", "page_figures"],
    variable: "DARM_PAGE_SECONDS",
    batch: u64::MAX,
};

/// Part of an injection.
pub(crate) struct Item {
    injection: &'static Injection,
    seed: u64,
    count: u64,
}

/// What a test measured.
#[derive(Serialize, Deserialize)]
pub(crate) struct Row {
    name: String,
    value: f64,
    unit: String,
}

impl Faults {
    pub(crate) fn run(&self) -> Result<()> {
        if self.job.parts().is_empty() {
            bail!(
                "nothing to do: give --kills, --frames, --stops, --stop-times, --pico, --store or --serve, each with a COUNT, or --attack or --page SECONDS"
            );
        }
        items::run(&self.job, &self.spread)
    }
}

impl Job {
    fn parts(&self) -> Vec<Item> {
        let injections = [
            (&KILLS, self.kills),
            (&FRAMES, self.frames),
            (&STOPS, self.stops),
            (&STOP_TIMES, self.stop_times),
            (&PICO, self.pico),
            (&STORE, self.store),
            (&SERVE, self.serve),
            (&ATTACK, self.attack),
            (&PAGE, self.page),
        ];
        let of = |(injection, count): (&'static Injection, Option<u64>)| {
            let (count, batch) = (count.unwrap_or(0), injection.batch);
            (0..count.div_ceil(batch)).map(move |k| Item { injection, seed: k, count: batch.min(count - k * batch) })
        };
        injections.into_iter().flat_map(of).collect()
    }
}

impl items::Job for Job {
    const COMMAND: &'static str = "faults";
    type Bench = Vec<Item>;
    type Outcome = Vec<Row>;

    fn items(&self) -> Result<Vec<String>> {
        Ok(self.parts().iter().map(|item| format!("{} {}", item.injection.name, item.seed)).collect())
    }

    fn bench(&self, _: Shard) -> Result<Vec<Item>> {
        if self.kills.or(self.stops).is_some() {
            prepare_emulator(Board::BL475eIot01a)?;
        }
        if self.pico.is_some() {
            prepare_emulator(Board::Pico)?;
        }
        if self.stops.is_some() {
            let mut build = Command::new("cargo");
            build.current_dir(setup::root()).args(["build", "--package", "darm"]);
            step::run("build darm", &mut build, BUILD_LIMIT, "run `cargo build --package darm`")?;
        }
        Ok(self.parts())
    }

    fn run(&self, parts: &Vec<Item>, item: usize) -> Result<Vec<Row>> {
        run_test(&parts[item])
    }

    /// One emulator at a time, and one cargo.
    fn runs_alone(&self, _: usize) -> bool {
        true
    }

    /// Counts are added up; of times the longest counts.
    fn figures(&self, outcomes: &[Vec<Row>]) -> Result<Vec<Figure>> {
        let mut sizes = Vec::new();
        if self.pico.is_some() {
            let elf = image::build_for(Board::Pico)?;
            sizes =
                image::sizes(&elf)?.map(|(name, bytes)| Figure::new(&format!("pico: {name}"), bytes, "bytes")).into();
        }
        let mut all: Vec<(&str, f64, &str)> = Vec::new();
        for Row { name, value, unit } in outcomes.iter().flatten() {
            match all.iter_mut().find(|(known, _, _)| known == name) {
                Some((_, known, unit)) if *unit == "s" => *known = known.max(*value),
                Some((_, known, _)) => *known += value,
                None => all.push((name, *value, unit)),
            }
        }
        all.into_iter().map(|(name, value, unit)| Figure::new(name, value, unit)).chain(sizes).collect()
    }

    fn seed(&self) -> u64 {
        0
    }
}

fn prepare_emulator(board: Board) -> Result<()> {
    if let Emulator::Absent(why) = board.emulator() {
        bail!("this runs in the emulator, and there is none: {why}");
    }
    image::build_for(board).map(|_| ())
}

/// Runs a test with its seed; its figures are the lines `FIGURE name = value unit`.
fn run_test(Item { injection, seed, count }: &Item) -> Result<Vec<Row>> {
    let mut command = Command::new("cargo");
    command.current_dir(setup::root()).arg("test").args(injection.arguments).args(["--", "--nocapture"]);
    command.env(injection.variable, count.to_string()).env("DARM_SEED", seed.to_string());
    let output = command.output().context("cargo did not start")?;
    let text = String::from_utf8_lossy(&output.stdout);
    if !output.status.success() {
        bail!("the run failed:\n{text}\n{}", String::from_utf8_lossy(&output.stderr));
    }
    let rows = text.lines().filter_map(|line| line.split_once("FIGURE ")).map(|(_, figure)| row(figure));
    let rows = rows.collect::<Result<Vec<_>>>()?;
    if rows.is_empty() {
        bail!("the test printed no figure:\n{text}");
    }
    Ok(rows)
}

fn row(line: &str) -> Result<Row> {
    let (name, value) = line.split_once(" = ").context("a figure without a value")?;
    let (value, unit) = value.split_once(' ').context("a figure without a unit")?;
    let value = value.parse().context("a figure that is not a number")?;
    Ok(Row { name: name.to_owned(), value, unit: unit.to_owned() })
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::{Path, PathBuf};

    use darm_figures::items::Job as _;

    use super::{ATTACK, FRAMES, Injection, Job, KILLS, PAGE, PICO, Row, SERVE, STOP_TIMES, STOPS, STORE, row, setup};

    const JOB: Job = Job {
        kills: Some(120),
        frames: None,
        stops: Some(20),
        stop_times: None,
        pico: None,
        store: None,
        serve: Some(60),
        attack: None,
        page: None,
    };

    fn files_below(folder: &Path) -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let is_built = |path: &PathBuf| path.ends_with("target");
        entries
            .filter(|path| !is_built(path))
            .flat_map(|path| if path.is_dir() { files_below(&path) } else { vec![path] })
            .collect()
    }

    /// A test that has moved to another package would be looked for where it is not.
    #[test]
    fn each_injection_names_a_package_that_reads_its_variable() {
        let manifests = files_below(&setup::root()).into_iter().filter(|path| path.ends_with("Cargo.toml"));
        let packages: Vec<(PathBuf, String)> =
            manifests.map(|path| (path.parent().unwrap().to_owned(), fs::read_to_string(&path).unwrap())).collect();
        for Injection { name, arguments, variable, .. } in
            [&KILLS, &FRAMES, &STOPS, &STOP_TIMES, &PICO, &STORE, &SERVE, &ATTACK, &PAGE]
        {
            let named = arguments
                .windows(2)
                .filter(|pair| pair[0] == "--package")
                .map(|pair| format!("name = \"{}\"", pair[1]));
            let is_read = |package: String| {
                let own = packages.iter().filter(|(_, manifest)| manifest.lines().any(|line| line == package));
                let texts =
                    own.flat_map(|(folder, _)| files_below(folder)).filter_map(|path| fs::read_to_string(path).ok());
                texts.into_iter().any(|text| text.contains(&format!("\"{variable}\"")))
            };
            assert!(named.into_iter().any(is_read), "{name}");
        }
    }

    #[test]
    fn faults_are_split_into_seeded_parts_that_add_up() {
        assert_eq!(JOB.items().unwrap(), ["kills 0", "kills 1", "kills 2", "stops 0", "serve 0", "serve 1"]);
        let parts = JOB.parts();
        assert_eq!(parts.iter().map(|part| part.count).collect::<Vec<_>>(), [50, 50, 20, 20, 50, 10]);
    }

    #[test]
    fn counts_are_added_and_the_longest_time_counts() {
        let part = |cuts: f64, time_s: f64| {
            vec![row(&format!("cuts = {cuts} cuts")).unwrap(), row(&format!("longest = {time_s} s")).unwrap()]
        };
        let outcomes: [Vec<Row>; 2] = [part(3.0, 0.5), part(4.0, 0.25)];
        let figures = JOB.figures(&outcomes).unwrap();
        assert_eq!((figures[0].value, figures[1].value), (7.0, 0.5));
    }
}
