//! The page of the diagnosis: files in, verdict and evidence out.

use maud::{Markup, html};

use crate::upload::MAX_FILES;

pub(super) fn diagnosis() -> Markup {
    html! {
        h1.hidden { "Diagnosis" }
        section aria-labelledby="files-title" {
            h2 #files-title { "Model and measurements" }
            form #files data-max-bytes=(MAX_FILES) {
                div #drop .drop {
                    p.wide { "Drop the files here together, or choose them:" }
                    div.field {
                        label for="known" { "Model" }
                        select #known { option value="" { "a file that I choose" } }
                        input #model type="file" accept=".toml,.urdf,.xml" aria-label="File of the model" aria-describedby="model-help";
                        p #model-help .note { "arm file, URDF, MJCF, or the TOML of an experiment" }
                    }
                    div.field {
                        label for="data" { "Measurements" }
                        select #recordings aria-label="Measurement of this server" hidden { option value="" { "a file that I choose" } }
                        a #replay-link href="/replay" hidden { "Replay" }
                        input #data type="file" accept=".csv,.txt,.tsv,.gz,.mcap,.mat,.npy,.npz" aria-describedby="data-help";
                        p #data-help .note { "of " code { "darm record" } ", or of another program: CSV, MCAP of ROS 2, NumPy, MATLAB" }
                    }
                    div.field {
                        label for="more" { "Files that the model names" }
                        input #more type="file" accept=".urdf,.xml,.toml" multiple aria-describedby="more-help";
                        p #more-help .note { "the URDF of an experiment; none for an arm. Meshes that a URDF names, such as " code { "package://" } ", are not needed and not read" }
                    }
                    // No box to tick: the space bar is the stop.
                    div.field {
                        label for="other-model" { "Recording of the table of another arm" }
                        select #other-model { option value="refuse" { "refuse" } option value="accept" { "accept" } }
                    }
                }
                p.note { "At most " (MAX_FILES >> 20) " MB together. The files stay on the computer of " code { "darm serve" } "; nothing is sent to the board." }
                p #recorded .note role="status" hidden {}
                p #files-note .note role="status" {}
                div.buttons {
                    button #diagnose type="submit" disabled { "Diagnose" }
                    button #cancel type="button" disabled { "Cancel" }
                }
            }
            p #failure .alert role="alert" hidden {}
            div #progress hidden {
                progress aria-labelledby="progress-text" {}
                p { span #progress-text role="status" {} span #tried {} }
            }
        }
        (columns())
        section #actions aria-labelledby="actions-title" hidden {
            h2 #actions-title { "Result of " span #result-files {} }
            div.buttons {
                button #write type="button" { "Write the corrected model" }
                button #words type="button" { "Measure these words next" }
                button #plan type="button" { "Plan again" }
            }
            p #no-table .note hidden { "No table can be made: the server has no arm, whose board it is for. Start it with one: " code { "darm serve arm.toml" } "." }
            p #actions-note .note role="status" {}
        }
        div #result {}
    }
}

/// What the measurements have, and how they are read.
fn columns() -> Markup {
    html! {
        section #log aria-labelledby="log-title" hidden {
            h2 #log-title { "Columns of the measurements" }
            p #log-text role="status" {}
            ul #log-problems .problems {}
            details #log-details {
                summary #log-summary {}
                p.note { "What a column holds is a quantity of the list; of joint 2 it is " code { "q2" } ", " code { "tau2" } " …. Each quantity has its own unit." }
                div.scroll tabindex="0" role="region" aria-labelledby="log-title" {
                    table.cards {
                        thead { tr { @for title in ["Column", "Numbers", "In the file", "Holds", "In", "Taken for"] { th scope="col" { (title) } } } }
                        tbody #columns {}
                    }
                }
            }
            ul #log-notes .notes {}
        }
    }
}
