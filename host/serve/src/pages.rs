//! The pages: a frame with the stop in it, and what each page has inside.

mod diagnosis;
mod history;
mod reach;
mod replay;

use axum::response::Html;
use maud::{DOCTYPE, Markup, html};

/// A page.
#[derive(Clone, Copy)]
pub(crate) struct Page {
    /// Its path on the server.
    pub(crate) path: &'static str,
    name: &'static str,
    script: &'static str,
    main: fn() -> Markup,
}

/// All of them, in the order of the navigation.
pub(crate) const ALL: [Page; 6] = [
    Page { path: "/", name: "Live", script: "/live.js", main: live },
    Page { path: "/program", name: "Program", script: "/program.js", main: program },
    Page { path: "/reach", name: "Reach", script: "/reach.js", main: reach::reach },
    Page { path: "/replay", name: "Replay", script: "/replay.js", main: replay::replay },
    Page { path: "/diagnosis", name: "Diagnosis", script: "/diagnosis.js", main: diagnosis::diagnosis },
    Page { path: "/history", name: "History", script: "/history.js", main: history::history },
];

impl Page {
    /// The page.
    pub(crate) fn html(self) -> Html<String> {
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    title { (self.name) " · darm" }
                    link rel="icon" href="/icon.svg";
                    link rel="stylesheet" href="/style.css";
                    script type="module" src=(self.script) {}
                }
                body data-link="connecting" {
                    (self.header())
                    main { ((self.main)()) }
                    footer {
                        p { kbd { "Space" } " stops the arm on every page, whatever has the focus. " kbd { "Enter" } " presses the focused button." }
                    }
                }
            }
        };
        Html(page.into_string())
    }

    /// The stop is a form: it works where no script does.
    fn header(self) -> Markup {
        html! {
            header.bar {
                nav aria-label="Pages" {
                    @for page in ALL {
                        a href=(page.path) aria-current=[(page.path == self.path).then_some("page")] { (page.name) }
                    }
                }
                p.link { span #link role="status" { "connecting" } " " span #age {} }
                div.control {
                    button #take type="button" disabled { "Take control" }
                    span #holder role="status" {}
                    details #here {
                        summary #here-count { "…" }
                        div {
                            p { "At this board:" }
                            ul #here-list {}
                            label { "This page is called " input #page-name maxlength="40" autocomplete="off"; }
                            p.note { "Without spaces: " kbd { "Space" } " stops the arm." }
                        }
                    }
                }
                form #stop-form action="/api/stop" method="post" {
                    button #stop type="submit" aria-keyshortcuts="Space" { "Stop" }
                }
            }
            p #stopped role="alert" hidden {}
            p #safe .alert role="alert" hidden {}
            p #asked .ask role="alert" hidden {
                span #asked-text {} " "
                button #hand-over type="button" { "Hand over" } " "
                button #keep type="button" { "Keep control" }
            }
            p #alert .alert role="alert" hidden {}
            noscript { p.alert { "Scripts are off: this page shows nothing live. The stop works." } }
        }
    }
}

/// What a page without an arm says, until its script knows that there is one.
fn no_arm() -> Markup {
    html! { p #no-arm .alert role="status" hidden { "The server has no arm. Start it with one: " code { "darm serve arm.toml" } "." } }
}

fn live() -> Markup {
    html! {
        h1.hidden { "Live" }
        div.columns {
            section #arm-section aria-labelledby="arm-title" {
                h2 #arm-title { "Arm" }
                (no_arm())
                div.picture.values { canvas #arm role="img" aria-label="The arm" tabindex="0" {} }
                p #arm-file .note {}
                p #tool .values aria-live="off" {}
                p #arm-legend .legend {
                    span.leg.contracted {} "contracted leg: thick over its length "
                    span.leg.extended {} "extended leg: thin rod with a ring "
                    span #seen-legend hidden { "· diamond: measured tool " }
                    "· drag, wheel or arrow keys turn the view"
                }
                p #picture-note .note {}
            }
            div {
                (measured())
                section aria-labelledby="state-title" {
                    h2 #state-title { "State" }
                    p #phase .phase.values role="status" { "unknown" }
                    div #progress .values {}
                    div.buttons {
                        button #play type="button" disabled { "Play the table" }
                        button #clear type="button" disabled { "Clear the safe state" }
                    }
                    dl #facts .facts.values {}
                }
                section aria-labelledby="events-title" {
                    h2 #events-title { "Events" }
                    ol #events .events.values reversed {}
                }
                section aria-labelledby="quality-title" {
                    h2 #quality-title { "Link" }
                    dl #quality .facts.values {}
                }
            }
        }
        (tables())
        section aria-labelledby="plots-title" {
            h2 #plots-title { "Over time" }
            div.buttons {
                label for="span" { "Shown" }
                select #span {
                    option value="60" { "1 minute" } option value="600" selected { "10 minutes" } option value="3600" { "1 hour" }
                }
                button #freeze type="button" aria-pressed="false" { "Freeze" }
                button #export type="button" { "Save as CSV" }
            }
            p #cursor .note.values aria-live="off" {}
            div #plots tabindex="0" role="group" aria-label="Plots over time; arrow keys move the cursor, + and − change the time that is shown" {}
        }
        section aria-labelledby="console-title" {
            h2 #console-title { "Console" }
            div #console .console.values tabindex="0" role="log" aria-labelledby="console-title" {}
            form #type-form {
                label for="line" { "Line; " code { "_" } " for a space, as " kbd { "Space" } " stops the arm" }
                input #line list="line-commands" maxlength="200" spellcheck="false" autocapitalize="none" autocomplete="off" placeholder="coil_1_on_200";
                datalist #line-commands {
                    @for command in ["help", "id", "status", "limits", "profile", "table", "fault", "log", "stop", "play", "clear"] { option value=(command) {} }
                }
                button type="submit" { "Send" }
            }
            p #line-note .note role="status" {}
        }
    }
}

fn measured() -> Markup {
    html! {
        section #measured-section aria-labelledby="measured-title" hidden {
            h2 #measured-title { "Measured tool pose" }
            p #residual .phase.values {}
            div.scroll tabindex="0" role="region" aria-labelledby="measured-title" {
                table.values {
                    thead { tr {
                        th scope="col" { "Axis" } th.num scope="col" { "Predicted" } th.num scope="col" { "Measured" }
                        th.num scope="col" { "Residual" }
                    } }
                    tbody #measured {}
                }
            }
            p #conditions {}
            p #measured-state .note {}
        }
    }
}

fn tables() -> Markup {
    html! {
        section #servo-section aria-labelledby="servo-title" hidden {
            h2 #servo-title { "Servos" }
            div.scroll tabindex="0" role="region" aria-labelledby="servo-title" {
                table.values {
                    thead { tr {
                        th scope="col" { "Servo" } th scope="col" { "Joint" } th.num scope="col" { "Angle" }
                        th.num scope="col" { "Load" } th scope="col" { "State" } th scope="col" { "Move to" }
                    } }
                    tbody #servos {}
                }
            }
        }
        section aria-labelledby="output-title" {
            h2 #output-title { "Outputs" }
            div.scroll tabindex="0" role="region" aria-labelledby="output-title" {
                table.values {
                    thead { tr {
                        th scope="col" { "Output" } th scope="col" { "Actuator" } th scope="col" { "Is" }
                        th.num scope="col" { "On for" } th scope="col" { "May still be on" } th scope="col" { "Switch" }
                        th scope="col" { "Set the actuator to" }
                    } }
                    tbody #outputs {}
                }
            }
        }
    }
}

fn program() -> Markup {
    html! {
        h1.hidden { "Program" }
        section aria-labelledby="table-title" {
            h2 #table-title { "Table" }
            div #drop .drop {
                label for="file" { "Open a table of " code { "darm table" } " (.darm) and its visit file (.visits.csv), or drop them here" }
                input #file type="file" accept=".darm,.csv" multiple;
            }
            p #no-program .note hidden { "None yet? Make one below." }
            div #origin hidden {
                p #origin-text {}
                p { code #origin-command {} }
                div.buttons {
                    button #save-table type="button" { "Save the table" }
                    button #save-visits type="button" { "Save the visit file" }
                }
                p #saved .note role="status" {}
            }
            p #table-note .note role="status" {}
            p #refusal .alert role="alert" hidden {}
            dl #table-facts .facts {}
            div.buttons {
                button #upload type="button" disabled { "Upload" }
                button #play type="button" disabled { "Play" }
                label { input #loop type="checkbox"; " again and again" }
                button #pause type="button" disabled { "Pause" }
                button #step-back type="button" disabled { "Row back" }
                button #step type="button" disabled { "Next row" }
            }
            p #loop-note .note role="status" {}
            p .note { "Pause stops, then sets the row that was reached: what a coil alone holds lets go for the moment between." }
            p #running .phase.values role="status" {}
            div #upload-progress hidden { label for="progress" { "Upload" } progress #progress max="1" value="0" {} }
        }
        section #record-section aria-labelledby="record-title" hidden {
            h2 #record-title { "Record" }
            p #no-data .note hidden { "To record here, start the server with a folder: " code { "darm serve arm.toml --data runs" } "." }
            div #record-here {
                label for="record-name" { "Name of the measurement" }
                input #record-name maxlength="60" pattern="[A-Za-z0-9_\\-]+" autocomplete="off";
                div.buttons { button #record type="button" disabled { "Play and record" } }
                p #record-note .note {}
                div #record-progress hidden { label for="recorded" { "Recording" } progress #recorded max="1" value="0" {} span #record-left {} }
                p #record-result role="status" {}
            }
        }
        section #timeline-section aria-labelledby="timeline-title" hidden {
            h2 #timeline-title { "Time line" }
            div.scroll tabindex="0" role="region" aria-labelledby="timeline-title" { div #timeline {} }
        }
        section #rows-section aria-labelledby="rows-title" hidden {
            h2 #rows-title { "Rows" }
            div.buttons { button #edit type="button" disabled { "Edit as a new table" } }
            div.scroll.tall tabindex="0" role="region" aria-labelledby="rows-title" {
                table {
                    thead { tr {
                        th.num scope="col" { "Row" } th.num scope="col" { "Time" } th scope="col" { "Word" }
                        th scope="col" { "Servos" } th scope="col" { "By hand" } th scope="col" { "Refused because" }
                    } }
                    tbody #rows {}
                }
            }
        }
        (make_section())
    }
}

fn make_section() -> Markup {
    html! {
        section #make-section aria-labelledby="make-title" hidden {
            h2 #make-title { "Make a table" }
            div.buttons {
                button #add type="button" { "Add a visit" }
                button #undo type="button" disabled { "Undo" }
                button #redo type="button" disabled { "Redo" }
                button #make-plan type="button" { "Measurement plan" }
            }
            div.scroll.tall tabindex="0" role="region" aria-labelledby="make-title" {
                table.cards hidden {
                    thead { tr {
                        th.num scope="col" { "Visit" } th scope="col" { "Word, actuator 0 first" } th scope="col" { "Servos, deg" }
                        th scope="col" { "Rest, s" } th scope="col" { "Row" }
                    } }
                    tbody #visits {}
                }
            }
            label { input #may-rest type="checkbox"; " Let the arm rest between visits where the limits of outputs demand it" }
            div #draft-scroll .scroll tabindex="0" role="region" aria-label="Time line of the visits; a click switches an output" hidden { div #draft {} }
            p #make-note .note role="status" {}
            div.buttons { button #make-visits type="button" disabled { "Open as a table" } }
            p.note {
                "Several lines that are pasted into a word become visits. Without a rest the arm stays until it is still and a few pictures are taken. "
                kbd { "Ctrl+Z" } " is undo."
            }
        }
    }
}
