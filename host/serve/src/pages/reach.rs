//! The page of reach: a target in the picture of the arm, the nearest word, the density of reachable positions.

use maud::{Markup, html};

pub(super) fn reach() -> Markup {
    html! {
        h1.hidden { "Reach" }
        (super::no_arm())
        div #reach .columns hidden {
            section aria-labelledby="arm-title" {
                h2 #arm-title { "Target and arm" }
                div.picture { canvas #arm role="application" aria-label="The target in the picture of the arm" aria-describedby="keys" tabindex="0" {} }
                p.legend {
                    span.leg.contracted {} "contracted leg " span.leg.extended {} "extended leg: thin rod with a ring "
                    "· ball: target, joined to the tool that the nearest word reaches · thin lines: the arm now"
                }
                p #keys .legend {
                    "Drag the ball; drag next to it to turn the view. With the picture in focus: " kbd { "←" } " " kbd { "→" } " " kbd { "↑" } " " kbd { "↓" }
                    " move the target 10 mm, with " kbd { "Shift" } " 1 mm; " span #depth-keys { kbd { "Page ↑" } " " kbd { "Page ↓" } " move it away and near; " }
                    kbd { "," } " " kbd { "." } " turn it 5°."
                }
                p #picture-note .note {}
            }
            div {
                (target())
                (result())
            }
        }
        (density())
        (order())
    }
}

fn target() -> Markup {
    html! {
        section aria-labelledby="target-title" {
            h2 #target-title { "Target pose of the tool" }
            form #target {
                div #pose .fields {}
                div #servo-fields .fields {}
                div.fields {
                    div.field {
                        label for="compare" { "Compare" }
                        select #compare { option value="pose" { "position and orientation" } option value="position" { "position only" } }
                    }
                    div.field {
                        label for="drag" { "Dragging the ball" }
                        select #drag { option value="move" { "moves the target" } option value="turn" { "turns the target" } }
                    }
                    div #optimise-field .field hidden {
                        label for="optimise" { "Servos" }
                        select #optimise { option value="fixed" { "at the angles above" } option value="free" { "at the best angles" } }
                    }
                }
                div.buttons { button #to-tool type="button" { "Target to the tool now" } }
                p #target-note .alert role="alert" hidden {}
            }
        }
    }
}

fn result() -> Markup {
    html! {
        section aria-labelledby="nearest-title" aria-describedby="searching" {
            h2 #nearest-title { "Nearest word" }
            p #word .phase role="status" {}
            p #searching .note {}
            div #search-progress .running hidden { progress aria-label="Search" max="1" {} button #cancel-search type="button" { "Cancel the search" } }
            dl #facts .facts {}
            div.buttons {
                button #set type="button" disabled data-needs-control data-ready="false" { "Set the arm to this word" }
                button #add-visit type="button" disabled { "Add to the table" }
            }
        }
    }
}

fn density() -> Markup {
    html! {
        section #density-section aria-labelledby="density-title" hidden {
            h2 #density-title { "Density of reachable positions" }
            div.fields {
                div #plane-field .field {
                    label for="plane" { "Plane through the target" }
                    select #plane { option value="xy" { "xy" } option value="xz" selected { "xz" } option value="yz" { "yz" } }
                }
            }
            p #density-note .note role="status" {}
            div #density-progress .running hidden { progress aria-label="Density map" max="1" {} button #cancel-density type="button" { "Cancel the map" } }
            div.buttons { button #form-density type="button" hidden { "Form the map" } }
            div.scroll tabindex="0" role="region" aria-labelledby="density-title" { div #density {} }
        }
    }
}

fn order() -> Markup {
    html! {
        section #order-section aria-labelledby="order-title" hidden {
            h2 #order-title { "Path from the word now to the nearest word" }
            div.fields {
                div.field {
                    label for="deviation" { "Largest deviation from the straight line, mm" }
                    input #deviation type="number" min="0" step="any" placeholder="any";
                }
            }
            p #order-note .note role="status" {}
            div #order-progress .running hidden { progress aria-label="Path" {} button #cancel-order type="button" { "Cancel the path" } }
            div.scroll tabindex="0" role="region" aria-labelledby="order-title" {
                table.cards {
                    thead { tr {
                        th.num scope="col" { "Step" } th scope="col" { "Word" } th #rests-at .num scope="col" { "Tool at" } th.num scope="col" { "Deviation, mm" }
                    } }
                    tbody #rests {}
                }
            }
            p.note { "Only the rests are checked, by the geometry; between them the arm snaps." }
        }
    }
}
