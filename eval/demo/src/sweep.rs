//! The loop for many seeds in this process, in one table: how often is it right?

use anyhow::Result;
use darm_diagnose::truth::Kind;
use darm_figures::figure::Figure;
use darm_figures::items::Job;
use darm_figures::progress::Progress;
use darm_figures::shard::Shard;
use darm_measure::median;
use serde::{Deserialize, Serialize};

use crate::ArmKind;
use crate::course::{self, Course};
use crate::rig::Rig;

/// Seeds 1 to `seeds` of an arm.
#[derive(Serialize, Deserialize)]
pub struct Sweep {
    pub(super) seeds: u64,
    pub(super) arm: ArmKind,
    #[serde(with = "effect")]
    pub(super) effect: Option<Kind>,
}

/// An effect by its name on the command line.
mod effect {
    use darm_diagnose::truth::Kind;
    use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer, de};

    pub(super) fn serialize<S: Serializer>(effect: &Option<Kind>, serializer: S) -> Result<S::Ok, S::Error> {
        effect.map(|kind| kind.to_string()).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Kind>, D::Error> {
        let name = Option::<String>::deserialize(deserializer)?;
        name.map(|name| name.parse().map_err(de::Error::custom)).transpose()
    }
}

/// What came of one seed.
#[derive(Serialize, Deserialize)]
pub struct Row {
    is_named: bool,
    is_placed: bool,
    is_false_name: bool,
    reaches_goal: bool,
    /// Error at the frames before, m.
    before_m: f64,
    /// The same once the loop is closed.
    after_m: Option<f64>,
    /// Held-out error with the effects found over the repeatability.
    ratio: Option<f64>,
    line: String,
}

impl Job for Sweep {
    const COMMAND: &'static str = "demo --sweep";
    type Bench = ();
    type Outcome = Row;

    fn items(&self) -> Result<Vec<String>> {
        Ok((1..=self.seeds).map(|seed| format!("seed {seed}")).collect())
    }

    fn bench(&self, _: Shard) -> Result<()> {
        Ok(())
    }

    fn run(&self, (): &(), item: usize) -> Result<Row> {
        let seed = 1 + item as u64;
        let task = self.arm.task(seed, self.effect)?;
        let design = task.design()?;
        let mut rig = Rig::in_process(&design.arm)?;
        let course = course::run(&task, design, &mut rig, &Progress::silent(), &mut |_, _| Ok(()))?;
        Ok(Row {
            is_named: course.named_rightly(),
            is_placed: course.placed_rightly(),
            is_false_name: course.diagnosis.verdict.names_effects() && !course.named_rightly(),
            reaches_goal: course.closed.as_ref().is_some_and(|closed| closed.errors().rms_m() <= course.goal_m()),
            before_m: course.before.rms_m(),
            after_m: course.closed.as_ref().map(|closed| closed.errors().rms_m()),
            ratio: ratio(&course),
            line: line(seed, &course),
        })
    }

    /// The board in this process has a separate clock, and the diagnosis uses all cores.
    fn runs_alone(&self, _: usize) -> bool {
        true
    }

    fn figures(&self, rows: &[Row]) -> Result<Vec<Figure>> {
        println!("{HEADER}");
        rows.iter().for_each(|row| println!("{}", row.line));
        let seeds = self.seeds;
        let count = |name: &str, is: fn(&Row) -> bool| {
            let count = rows.iter().filter(|row| is(row)).count();
            Figure::new(&format!("{name}, of {seeds}"), count as f64, "arms")
        };
        if self.effect == Some(Kind::Nothing) {
            return Ok(vec![count("false names on clean arms", |row| row.is_false_name)?]);
        }
        let worst_ratio = rows.iter().filter_map(|row| row.ratio).fold(0.0, f64::max);
        let mut figures = vec![
            count("effects named rightly", |row| row.is_named)?,
            count("place named rightly too", |row| row.is_placed)?,
            Figure::new(&format!("largest held-out error over repeatability, of {seeds}"), worst_ratio, "times")?,
        ];
        match self.arm {
            ArmKind::Planar | ArmKind::Hybrid => {
                figures.push(count("stops: arms that reach the goal", |row| row.reaches_goal)?);
            }
            ArmKind::Spatial6 => {
                figures.push(count("words alone: arms that reach the goal", |row| row.reaches_goal)?);
                figures.extend(errors(rows)?);
            }
        }
        Ok(figures)
    }

    fn seed(&self) -> u64 {
        self.seeds
    }
}

/// Errors at the positions with the words of the drawing and with better ones, of the arms where the loop was closed.
fn errors(rows: &[Row]) -> Result<[Figure; 3]> {
    let closed = || rows.iter().filter_map(|row| Some((row.before_m, row.after_m?)));
    let figure = |name: &str, error_m: Option<f64>| {
        let name = format!("words alone: error at the positions {name}");
        Figure::new(&name, error_m.map_or(f64::NAN, |m| 1e3 * m), "mm")
    };
    Ok([
        figure("before, median", median(closed().map(|(before_m, _)| before_m)))?,
        figure("after, median", median(closed().map(|(_, after_m)| after_m)))?,
        figure("after, largest", closed().map(|(_, after_m)| after_m).reduce(f64::max))?,
    ])
}

const HEADER: &str = "\
seed  hidden effect    place                       verdict                named                                     held-out error   at the frames, mm
                                                                                                                      over repeats   before  stops  table";

/// Held-out error with the effects found over the repeatability.
fn ratio(course: &Course) -> Option<f64> {
    let after = course.diagnosis.error.after.held_out.as_ref()?.norm.value;
    Some(after / course.diagnosis.repeatability.as_ref()?.norm.value)
}

fn line(seed: u64, course: &Course) -> String {
    let diagnosis = &course.diagnosis;
    let named: Vec<String> = diagnosis.effects.iter().map(|found| format!("{} {}", found.law, found.site)).collect();
    let ratio = ratio(course).map_or("-".to_owned(), |ratio| format!("{ratio:.2}"));
    let closed = course.closed.as_ref().map_or("     -      -".to_owned(), |closed| {
        let stops = closed.by_stops.as_ref().map_or("-".to_owned(), |by| format!("{:.2}", 1e3 * by.errors.rms_m()));
        format!("{stops:>6} {:6.2}", 1e3 * closed.table_only.rms_m())
    });
    let right = if course.placed_rightly() { "" } else { "  <-" };
    format!(
        "{seed:4}  {:15}  {:26}  {:21}  {:40}  {ratio:>14}   {:6.2} {closed}{right}",
        course.sealed.effect,
        course.sealed.place,
        format!("{:?}", diagnosis.verdict),
        named.join(" + "),
        1e3 * course.before.rms_m(),
    )
}
