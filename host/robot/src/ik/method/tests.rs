//! The methods side by side on the planar robot of the lecture.

use darm_core::real::Vec3;
use darm_core::se::Pose;

use super::*;
use crate::robot::planar::planar_arm;

/// Errors, m, before each step of a method from a bent posture to (0.4, 0.4) m.
fn errors(method: Method, steps: usize) -> (Status, Vec<f64>) {
    let (arm, tip) = planar_arm(&[0.5, 0.3], &[[-3.0, 3.0]; 2]);
    let options = Options { orientation_rad: f64::INFINITY, steps, ..Options::default() };
    let target = Pose::at(Vec3::new(0.4, 0.4, 0.0));
    let found = arm.inverse(method, &tip, &target, &[0.3, 1.2], &options).unwrap();
    assert_eq!(found.steps + 1, found.history.len());
    (found.status, found.history.iter().map(|residual| residual.error_m).collect())
}

#[test]
fn every_method_arrives_and_the_transpose_last() {
    let lengths = Method::STEPS.map(|method| {
        let (status, errors) = errors(method, 500);
        assert_eq!(status, Status::Reached, "{method}");
        assert!(errors.last().is_some_and(|last| *last < 1e-5));
        errors.len()
    });
    assert!(lengths.iter().all(|length| *length <= lengths[3]), "{lengths:?}");
}

#[test]
fn the_inverse_converges_quadratically() {
    let (_, errors) = errors(Method::Inverse, 50);
    // Each error is at most twice the square of the one before, once it is below a decimetre.
    let pairs: Vec<_> = errors.windows(2).filter(|pair| pair[0] < 0.1).collect();
    assert!(pairs.len() > 1 && pairs.iter().all(|pair| pair[1] <= 2.0 * pair[0] * pair[0]), "{errors:?}");
}

#[test]
fn too_few_steps_are_told_not_failed() {
    let (status, errors) = errors(Method::Transpose, 3);
    assert_eq!((status, errors.len()), (Status::NotConverged, 4));
}

#[test]
fn methods_are_named_as_they_are_typed() {
    for method in Method::all() {
        assert_eq!(method.name().parse(), Ok(method));
    }
    assert!(Method::from_str("newton").unwrap_err().contains("pseudo-inverse"));
}
