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
                p.note {
                    "A name that you give an entry below is shown before its digest, also on the page Diagnosis. Without spaces: " kbd { "Space" } " stops the arm."
                }
                p #note .note role="status" {}
            }
            (table("runs", "Runs", &["Name, began", "Took", "Outcome", "Rows", "Table", "Model", "Board", "Events"]))
            section #events-section aria-labelledby="events-title" hidden {
                h2 #events-title tabindex="-1" {}
                ol #events .events {}
            }
            (table("diagnoses", "Diagnoses", &["Name, when", "Model", "Measurements", "Verdict", "Corrected model", "Open"]))
            section aria-labelledby="models-title" {
                h2 #models-title { "Models" }
                p.note { "A corrected model is below the model that it was made from." }
                div #lineage {}
            }
            section aria-labelledby="compare-title" {
                h2 #compare-title { "Compare" }
                div.fields {
                    @for (id, label) in [("first", "This"), ("second", "with")] {
                        div.field { label for=(id) { (label) } select #(id) { option value="" { "choose a diagnosis or a model" } } }
                    }
                }
                p #compare-note .note role="status" {}
                div #compare-scroll .scroll tabindex="0" role="region" aria-labelledby="compare-title" hidden {
                    table #compared {
                        thead { tr { th scope="col" { "Number" } th scope="col" {} th scope="col" {} th scope="col" { "Differs" } } }
                        tbody {}
                    }
                }
            }
            (table("tables", "Tables", &["Name, first seen", "File", "Digest", "Model", "Rows", "Ends", "Save"]))
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
