//! The crate `k`: forward kinematics, Jacobian, and its inverse kinematics with clamped joints and random restarts for 5 ms.

use std::error::Error;
use std::hint::black_box;
use std::time::{Duration, Instant};

use darm_core::actuator::JointKind;
use darm_core::real::Vec3;
use darm_core::se::Pose;
use k::nalgebra::{Isometry3, Matrix3, Translation3, Unit, UnitQuaternion, Vector3};
use k::{InverseKinematicsSolver, JacobianIkSolver, JointType, Node, NodeBuilder, SerialChain};

use super::{Measured, time, time_inverse};
use crate::models::Arm;

/// How long restarts continue for one target.
const PATIENCE: Duration = Duration::from_millis(5);

pub(crate) fn measure<const N: usize>(into: &mut Measured, arm: &Arm<N>) -> Result<(), Box<dyn Error>> {
    let chain = chain(arm).ok_or("the arm has no joints")?;
    time(into, arm, "pose", |[q, ..]| {
        chain.set_joint_positions_unchecked(q);
        black_box(chain.end_transform()).translation.vector.sum()
    });
    time(into, arm, "jacobian", |[q, ..]| {
        chain.set_joint_positions_unchecked(q);
        let jacobian = black_box(k::jacobian(&chain));
        jacobian[(0, 0)] + jacobian[(5, N - 1)] + jacobian[(1, N / 2)]
    });
    let solver = JacobianIkSolver::new(1e-5, 1e-5, 0.5, 100);
    let mut state = 7u64;
    let mut part = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    time_inverse(into, arm, 1, |index| {
        let (start, target) = &arm.targets[index];
        let (target, began) = (isometry(target), Instant::now());
        let mut q = *start;
        loop {
            chain.set_joint_positions_clamped(&q);
            if solver.solve(&chain, &target).is_ok() {
                return true;
            }
            if began.elapsed() > PATIENCE {
                return false;
            }
            q = arm.limits.map(|[low, high]| low + (high - low) * part());
        }
    });
    Ok(())
}

/// The arm as a chain of that crate, with a fixed joint at its end.
fn chain<const N: usize>(arm: &Arm<N>) -> Option<SerialChain<f64>> {
    // A node holds its children alone: all are kept until the chain holds them.
    let mut nodes: Vec<Node<f64>> = Vec::new();
    for (index, (joint, [low, high])) in arm.joints.iter().zip(&arm.limits).enumerate() {
        let axis = Unit::new_normalize(vector(&joint.axis.direction));
        let joint_type = match joint.axis.kind {
            JointKind::Revolute => JointType::Rotational { axis },
            JointKind::Prismatic => JointType::Linear { axis },
        };
        let name = format!("joint{index}");
        let node = NodeBuilder::new().name(&name).joint_type(joint_type).origin(isometry(&joint.placement));
        let node = node.limits(Some((*low..=*high).into())).into_node();
        if let Some(parent) = nodes.last() {
            node.set_parent(parent);
        }
        nodes.push(node);
    }
    let end = NodeBuilder::new().name("end").joint_type(JointType::Fixed).origin(isometry(&arm.end)).into_node();
    end.set_parent(nodes.last()?);
    Some(SerialChain::from_end(&end))
}

fn vector(v: &Vec3<f64>) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

fn isometry(pose: &Pose<f64>) -> Isometry3<f64> {
    let rotation = Matrix3::from_column_slice(pose.rotation.as_slice());
    let translation = Translation3::from(vector(&pose.position));
    Isometry3::from_parts(translation, UnitQuaternion::from_matrix(&rotation))
}
