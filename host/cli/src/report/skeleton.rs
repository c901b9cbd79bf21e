//! What all pages have in common.

use maud::{DOCTYPE, Markup, PreEscaped, html};

/// A page with everything that it needs in it: `title` is that of the window, `body` all that is seen.
pub(super) fn skeleton(title: &str, body: &Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "darm: " (title) }
                style { (PreEscaped(include_str!("style.css"))) }
            }
            body { main { (body) } }
        }
    }
}
