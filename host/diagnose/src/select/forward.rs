//! The search for what is missing: effects are added one at a time, each the one that predicts unseen rows best.
//!
//! All candidates are judged by their linear fit first, cross-validated over whole groups; the best few, if they gain
//! anything that may be more than chance, are fitted in full and judged again. The best is kept when its gain is no
//! chance ([`DISCOVERY_LEVEL`], over all that were tried) and is confirmed. After each addition those found before have
//! to prove themselves again.

use crate::outcome::Rung;
use crate::select::problem::{Kind, Trial};
use crate::select::significance::{DISCOVERY_LEVEL, RIVAL_LEVEL};

/// Candidates of each step that are fitted in full.
const REFINED: usize = 8;
/// Effects that one search adds at most: some may take each other's place again and again.
const MOST_STEPS: usize = 80;
/// Exchanges of one effect for another in one search.
const MOST_EXCHANGES: usize = 12;
/// Fall of the loss below which an exchange is rounding: the effect may have been exchanged for itself.
const LEAST_GAIN: f64 = 1.0;

/// A search and what it has tried.
#[derive(Debug)]
pub struct Search<K: Kind> {
    /// What it works on.
    pub kind: K,
    /// Everything tried.
    pub ladder: Vec<Rung>,
}

/// The model that is taken, and for the effect added last what else was fitted in full.
pub type Found<K> = (Trial<K>, Vec<Trial<K>>);

impl<K: Kind> Search<K> {
    /// A search that has tried nothing.
    pub fn new(kind: K) -> Self {
        Self { kind, ladder: Vec::new() }
    }

    /// The model with all effects that prove themselves, and for the last one what else was fitted in full.
    pub fn run(&mut self, start: Trial<K>) -> Result<Found<K>, K::Error> {
        let n_known = self.kind.n_effects(&start.fit);
        let mut best = self.kind.settled(start)?;
        let (mut rivals, mut exchanges, mut steps) = (Vec::new(), 0, 0);
        while self.kind.n_effects(&best.fit) < self.kind.most() && steps < MOST_STEPS {
            steps += 1;
            let mut tried = self.step(&best, self.kind.n_effects(&best.fit) - n_known)?;
            let Some(proven) = self.proven(&best, &tried)? else {
                match self.exchanged(&best, n_known)? {
                    Some(better) if exchanges < MOST_EXCHANGES => best = self.kind.settled(better)?,
                    _ => break,
                }
                exchanges += 1;
                rivals.clear();
                continue;
            };
            self.keep(&tried[proven]);
            best = tried.remove(proven);
            rivals = tried;
            while let Some(without) = self.superfluous(&best, n_known)? {
                best = without;
                rivals.clear();
            }
            best = self.kind.settled(best)?;
        }
        Ok((best, rivals))
    }

    /// The best candidates beside the effects of `current`, fitted in full, the best first.
    pub fn step(&mut self, current: &Trial<K>, step: usize) -> Result<Vec<Trial<K>>, K::Error> {
        let mut screened = self.kind.screened(current)?;
        screened.sort_by(|a, b| a.loss.total_cmp(&b.loss));
        let n_tried = screened.len() as f64;
        let chances: Vec<f64> =
            screened.iter().map(|trial| (self.kind.fall(current, trial).p * n_tried).min(1.0)).collect();
        let mut tried = Vec::new();
        for (trial, p) in screened.iter().zip(&chances) {
            if *p < 1.0 && tried.len() < REFINED {
                // An effect that leaves the arm without a pose somewhere is not the one.
                tried.extend(self.kind.refined(trial).ok());
            }
        }
        tried.sort_by(|a, b| a.loss.total_cmp(&b.loss));
        for (trial, refined) in tried.iter().map(|trial| (trial, true)).chain(screened.iter().map(|t| (t, false))) {
            let rung = self.rung(current, trial, step, n_tried, refined);
            let known = self.ladder.iter().any(|r| r.step == step && r.law == rung.law && r.place == rung.place);
            if refined || !known {
                self.ladder.push(rung);
            }
        }
        Ok(tried)
    }

    fn rung(&self, current: &Trial<K>, trial: &Trial<K>, step: usize, n_tried: f64, refined: bool) -> Rung {
        let (law, place) = trial.effect.as_ref().map_or(("none", String::new()), |effect| self.kind.name(effect));
        Rung {
            step,
            law,
            place,
            values: self.kind.n_values(&trial.fit) - self.kind.n_values(&current.fit),
            cross_validated: trial.error,
            without: current.error,
            p: (self.kind.fall(current, trial).p * n_tried).min(1.0),
            refined,
            kept: false,
        }
    }

    fn keep(&mut self, kept: &Trial<K>) {
        let Some((law, place)) = kept.effect.as_ref().map(|effect| self.kind.name(effect)) else { return };
        let same = |rung: &&mut Rung| rung.refined && rung.law == law && rung.place == place;
        if let Some(rung) = self.ladder.iter_mut().rev().find(same) {
            rung.kept = true;
        }
    }

    /// The first that proves itself; where laws do not overlap only the best may.
    fn proven(&mut self, best: &Trial<K>, tried: &[Trial<K>]) -> Result<Option<usize>, K::Error> {
        let most = if self.kind.overlaps() { tried.len() } else { tried.len().min(1) };
        for (k, trial) in tried.iter().enumerate().take(most) {
            if self.proves_itself(best, trial)? {
                return Ok(Some(k));
            }
        }
        Ok(None)
    }

    /// Whether an effect predicts what it was not fitted to.
    fn proves_itself(&mut self, without: &Trial<K>, with: &Trial<K>) -> Result<bool, K::Error> {
        let last = self.ladder.last().map_or(0, |last| last.step);
        let n_tried = self.ladder.iter().filter(|rung| rung.step == last).count();
        let discovered = self.kind.fall(without, with).p * (n_tried as f64) < DISCOVERY_LEVEL;
        Ok(discovered && self.kind.confirmed(without, with)?)
    }

    /// The best model in which one effect found gives its place to another, where that predicts unseen rows better.
    fn exchanged(&mut self, best: &Trial<K>, n_known: usize) -> Result<Option<Trial<K>>, K::Error> {
        let mut better: Option<Trial<K>> = None;
        if !self.kind.exchanges() {
            return Ok(None);
        }
        for effect in n_known..self.kind.n_effects(&best.fit) {
            let without = self.kind.without(best, effect)?;
            let tried = self.kind.screened(&without)?.into_iter().min_by(|a, b| a.loss.total_cmp(&b.loss));
            let tried = tried.and_then(|trial| self.kind.refined(&trial).ok());
            let least = better.as_ref().map_or(best.loss, |better| better.loss);
            let worth =
                |trial: &Trial<K>| trial.loss < least - LEAST_GAIN && self.kind.fall(best, trial).p < RIVAL_LEVEL;
            better = tried.filter(worth).or(better);
        }
        Ok(better)
    }

    /// The model without an effect that is not missed: one that would not be discovered beside those that came later; where
    /// laws overlap, one that is worth nothing at all.
    fn superfluous(&mut self, best: &Trial<K>, n_known: usize) -> Result<Option<Trial<K>>, K::Error> {
        let n = self.kind.n_effects(&best.fit);
        if n < n_known + 2 {
            return Ok(None);
        }
        for dropped in n_known..n - 1 {
            let without = self.kind.without(best, dropped)?;
            let missed = match self.kind.overlaps() {
                true => self.kind.fall(&without, best).p <= RIVAL_LEVEL,
                false => self.proves_itself(&without, best)?,
            };
            if !missed {
                return Ok(Some(without));
            }
        }
        Ok(None)
    }

    /// What else explains the rows as well as one effect of the best model does, with the confidence that it is worse.
    pub fn rivals(
        &mut self,
        best: &Trial<K>,
        effect: usize,
        step: usize,
        known: Option<Vec<Trial<K>>>,
    ) -> Result<Vec<(Trial<K>, f64)>, K::Error> {
        let rivals = match known {
            Some(rivals) => rivals,
            None => {
                let without = self.kind.without(best, effect)?;
                let n_rungs = self.ladder.len();
                let rivals = self.step(&without, step)?;
                self.ladder.truncate(n_rungs);
                rivals
            }
        };
        let judged = rivals.into_iter().map(|rival| {
            let as_good = self.kind.fall(&rival, best).p;
            (rival, as_good)
        });
        Ok(judged.filter(|(_, as_good)| *as_good > RIVAL_LEVEL).map(|(rival, p)| (rival, 1.0 - p)).collect())
    }
}
