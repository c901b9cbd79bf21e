//! How far the pose that a chip predicts in `f32` can be from the one that the host predicts in `f64`.
//!
//! # Bound
//!
//! d ≤ Σ_k s_k·δ_k + u·Σ_i [ (5.2 + 8.7·n_i)·(r_i + ℓ) + 5.2·|p_i| + |q_i| ] + u·m·(12.4·(|q| + ℓ) + |q|)
//!
//! | symbol | unit | meaning |
//! | --- | --- | --- |
//! | d | m | distance of the two poses, d² = \|Δp\|² + ℓ²θ² |
//! | u | 1 | 2⁻²⁴, what one operation in `f32` is off by at most, as a share |
//! | s_k | m/m, m/rad | how far the tool goes, as a distance, per unit of the value of actuator k |
//! | δ_k | m, rad | what the value of actuator k appears to be off by, below |
//! | i | | a stage, the mount and the tool |
//! | n_i | | steps of Newton's method for a platform, 1 for a joint, 0 for a link; `f32` takes no more than `f64` |
//! | p_i, r_i, q_i | m | position of its top in its base, in the tool, and in the arm's base; q is the tool's |
//! | m | | effects that move the tool rigidly |
//!
//! To first order in u, and worst case: every rounding at its most, all of one sign.
//!
//! - A product of rotations, or of a rotation and a vector, sums three products: 3u by entry, 3√3·u = 5.2u as a norm. It
//!   turns all that is further out, at the lever r_i, and weighs ℓ as a rotation.
//! - A step of Newton's method multiplies the rotation by that of the step: two roundings by entry of the one, three of
//!   the product, 5√3·u = 8.7u. The equations of the legs take back what is a rotation of it, not the rest.
//! - A leg is measured as |R·t + p − b|: 5.2u·|t| for R·t, u·(|t| + |p|) and u·l for the sums, 2.5u·l for the root of three
//!   squares. It is given as b, t and l with u each, and e effects add to l with u each. The last step rounds R and p once
//!   more: δ = u·[(7.2 + 8.7·(1 + n))·|t| + 2·|p| + |b| + (4.5 + e)·l]. What the last step leaves by its own curvature is
//!   the square of ε^¾ and of no account. A joint: δ = u·(1 + e)·|value|.
//! - Where legs give way, settling ends when no actuator moves by more than 10⁻⁸ + 16ε, [`Model::predict`], of both
//!   scalars; as each time leaves less than half of what the last one left, no more than that is left. The loads come of
//!   a platform whose condition is below 10³: their share of 10³·u is 6·10⁻⁵ of the deflection.
//!
//! Source of the rules: Higham, Accuracy and Stability of Numerical Algorithms, SIAM, 2002, chapters 2 and 3.
//!
//! [`Model::predict`]: darm_core::model::Model::predict

use darm_core::actuator::{Setting, Stage};
use darm_core::chain::{ChainError, Parameter};
use darm_core::effect::Place;
use darm_core::model::Condition;
use darm_core::real::Vec3;
use darm_core::se::Pose;

use super::{Arm, ArmScratch};

/// u.
const UNIT: f64 = f32::EPSILON as f64 / 2.0;
/// A rotation times a rotation or a vector.
const PRODUCT: f64 = 5.2 * UNIT;
/// A step of Newton's method.
const STEP: f64 = 8.7 * UNIT;
/// What settling leaves, m: of both scalars.
const SETTLED: f64 = 2e-8 + 16.0 * f32::EPSILON as f64;
/// What the loads of a platform are off by, as a share.
const LOADS: f64 = 1e3 * UNIT;

impl Arm {
    /// The most that a prediction in `f32` can be away from [`Model::predict`] in `f64`, m; see the [module](self).
    ///
    /// [`Model::predict`]: darm_core::model::Model::predict
    ///
    /// # Errors
    ///
    /// The model has no pose under `condition`.
    pub fn single_precision_bound_m(&self, condition: &Condition<f64>) -> Result<f64, ChainError> {
        let (model, scale_m) = (&self.model, self.length_scale_m);
        let mut scratch = ArmScratch::default();
        let seen = model.predict(condition, &mut scratch)?;
        let tool = scratch.pose_base_tool;
        let part = |own: &Pose<f64>, top: &Pose<f64>, steps: f64| {
            let lever = top.to(&tool).position.norm() + scale_m;
            (PRODUCT + STEP * steps) * lever + PRODUCT * own.position.norm() + UNIT * top.position.norm()
        };
        let chain = &model.chain;
        let mut bound = part(&chain.mount, &chain.mount, 0.0) + part(&chain.tool, &tool, 0.0);
        let mut steps = Vec::new();
        for (index, stage) in chain.stages.iter().enumerate() {
            steps.push(newton_steps(stage, &scratch.settings[index]));
            bound += part(&scratch.stages[index], &scratch.tops[index], steps[index]);
        }
        let ideal = |actuator: usize, state| chain.get(Parameter::Stop { actuator: actuator as u8, state });
        for (site, leg) in model.sites(condition) {
            let effects = model.effects.iter().filter(|effect| effect.place().holds(&site));
            let (count, bears) = effects.fold((0.0, false), |(n, bears), law| (n + 1.0, bears || law.bears_load()));
            let setting = &scratch.settings[site.stage][leg];
            let own = match &chain.stages[site.stage] {
                Stage::Planar(_) | Stage::Spatial(_) => {
                    of_leg(setting, &scratch.stages[site.stage], steps[site.stage], count)
                }
                _ => UNIT * (1.0 + count) * setting.value.abs(),
            };
            let given_way = (setting.value - ideal(site.actuator, site.digit).unwrap_or(setting.value)).abs();
            let loaded = if bears { SETTLED + LOADS * given_way } else { 0.0 };
            let stop = Parameter::Stop { actuator: site.actuator as u8, state: site.digit };
            let twist = chain.derivative(stop, &scratch);
            bound += size(&twist.linear, &twist.angular, scale_m) * (own + loaded);
        }
        let moves_all = |place| matches!(place, Place::Base | Place::Tool | Place::Camera);
        let moving = model.effects.iter().filter(|effect| moves_all(effect.place())).count() as f64;
        let reach = seen.position.norm();
        Ok(bound + UNIT * moving * (12.4 * (reach + scale_m) + reach))
    }
}

/// δ_k of a leg.
fn of_leg(leg: &Setting<f64>, pose: &Pose<f64>, steps: f64, effects: f64) -> f64 {
    let top = leg.top.norm();
    let of_position = 2.0 * pose.position.norm() + leg.base.norm();
    STEP * (1.0 + steps) * top + UNIT * (7.2 * top + of_position + (4.5 + effects) * leg.value.abs())
}

fn newton_steps(stage: &Stage<f64>, settings: &[Setting<f64>; darm_core::actuator::MAX_LEGS]) -> f64 {
    let steps = match stage {
        Stage::Planar(platform) => platform.assemble(settings).map(|found| found.iterations),
        Stage::Spatial(platform) => platform.assemble(settings).map(|found| found.iterations),
        Stage::Discrete(_) | Stage::Servo(_) => Ok(1),
        Stage::Link(_) => Ok(0),
    };
    steps.map_or(0.0, f64::from)
}

/// A motion as a distance.
fn size(linear: &Vec3<f64>, angular: &Vec3<f64>, scale_m: f64) -> f64 {
    (linear.norm_squared() + scale_m * scale_m * angular.norm_squared()).sqrt()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use darm_core::chain::Scratch;
    use darm_core::units::Word;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn single_precision_stays_within_its_bound() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let files = ["tests/data/corrected/corrected.toml", "examples/planar4.toml", "examples/serial12.toml"];
        for (file, most_m) in files.into_iter().zip([2e-3, 2e-4, 1e-4]) {
            let arm = Arm::read(&root.join(file)).unwrap();
            let single = arm.model.cast::<f32>();
            let mut random = ChaCha8Rng::seed_from_u64(3);
            let mut share: f64 = 0.0;
            for _ in 0..200 {
                let [word, previous] = [(); 2].map(|()| {
                    let digits: Vec<u8> = (0..arm.n_actuators()).map(|_| random.random_range(0..2)).collect();
                    Word::new(&digits).unwrap()
                });
                let condition = arm.model.working(word, previous, &[]);
                let fine = arm.model.predict(&condition, &mut ArmScratch::default()).unwrap();
                let coarse = single.predict(&single.working(word, previous, &[]), &mut Scratch::default()).unwrap();
                let coarse =
                    Pose { rotation: coarse.rotation.map(f64::from), position: coarse.position.map(f64::from) };
                let bound_m = arm.single_precision_bound_m(&condition).unwrap();
                assert!(bound_m < most_m, "{file} {word}: {bound_m}");
                share = share.max(fine.distance(&coarse, arm.length_scale_m) / bound_m);
            }
            assert!(share < 1.0, "{file}: {share}");
        }
    }
}
