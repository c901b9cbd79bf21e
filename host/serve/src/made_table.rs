//! The table of the next measurement: of the words that distinguish the candidates, or of a measurement plan.

use darm_arm::arm::{Arm, frames};
use darm_arm::board_profile::BoardProfile;
use darm_arm::plan::Visit;
use darm_arm::table_file;
use darm_core::units::Word;
use darm_diagnose::measurement_plan::{self, measurement_visits};
use darm_measure::visit_table::{MEASUREMENT_DWELL_S, PlannedVisit, VisitTable, default_dwell_s};
use serde::{Deserialize, Serialize};

use crate::program::{Origin, Program};
use crate::refusal::{Kind, Refused};

/// Which table a page wants.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TableRequest {
    /// Number of the result that the page shows.
    pub(super) result: u64,
    of: Of,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Of {
    Words,
    Plan,
}

/// What the next measurement is made from.
#[derive(Clone)]
pub(super) struct Next {
    /// The corrected arm, or the one that was diagnosed.
    pub(super) arm: Arm,
    /// Words that distinguish the candidates.
    pub(super) words: Vec<String>,
    /// The files that were diagnosed.
    pub(super) diagnosed: String,
}

/// A table that was made.
#[derive(Serialize)]
pub(super) struct TableView {
    name: &'static str,
    digest: String,
    n_visits: usize,
}

impl TableRequest {
    /// The table for the board with this profile, opened.
    pub(super) fn make(self, next: &Next, profile: &BoardProfile) -> Result<(TableView, Program), Refused> {
        let (arm, refused) = (&next.arm, |error: &dyn std::fmt::Display| Refused::new(Kind::Refused, error));
        let (name, visits_name) = match self.of {
            Of::Words => ("next.darm", "next.visits.csv"),
            Of::Plan => ("plan.darm", "plan.visits.csv"),
        };
        let (planned, may_rest) = match self.of {
            Of::Words => (word_visits(next, default_dwell_s(arm, profile))?, false),
            Of::Plan => {
                let visits = measurement_visits(arm, &measurement_plan::Options::default(), MEASUREMENT_DWELL_S);
                (visits.map_err(|error| refused(&error))?, true)
            }
        };
        let table = VisitTable { arm, profile, device: None, modules: &[], may_rest };
        let (plan, visits) = table.of(&planned).map_err(|error| refused(&error))?;
        let n_visits = visits.rests.len();
        let view = TableView { name, digest: visits.table.to_string(), n_visits };
        let (diagnosed, model) = (next.diagnosed.clone(), arm.model.number);
        let origin = Origin { visits_name: visits_name.into(), n_visits, diagnosed, model };
        let program = Program::open(name, &table_file::bytes(&plan.image))?;
        Ok((view, program.made(origin, visits.to_text())))
    }
}

fn word_visits(next: &Next, dwell_s: f64) -> Result<Vec<PlannedVisit>, Refused> {
    next.words.iter().map(|text| word_visit(&next.arm, text, dwell_s)).collect()
}

fn word_visit(arm: &Arm, text: &str, dwell_s: f64) -> Result<PlannedVisit, Refused> {
    let refused = |error: &dyn std::fmt::Display| Refused::new(Kind::Refused, format!("{text}: {error}"));
    let word: Word = text.parse().map_err(|error| refused(&error))?;
    frames::check_word(&word, arm).map_err(|error| refused(&error))?;
    Ok(PlannedVisit { visit: Visit { word, servos_rad: Vec::new(), dwell_s, label: text.into() }, held_out: false })
}
