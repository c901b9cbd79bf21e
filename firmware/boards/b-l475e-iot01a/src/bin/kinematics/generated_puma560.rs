//! Kinematics and dynamics of Puma 560.
//! Coordinates, base first: waist, shoulder, elbow, wrist roll, wrist bend, flange.
//! Tool: link 6. Gravity: [0.0, 0.0, -9.81] m/s² in the frame of the base.
//! Positions in rad or m, velocities and accelerations in rad or m per s and s², torques in N·m, forces in N. Angular
//! parts come before linear ones. The inertia of rotors is included, friction is not.
#![allow(dead_code, unreachable_pub, unused_parens, unused_variables, clippy::all)]

/// Ten inertial parameters of each link in the frame of its joint: m (kg), m·c_x, m·c_y, m·c_z (kg·m), I_xx, I_xy,
/// I_yy, I_xz, I_yz, I_zz about the frame's origin (kg·m²).
pub const PARAMETERS: [[f32; 10]; 6] = [
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.35],
    [17.4, 1.1832, 0.1044, 3.9585, 1.0311852, -0.0070992, 1.5050163, -0.269178, -0.023751, 0.620084],
    [4.8, 0.0, 0.336, 0.06768, 0.090474285, 0.0, 0.013454288, 0.0, -0.0047376, 0.10952],
    [0.82, 0.0, 0.0, 0.01558, 0.00209602, 0.0, 0.00209602, 0.0, 0.0, 0.0013],
    [0.34, 0.0, 0.0, 0.0, 0.0003, 0.0, 0.0003, 0.0, 0.0, 0.0004],
    [0.09, 0.0, 0.0, 0.00288, 0.00024216, 0.0, 0.00024216, 0.0, 0.0, 4e-5],
];

/// Torques of a motion.
///
/// - `q`: positions, rad or m.
/// - `qd`: velocities, rad/s or m/s.
/// - `qdd`: accelerations, rad/s² or m/s².
/// - writes `torque`: of each coordinate, N·m or N.
pub fn inverse_dynamics(q: &[f32; 6], qd: &[f32; 6], qdd: &[f32; 6], torque: &mut [f32; 6]) {
    let [(s17, c17), (s19, c19), (s21, c21), (s23, c23), (s25, c25)] = sin_cos([q[1], q[2], q[3], q[4], q[5]]);
    let t29 = qd[0] * c17;
    let t34 = qd[1] * t29;
    let t35 = qdd[0] * s17 + t34;
    let t28 = qd[0] * s17;
    let t36 = qd[1] * t28;
    let t37 = qdd[0] * c17 - t36;
    let t67 = 1.0311852 * t28 - 0.0070992 * t29 - 0.269178 * qd[1];
    let t77 = 0.269178 * t28 + 0.023751 * t29 - 0.620084 * qd[1];
    let t111 = s19 * t29 + c19 * t28;
    let t130 = c19 * t37 - s19 * t35 - qd[2] * t111;
    let t131 = qdd[1] + qdd[2];
    let t132 = qd[1] + qd[2];
    let t170 = 0.090474285 * t111;
    let t114 = c19 * t29 - s19 * t28;
    let t176 = 0.0047376 * t114 - 0.10952 * t132;
    let t105 = 9.81 * c17 + 0.4318 * (qdd[1] + t28 * t29) + 0.15005 * (t34 - t35);
    let t39 = t29 * t29;
    let t101 = 9.81 * s17 - 0.4318 * (t39 + qd[1] * qd[1]) + 0.15005 * (t36 + t37);
    let t123 = s19 * t105 + c19 * t101;
    let t231 = qdd[3] + t130;
    let t211 = s21 * t132 - c21 * t111;
    let t214 = c21 * t132 + s21 * t111;
    let t253 = 0.00209602 * t214;
    let t252 = 0.00209602 * t211;
    let t128 = s19 * t37 + c19 * t35 + qd[2] * t114;
    let t228 = s21 * t131 - c21 * t128 + qd[3] * t214;
    let t232 = qd[3] + t114;
    let t273 = s23 * t232 - c23 * t211;
    let t292 = c23 * t231 + s23 * t228 - qd[4] * t273;
    let t294 = qd[4] + t214;
    let t301 = 0.0003 * t273;
    let t303 = 0.0004 * t294;
    let t318 = s25 * t294 - c25 * t273;
    let t321 = c25 * t294 + s25 * t273;
    let t360 = 0.00024216 * t321;
    let t359 = 0.00024216 * t318;
    let t373 = 4e-5 * (qdd[5] + t292) + t318 * t360 - t321 * t359;
    let t391 = 0.0003 * t292 + t294 * t301 - t273 * t303 + t373;
    let t276 = c23 * t232 + s23 * t211;
    let t290 = s23 * t231 - c23 * t228 + qd[4] * t276;
    let t302 = 0.0003 * t276;
    let t230 = c21 * t131 + s21 * t128 - qd[3] * t211;
    let t293 = qdd[4] + t230;
    let t337 = c25 * t293 + s25 * t290 - qd[5] * t318;
    let t339 = qd[5] + t276;
    let t361 = 4e-5 * t339;
    let t108 = 0.4318 * (t36 - t37) - 0.15005 * (t28 * t28 + t39);
    let t139 = t111 * t132;
    let t143 = t114 * t132;
    let t146 = t128 + t143;
    let t208 = t108 - 0.0203 * (t130 - t139) + 0.4318 * t146;
    let t134 = t114 * t114;
    let t135 = t132 * t132;
    let t137 = t111 * t114;
    let t138 = t131 - t137;
    let t200 = t123 - 0.0203 * (t134 + t135) - 0.4318 * t138;
    let t226 = c21 * t208 + s21 * t200;
    let t126 = c19 * t105 - s19 * t101;
    let t133 = t111 * t111;
    let t142 = t133 + t135;
    let t204 = t126 + 0.0203 * (t131 + t137) - 0.4318 * t142;
    let t223 = s21 * t208 - c21 * t200;
    let t285 = s23 * t204 - c23 * t223;
    let t330 = s25 * t226 - c25 * t285;
    let t377 = 0.00024216 * t337 + t339 * t359 - t318 * t361 + 0.00288 * t330;
    let t335 = s25 * t293 - c25 * t290 + qd[5] * t321;
    let t333 = c25 * t226 + s25 * t285;
    let t375 = 0.00024216 * t335 + t321 * t361 - t339 * t360 - 0.00288 * t333;
    let t390 = 0.0003 * t290 + t276 * t303 - t294 * t302 + (s25 * t377 - c25 * t375);
    let t410 = 0.0013 * t231 + t211 * t253 - t214 * t252 + (c23 * t391 + s23 * t390);
    let t353 = 0.00288 * (t335 - t321 * t339) - 0.09 * t333;
    let t351 = 0.00288 * (t337 + t318 * t339) + 0.09 * t330;
    let t412 = 0.01558 * (t228 - t214 * t232) - 0.82 * t226 - (0.34 * t226 - (c25 * t353 - s25 * t351));
    let t288 = c23 * t204 + s23 * t223;
    let t394 = 0.34 * t288 - (0.00288 * (t318 * t318 + t321 * t321) - 0.09 * t288);
    let t393 = 0.34 * t285 - (s25 * t353 + c25 * t351);
    let t411 = 0.01558 * (t230 + t211 * t232) + 0.82 * t223 + (s23 * t394 - c23 * t393);
    let t425 = c21 * t412 - s21 * t411;
    let t435 = 0.013454288 * t130 - 0.0047376 * t131 + t132 * t170 + t111 * t176 + 0.06768 * t123 + (t410 + 0.0203 * t425);
    let t173 = 0.013454288 * t114 - 0.0047376 * t132;
    let t254 = 0.0013 * t232;
    let t392 = 0.0004 * t293 + t273 * t302 - t276 * t301 + (c25 * t377 + s25 * t375);
    let t409 = 0.00209602 * t230 + t232 * t252 - t211 * t254 + 0.01558 * t223 + t392;
    let t408 = 0.00209602 * t228 + t214 * t254 - t232 * t253 - 0.01558 * t226 + (s23 * t391 - c23 * t390);
    let t434 = 0.090474285 * t128 - t114 * t176 - t132 * t173 + 0.336 * t108 - 0.06768 * t126 + (s21 * t409 - c21 * t408 - 0.4318 * t425);
    let t413 = 0.01558 * (t211 * t211 + t214 * t214) - 0.82 * t204 - (c23 * t394 + s23 * t393);
    let t438 = 0.336 * t142 + 0.06768 * (t128 - t143) - 4.8 * t126 + t413;
    let t422 = s21 * t412 + c21 * t411;
    let t437 = 0.336 * t138 - 0.06768 * (t130 + t139) - 4.8 * t123 + t422;
    let t72 = 0.0070992 * t28 - 1.5050163 * t29 + 0.023751 * qd[1];
    let t451 = c19 * t438 + s19 * t437;
    torque[0] = 0.35 * qdd[0] - (c17 * (0.0070992 * t35 - 1.5050163 * t37 + 0.023751 * qdd[1] - qd[1] * t67 - t28 * t77 - 38.832886 * s17 - (c19 * t435 + s19 * t434 + 0.15005 * (s19 * t438 - c19 * t437) - 0.4318 * (0.336 * t146 - 0.06768 * (t133 + t134) + 4.8 * t108 - t425))) - s17 * (1.0311852 * t35 - 0.0070992 * t37 - 0.269178 * qdd[1] - t29 * t77 + qd[1] * t72 - 38.832886 * c17 - (s19 * t435 - c19 * t434 - 0.15005 * t451)));
    let t436 = 0.0047376 * t130 - 0.10952 * t131 - t111 * t173 + t114 * t170 + 0.336 * t123 - (c21 * t409 + s21 * t408 - 0.0203 * t413 + 0.4318 * t422);
    torque[1] = -(0.269178 * t35 + 0.023751 * t37 - 0.620084 * qdd[1] + t28 * t72 + t29 * t67 - 11.607192 * c17 + 1.024164 * s17 + (t436 + 0.4318 * t451));
    torque[2] = -t436;
    torque[3] = t410;
    torque[4] = t392;
    torque[5] = t373;
}

/// Mass matrix.
///
/// - `q`: positions, rad or m.
/// - writes `mass`: symmetric, kg·m² of coordinates that turn, kg of those that slide.
pub fn mass_matrix(q: &[f32; 6], mass: &mut [[f32; 6]; 6]) {
    let [(s4, c4), (s6, c6), (s8, c8), (s10, c10)] = sin_cos([q[1], q[2], q[3], q[4]]);
    let t62 = 0.00020216 * (s10 * s10);
    let t66 = 0.00164 + t62;
    let t26 = 0.00288 * s10;
    let t70 = c8 * t26;
    let t102 = 0.025375 - t70;
    let t104 = t70 - t102;
    let t106 = 0.0203 * t104;
    let t121 = 0.013454288 + (t66 - t106);
    let t63 = 0.00020216 * (s10 * c10);
    let t67 = c8 * t63;
    let t25 = 0.00288 * c10;
    let t105 = 0.01558 + t25 + (0.55533 + t25);
    let t112 = t67 + 0.2159 * t104 - 0.01015 * t105;
    let t146 = s6 * c6;
    let t95 = 0.0001 + t62;
    let t98 = t95 * (s8 * s8);
    let t107 = 0.4318 * t105;
    let t120 = 0.090474285 + (0.00263818 - t62 + t98 + t107);
    let t145 = t120 - t121;
    let t147 = s6 * s6;
    let t151 = t112 * (2.0 * t146) + t145 * t147;
    let t118 = 0.89133 + t25;
    let t135 = c6 * t102 - s6 * t118;
    let t161 = t135 + (2.61239 + t135);
    let t163 = 0.4318 * t161;
    let t69 = s8 * t26;
    let t162 = 0.06768 + t69 + (0.9754825 + t69);
    let t164 = 0.15005 * t162;
    let t177 = 1.5050163 + (t121 + t151 + (t163 + t164));
    let t132 = s6 * t102 + c6 * t118;
    mass[0][0] = 0.35 + (t177 - ((0.0070992 - (t112 * (1.0 - 2.0 * t147) + t145 * t146 - 0.4318 * t132)) * (2.0 * (s4 * c4)) - (1.0311852 + (t120 - t151 + t164) - t177) * (s4 * s4)));
    let t76 = s8 * t63 + 0.4318 * t69;
    let t122 = 0.0047376 + t76;
    let t115 = t95 * (s8 * c8) - 0.0203 * t69;
    let t139 = c6 * t122 - s6 * t115 + 0.15005 * t132;
    let t126 = s6 * t122 + c6 * t115;
    let t183 = c4 * (0.023751 + t139) + s4 * (0.269178 - (t126 - 0.075025 * t161 - 0.2159 * t162));
    mass[0][1] = -t183;
    let t144 = c4 * t139 - s4 * (t126 - 0.15005 * t135);
    mass[0][2] = -t144;
    let t71 = 0.4318 * t70;
    let t74 = t66 - 0.0203 * t70;
    let t72 = t67 + t71;
    let t84 = s6 * t69;
    let t94 = c4 * (t71 - (c6 * t74 + s6 * t72 + 0.15005 * (c6 * t69))) + s4 * (s6 * t74 - c6 * t72 + 0.15005 * t84);
    mass[0][3] = -t94;
    let t30 = s8 * t25;
    let t31 = 0.4318 * t30;
    let t33 = 0.0203 * t30;
    let t32 = 0.00064216 * s8 + t31;
    let t29 = c8 * t25;
    let t49 = c6 * t26 + s6 * t29;
    let t59 = c4 * (t31 + (c6 * t33 - s6 * t32 - 0.15005 * (s6 * t26 - c6 * t29))) - s4 * (s6 * t33 + c6 * t32 + 0.15005 * t49);
    mass[0][4] = -t59;
    let t13 = 4e-5 * c10;
    let t12 = 4e-5 * s10;
    let t14 = c8 * t12;
    let t24 = c4 * (c6 * t13 - s6 * t14) - s4 * (s6 * t13 + c6 * t14);
    mass[0][5] = t24;
    mass[1][0] = -t183;
    let t123 = 0.10952 + (0.00273818 - t98 - (t106 - t107));
    mass[1][1] = 0.620084 + (t123 + t163);
    let t141 = t123 + 0.4318 * t135;
    mass[1][2] = t141;
    let t91 = t76 - 0.4318 * t84;
    mass[1][3] = -t91;
    let t37 = 0.00064216 * c8 - 5.8464e-5 * s10 + 0.4318 * t29;
    let t56 = t37 - 0.4318 * t49;
    mass[1][4] = t56;
    let t15 = s8 * t12;
    mass[1][5] = t15;
    mass[2][0] = -t144;
    mass[2][1] = t141;
    mass[2][2] = t123;
    mass[2][3] = -t76;
    mass[2][4] = t37;
    mass[2][5] = t15;
    mass[3][0] = -t94;
    mass[3][1] = -t91;
    mass[3][2] = -t76;
    mass[3][3] = t66;
    mass[3][4] = 0.0;
    mass[3][5] = t13;
    mass[4][0] = -t59;
    mass[4][1] = t56;
    mass[4][2] = t37;
    mass[4][3] = 0.0;
    mass[4][4] = 0.00064216;
    mass[4][5] = 0.0;
    mass[5][0] = t24;
    mass[5][1] = t15;
    mass[5][2] = t15;
    mass[5][3] = t13;
    mass[5][4] = 0.0;
    mass[5][5] = 4e-5;
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
