//! The two examples of the paper as pictures: Figure 6, a search that the first λ solves, and Figures 7 and 8, where it
//! ends in a collision and the second λ solves.

use std::path::Path;

use anyhow::{Context as _, Result};
use darm_papers::grasp::assembly::HandFile;
use darm_papers::grasp::contact::{Configuration, Contacts};
use darm_papers::grasp::paper::{Attempt, End, Settings};
use darm_papers::grasp::picture;

/// Iterations of Figures 6, 7 and 8.
const PAPER_ITERATIONS: [u32; 3] = [15, 10, 4];
/// Stages of Figures 7 and 8 before the last one.
const SHOWN: usize = 3;

/// A search and its configurations on the way.
struct Search {
    attempt: Attempt,
    path: Vec<Configuration>,
}

/// The constraints whose searches are most like the paper's so far, and by how many iterations they differ.
#[derive(Default)]
struct Nearest<'a>(Option<(u32, &'a Contacts)>);

impl<'a> Nearest<'a> {
    fn offer(&mut self, distance: u32, contacts: &'a Contacts) {
        if self.0.is_none_or(|(known, _)| distance < known) {
            self.0 = Some((distance, contacts));
        }
    }
}

/// Draws the three pictures; of all constraints those whose searches are as long as the paper's, or nearly.
pub(super) fn pictures(file: &HandFile, constraints: &[Contacts], folder: &Path) -> Result<()> {
    let [Some(first), Some(second)] = [file.lambdas.first(), file.lambdas.get(1)] else { return Ok(()) };
    let both = |contacts: &Contacts| [search(file, *first, contacts), search(file, *second, contacts)];
    let (mut one, mut two) = (Nearest::default(), Nearest::default());
    for contacts in constraints {
        let [a, b] = both(contacts).map(|search| search.attempt);
        let far = |found: u32, figure: usize| found.abs_diff(PAPER_ITERATIONS[figure]);
        if a.end == End::Solved {
            one.offer(far(a.iterations, 0), contacts);
        }
        if a.end == End::Collides && b.end == End::Solved {
            two.offer(far(a.iterations, 1) + far(b.iterations, 2), contacts);
        }
    }
    let (Some((_, one)), Some((_, two))) = (one.0, two.0) else { return Ok(()) };
    let ([six, _], [seven, eight]) = (both(one), both(two));
    println!("Figures 6 to 8: iterations to the end of a λ; {}", folder.display());
    for (index, (search, contacts)) in [(&six, one), (&seven, two), (&eight, two)].into_iter().enumerate() {
        let Attempt { iterations, end, .. } = search.attempt;
        println!("Figure {}: {iterations}, {end}; the paper {}", index + 6, PAPER_ITERATIONS[index]);
        let path = folder.join(format!("figure-{}.svg", index + 6));
        let svg = picture::svg(&file.hand, &stages(&search.path, if index == 0 { 1 } else { SHOWN }), contacts);
        std::fs::write(&path, svg).with_context(|| format!("{} cannot be written", path.display()))?;
    }
    Ok(())
}

fn search(file: &HandFile, lambda: f64, contacts: &Contacts) -> Search {
    let mut path = Vec::new();
    let attempt = file.hand.attempt(lambda, contacts, &Settings::default(), |at| path.push(*at));
    Search { attempt, path }
}

/// The first configurations and the last one, counted from 1 as in the paper.
fn stages(path: &[Configuration], first: usize) -> Vec<(String, Configuration)> {
    let last = path.len().saturating_sub(1);
    let shown = (0..first.min(last)).chain([last]);
    shown.map(|k| (format!("k = {}", k + 1), path[k])).collect()
}
