//! Camera lines: one measurement of the tool's pose per line of comma-separated values.
//!
//! The first line is the header; columns may be in any order, other columns are ignored.
//!
//! | column                      | meaning                                                            |
//! |-----------------------------|--------------------------------------------------------------------|
//! | `time_s`                    | time of the measurement, in seconds of Unix time                   |
//! | `x_m`, `y_m`, `angle_deg`   | pose of the tool in the base, of a planar arm                      |
//! | `x_m`, `y_m`, `z_m`, `rx_deg`, `ry_deg`, `rz_deg` | the same of any arm, with a rotation vector  |
//! | `supply_bar`, `temperature_c` ? | supply pressure and temperature of the arm, if measured |

use std::time::{SystemTime, UNIX_EPOCH};

use darm_core::real::Vec3;
use darm_core::se::{Pose, Pose2};
use darm_device::clock::host_now_s;

use darm_measure::csv_text::{csv_cells, csv_line};

/// One bar in the unit of the model's supply, Pa.
pub(crate) const BAR: f64 = 1e5;

/// One measurement.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Picture {
    /// Unix time.
    pub(crate) time_s: f64,
    /// Pose of the tool in the base.
    pub(crate) pose: Pose<f64>,
    /// Supply.
    pub(crate) supply_bar: Option<f64>,
    /// Temperature, in °C.
    pub(crate) temperature_c: Option<f64>,
}

/// Why a line is not a measurement.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub(crate) enum LineError {
    /// A column is missing in the header.
    #[error("the header has no column {0}; it needs time_s and x_m,y_m,angle_deg or x_m,y_m,z_m,rx_deg,ry_deg,rz_deg")]
    NoColumn(&'static str),
    /// A cell is not a number.
    #[error("column {column}: {text:?} is not a number; correct the camera's output")]
    Cell {
        /// The column.
        column: &'static str,
        /// The cell.
        text: String,
    },
}

const PLANAR: [&str; 3] = ["x_m", "y_m", "angle_deg"];
const SPATIAL: [&str; 6] = ["x_m", "y_m", "z_m", "rx_deg", "ry_deg", "rz_deg"];

/// The header of lines for a planar arm or for any arm.
pub(crate) fn header(planar: bool) -> String {
    let pose: &[&str] = if planar { &PLANAR } else { &SPATIAL };
    csv_line([&["time_s"], pose, &["supply_bar", "temperature_c"]].concat())
}

impl Picture {
    /// The line of this picture under [`header`].
    pub(crate) fn line(&self, planar: bool) -> String {
        let pose = pose_numbers(&self.pose, planar).into_iter().map(|number| format!("{number:.7}"));
        let conditions = [self.supply_bar, self.temperature_c];
        let conditions = conditions.map(|value| value.map_or(String::new(), |value| format!("{value:.4}")));
        csv_line(std::iter::once(format!("{:.6}", self.time_s)).chain(pose).chain(conditions))
    }
}

fn pose_numbers(pose: &Pose<f64>, planar: bool) -> Vec<f64> {
    let p = &pose.position;
    if planar {
        return vec![p.x, p.y, Pose2::projection(pose).angle_rad.to_degrees()];
    }
    let w = pose.log().angular.map(f64::to_degrees);
    vec![p.x, p.y, p.z, w.x, w.y, w.z]
}

/// Reads lines under a header.
#[derive(Clone, Debug)]
pub(crate) struct Columns {
    names: Vec<String>,
    planar: bool,
}

impl Columns {
    /// Reads the header.
    pub(crate) fn parse(header: &str) -> Result<Self, LineError> {
        let names = csv_cells(header);
        let has = |wanted: &str| names.iter().any(|name| name == wanted);
        let planar = !has("z_m");
        let pose: &[&'static str] = if planar { &PLANAR } else { &SPATIAL };
        match std::iter::once(&"time_s").chain(pose).find(|name| !has(name)) {
            Some(missing) => Err(LineError::NoColumn(missing)),
            None => Ok(Self { names, planar }),
        }
    }

    /// Whether the poses are planar.
    pub(crate) fn is_planar(&self) -> bool {
        self.planar
    }

    /// Reads a line; `None` when the camera has not seen the tool: its pose is NaN.
    pub(crate) fn picture(&self, line: &str) -> Result<Option<Picture>, LineError> {
        let cells = csv_cells(line);
        let time_s = self.number(&cells, "time_s")?;
        let pose = if self.planar {
            let [x, y, angle] = self.numbers(&cells, &PLANAR)?;
            Pose::from(Pose2::new(x, y, angle.to_radians()))
        } else {
            let [x, y, z, rx, ry, rz] = self.numbers(&cells, &SPATIAL)?;
            Pose::new(&Vec3::new(rx, ry, rz).map(f64::to_radians), Vec3::new(x, y, z))
        };
        let seen = time_s.is_finite() && pose.position.iter().chain(pose.rotation.iter()).all(|n| n.is_finite());
        let optional = |column| self.number(&cells, column).ok().filter(|n| n.is_finite());
        let picture =
            Picture { time_s, pose, supply_bar: optional("supply_bar"), temperature_c: optional("temperature_c") };
        Ok(seen.then_some(picture))
    }

    fn numbers<const N: usize>(&self, cells: &[String], columns: &[&'static str; N]) -> Result<[f64; N], LineError> {
        let mut numbers = [0.0; N];
        for (number, column) in numbers.iter_mut().zip(columns) {
            *number = self.number(cells, column)?;
        }
        Ok(numbers)
    }

    fn number(&self, cells: &[String], column: &'static str) -> Result<f64, LineError> {
        let at = self.names.iter().position(|name| name == column);
        let text = at.and_then(|at| cells.get(at)).map_or("", String::as_str);
        text.parse().map_err(|_| LineError::Cell { column, text: text.to_owned() })
    }
}

/// Now, Unix time, in seconds.
pub(crate) fn unix_now_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64()
}

/// Unix time less the host's time of the links, in seconds.
pub(crate) fn unix_less_host_s() -> f64 {
    unix_now_s() - host_now_s()
}

#[cfg(test)]
mod tests {
    use darm_core::real::Vec3;
    use darm_core::se::{Pose, Pose2};

    use super::{Columns, LineError, Picture, header};

    fn round_trip(picture: &Picture, planar: bool) {
        let columns = Columns::parse(&header(planar)).unwrap();
        let read = columns.picture(&picture.line(planar)).unwrap().unwrap();
        assert!(read.pose.distance(&picture.pose, 0.5) < 1e-6);
        assert_eq!(
            (read.time_s, read.supply_bar, read.temperature_c),
            (picture.time_s, picture.supply_bar, picture.temperature_c)
        );
    }

    #[test]
    fn a_measurement_survives_writing_and_parsing() {
        let pose = Pose::from(Pose2::new(1.0, -2.0, 0.3));
        round_trip(&Picture { time_s: 1.75e9, pose, supply_bar: Some(6.0), temperature_c: None }, true);
        let pose = Pose::new(&Vec3::new(0.1, 0.2, -0.3), Vec3::new(1.0, 2.0, 3.0));
        round_trip(&Picture { time_s: 1.75e9, pose, supply_bar: None, temperature_c: Some(21.5) }, false);
    }

    #[test]
    fn columns_are_found_by_name() {
        let columns = Columns::parse("angle_deg, x_m,extra,y_m,time_s").unwrap();
        let picture = columns.picture("90,1,?,2,3").unwrap().unwrap();
        assert_eq!((picture.time_s, picture.pose.position.y), (3.0, 2.0));
        assert_eq!(columns.picture("nan,nan,,nan,3"), Ok(None));
        assert_eq!(columns.picture("90"), Err(LineError::Cell { column: "time_s", text: String::new() }));
        assert_eq!(Columns::parse("time_s,x_m,y_m").unwrap_err(), LineError::NoColumn("angle_deg"));
    }
}
