//! The frame of all pages.

use darm_arm::draw::palette::{BLUE, GREEN, GRID, GROUND, INK, MUTED, ORANGE, PALE, PAPER, RED};
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// The palette as variables of the style sheet.
fn colors() -> String {
    format!(
        ":root {{ --ink: {INK}; --muted: {MUTED}; --pale: {PALE}; --line: {GRID}; --ground: {GROUND}; --paper: {PAPER}; \
         --before: {ORANGE}; --after: {BLUE}; --good: {GREEN}; --bad: {RED}; }}\n"
    )
}

/// A self-contained page: `title` is that of the window, `body` its content.
pub(super) fn skeleton(title: &str, body: &Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "darm: " (title) }
                style { (PreEscaped(colors())) (PreEscaped(include_str!("style.css"))) }
            }
            body { main { (body) } script { (PreEscaped(include_str!("page.js"))) } }
        }
    }
}
