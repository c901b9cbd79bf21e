//! A table file that a page has opened: its rows as a time line per output, and where it breaks a limit.

use std::path::Path;

use darm_arm::table_file::{TableFile, TableFileError, unchecked_records};
use darm_core::output::{Coil, Drive, Wiring};
use darm_core::table::{Record, Row, wiring};
use darm_core::units::{Digest, Micros};
use serde::Serialize;

use crate::refusal::{Limit, Refused};

/// An opened table.
pub(crate) struct Program {
    /// The table; `None` where it breaks one of its limits.
    pub file: Option<TableFile>,
    /// What pages show.
    pub view: ProgramView,
    /// The bytes of its file.
    pub bytes: Vec<u8>,
    /// The text of its visit file, of a table that the server made or that was opened with it.
    pub visits: Option<String>,
}

/// Where a table with a visit file comes from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Origin {
    /// Name of its visit file.
    pub visits_name: String,
    /// Number of visits.
    pub n_visits: usize,
    /// What was diagnosed, where it was made after a diagnosis.
    pub diagnosed: Option<String>,
    /// Number of the model that it was made with; `None` where that is not the server's.
    pub model: Option<u32>,
}

/// A table as pages show it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct ProgramView {
    /// Name of the file.
    pub name: String,
    /// Digest of the table, as the board reports it; `None` where it is refused.
    pub digest: Option<String>,
    /// End of the program, s.
    pub end_s: f64,
    /// The rows in order of time.
    pub rows: Vec<RowView>,
    /// When each output is on.
    pub lanes: Vec<Lane>,
    /// Why it is refused, with row and limit.
    pub refusal: Option<Refused>,
    /// What it was made from; `None` of a table that was opened without its visit file.
    pub origin: Option<Origin>,
}

/// A row of a table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct RowView {
    /// Time after the start, s.
    pub at_s: f64,
    /// One digit for each actuator.
    pub word: String,
    /// Joint angles, rad.
    pub servos_rad: Vec<f32>,
}

/// When an output is on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Lane {
    /// Number of the output.
    pub output: u8,
    /// Number of its actuator.
    pub actuator: usize,
    /// `hold`, `peak-hold` or `latch`: a latch keeps its state without current.
    pub drive: &'static str,
    /// Its limits in this table.
    pub limit: Limit,
    /// From when to when, s.
    pub spans_s: Vec<[f64; 2]>,
}

impl Program {
    /// Opens the bytes of a table file. A table that breaks a limit is opened too, to show where.
    ///
    /// # Errors
    ///
    /// The bytes are not a complete table of this version.
    pub(crate) fn open(name: &str, bytes: &[u8]) -> Result<Self, Refused> {
        let (path, own, visits) = (Path::new(name), bytes.to_vec(), None);
        match TableFile::parse(path, bytes) {
            Ok(file) => {
                let digest = Some(file.digest().to_string());
                let view = ProgramView { digest, ..view(name, &file.records, None) };
                Ok(Self { file: Some(file), view, bytes: own, visits })
            }
            Err(error @ TableFileError::Refused { .. }) => {
                let records = unchecked_records(path, bytes)?;
                Ok(Self { file: None, view: view(name, &records, Some(error.into())), bytes: own, visits })
            }
            Err(error) => Err(error.into()),
        }
    }

    /// The program with its visit file.
    #[must_use]
    pub(crate) fn with_visits(self, origin: Origin, visits: String) -> Self {
        Self { view: ProgramView { origin: Some(origin), ..self.view }, visits: Some(visits), ..self }
    }

    /// Digest of a table that breaks none of its limits.
    pub(crate) fn digest(&self) -> Option<Digest> {
        self.file.as_ref().map(TableFile::digest)
    }
}

fn view(name: &str, records: &[Record], refusal: Option<Refused>) -> ProgramView {
    let rows: Vec<&Row> = records.iter().filter_map(row_of).collect();
    let end = records.iter().find_map(|record| if let Record::End { at } = record { Some(*at) } else { None });
    let end = end.or(rows.last().map(|row| row.at)).unwrap_or_default();
    let wiring = wiring(records).unwrap_or_default();
    ProgramView {
        name: name.to_owned(),
        digest: None,
        end_s: seconds(end),
        rows: rows.iter().map(|row| RowView::of(row)).collect(),
        lanes: lanes(&wiring, &rows, end),
        refusal: refusal.map(|refusal| refusal.with_limit_of(&wiring)),
        origin: None,
    }
}

fn row_of(record: &Record) -> Option<&Row> {
    if let Record::Row(row) = record { Some(row) } else { None }
}

impl RowView {
    fn of(row: &Row) -> Self {
        Self { at_s: seconds(row.at), word: row.word.to_string(), servos_rad: row.servos.to_vec() }
    }
}

/// The spans in which the words of the rows feed each coil.
fn lanes(wiring: &Wiring, rows: &[&Row], end: Micros) -> Vec<Lane> {
    let fed: Vec<(Micros, u64)> = rows.iter().map(|row| (row.at, wiring.coils_on(&row.word))).collect();
    let lane = |(index, (actuator, coil)): (usize, (usize, &Coil))| Lane {
        output: coil.output,
        actuator,
        drive: drive_name(&coil.drive),
        limit: coil.limit.into(),
        spans_s: spans_s(fed.iter().map(|(at, fed)| (*at, fed >> index & 1 == 1)), end),
    };
    coils_with_actuators(wiring).enumerate().map(lane).collect()
}

/// All coils in the order of the wiring, each with the number of its actuator.
pub(crate) fn coils_with_actuators(wiring: &Wiring) -> impl Iterator<Item = (usize, &Coil)> {
    let owners = wiring.actuators_with_coils().enumerate();
    owners.flat_map(|(actuator, (_, coils))| coils.iter().map(move |coil| (actuator, coil)))
}

fn spans_s(switched: impl Iterator<Item = (Micros, bool)>, end: Micros) -> Vec<[f64; 2]> {
    let (mut spans, mut since) = (Vec::new(), None);
    for (at, is_on) in switched.chain([(end, false)]) {
        match (since, is_on) {
            (None, true) => since = Some(at),
            (Some(from), false) => {
                spans.push([seconds(from), seconds(at)]);
                since = None;
            }
            _ => {}
        }
    }
    spans
}

/// The name of a drive, as profiles write it.
pub(crate) fn drive_name(drive: &Drive) -> &'static str {
    match drive {
        Drive::Hold { .. } => "hold",
        Drive::PeakHold { .. } => "peak-hold",
        Drive::Latch { .. } => "latch",
    }
}

pub(crate) fn seconds(at: Micros) -> f64 {
    1e-6 * at.0 as f64
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_arm::plan::{Visit, plan};
    use darm_arm::table_file;
    use darm_arm::wired_arm::WiredArm;
    use darm_core::table::Record;

    use super::Program;
    use crate::refusal::Kind;

    fn table() -> (WiredArm, darm_arm::plan::Plan) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/planar4.toml");
        let wired = WiredArm::read(&path, None).unwrap();
        let visit =
            |word: &str| Visit { word: word.parse().unwrap(), servos_rad: vec![], dwell_s: 0.5, label: "A".into() };
        let visits = [visit("000010000000"), visit("000010000001")];
        let plan = plan(&wired.arm, &visits, &wired.profile.board(None), &[]).unwrap();
        (wired, plan)
    }

    #[test]
    fn each_output_has_the_spans_in_which_it_is_on() {
        let (_, plan) = table();
        let program = Program::open("a.darm", &table_file::bytes(&plan.image)).unwrap();
        let lane = |output| program.view.lanes.iter().find(|lane| lane.output == output).unwrap();
        let end_s = 1e-6 * plan.end.0 as f64;
        assert_eq!(lane(4).spans_s, [[0.0, end_s]]);
        let [[from_s, to_s]] = lane(11).spans_s[..] else { panic!("{:?}", lane(11)) };
        assert!(from_s > 0.5 && to_s == end_s);
        assert!(lane(0).spans_s.is_empty() && program.view.refusal.is_none());
    }

    #[test]
    fn a_table_that_breaks_a_limit_is_shown_with_its_row_and_the_limit() {
        let (wired, plan) = table();
        let (start, rows): (Vec<Record>, Vec<Record>) = (
            wired.wiring.coils.iter().copied().map(Record::Coil).collect(),
            plan.rows.iter().cloned().map(Record::Row).collect(),
        );
        let profile = wired.profile.profile.digest;
        let (model, switch_limit) = (wired.arm.hash(), wired.wiring.switch_limit);
        let mut records = vec![Record::Start { model, device: None, profile, switch_limit }];
        records.extend(start);
        records.extend(wired.wiring.actuators.iter().copied().map(Record::Actuator));
        records.extend(rows);
        records.push(Record::End { at: darm_core::units::Micros(3_000_000_000) });
        let image = darm_arm::image::UploadImage::table(&records, model);
        let program = Program::open("long.darm", &table_file::bytes(&image)).unwrap();
        let refusal = program.view.refusal.unwrap();
        assert_eq!((refusal.kind, refusal.place.row, refusal.place.output), (Kind::Refused, Some(2), Some(4)));
        assert!(refusal.place.limit.is_some() && program.file.is_none());
    }

    #[test]
    fn other_files_are_invalid() {
        assert_eq!(Program::open("a.txt", b"no table").err().unwrap().kind, Kind::Invalid);
    }
}
