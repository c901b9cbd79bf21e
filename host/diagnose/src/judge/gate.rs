//! The gate that every verdict passes, the same for all kinds of measurement.
//!
//! | what the data say | verdict |
//! | --- | --- |
//! | effects that lower the error on rows that no fit has seen, each by itself, and no more than a known noise is left | `effect-found` |
//! | the same, they take most of what was there, and more than noise is left, or the noise is not known | `partly-explained` |
//! | effects in whose place others do as well | `not-identifiable` |
//! | no effect, and more than noise | `unexplained-structure` |
//! | no effect, no more than noise, and the noise is known | `no-effect` |
//! | no effect, no more than noise, and the noise is not known well enough | `too-little-data` |
//! | another reading of model or log explains far more, or the model explains too little to belong to the log | `wrong-model-or-log` |
//!
//! What is left is more than noise where the [lower bound](crate::judge::lack_of_fit) of any axis exceeds it, or where it depends on
//! something that was recorded. Neither test needs the laws.

use crate::outcome::Verdict;
use crate::prepare::repeatability::MIN_DOF;

/// Share of what is beyond the noise that may be left where a verdict says that it is explained.
pub(crate) const UNEXPLAINED_SHARE: f64 = 0.1;

/// What a verdict rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Evidence {
    /// Whether model and log agree as they are read.
    pub(crate) agrees: bool,
    /// How many effects are named.
    pub(crate) named: usize,
    /// Whether there are effects in whose place others do as well.
    pub(crate) is_ambiguous: bool,
    /// Whether there is more than noise before any effect is added.
    pub(crate) was_beyond_noise: bool,
    /// Whether more than noise is left with them.
    pub(crate) is_left: bool,
    /// Whether the effects take most of what was there before.
    pub(crate) is_mainly_taken: bool,
    /// Whether the error on rows that no fit has seen falls beyond its own uncertainty.
    pub(crate) held_out_falls: bool,
    /// Degrees of freedom of the noise; none where it is not known.
    pub(crate) noise_dof: usize,
}

impl Evidence {
    /// Whether the noise is known well enough to say that nothing is left.
    pub(crate) fn is_noise_known(&self) -> bool {
        self.noise_dof >= MIN_DOF
    }
}

/// The verdict.
pub(crate) fn verdict(evidence: &Evidence) -> Verdict {
    let is_any = evidence.named > 0 || evidence.is_ambiguous;
    let without_names = || match evidence.was_beyond_noise {
        true => Verdict::UnexplainedStructure,
        false if evidence.is_noise_known() => Verdict::NoEffect,
        false => Verdict::TooLittleData,
    };
    match () {
        () if !evidence.agrees => Verdict::WrongModelOrLog,
        () if !is_any => without_names(),
        () if !evidence.held_out_falls => match without_names() {
            Verdict::NoEffect => Verdict::TooLittleData,
            other => other,
        },
        () if evidence.is_left && evidence.is_mainly_taken && !evidence.is_ambiguous => Verdict::PartlyExplained,
        () if evidence.is_left => Verdict::UnexplainedStructure,
        () if evidence.is_ambiguous => Verdict::NotIdentifiable,
        () if !evidence.is_noise_known() => Verdict::PartlyExplained,
        () => Verdict::EffectFound,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn evidence() -> impl Strategy<Value = Evidence> {
        (0usize..3, any::<[bool; 6]>(), 0usize..40).prop_map(|(named, all, noise_dof)| {
            let [agrees, is_ambiguous, was_beyond_noise, is_left, is_mainly_taken, held_out_falls] = all;
            let mut evidence = Evidence {
                agrees,
                named,
                is_ambiguous,
                was_beyond_noise,
                is_left,
                is_mainly_taken,
                held_out_falls,
                noise_dof,
            };
            evidence.is_left &= evidence.was_beyond_noise;
            evidence
        })
    }

    proptest! {
        #[test]
        fn no_verdict_says_more_than_its_evidence(evidence in evidence()) {
            let verdict = verdict(&evidence);
            let Evidence { named, is_ambiguous, is_left, held_out_falls, noise_dof, .. } = evidence;
            prop_assert_eq!(verdict == Verdict::WrongModelOrLog, !evidence.agrees);
            match verdict {
                Verdict::EffectFound => {
                    prop_assert!(named > 0 && held_out_falls && !is_left && !is_ambiguous && noise_dof >= MIN_DOF);
                }
                Verdict::PartlyExplained => {
                    let is_known_part = is_left && evidence.is_mainly_taken;
                    prop_assert!(named > 0 && held_out_falls && (is_known_part || !is_left && noise_dof < MIN_DOF));
                }
                Verdict::NoEffect => {
                    prop_assert!(named == 0 && !is_ambiguous && !evidence.was_beyond_noise && noise_dof >= MIN_DOF);
                }
                Verdict::NotIdentifiable => prop_assert!(is_ambiguous && held_out_falls),
                Verdict::UnexplainedStructure => prop_assert!(evidence.was_beyond_noise || is_left),
                Verdict::TooLittleData => prop_assert!(noise_dof < MIN_DOF || !held_out_falls),
                Verdict::WrongModelOrLog => {}
            }
        }
    }
}
