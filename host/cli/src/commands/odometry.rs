//! `darm odometry`: the pose of a robot with two driven wheels on one axle, and the inverse.

mod readings;

use std::f64::consts::TAU;
use std::path::PathBuf;

use darm_core::odometry::{Drive, Estimate, Velocity};
use darm_core::real::Vec2;
use serde::Serialize;

use self::readings::{Reading, read};
use crate::failure::Usage;
use crate::number_text::numbers;
use crate::ui::{Answer, Ui, columns, number};
use darm_measure::csv_text::csv_line;

const EXAMPLES: &str = "\
Examples:
  darm odometry drive.csv --radius 33 --track 160 --ticks-per-turn 4096
  darm odometry drive.csv --radius 33 --track 160 --ticks-per-turn 4096 --csv > path.csv
  darm odometry drive.csv --radius 33 --track 160 --ticks-per-turn 4096 --counter-bits 16
  darm odometry --radius 33 --track 160 --ticks-per-turn 4096 --ticks 900,1100 --rate 50
  darm odometry --radius 33 --track 160 --speeds 340,360 --time 2   # deg/s
  darm odometry --radius 33 --track 160 --velocity 200,-30   # the inverse: speeds of the wheels
  darm odometry --radius 33 --track 160 --ticks-per-turn 4096 --to 500,200   # the arc

Columns of the table: left_ticks and right_ticks, counted since the row before, or left_count and right_count, running totals; or \
left_rad_s and right_rad_s (or _deg_s), from each row to the next; t_s with speeds, optional otherwise. The robot starts at the origin \
with x ahead and y to the left; headings turn to the left. Between two rows it drives along an arc.";

/// Compute the pose of a differential drive from its encoders, or its wheels from a velocity or a place
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
#[command(
    override_usage = "darm odometry --radius <MM> --track <MM> [OPTIONS] <FILE.csv|--ticks …|--speeds …|--velocity …|--to …>"
)]
#[command(group = clap::ArgGroup::new("motion").args(["file", "ticks", "speeds", "velocity", "to"]).required(true))]
pub(crate) struct Odometry {
    /// Ticks or speeds over time
    #[arg(value_name = "FILE.csv")]
    file: Option<PathBuf>,
    /// Radius of the wheels, mm
    #[arg(long, value_name = "MM")]
    radius: f64,
    /// Distance between the wheels, mm
    #[arg(long, value_name = "MM")]
    track: f64,
    /// Encoder ticks per turn of a wheel
    #[arg(long, value_name = "N")]
    ticks_per_turn: Option<f64>,
    /// Width of the counters of the encoders in FILE.csv, which wrap: 8, 16 or 32 bits, say
    #[arg(long, value_name = "BITS", requires = "file", value_parser = clap::value_parser!(u32).range(4..=53))]
    counter_bits: Option<u32>,
    /// Variance of the travel of a wheel per m of it, mm²: the standard deviations of the pose are printed
    #[arg(long, value_name = "MM2", default_value_t = 0.0)]
    variance: f64,
    /// Ticks of the left and the right wheel in one reading
    #[arg(long, value_name = "LEFT,RIGHT", allow_hyphen_values = true, requires = "ticks_per_turn")]
    ticks: Option<String>,
    /// Readings a second of --ticks: velocities are printed
    #[arg(long, value_name = "HZ", requires = "ticks")]
    rate: Option<f64>,
    /// Speeds of the left and the right wheel, deg/s
    #[arg(long, value_name = "LEFT,RIGHT", allow_hyphen_values = true, requires = "time")]
    speeds: Option<String>,
    /// Duration of --speeds, s
    #[arg(long, value_name = "S", requires = "speeds")]
    time: Option<f64>,
    /// Velocity ahead in mm/s and to the left in deg/s: print the speeds of the wheels
    #[arg(long, value_name = "V,W", allow_hyphen_values = true)]
    velocity: Option<String>,
    /// Place in mm: print the travel of the wheels along the arc there; with a heading, in deg, it has to be that of the arc
    #[arg(long, value_name = "X,Y[,HEADING]", allow_hyphen_values = true)]
    to: Option<String>,
    /// Print comma-separated values: a row per pose
    #[arg(long)]
    csv: bool,
}

/// Where the robot is after a reading.
#[derive(Serialize)]
struct Row {
    #[serde(skip_serializing_if = "Option::is_none")]
    t_s: Option<f64>,
    x_m: f64,
    y_m: f64,
    heading_rad: f64,
    /// Velocity during the reading, where its duration is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    v_m_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    w_rad_s: Option<f64>,
    /// Standard deviations, where a variance is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    x_sd_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    y_sd_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    heading_sd_rad: Option<f64>,
}

#[derive(Serialize)]
struct Path {
    /// Length of the path of the middle between the wheels.
    length_m: f64,
    poses: Vec<Row>,
    #[serde(skip)]
    csv: bool,
}

/// A column of --csv: its name and its value, if the row has it.
type Column = (&'static str, fn(&Row) -> Option<f64>);

/// What the wheels have to do, the left one first.
#[derive(Serialize)]
struct Wheels {
    #[serde(skip_serializing_if = "Option::is_none")]
    speeds_rad_s: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ticks_per_s: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    travel_m: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    angles_rad: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ticks: Option<[f64; 2]>,
    /// Heading at the end of the arc.
    #[serde(skip_serializing_if = "Option::is_none")]
    heading_rad: Option<f64>,
}

impl Odometry {
    pub(crate) fn run(&self, ui: Ui) -> anyhow::Result<()> {
        let drive = self.drive()?;
        if let Some(text) = &self.velocity {
            return ui.print(&self.wheels_of(&drive, text)?);
        }
        if let Some(text) = &self.to {
            return ui.print(&self.wheels_to(&drive, text)?);
        }
        let readings = match &self.file {
            Some(path) => read(path, &drive, self.ticks_per_turn, self.counter_bits)?,
            None => vec![self.one(&drive)?],
        };
        ui.print(&self.path(&drive, &readings))
    }

    fn drive(&self) -> Result<Drive<f64>, Usage> {
        let size = |value: f64, option: &str| match (1e-3..=1e12).contains(&value) {
            true => Ok(value),
            false => Err(Usage(format!("{option} {value}: give a number from 0.001 to 1e12"))),
        };
        if !(0.0..=1e12).contains(&self.variance) {
            return Err(Usage(format!("--variance {}: give a number from 0 to 1e12", self.variance)));
        }
        Ok(Drive {
            radius_m: 1e-3 * size(self.radius, "--radius")?,
            half_track_m: 0.5e-3 * size(self.track, "--track")?,
            ticks_per_turn: size(self.ticks_per_turn.unwrap_or(1.0), "--ticks-per-turn")?,
            variance_per_m: 1e-6 * self.variance,
        })
    }

    /// The reading of the command line.
    fn one(&self, drive: &Drive<f64>) -> Result<Reading, Usage> {
        let time = |value: Option<f64>, option: &str| match value {
            Some(value) if !(value > 0.0 && value <= 1e12) => {
                Err(Usage(format!("{option} {value}: give a number above 0 and at most 1e12")))
            }
            value => Ok(value),
        };
        let travel = |angles: [f64; 2]| angles.map(|angle| angle * drive.radius_m);
        if let Some(text) = &self.ticks {
            let duration_s = time(self.rate, "--rate")?.map(f64::recip);
            let angles = pair(text, "--ticks")?.map(|ticks| TAU * ticks / drive.ticks_per_turn);
            return Ok(Reading { t_s: None, duration_s, travel_m: travel(angles) });
        }
        let duration_s = time(self.time, "--time")?;
        let speeds = pair(self.speeds.as_deref().unwrap_or_default(), "--speeds")?.map(f64::to_radians);
        let angles = speeds.map(|speed| speed * duration_s.unwrap_or(0.0));
        Ok(Reading { t_s: duration_s, duration_s, travel_m: travel(angles) })
    }

    fn path(&self, drive: &Drive<f64>, readings: &[Reading]) -> Path {
        let (mut estimate, mut length_m) = (Estimate::start(), 0.0);
        let mut poses = Vec::new();
        for Reading { t_s, duration_s, travel_m } in readings {
            estimate = drive.advance_by(&estimate, *travel_m);
            let [left, right] = *travel_m;
            length_m += (0.5 * (left + right)).abs();
            let rate = |of: f64| duration_s.map(|duration| of / duration);
            let sd = |k: usize| (self.variance > 0.0).then(|| estimate.covariance[(k, k)].max(0.0).sqrt());
            poses.push(Row {
                t_s: *t_s,
                x_m: estimate.pose.position.x,
                y_m: estimate.pose.position.y,
                heading_rad: estimate.pose.angle_rad,
                v_m_s: rate(0.5 * (left + right)),
                w_rad_s: rate((right - left) / (2.0 * drive.half_track_m)),
                x_sd_m: sd(0),
                y_sd_m: sd(1),
                heading_sd_rad: sd(2),
            });
        }
        Path { length_m, poses, csv: self.csv }
    }

    fn wheels_of(&self, drive: &Drive<f64>, text: &str) -> Result<Wheels, Usage> {
        let [v, w] = pair(text, "--velocity")?;
        let speeds = drive.speeds(&Velocity { linear_m_s: 1e-3 * v, angular_rad_s: w.to_radians() });
        Ok(Wheels {
            speeds_rad_s: Some(speeds),
            ticks_per_s: self.ticks_per_turn.map(|ticks| speeds.map(|speed| speed * ticks / TAU)),
            travel_m: None,
            angles_rad: None,
            ticks: None,
            heading_rad: None,
        })
    }

    fn wheels_to(&self, drive: &Drive<f64>, text: &str) -> Result<Wheels, Usage> {
        /// A heading is that of the arc within this, deg.
        const HEADING_DEG: f64 = 0.01;
        let given = numbers(text, "--to")?;
        let [x, y, ref heading @ ..] = given[..] else {
            return Err(Usage(format!("--to {text}: give a place in mm, such as 500,200")));
        };
        let travel = drive.arc_to(&Vec2::new(1e-3 * x, 1e-3 * y));
        let end = drive.advance_by(&Estimate::start(), travel).pose.angle_rad;
        let off = |heading: f64| (heading - end.to_degrees() + 180.0).rem_euclid(360.0) - 180.0;
        match heading {
            [] => {}
            [heading] if off(*heading).abs() <= HEADING_DEG => {}
            [heading] => {
                return Err(Usage(format!(
                    "--to {text}: the arc to this place ends at the heading {} deg, not {heading}; leave the heading out, or \
                     drive two arcs",
                    number(end.to_degrees(), 3)
                )));
            }
            _ => return Err(Usage(format!("--to {text}: give a place in mm and at most a heading in deg"))),
        }
        let angles = travel.map(|travel| travel / drive.radius_m);
        Ok(Wheels {
            speeds_rad_s: None,
            ticks_per_s: None,
            travel_m: Some(travel),
            angles_rad: Some(angles),
            ticks: self.ticks_per_turn.map(|ticks| angles.map(|angle| angle * ticks / TAU)),
            heading_rad: Some(end),
        })
    }
}

fn pair(text: &str, option: &str) -> Result<[f64; 2], Usage> {
    let wrong = |_| Usage(format!("{option} {text}: give two numbers, such as 100,120"));
    numbers(text, option)?.try_into().map_err(wrong)
}

impl Answer for Path {
    fn text(&self) -> String {
        if self.csv {
            let all: [Column; 9] = [
                ("t_s", |row| row.t_s),
                ("x_m", |row| Some(row.x_m)),
                ("y_m", |row| Some(row.y_m)),
                ("heading_rad", |row| Some(row.heading_rad)),
                ("v_m_s", |row| row.v_m_s),
                ("w_rad_s", |row| row.w_rad_s),
                ("x_sd_m", |row| row.x_sd_m),
                ("y_sd_m", |row| row.y_sd_m),
                ("heading_sd_rad", |row| row.heading_sd_rad),
            ];
            let used: Vec<_> =
                all.into_iter().filter(|(_, of)| self.poses.iter().any(|row| of(row).is_some())).collect();
            let cell = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:?}"));
            let rows = self.poses.iter().map(|row| csv_line(used.iter().map(|(_, of)| cell(of(row)))));
            let head = csv_line(used.iter().map(|(name, _)| *name));
            return std::iter::once(head).chain(rows).collect::<Vec<_>>().join("\n");
        }
        let Some(last) = self.poses.last() else { return String::new() };
        let mut text = format!(
            "after {} reading(s): x {} mm, y {} mm, heading {} deg; path {} mm",
            self.poses.len(),
            number(1e3 * last.x_m, 3),
            number(1e3 * last.y_m, 3),
            number(last.heading_rad.to_degrees(), 3),
            number(1e3 * self.length_m, 3)
        );
        if let (Some(v), Some(w)) = (last.v_m_s, last.w_rad_s) {
            text += &format!(
                "\nvelocity {} mm/s ahead, {} deg/s to the left in the last reading",
                number(1e3 * v, 3),
                number(w.to_degrees(), 3)
            );
        }
        if let (Some(x), Some(y), Some(heading)) = (last.x_sd_m, last.y_sd_m, last.heading_sd_rad) {
            text += &format!(
                "\nstandard deviations: x {} mm, y {} mm, heading {} deg",
                number(1e3 * x, 2),
                number(1e3 * y, 2),
                number(heading.to_degrees(), 3)
            );
        }
        text
    }
}

impl Answer for Wheels {
    fn text(&self) -> String {
        let degrees = |angles: [f64; 2]| angles.map(f64::to_degrees);
        let rows = [
            ("speed", self.speeds_rad_s.map(degrees), "deg/s"),
            ("ticks a second", self.ticks_per_s, ""),
            ("travel", self.travel_m.map(|travel| travel.map(|x| 1e3 * x)), "mm"),
            ("angle", self.angles_rad.map(degrees), "deg"),
            ("ticks", self.ticks, ""),
        ];
        let rows = rows.into_iter().filter_map(|(name, values, unit)| {
            let [left, right] = values?.map(|value| number(value, 3));
            Some(vec![name.to_owned(), left, right, unit.to_owned()])
        });
        let head = ["", "left", "right", ""].map(str::to_owned).to_vec();
        let mut text = columns(&std::iter::once(head).chain(rows).collect::<Vec<_>>());
        if let Some(heading) = self.heading_rad {
            text += &format!("\nheading at the end {} deg", number(heading.to_degrees(), 3));
        }
        text
    }
}
