//! The page of the history: runs, diagnoses, models with their lineage, tables, uploads.

use maud::{Markup, html};

pub(super) fn history() -> Markup {
    html! {
        h1.hidden { "History" }
        p #none .alert role="status" hidden { "This server keeps no history. Start it with " code { "darm serve --history FILE" } "." }
        p #problem .alert role="alert" hidden {}
        div #history hidden {
            section aria-labelledby="export-title" {
                h2 #export-title { "Export" }
                p.note { "Kept in " code #file {} ". Shown are the newest 200 entries of each kind; files have all of them." }
                div.buttons {
                    button #json type="button" { "All as JSON" }
                    @for kind in ["runs", "diagnoses", "models", "tables", "uploads"] {
                        button type="button" data-csv=(kind) { (kind) " as CSV" }
                    }
                    button #refresh type="button" { "Refresh" }
                }
                p #note .note role="status" {}
            }
            (table("runs", "Runs", &["Began", "Took", "Outcome", "Rows", "Table", "Model", "Board", "Events"]))
            section #events-section aria-labelledby="events-title" hidden {
                h2 #events-title tabindex="-1" {}
                ol #events .events {}
            }
            (table("diagnoses", "Diagnoses", &["When", "Model", "Measurements", "Verdict", "Corrected model", "Numbers"]))
            section aria-labelledby="models-title" {
                h2 #models-title { "Models" }
                p.note { "A corrected model is below the model that it was made from." }
                div #lineage {}
            }
            (table("tables", "Tables", &["First seen", "Name", "Digest", "Model", "Rows", "Ends", "File"]))
            (table("uploads", "Uploads", &["When", "Table", "Digest", "Model", "Board"]))
        }
    }
}

/// A section with a table that the script fills.
fn table(kind: &str, title: &str, columns: &[&str]) -> Markup {
    let title_id = format!("{kind}-title");
    html! {
        section aria-labelledby=(title_id) {
            h2 id=(title_id) { (title) }
            div.scroll.tall tabindex="0" role="region" aria-labelledby=(title_id) {
                table.cards {
                    thead { tr { @for column in columns { th scope="col" { (column) } } } }
                    tbody id=(kind) {}
                }
            }
        }
    }
}
