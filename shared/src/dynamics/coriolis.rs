//! The Coriolis matrix of Christoffel's symbols, the one for which Ṁ − 2C is skew.
//!
//! Source: S. Echeandia, P. M. Wensing, Numerical Methods to Compute the Coriolis Matrix and Christoffel Symbols for
//! Rigid-Body Systems, J. of Computational and Nonlinear Dynamics 16 (2021) 091004, algorithm 1.

use nalgebra::SMatrix;

use super::Vec3;
use super::mass::set;
use crate::real::{Mat3, Mat6, Real, Vec6, real};
use crate::se::Twist;
use crate::tree::{Body, Frames, Tree};

/// A matrix of six by six from its four quarters.
fn quarters<T: Real>(a: &Mat3<T>, b: &Mat3<T>, c: &Mat3<T>, d: &Mat3<T>) -> Mat6<T> {
    Mat6::from_fn(|row, column| match (row < 3, column < 3) {
        (true, true) => a[(row, column)],
        (true, false) => b[(row, column - 3)],
        (false, true) => c[(row - 3, column)],
        (false, false) => d[(row - 3, column - 3)],
    })
}

fn skew<T: Real>(v: &Vec3<T>) -> Mat3<T> {
    v.cross_matrix()
}

/// Spatial inertia, angular part first.
pub(super) fn spatial<T: Real>(body: &Body<T>) -> Mat6<T> {
    let h = skew(&body.moment);
    let mass = Mat3::from_diagonal_element(body.mass);
    quarters(&body.inertia.to_matrix(), &h, &-h, &mass)
}

/// \[V ×\]: the rate of a twist that moves with V.
pub(super) fn cross<T: Real>(twist: &Twist<T>) -> Mat6<T> {
    let (w, v) = (skew(&twist.angular), skew(&twist.linear));
    quarters(&w, &Mat3::zeros(), &v, &w)
}

/// ½ (V ×* I + (I V) ×̄* − I V ×) for one body.
fn body_coriolis<T: Real>(inertia: &Mat6<T>, twist: &Twist<T>) -> Mat6<T> {
    let moving = cross(twist);
    let momentum = inertia * twist.to_vector();
    let (n, f) = (
        skew(&Vec3::new(momentum[0], momentum[1], momentum[2])),
        skew(&Vec3::new(momentum[3], momentum[4], momentum[5])),
    );
    let bar = quarters(&-n, &-f, &-f, &Mat3::zeros());
    (bar - moving.transpose() * inertia - inertia * moving) * real::<T>(0.5)
}

/// C(q, q̇), N × N: V = C q̇, Ṁ = C + Cᵀ, for a tree on a fixed base at the joint velocities `qd`.
pub fn coriolis_matrix<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    frames: &Frames<T, N>,
    qd: &[T; N],
) -> SMatrix<T, N, N> {
    let twists = tree.twists(&Twist::zero(), qd, frames);
    let mut inertias = [Mat6::<T>::zeros(); N];
    let mut couplings = [Mat6::<T>::zeros(); N];
    let mut screws = [(Vec6::<T>::zeros(), Vec6::<T>::zeros()); N];
    for index in 0..N {
        let (Some(link), Some(frame), Some(twist)) =
            (tree.links.get(index), frames.links().get(index), twists.get(index))
        else {
            continue;
        };
        let at_origin = Twist { angular: twist.angular, linear: twist.linear + frame.origin.cross(&twist.angular) };
        let inertia = spatial(&link.body.in_base(frame));
        let (angular, linear) = link.screw(frame);
        let screw = Twist { angular, linear }.to_vector();
        if let (Some(i), Some(b), Some(s)) = (inertias.get_mut(index), couplings.get_mut(index), screws.get_mut(index))
        {
            (*i, *b, *s) = (inertia, body_coriolis(&inertia, &at_origin), (screw, cross(&at_origin) * screw));
        }
    }
    inward(tree, &mut inertias, &mut couplings, &screws)
}

fn inward<T: Real, const N: usize>(
    tree: &Tree<T, N>,
    inertias: &mut [Mat6<T>; N],
    couplings: &mut [Mat6<T>; N],
    screws: &[(Vec6<T>, Vec6<T>); N],
) -> SMatrix<T, N, N> {
    let mut matrix = SMatrix::<T, N, N>::zeros();
    for j in (0..N).rev() {
        let (Some(link), Some((screw, rate)), Some(inertia), Some(coupling)) =
            (tree.links.get(j), screws.get(j), inertias.get(j).copied(), couplings.get(j).copied())
        else {
            continue;
        };
        let along = inertia * rate + coupling * screw;
        let (carried, across) = (inertia * screw, coupling.transpose() * screw);
        set(&mut matrix, j, j, screw.dot(&along));
        let mut i = usize::from(link.parent);
        for _ in 0..N {
            let (Some(link), Some((screw, rate))) = (tree.links.get(i), screws.get(i)) else { break };
            set(&mut matrix, i, j, screw.dot(&along));
            set(&mut matrix, j, i, rate.dot(&carried) + screw.dot(&across));
            i = usize::from(link.parent);
        }
        let parent = usize::from(link.parent);
        if let (Some(i), Some(b)) = (inertias.get_mut(parent), couplings.get_mut(parent)) {
            *i += inertia;
            *b += coupling;
        }
    }
    matrix
}
