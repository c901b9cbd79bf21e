//! Kinematics and dynamics of finger.
//! Coordinates, base first: base, knuckle.
//! Tool: distal. Gravity: [0.0, 0.0, -9.81] m/s² in the frame of the base.
//! Positions in rad or m, velocities and accelerations in rad or m per s and s², torques in N·m, forces in N. Angular
//! parts come before linear ones. The inertia of rotors is included, friction is not.
//! Joint tip follows knuckle: 0.7 times its position plus 0.0.
#![allow(dead_code, unreachable_pub, unused_parens, unused_variables, clippy::all)]

/// Ten inertial parameters of each link in the frame of its joint: m (kg), m·c_x, m·c_y, m·c_z (kg·m), I_xx, I_xy,
/// I_yy, I_xz, I_yz, I_zz about the frame's origin (kg·m²).
pub const PARAMETERS: [[f32; 10]; 3] = [
    [0.013430937, 0.0, 0.0, 0.00030219607, 1.0521507e-5, 0.0, 1.0521507e-5, 0.0, 0.0, 4.13319e-7],
    [0.006896424, 0.0, 0.0, 9.654994e-5, 2.251424e-6, 0.0, 2.251424e-6, 0.0, 0.0, 1.6051428e-7],
    [0.0038000704, 0.0, 0.0, 3.8000704e-5, 6.6798003e-7, 0.0, 6.6798003e-7, 0.0, 0.0, 6.4492625e-8],
];

/// Pose of the tool in the frame of the base.
///
/// - `q`: positions, rad or m.
/// - writes `rotation`: axes of the tool as columns.
/// - writes `position`: origin of the tool, m.
pub fn forward_kinematics(q: &[f32; 2], rotation: &mut [[f32; 3]; 3], position: &mut [f32; 3]) {
    let t2 = 0.7 * q[1];
    let [(s3, c3), (s5, c5), (s7, c7)] = sin_cos([q[0], q[1], t2]);
    let t14 = c5 * s7 + s5 * c7;
    let t11 = s5 * s7 - c5 * c7;
    let t20 = s3 * t14 + c3 * t11;
    rotation[0][0] = -t20;
    rotation[0][1] = 0.0;
    let t23 = c3 * t14 - s3 * t11;
    rotation[0][2] = t23;
    rotation[1][0] = 0.0;
    rotation[1][1] = 1.0;
    rotation[1][2] = 0.0;
    rotation[2][0] = -t23;
    rotation[2][1] = 0.0;
    rotation[2][2] = -t20;
    let t17 = 0.045 + 0.028 * c5;
    let t15 = 0.028 * s5;
    position[0] = s3 * t17 + c3 * t15;
    position[1] = 0.0;
    position[2] = 0.05 + (c3 * t17 - s3 * t15);
}

/// Jacobian of the tool along the axes of the base.
///
/// - `q`: positions, rad or m.
/// - writes `jacobian`: angular velocity (rows 0 to 2, rad/s) and velocity (rows 3 to 5, m/s) of the tool per rad/s or
/// m/s.
pub fn jacobian(q: &[f32; 2], jacobian: &mut [[f32; 2]; 6]) {
    let [(s2, c2), (s4, c4)] = sin_cos([q[0], q[1]]);
    jacobian[0][0] = 0.0;
    jacobian[0][1] = 0.0;
    jacobian[1][0] = 1.0;
    jacobian[1][1] = 1.7;
    jacobian[2][0] = 0.0;
    jacobian[2][1] = 0.0;
    let t8 = 0.05 + 0.045 * c2;
    let t18 = t8 + 0.028 * (c2 * c4 - s2 * s4);
    jacobian[3][0] = t18 - 0.05;
    jacobian[3][1] = t18 - t8;
    jacobian[4][0] = 0.0;
    jacobian[4][1] = 0.0;
    let t6 = 0.045 * s2;
    let t16 = t6 + 0.028 * (s2 * c4 + c2 * s4);
    jacobian[5][0] = -t16;
    jacobian[5][1] = t6 - t16;
}

/// Pose of the tool in the frame of the base, and its Jacobian along the axes of the base.
///
/// - `q`: positions, rad or m.
/// - writes `rotation`: axes of the tool as columns.
/// - writes `position`: origin of the tool, m.
/// - writes `jacobian`: angular velocity (rows 0 to 2, rad/s) and velocity (rows 3 to 5, m/s) of the tool per rad/s or
/// m/s.
pub fn kinematics(q: &[f32; 2], rotation: &mut [[f32; 3]; 3], position: &mut [f32; 3], jacobian: &mut [[f32; 2]; 6]) {
    let t2 = 0.7 * q[1];
    let [(s3, c3), (s5, c5), (s7, c7)] = sin_cos([q[0], q[1], t2]);
    let t15 = c3 * c5 - s3 * s5;
    let t17 = s3 * c5 + c3 * s5;
    let t25 = c7 * t15 - s7 * t17;
    rotation[0][0] = t25;
    rotation[0][1] = 0.0;
    let t27 = c7 * t17 + s7 * t15;
    rotation[0][2] = t27;
    rotation[1][0] = 0.0;
    rotation[1][1] = 1.0;
    rotation[1][2] = 0.0;
    rotation[2][0] = -t27;
    rotation[2][1] = 0.0;
    rotation[2][2] = t25;
    let t9 = 0.045 * s3;
    let t19 = t9 + 0.028 * t17;
    position[0] = t19;
    position[1] = 0.0;
    let t11 = 0.05 + 0.045 * c3;
    let t21 = t11 + 0.028 * t15;
    position[2] = t21;
    jacobian[0][0] = 0.0;
    jacobian[0][1] = 0.0;
    jacobian[1][0] = 1.0;
    jacobian[1][1] = 1.7;
    jacobian[2][0] = 0.0;
    jacobian[2][1] = 0.0;
    jacobian[3][0] = t21 - 0.05;
    jacobian[3][1] = t21 - t11;
    jacobian[4][0] = 0.0;
    jacobian[4][1] = 0.0;
    jacobian[5][0] = -t19;
    jacobian[5][1] = t9 - t19;
}

/// Torques of a motion.
///
/// - `q`: positions, rad or m.
/// - `qd`: velocities, rad/s or m/s.
/// - `qdd`: accelerations, rad/s² or m/s².
/// - writes `torque`: of each coordinate, N·m or N.
pub fn inverse_dynamics(q: &[f32; 2], qd: &[f32; 2], qdd: &[f32; 2], torque: &mut [f32; 2]) {
    let t6 = 0.7 * q[1];
    let [(s9, c9), (s11, c11), (s13, c13)] = sin_cos([q[0], q[1], t6]);
    let t31 = qdd[0] + qdd[1];
    let t24 = 9.81 * c9 - 0.045 * (qd[0] * qd[0]);
    let t22 = 9.81 * s9 - 0.045 * qdd[0];
    let t27 = s11 * t24 + c11 * t22;
    let t53 = 0.7 * qdd[1] + t31;
    let t30 = c11 * t24 - s11 * t22;
    let t32 = qd[0] + qd[1];
    let t33 = t32 * t32;
    let t46 = t30 - 0.028 * t33;
    let t44 = t27 - 0.028 * t31;
    let t49 = s13 * t46 + c13 * t44;
    let t64 = 6.6798003e-7 * t53 - 3.8000704e-5 * t49;
    let t54 = 0.7 * qd[1] + t32;
    let t61 = 3.8000704e-5 * (t54 * t54) - 0.0038000704 * (c13 * t46 - s13 * t44);
    let t59 = 3.8000704e-5 * t53 - 0.0038000704 * t49;
    let t67 = s13 * t61 - c13 * t59;
    let t73 = 2.251424e-6 * t31 - 9.654994e-5 * t27 + (t64 - 0.028 * t67);
    torque[0] = 1.0521507e-5 * qdd[0] - 0.0029645436 * s9 + (t73 - 0.045 * (s11 * (9.654994e-5 * t33 - 0.006896424 * t30 + (c13 * t61 + s13 * t59)) - c11 * (9.654994e-5 * t31 - 0.006896424 * t27 - t67))) + 1e-5 * qdd[0];
    torque[1] = t73 + 1e-5 * qdd[1] + 0.7 * (t64 + 7e-6 * qdd[1]);
}

/// Torques that hold the robot against gravity.
///
/// - `q`: positions, rad or m.
/// - writes `torque`: of each coordinate, N·m or N.
pub fn gravity(q: &[f32; 2], torque: &mut [f32; 2]) {
    let t2 = 0.7 * q[1];
    let [(s3, c3), (s5, c5), (s7, c7)] = sin_cos([q[0], q[1], t2]);
    let t15 = s3 * c5 + c3 * s5;
    let t26 = 0.0038000704 * (0.045 * s3 + 0.028 * t15);
    let t27 = 3.8000704e-5 * (c7 * t15 + s7 * (c3 * c5 - s3 * s5)) + t26;
    let t28 = 9.654994e-5 * t15 + 0.0003103391 * s3 + t27;
    torque[0] = -(9.81 * (0.00030219607 * s3 + t28));
    torque[1] = 6.867 * (t26 - t27) - 9.81 * (t28 - 0.00048134226 * s3);
}

/// Mass matrix.
///
/// - `q`: positions, rad or m.
/// - writes `mass`: symmetric, kg·m² of coordinates that turn, kg of those that slide.
pub fn mass_matrix(q: &[f32; 2], mass: &mut [[f32; 2]; 2]) {
    let t1 = 0.7 * q[1];
    let [(s2, c2), (s4, c4)] = sin_cos([q[1], t1]);
    let t6 = 3.8000704e-5 * c4;
    let t17 = 0.028 * (t6 + (0.000106401974 + t6));
    let t19 = 2.9194039e-6 + t17;
    let t10 = s2 * (3.8000704e-5 * s4);
    let t21 = t10 - c2 * (0.00020295191 + t6);
    mass[0][0] = 2.0521506e-5 + (t19 - 0.045 * (t21 - (0.00048134226 - t21)));
    let t8 = 1.0640198e-6 * c4;
    let t9 = 6.6798003e-7 + t8;
    let t31 = t19 - 0.045 * t21 + 0.7 * (t9 - 0.045 * (t10 - c2 * t6));
    mass[0][1] = t31;
    mass[1][0] = t31;
    mass[1][1] = 1.2919404e-5 + t17 + 0.7 * t9 + 0.7 * (8.135566e-6 + t8);
}

/// Regressor: its product with PARAMETERS is the torque of the motion without the inertia of rotors.
///
/// - `q`: positions, rad or m.
/// - `qd`: velocities, rad/s or m/s.
/// - `qdd`: accelerations, rad/s² or m/s².
/// - writes `regressor`: torque per inertial parameter of each link, in the order of PARAMETERS.
pub fn regressor(q: &[f32; 2], qd: &[f32; 2], qdd: &[f32; 2], regressor: &mut [[[f32; 10]; 3]; 2]) {
    let t6 = 0.7 * q[1];
    let [(s9, c9), (s11, c11), (s13, c13)] = sin_cos([q[0], q[1], t6]);
    regressor[0][0][0] = 0.0;
    let t35 = 9.81 * c9;
    regressor[0][0][1] = -t35;
    regressor[0][0][2] = 0.0;
    let t34 = 9.81 * s9;
    regressor[0][0][3] = -t34;
    regressor[0][0][4] = 0.0;
    regressor[0][0][5] = 0.0;
    regressor[0][0][6] = qdd[0];
    regressor[0][0][7] = 0.0;
    regressor[0][0][8] = 0.0;
    regressor[0][0][9] = 0.0;
    let t40 = t35 - 0.045 * (qd[0] * qd[0]);
    let t38 = t34 - 0.045 * qdd[0];
    let t43 = s11 * t40 + c11 * t38;
    let t16 = 0.045 * c9;
    let t21 = c9 * c11 - s9 * s11;
    let t15 = 0.045 * s9;
    let t23 = s9 * c11 + c9 * s11;
    let t65 = t16 * t21 + t15 * t23;
    let t46 = c11 * t40 - s11 * t38;
    let t68 = t16 * t23 - t15 * t21;
    regressor[0][1][0] = t46 * t68 - t43 * t65;
    let t48 = qd[0] + qd[1];
    let t49 = t48 * t48;
    let t47 = qdd[0] + qdd[1];
    regressor[0][1][1] = -(t46 + (t49 * t65 + t47 * t68));
    regressor[0][1][2] = 0.0;
    regressor[0][1][3] = t47 * t65 - t49 * t68 - t43;
    regressor[0][1][4] = 0.0;
    regressor[0][1][5] = 0.0;
    regressor[0][1][6] = t47;
    regressor[0][1][7] = 0.0;
    regressor[0][1][8] = 0.0;
    regressor[0][1][9] = 0.0;
    let t53 = t46 - 0.028 * t49;
    let t51 = t43 - 0.028 * t47;
    let t56 = s13 * t53 + c13 * t51;
    let t31 = c13 * t21 - s13 * t23;
    let t17 = 0.05 + t16;
    let t27 = t17 + 0.028 * t21;
    let t99 = 0.05 - t27;
    let t25 = t15 + 0.028 * t23;
    let t33 = c13 * t23 + s13 * t21;
    let t102 = t31 * t99 - t25 * t33;
    let t59 = c13 * t53 - s13 * t51;
    let t105 = t33 * t99 + t25 * t31;
    regressor[0][2][0] = t56 * t102 - t59 * t105;
    let t61 = 0.7 * qd[1] + t48;
    let t62 = t61 * t61;
    let t60 = 0.7 * qdd[1] + t47;
    regressor[0][2][1] = t62 * t102 + t60 * t105 - t59;
    regressor[0][2][2] = 0.0;
    regressor[0][2][3] = -(t56 + (t60 * t102 - t62 * t105));
    regressor[0][2][4] = 0.0;
    regressor[0][2][5] = 0.0;
    regressor[0][2][6] = t60;
    regressor[0][2][7] = 0.0;
    regressor[0][2][8] = 0.0;
    regressor[0][2][9] = 0.0;
    regressor[1][0][0] = 0.0;
    regressor[1][0][1] = 0.0;
    regressor[1][0][2] = 0.0;
    regressor[1][0][3] = 0.0;
    regressor[1][0][4] = 0.0;
    regressor[1][0][5] = 0.0;
    regressor[1][0][6] = 0.0;
    regressor[1][0][7] = 0.0;
    regressor[1][0][8] = 0.0;
    regressor[1][0][9] = 0.0;
    regressor[1][1][0] = 0.0;
    regressor[1][1][1] = -t46;
    regressor[1][1][2] = 0.0;
    regressor[1][1][3] = -t43;
    regressor[1][1][4] = 0.0;
    regressor[1][1][5] = 0.0;
    regressor[1][1][6] = t47;
    regressor[1][1][7] = 0.0;
    regressor[1][1][8] = 0.0;
    regressor[1][1][9] = 0.0;
    let t81 = t17 - t27;
    let t80 = t15 - t25;
    let t84 = t31 * t81 + t33 * t80;
    let t87 = t33 * t81 - t31 * t80;
    regressor[1][2][0] = t56 * t84 - t59 * t87;
    regressor[1][2][1] = -(t59 - (t62 * t84 + t60 * t87) + 0.7 * t59);
    regressor[1][2][2] = 0.0;
    regressor[1][2][3] = -(t56 + (t60 * t84 - t62 * t87) + 0.7 * t56);
    regressor[1][2][4] = 0.0;
    regressor[1][2][5] = 0.0;
    regressor[1][2][6] = 1.7 * t60;
    regressor[1][2][7] = 0.0;
    regressor[1][2][8] = 0.0;
    regressor[1][2][9] = 0.0;
}

/// Sine and cosine of each angle, within 1.2e-7; not a number beyond 6434 rad.
#[inline(always)]
fn sin_cos<const N: usize>(angles: [f32; N]) -> [(f32, f32); N] {
    angles.map(|x| {
        let x = if x.abs() < 6434.0 { x } else { f32::NAN };
        let rounded = x * core::f32::consts::FRAC_2_PI + 12582912.0;
        let quarters = rounded.to_bits();
        let k = rounded - 12582912.0;
        let r = ((x - k * 1.5703125) - k * 0.0004837513) - k * 7.54979e-8;
        let z = r * r;
        let sine = r + r * z * (-0.16666655 + z * (0.008332161 + z * -0.00019515296));
        let cosine = (1.0 - 0.5 * z) + z * z * (0.041666646 + z * (-0.0013887316 + z * 2.4433157e-5));
        let (sine, cosine) = if quarters & 1 == 0 { (sine, cosine) } else { (cosine, sine) };
        let sine = sine.to_bits() ^ ((quarters & 2) << 30);
        let cosine = cosine.to_bits() ^ ((quarters.wrapping_add(1) & 2) << 30);
        (f32::from_bits(sine), f32::from_bits(cosine))
    })
}
