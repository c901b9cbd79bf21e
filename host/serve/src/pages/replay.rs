//! The page of replays: a recorded run as a time line, the posture and the residual at its cursor, its curves.

use maud::{Markup, html};

pub(super) fn replay() -> Markup {
    html! {
        h1.hidden { "Replay" }
        p #replay-alert .alert role="alert" hidden {}
        div #replay .recorded hidden {
            section aria-labelledby="run-title" {
                h2 #run-title {}
                p.note { "Recorded, not live: nothing here moves the arm, and it may be elsewhere now. " span #growing role="status" {} }
                p #problem .alert role="status" hidden {}
                canvas #marks aria-hidden="true" {}
                input #at type="range" step="any" aria-label="Time" aria-describedby="at-keys";
                p #at-text .phase {}
                div.buttons {
                    button #back type="button" { "Row back" }
                    button #play type="button" { "Play" }
                    button #forth type="button" { "Next row" }
                    label for="speed" { "Speed" }
                    select #speed { option value="1" selected { "1×" } option value="4" { "4×" } option value="16" { "16×" } }
                    button #again type="button" { "Read again" }
                }
                p #at-keys .note {
                    "On the time line " kbd { "←" } " " kbd { "→" } " go to the rows before and after, " kbd { "Page ↑" } " " kbd { "Page ↓" } " " kbd { "Home" } " " kbd { "End" }
                    " further; " kbd { "Enter" } " presses Play. "
                    span #marks-key { "Marks: ▶ started, ✓ finished, ■ stopped, ✕ fault; thin lines are rows of the table." }
                }
                ul #notes .notes {}
            }
            div.columns {
                section #arm-section aria-labelledby="arm-title" {
                    h2 #arm-title { "Arm at this row" }
                    div.picture { canvas #arm role="img" aria-label="The arm" tabindex="0" {} }
                    p #tool {}
                    p.legend {
                        span.leg.contracted {} "contracted leg " span.leg.extended {} "extended leg: thin rod with a ring "
                        "· diamond: measured tool · drag, wheel or arrow keys turn the view"
                    }
                    p #picture-note .note {}
                }
                div {
                    (super::measured())
                    section aria-labelledby="row-title" {
                        h2 #row-title { "Row" }
                        dl #facts .facts {}
                    }
                    section #events-section aria-labelledby="events-title" hidden {
                        h2 #events-title { "Events" }
                        ol #events .events.jumps {}
                    }
                }
            }
            section #plots-section aria-labelledby="plots-title" {
                h2 #plots-title { "Over the run" }
                div.buttons {
                    button #closer type="button" { "Enlarge" }
                    button #wider type="button" { "Reduce" }
                    button #all type="button" { "All" }
                    span #shown .note {}
                }
                div #plots tabindex="0" role="group" aria-label="Plots over the run; arrow keys move the cursor by rows, + − 0 change the time that is shown" {}
            }
        }
        section aria-labelledby="recordings-title" {
            h2 #recordings-title { "Recordings of this server" }
            div.scroll.tall tabindex="0" role="region" aria-labelledby="recordings-title" {
                table.cards {
                    thead { tr { @for title in ["Name", "Written", "Size", "Open"] { th scope="col" { (title) } } } }
                    tbody #recordings {}
                }
            }
        }
    }
}
