//! The paper's search: initial configurations by λ, steps by the pseudo-inverse, four ending conditions.
//!
//! The printed loop continues when a configuration meets the contacts and collides; nothing changes any more
//! then, so it is taken as the end of that λ.
//!
//! Source: Suárez, Claret, Searching a valid hand configuration to perform a given grasp, SYROCO 2009.

use std::fmt;

use darm_core::real::Vec3;

use super::contact::{Configuration, Contact, Contacts};
use super::hand::{Hand, Placed};
use super::jacobian::{jacobian, smallest_step};
use super::layout::{Angles, COORDINATES, JOINTS, THUMB};

/// Constants of the search, the paper's by default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// k_max: most iterations for one λ.
    pub max_iterations: u32,
    /// α: share of the error that a step goes for.
    pub gain: f64,
    /// d_min: how near every pᵢ and rᵢ has to come, m.
    pub reached_m: f64,
    /// s_min: progress that counts as none, the sum over all pᵢ and rᵢ, m.
    pub stalled_m: f64,
    /// n: how many iterations in a row without progress end the search.
    pub stalled_iterations: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { max_iterations: 1000, gain: 1.0, reached_m: 1e-3, stalled_m: 0.05e-3, stalled_iterations: 20 }
    }
}

/// How the search with one λ ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The contacts are met and nothing collides.
    Solved,
    /// The contacts are met, but parts of the hand collide.
    Collides,
    /// No progress any more.
    Stalled,
    /// k_max iterations are done.
    Exhausted,
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Solved => "solved",
            Self::Collides => "collides",
            Self::Stalled => "stalled",
            Self::Exhausted => "exhausted",
        })
    }
}

/// What one λ came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attempt {
    /// Where it ended.
    pub configuration: Configuration,
    /// Why.
    pub end: End,
    /// Jacobian iterations.
    pub iterations: u32,
}

/// φ_T and all angles: Q of the paper.
#[derive(Clone, Copy, Debug)]
pub(super) struct Variables {
    pub(super) turn_rad: f64,
    pub(super) angles: Angles,
}

impl Hand {
    /// The angles of the paper's initial configurations: adduction (j = 1) and the lateral virtual joint (j = 6) in the
    /// middle, all others λ of the way from their greatest to their least (its equation 3).
    pub fn initial_angles(&self, lambda: f64) -> Angles {
        let middle = self.middle();
        std::array::from_fn(|k| match k % COORDINATES {
            0 => middle[k],
            j if j == JOINTS + 1 => middle[k],
            _ => lambda * self.limits[k][0] + (1.0 - lambda) * self.limits[k][1],
        })
    }

    /// φ_T that brings p₃ − p₁ nearest to p₃* − p₁*, both seen along the thumb's contact normal (equations 4 and 5).
    pub(super) fn initial_turn(&self, placed: &Placed, contacts: &Contacts) -> f64 {
        let palm = self.on_thumb(placed, contacts, 0.0);
        let normal = contacts[THUMB].direction;
        let wide = |contacts: &[Contact]| contacts[THUMB - 1].point - contacts[0].point;
        let (wanted, present) = (wide(contacts), palm.rotation * wide(&self.contacts(placed)));
        let flat = |v: Vec3<f64>| v - normal * normal.dot(&v);
        let (wanted, present) = (flat(wanted), flat(present));
        present.cross(&wanted).dot(&normal).atan2(present.dot(&wanted))
    }

    /// The paper's initial configuration C₀ for λ: the thumb on its contact, the hand turned towards the others.
    pub fn initial_configuration(&self, lambda: f64, contacts: &Contacts) -> Configuration {
        let angles = self.initial_angles(lambda);
        let placed = self.place(&angles);
        let turn_rad = self.initial_turn(&placed, contacts);
        Configuration { pose_world_palm: self.on_thumb(&placed, contacts, turn_rad), angles }
    }

    /// The paper's search from the initial configuration of one λ; `visit` sees every configuration on the way.
    pub fn attempt(
        &self,
        lambda: f64,
        contacts: &Contacts,
        settings: &Settings,
        mut visit: impl FnMut(&Configuration),
    ) -> Attempt {
        let angles = self.initial_angles(lambda);
        let mut placed = self.place(&angles);
        let mut q = Variables { turn_rad: self.initial_turn(&placed, contacts), angles };
        let (mut iterations, mut stalled) = (0, 0);
        let mut before: Option<Contacts> = None;
        loop {
            let pose_world_palm = self.on_thumb(&placed, contacts, q.turn_rad);
            let configuration = Configuration { pose_world_palm, angles: q.angles };
            visit(&configuration);
            let wanted = contacts.map(|contact| contact.seen_from(&pose_world_palm));
            let reached = self.contacts(&placed);
            let attempt = |end| Attempt { configuration, end, iterations };
            if self.moved(&wanted, &reached).iter().flatten().all(|moved| *moved < settings.reached_m) {
                return attempt(if self.shapes.collision(&placed.links).is_some() {
                    End::Collides
                } else {
                    End::Solved
                });
            }
            let world = reached.map(|contact| contact.seen_from(&pose_world_palm.inverse()));
            let progress = before.map_or(f64::INFINITY, |b| self.moved(&b, &world).iter().flatten().sum());
            stalled = if progress < settings.stalled_m { stalled + 1 } else { 0 };
            if stalled >= settings.stalled_iterations {
                return attempt(End::Stalled);
            }
            if iterations >= settings.max_iterations {
                return attempt(End::Exhausted);
            }
            before = Some(world);
            let rows = self.paper_rows(&placed, &wanted) * settings.gain;
            if !rows.iter().all(|row| row.is_finite()) {
                return attempt(End::Stalled);
            }
            let step = smallest_step(&jacobian(&placed), &rows);
            q.turn_rad += step[0];
            let angles = std::array::from_fn(|k: usize| q.angles[k] + step[1 + k]);
            q.angles = self.within_limits(&angles);
            placed = self.place(&q.angles);
            iterations += 1;
        }
    }

    /// |Δpᵢ| and |Δrᵢ| between contacts, m.
    fn moved(&self, a: &Contacts, b: &Contacts) -> [[f64; 2]; THUMB + 1] {
        std::array::from_fn(|i| {
            let rho = self.fingers[i].tip_radius_m;
            [(a[i].point - b[i].point).norm(), (a[i].center(rho) - b[i].center(rho)).norm()]
        })
    }

    /// The paper's search with one λ after another, up to the first that solves it; what each came to.
    pub fn search(&self, lambdas: &[f64], contacts: &Contacts, settings: &Settings) -> Vec<Attempt> {
        let mut attempts = Vec::new();
        for lambda in lambdas {
            let attempt = self.attempt(*lambda, contacts, settings, |_| ());
            attempts.push(attempt);
            if attempt.end == End::Solved {
                break;
            }
        }
        attempts
    }
}
