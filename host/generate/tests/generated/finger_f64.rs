//! Kinematics and dynamics of finger.
//! Coordinates, base first: base, knuckle.
//! Tool: distal. Gravity: [0.0, 0.0, -9.81] m/s² in the frame of the base.
//! Positions in rad or m, velocities and accelerations in rad or m per s and s², torques in N·m, forces in N. Angular
//! parts come before linear ones. The inertia of rotors is included, friction is not.
//! Joint tip follows knuckle: 0.7 times its position plus 0.0.
#![allow(dead_code, unreachable_pub, unused_parens, unused_variables, clippy::all)]

/// Ten inertial parameters of each link in the frame of its joint: m (kg), m·c_x, m·c_y, m·c_z (kg·m), I_xx, I_xy,
/// I_yy, I_xz, I_yz, I_zz about the frame's origin (kg·m²).
pub const PARAMETERS: [[f64; 10]; 3] = [
    [0.013430936912627084, 0.0, 0.0, 0.0003021960805341094, 1.0521506448173102e-5, 0.0, 1.0521506448173102e-5, 0.0, 0.0, 4.1331898791241386e-7],
    [0.006896424193160314, 0.0, 0.0, 9.65499387042444e-5, 2.2514238831595993e-6, 0.0, 2.2514238831595993e-6, 0.0, 0.0, 1.6051427309580635e-7],
    [0.0038000704737822136, 0.0, 0.0, 3.800070473782214e-5, 6.679800069961745e-7, 0.0, 6.679800069961745e-7, 0.0, 0.0, 6.449262461218956e-8],
];

/// Pose of the tool in the frame of the base.
///
/// - `q`: positions, rad or m.
/// - writes `rotation`: axes of the tool as columns.
/// - writes `position`: origin of the tool, m.
pub fn forward_kinematics(q: &[f64; 2], rotation: &mut [[f64; 3]; 3], position: &mut [f64; 3]) {
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
pub fn jacobian(q: &[f64; 2], jacobian: &mut [[f64; 2]; 6]) {
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
pub fn kinematics(q: &[f64; 2], rotation: &mut [[f64; 3]; 3], position: &mut [f64; 3], jacobian: &mut [[f64; 2]; 6]) {
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
pub fn inverse_dynamics(q: &[f64; 2], qd: &[f64; 2], qdd: &[f64; 2], torque: &mut [f64; 2]) {
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
    let t64 = 6.679800069961745e-7 * t53 - 3.800070473782214e-5 * t49;
    let t54 = 0.7 * qd[1] + t32;
    let t61 = 3.800070473782214e-5 * (t54 * t54) - 0.0038000704737822136 * (c13 * t46 - s13 * t44);
    let t59 = 3.800070473782214e-5 * t53 - 0.0038000704737822136 * t49;
    let t67 = s13 * t61 - c13 * t59;
    let t73 = 2.2514238831595993e-6 * t31 - 9.65499387042444e-5 * t27 + (t64 - 0.028 * t67);
    torque[0] = 1.0521506448173102e-5 * qdd[0] - 0.0029645435500396133 * s9 + (t73 - 0.045 * (s11 * (9.65499387042444e-5 * t33 - 0.006896424193160314 * t30 + (c13 * t61 + s13 * t59)) - c11 * (9.65499387042444e-5 * t31 - 0.006896424193160314 * t27 - t67))) + 1e-5 * qdd[0];
    torque[1] = t73 + 1e-5 * qdd[1] + 0.7 * (t64 + 7e-6 * qdd[1]);
}

/// Torques that hold the robot against gravity.
///
/// - `q`: positions, rad or m.
/// - writes `torque`: of each coordinate, N·m or N.
pub fn gravity(q: &[f64; 2], torque: &mut [f64; 2]) {
    let t2 = 0.7 * q[1];
    let [(s3, c3), (s5, c5), (s7, c7)] = sin_cos([q[0], q[1], t2]);
    let t15 = s3 * c5 + c3 * s5;
    let t26 = 0.0038000704737822136 * (0.045 * s3 + 0.028 * t15);
    let t27 = 3.800070473782214e-5 * (c7 * t15 + s7 * (c3 * c5 - s3 * s5)) + t26;
    let t28 = 9.65499387042444e-5 * t15 + 0.00031033908869221413 * s3 + t27;
    torque[0] = -(9.81 * (0.0003021960805341094 * s3 + t28));
    torque[1] = 6.867 * (t26 - t27) - 9.81 * (t28 - 0.0004813422600124137 * s3);
}

/// Mass matrix.
///
/// - `q`: positions, rad or m.
/// - writes `mass`: symmetric, kg·m² of coordinates that turn, kg of those that slide.
pub fn mass_matrix(q: &[f64; 2], mass: &mut [[f64; 2]; 2]) {
    let t1 = 0.7 * q[1];
    let [(s2, c2), (s4, c4)] = sin_cos([q[1], t1]);
    let t6 = 3.800070473782214e-5 * c4;
    let t17 = 0.028 * (t6 + (0.00010640197326590198 + t6));
    let t19 = 2.919403890155774e-6 + t17;
    let t10 = s2 * (3.800070473782214e-5 * s4);
    let t21 = t10 - c2 * (0.00020295191197014636 + t6);
    mass[0][0] = 2.05215064481731e-5 + (t19 - 0.045 * (t21 - (0.0004813422600124137 - t21)));
    let t8 = 1.06401973265902e-6 * c4;
    let t9 = 6.679800069961745e-7 + t8;
    let t31 = t19 - 0.045 * t21 + 0.7 * (t9 - 0.045 * (t10 - c2 * t6));
    mass[0][1] = t31;
    mass[1][0] = t31;
    mass[1][1] = 1.2919403890155774e-5 + t17 + 0.7 * t9 + 0.7 * (8.135566011893497e-6 + t8);
}

/// Regressor: its product with PARAMETERS is the torque of the motion without the inertia of rotors.
///
/// - `q`: positions, rad or m.
/// - `qd`: velocities, rad/s or m/s.
/// - `qdd`: accelerations, rad/s² or m/s².
/// - writes `regressor`: torque per inertial parameter of each link, in the order of PARAMETERS.
pub fn regressor(q: &[f64; 2], qd: &[f64; 2], qdd: &[f64; 2], regressor: &mut [[[f64; 10]; 3]; 2]) {
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

/// Sine and cosine of each angle, within 2.3e-16; not a number beyond 1e5 rad.
#[inline(always)]
fn sin_cos<const N: usize>(angles: [f64; N]) -> [(f64, f64); N] {
    // A vector of eight that is not full is written to memory in pieces and read back masked: on a Zen 5 six angles took
    // up to 27 ns longer, by where the program lies in memory.
    if cfg!(target_feature = "avx512f") && N > 4 && N < 8 {
        let full = sin_cos::<8>(core::array::from_fn(|index| if index < N { angles[index] } else { 0.0 }));
        return core::array::from_fn(|index| full[index]);
    }
    angles.map(|x| {
        let x = if x.abs() < 1e5 { x } else { f64::NAN };
        let rounded = x * core::f64::consts::FRAC_2_PI + 6755399441055744.0;
        let quarters = rounded.to_bits();
        let k = rounded - 6755399441055744.0;
        let r = ((x - k * 1.5707963267341256) - k * 6.077100506303966e-11) - k * 2.0222662487959506e-21;
        let z = r * r;
        let zz = z * z;
        let sine = r + r * z * ((-0.16666666666666632 + z * 0.00833333333332249)
            + zz * ((-0.0001984126982985795 + z * 2.7557313707070068e-6)
                + zz * (-2.5050760253406863e-8 + z * 1.58969099521155e-10)));
        let tail = zz * ((0.0416666666666666 + z * -0.001388888888887411)
            + zz * ((2.480158728947673e-5 + z * -2.7557314351390663e-7)
                + zz * (2.087572321298175e-9 + z * -1.1359647557788195e-11)));
        let half = 0.5 * z;
        let leading = 1.0 - half;
        let cosine = leading + (((1.0 - leading) - half) + tail);
        let odd = 0u64.wrapping_sub(quarters & 1);
        let (a, b) = (sine.to_bits(), cosine.to_bits());
        let swap = (a ^ b) & odd;
        let sine = a ^ swap ^ ((quarters & 2) << 62);
        let cosine = b ^ swap ^ ((quarters.wrapping_add(1) & 2) << 62);
        (f64::from_bits(sine), f64::from_bits(cosine))
    })
}
