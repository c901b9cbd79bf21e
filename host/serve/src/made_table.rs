//! Tables that the server makes: of edited visits, of words, or of a measurement plan.

use darm_arm::arm::{Arm, frames};
use darm_arm::board_profile::BoardProfile;
use darm_arm::plan::Visit;
use darm_arm::table_file;
use darm_core::units::Word;
use darm_diagnose::measurement_plan::{self, measurement_visits};
use darm_measure::visit_table::{MEASUREMENT_DWELL_S, PlannedVisit, VisitTable, VisitTableError, default_dwell_s};
use darm_measure::visits::Visits;
use serde::{Deserialize, Serialize};

use crate::hub::Hub;
use crate::job_queue::Work;
use crate::program::{Origin, Program, ProgramView};
use crate::refusal::{Kind, Place, Refused};

/// What is to be visited.
#[derive(Clone, Debug)]
pub(crate) enum Visited {
    /// These visits in this order.
    Edited {
        visits: Vec<EditedVisit>,
        /// Whether the arm may rest between them, so that limits of outputs are kept.
        may_rest: bool,
    },
    /// Words of which every parameter and every effect can be determined.
    Plan,
}

impl Visited {
    /// These words, without a rest between them.
    pub(crate) fn of_words(words: Vec<String>) -> Self {
        let visit = |word| EditedVisit { word, servos_rad: Vec::new(), dwell_s: None };
        Self::Edited { visits: words.into_iter().map(visit).collect(), may_rest: false }
    }
}

/// A visit as a page edits it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct EditedVisit {
    pub(crate) word: String,
    /// Joint angles, rad.
    #[serde(default)]
    pub(crate) servos_rad: Vec<f64>,
    /// How long the arm rests there, s; by default until it is still and a few pictures are taken.
    pub(crate) dwell_s: Option<f64>,
}

/// A table that was made.
#[derive(Serialize)]
pub(crate) struct TableView {
    name: String,
    digest: String,
    n_visits: usize,
}

/// A table that is being edited, as it would be.
#[derive(Serialize)]
pub(crate) struct DraftView {
    #[serde(flatten)]
    program: ProgramView,
    /// From when to when the arm rests at each visit, s.
    visits_s: Vec<[f64; 2]>,
}

const DRAFT: &str = "draft";

/// The table of these visits, which no page opens yet.
pub(crate) fn draft(arm: &Arm, profile: &BoardProfile, visited: &Visited) -> Result<DraftView, Refused> {
    let (table, visits) = make(arm, visited, profile)?;
    let program = Program::open(DRAFT, &table)?.view;
    Ok(DraftView { program, visits_s: visits.rests.iter().map(|rest| [rest.from_s, rest.to_s]).collect() })
}

/// What a table is called, and what it is made after.
pub(crate) struct Occasion {
    /// Name of its file, without the end.
    pub(crate) name: &'static str,
    /// The files of the diagnosis that it is made after, if there is one.
    pub(crate) diagnosed: Option<String>,
}

/// Makes the table of an arm and opens it, as a page does with a file: nothing is sent to the board.
pub(crate) fn open(
    hub: &Hub,
    arm: &Arm,
    visited: &Visited,
    Occasion { name, diagnosed }: Occasion,
    work: &Work,
) -> Result<TableView, Refused> {
    let no_board = "a table is made for the profile of the board; start the server with its arm";
    let wired = hub.wired().ok_or_else(|| Refused::new(Kind::Invalid, no_board))?;
    work.check()?;
    let (table, visits) = make(arm, visited, &wired.profile)?;
    let n_visits = visits.rests.len();
    let view = TableView { name: format!("{name}.darm"), digest: visits.table.to_string(), n_visits };
    let origin =
        Origin { visits_name: format!("{name}.visits.csv"), n_visits, diagnosed, model: Some(arm.model.number) };
    let program = Program::open(&view.name, &table)?.with_visits(origin, visits.to_text());
    // A page that has left opens no table on those of others.
    work.check()?;
    hub.set_program(std::sync::Arc::new(program));
    Ok(view)
}

fn make(arm: &Arm, visited: &Visited, profile: &BoardProfile) -> Result<(Vec<u8>, Visits), Refused> {
    let (planned, may_rest) = match visited {
        Visited::Edited { visits, may_rest } => {
            let dwell_s = default_dwell_s(arm, profile);
            let visit = |(index, visit): (usize, &EditedVisit)| planned(arm, index, visit, dwell_s);
            (visits.iter().enumerate().map(visit).collect::<Result<_, _>>()?, *may_rest)
        }
        Visited::Plan => {
            let visits = measurement_visits(arm, &measurement_plan::PlanOptions::default(), MEASUREMENT_DWELL_S);
            (visits.map_err(|error| Refused::new(Kind::Refused, error))?, true)
        }
    };
    let table = VisitTable { arm, profile, device: None, modules: &[], may_rest };
    let (plan, visits) = table.of(&planned).map_err(|error| {
        let VisitTableError::Plan(plan) = &error else { return Refused::new(Kind::Refused, error) };
        let index = planned.iter().position(|planned| plan.visit() == Some(&planned.visit.label));
        Refused { place: Place { visit: index, ..Place::default() }, ..Refused::new(Kind::Refused, error) }
    })?;
    Ok((table_file::bytes(&plan.image), visits))
}

/// A visit, called by its number from 1, as a page numbers them.
fn planned(arm: &Arm, index: usize, visit: &EditedVisit, default_s: f64) -> Result<PlannedVisit, Refused> {
    let EditedVisit { word: text, servos_rad, dwell_s } = visit;
    let label = format!("visit {}", index + 1);
    let refused = |error: &dyn std::fmt::Display| Refused {
        place: Place { visit: Some(index), ..Place::default() },
        ..Refused::new(Kind::Refused, format!("{label}, {text}: {error}"))
    };
    let word: Word = text.parse().map_err(|error| refused(&error))?;
    frames::check_word(&word, arm).map_err(|error| refused(&error))?;
    let visit = Visit { word, servos_rad: servos_rad.clone(), dwell_s: dwell_s.unwrap_or(default_s), label };
    Ok(PlannedVisit { visit, held_out: false })
}
