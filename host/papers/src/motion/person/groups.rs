//! Links that share their scales: those of the left and of the right side.

use rand::{Rng, RngExt as _};
use rand_distr::StandardNormal;

use crate::motion::BodyPoint;
use darm_robot::robot::Robot;

/// Links that share their scales.
pub(in crate::motion) struct Groups {
    pub(super) names: Vec<String>,
    /// The group of each body, the base first.
    pub(super) of: Vec<usize>,
}

impl Groups {
    pub(in crate::motion) fn new(tree: &Robot) -> Self {
        let base = tree.frames.first().map_or("base", |frame| frame.name.as_str());
        let links = std::iter::once(base).chain(tree.joints.iter().map(|joint| joint.link.as_str()));
        let (mut names, mut of) = (Vec::<String>::new(), Vec::new());
        for link in links {
            let sided = ["left_", "right_", "l_", "r_"].iter().find_map(|side| link.strip_prefix(side)).unwrap_or(link);
            // Links between the joints at one place carry nothing and have no length of their own.
            let plain = sided.split("_virtual").next().unwrap_or(sided).to_owned();
            let at = names.iter().position(|name| *name == plain).unwrap_or_else(|| {
                names.push(plain);
                names.len() - 1
            });
            of.push(at);
        }
        Self { names, of }
    }

    /// A scale for every group, drawn about 1.
    pub(in crate::motion) fn drawn(&self, random: &mut impl Rng, spread: f64) -> Vec<f64> {
        self.names.iter().map(|_| 1.0 + spread * random.sample::<f64, _>(StandardNormal).clamp(-2.0, 2.0)).collect()
    }

    fn body(&self, joint: Option<usize>) -> usize {
        self.of[joint.map_or(0, |joint| joint + 1)]
    }

    /// The tree with these lengths and masses of the groups.
    pub(in crate::motion) fn scaled(&self, tree: &Robot, lengths: &[f64], masses: &[f64]) -> Robot {
        let mut scaled = tree.clone();
        let grow = |inertia: &mut darm_core::tree::Inertia<f64>, group: usize| {
            inertia.mass *= masses[group];
            inertia.com *= lengths[group];
            inertia.about_com *= masses[group] * lengths[group].powi(2);
        };
        grow(&mut scaled.base, self.of[0]);
        for (k, joint) in scaled.joints.iter_mut().enumerate() {
            joint.joint.placement.position *= lengths[self.body(joint.joint.parent)];
            grow(&mut joint.joint.inertia, self.of[k + 1]);
        }
        scaled
    }

    pub(in crate::motion) fn markers(&self, markers: &[BodyPoint], lengths: &[f64]) -> Vec<BodyPoint> {
        markers.iter().map(|m| BodyPoint { point: m.point * lengths[self.body(m.joint)], ..*m }).collect()
    }
}
