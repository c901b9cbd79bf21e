//! Tables that the server makes: of words, or of a measurement plan.

use darm_arm::arm::{Arm, frames};
use darm_arm::board_profile::BoardProfile;
use darm_arm::plan::Visit;
use darm_arm::table_file;
use darm_core::units::Word;
use darm_diagnose::measurement_plan::{self, measurement_visits};
use darm_measure::visit_table::{MEASUREMENT_DWELL_S, PlannedVisit, VisitTable, default_dwell_s};
use serde::Serialize;

use crate::hub::Hub;
use crate::job_queue::Work;
use crate::program::{Origin, Program};
use crate::refusal::{Kind, Refused};

/// What is to be visited.
#[derive(Clone, Debug)]
pub(crate) enum Visited {
    /// These words in this order; each for this time, s, else until the arm rests and a few pictures are taken.
    Words(Vec<String>, Option<f64>),
    /// Words of which every parameter and every effect can be determined.
    Plan,
}

/// A table that was made.
#[derive(Serialize)]
pub(crate) struct TableView {
    name: String,
    digest: String,
    n_visits: usize,
}

/// Makes the table of an arm, called `name`, and opens it, as a page does with a file: nothing is sent to the board. `diagnosed` are
/// the files of the diagnosis that it is made after.
pub(crate) fn open(
    hub: &Hub,
    arm: &Arm,
    visited: &Visited,
    (name, diagnosed): (&str, Option<String>),
    work: &Work,
) -> Result<TableView, Refused> {
    let no_board = "a table is made for the profile of the board; start the server with its arm";
    let wired = hub.wired().ok_or_else(|| Refused::new(Kind::Invalid, no_board))?;
    work.check()?;
    let (table, visits) = make(arm, visited, &wired.profile)?;
    let n_visits = visits.rests.len();
    let view = TableView { name: format!("{name}.darm"), digest: visits.table.to_string(), n_visits };
    let origin = Origin { visits_name: format!("{name}.visits.csv"), n_visits, diagnosed, model: arm.model.number };
    let program = Program::open(&view.name, &table)?.made(origin, visits.to_text());
    // A page that has left opens no table on those of others.
    work.check()?;
    hub.set_program(std::sync::Arc::new(program));
    Ok(view)
}

fn make(
    arm: &Arm,
    visited: &Visited,
    profile: &BoardProfile,
) -> Result<(Vec<u8>, darm_measure::visits::Visits), Refused> {
    let refused = |error: &dyn std::fmt::Display| Refused::new(Kind::Refused, error);
    let (planned, may_rest) = match visited {
        Visited::Words(words, dwell_s) => {
            let dwell_s = dwell_s.unwrap_or_else(|| default_dwell_s(arm, profile));
            let visits: Result<Vec<PlannedVisit>, _> =
                words.iter().map(|text| word_visit(arm, text, dwell_s)).collect();
            (visits?, false)
        }
        Visited::Plan => {
            let visits = measurement_visits(arm, &measurement_plan::Options::default(), MEASUREMENT_DWELL_S);
            (visits.map_err(|error| refused(&error))?, true)
        }
    };
    let table = VisitTable { arm, profile, device: None, modules: &[], may_rest };
    let (plan, visits) = table.of(&planned).map_err(|error| refused(&error))?;
    Ok((table_file::bytes(&plan.image), visits))
}

fn word_visit(arm: &Arm, text: &str, dwell_s: f64) -> Result<PlannedVisit, Refused> {
    let refused = |error: &dyn std::fmt::Display| Refused::new(Kind::Refused, format!("{text}: {error}"));
    let word: Word = text.parse().map_err(|error| refused(&error))?;
    frames::check_word(&word, arm).map_err(|error| refused(&error))?;
    Ok(PlannedVisit { visit: Visit { word, servos_rad: Vec::new(), dwell_s, label: text.into() }, held_out: false })
}
