//! The frame of all pages.

use maud::{DOCTYPE, Markup, PreEscaped, html};

/// A self-contained page: `title` is that of the window, `body` its content.
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
