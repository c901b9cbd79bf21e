/*
 * Kinematics and dynamics of finger.
 * Coordinates, base first: base, knuckle.
 * Tool: distal. Gravity: [0.0, 0.0, -9.81] m/s² in the frame of the base.
 * Positions in rad or m, velocities and accelerations in rad or m per s and s², torques in N·m, forces in N. Angular
 * parts come before linear ones. The inertia of rotors is included, friction is not.
 * Joint tip follows knuckle: 0.7 times its position plus 0.0.
 * Arrays are by rows. Names begin with the robot's. With -ffp-contract=off the results are those of the generated Rust,
 * bit by bit.
 */
#ifndef FINGER_H
#define FINGER_H

#include <math.h>
#include <stdint.h>
#include <string.h>

/* Sine and cosine, within 1.2e-7; not a number beyond 6434 rad. */
static inline void finger_sin_cos(float x, float *sine, float *cosine) {
    x = fabsf(x) < 6434.0f ? x : (float)NAN;
    const float rounded = x * 0.63661975f + 12582912.0f;
    uint32_t quarters, a, b;
    memcpy(&quarters, &rounded, sizeof quarters);
    const float k = rounded - 12582912.0f;
    const float r = ((x - k * 1.5703125f) - k * 0.0004837513f) - k * 7.54979e-8f;
    const float z = r * r;
    const float s = r + r * z * (-0.16666655f + z * (0.008332161f + z * -0.00019515296f));
    const float c = (1.0f - 0.5f * z) + z * z * (0.041666646f + z * (-0.0013887316f + z * 2.4433157e-5f));
    memcpy(&a, &s, sizeof a);
    memcpy(&b, &c, sizeof b);
    const uint32_t swap = (a ^ b) & (0u - (quarters & 1u));
    a ^= swap ^ ((quarters & 2u) << 30);
    b ^= swap ^ (((quarters + 1u) & 2u) << 30);
    memcpy(sine, &a, sizeof a);
    memcpy(cosine, &b, sizeof b);
}

/*
 * Ten inertial parameters of each link in the frame of its joint: m (kg), m·c_x, m·c_y, m·c_z (kg·m), I_xx, I_xy, I_yy,
 * I_xz, I_yz, I_zz about the frame's origin (kg·m²).
 */
static const float FINGER_PARAMETERS[3][10] = {
    {0.013430937f, 0.0f, 0.0f, 0.00030219607f, 1.0521507e-5f, 0.0f, 1.0521507e-5f, 0.0f, 0.0f, 4.13319e-7f},
    {0.006896424f, 0.0f, 0.0f, 9.654994e-5f, 2.251424e-6f, 0.0f, 2.251424e-6f, 0.0f, 0.0f, 1.6051428e-7f},
    {0.0038000704f, 0.0f, 0.0f, 3.8000704e-5f, 6.6798003e-7f, 0.0f, 6.6798003e-7f, 0.0f, 0.0f, 6.4492625e-8f},
};

/*
 * Pose of the tool in the frame of the base.
 *
 * q: positions, rad or m.
 * writes rotation: axes of the tool as columns.
 * writes position: origin of the tool, m.
 */
static inline void finger_forward_kinematics(const float q[2], float rotation[3][3], float position[3]) {
    const float t2 = 0.7f * q[1];
    float s3, c3;
    finger_sin_cos(q[0], &s3, &c3);
    float s5, c5;
    finger_sin_cos(q[1], &s5, &c5);
    float s7, c7;
    finger_sin_cos(t2, &s7, &c7);
    const float t14 = c5 * s7 + s5 * c7;
    const float t11 = s5 * s7 - c5 * c7;
    const float t20 = s3 * t14 + c3 * t11;
    rotation[0][0] = -t20;
    rotation[0][1] = 0.0f;
    const float t23 = c3 * t14 - s3 * t11;
    rotation[0][2] = t23;
    rotation[1][0] = 0.0f;
    rotation[1][1] = 1.0f;
    rotation[1][2] = 0.0f;
    rotation[2][0] = -t23;
    rotation[2][1] = 0.0f;
    rotation[2][2] = -t20;
    const float t17 = 0.045f + 0.028f * c5;
    const float t15 = 0.028f * s5;
    position[0] = s3 * t17 + c3 * t15;
    position[1] = 0.0f;
    position[2] = 0.05f + (c3 * t17 - s3 * t15);
}

/*
 * Jacobian of the tool along the axes of the base.
 *
 * q: positions, rad or m.
 * writes jacobian: angular velocity (rows 0 to 2, rad/s) and velocity (rows 3 to 5, m/s) of the tool per rad/s or m/s.
 */
static inline void finger_jacobian(const float q[2], float jacobian[6][2]) {
    float s2, c2;
    finger_sin_cos(q[0], &s2, &c2);
    float s4, c4;
    finger_sin_cos(q[1], &s4, &c4);
    jacobian[0][0] = 0.0f;
    jacobian[0][1] = 0.0f;
    jacobian[1][0] = 1.0f;
    jacobian[1][1] = 1.7f;
    jacobian[2][0] = 0.0f;
    jacobian[2][1] = 0.0f;
    const float t8 = 0.05f + 0.045f * c2;
    const float t18 = t8 + 0.028f * (c2 * c4 - s2 * s4);
    jacobian[3][0] = t18 - 0.05f;
    jacobian[3][1] = t18 - t8;
    jacobian[4][0] = 0.0f;
    jacobian[4][1] = 0.0f;
    const float t6 = 0.045f * s2;
    const float t16 = t6 + 0.028f * (s2 * c4 + c2 * s4);
    jacobian[5][0] = -t16;
    jacobian[5][1] = t6 - t16;
}

/*
 * Pose of the tool in the frame of the base, and its Jacobian along the axes of the base.
 *
 * q: positions, rad or m.
 * writes rotation: axes of the tool as columns.
 * writes position: origin of the tool, m.
 * writes jacobian: angular velocity (rows 0 to 2, rad/s) and velocity (rows 3 to 5, m/s) of the tool per rad/s or m/s.
 */
static inline void finger_kinematics(const float q[2], float rotation[3][3], float position[3], float jacobian[6][2]) {
    const float t2 = 0.7f * q[1];
    float s3, c3;
    finger_sin_cos(q[0], &s3, &c3);
    float s5, c5;
    finger_sin_cos(q[1], &s5, &c5);
    float s7, c7;
    finger_sin_cos(t2, &s7, &c7);
    const float t15 = c3 * c5 - s3 * s5;
    const float t17 = s3 * c5 + c3 * s5;
    const float t25 = c7 * t15 - s7 * t17;
    rotation[0][0] = t25;
    rotation[0][1] = 0.0f;
    const float t27 = c7 * t17 + s7 * t15;
    rotation[0][2] = t27;
    rotation[1][0] = 0.0f;
    rotation[1][1] = 1.0f;
    rotation[1][2] = 0.0f;
    rotation[2][0] = -t27;
    rotation[2][1] = 0.0f;
    rotation[2][2] = t25;
    const float t9 = 0.045f * s3;
    const float t19 = t9 + 0.028f * t17;
    position[0] = t19;
    position[1] = 0.0f;
    const float t11 = 0.05f + 0.045f * c3;
    const float t21 = t11 + 0.028f * t15;
    position[2] = t21;
    jacobian[0][0] = 0.0f;
    jacobian[0][1] = 0.0f;
    jacobian[1][0] = 1.0f;
    jacobian[1][1] = 1.7f;
    jacobian[2][0] = 0.0f;
    jacobian[2][1] = 0.0f;
    jacobian[3][0] = t21 - 0.05f;
    jacobian[3][1] = t21 - t11;
    jacobian[4][0] = 0.0f;
    jacobian[4][1] = 0.0f;
    jacobian[5][0] = -t19;
    jacobian[5][1] = t9 - t19;
}

/*
 * Torques of a motion.
 *
 * q: positions, rad or m.
 * qd: velocities, rad/s or m/s.
 * qdd: accelerations, rad/s² or m/s².
 * writes torque: of each coordinate, N·m or N.
 */
static inline void finger_inverse_dynamics(const float q[2], const float qd[2], const float qdd[2], float torque[2]) {
    const float t6 = 0.7f * q[1];
    float s9, c9;
    finger_sin_cos(q[0], &s9, &c9);
    float s11, c11;
    finger_sin_cos(q[1], &s11, &c11);
    float s13, c13;
    finger_sin_cos(t6, &s13, &c13);
    const float t31 = qdd[0] + qdd[1];
    const float t24 = 9.81f * c9 - 0.045f * (qd[0] * qd[0]);
    const float t22 = 9.81f * s9 - 0.045f * qdd[0];
    const float t27 = s11 * t24 + c11 * t22;
    const float t53 = 0.7f * qdd[1] + t31;
    const float t30 = c11 * t24 - s11 * t22;
    const float t32 = qd[0] + qd[1];
    const float t33 = t32 * t32;
    const float t46 = t30 - 0.028f * t33;
    const float t44 = t27 - 0.028f * t31;
    const float t49 = s13 * t46 + c13 * t44;
    const float t64 = 6.6798003e-7f * t53 - 3.8000704e-5f * t49;
    const float t54 = 0.7f * qd[1] + t32;
    const float t61 = 3.8000704e-5f * (t54 * t54) - 0.0038000704f * (c13 * t46 - s13 * t44);
    const float t59 = 3.8000704e-5f * t53 - 0.0038000704f * t49;
    const float t67 = s13 * t61 - c13 * t59;
    const float t73 = 2.251424e-6f * t31 - 9.654994e-5f * t27 + (t64 - 0.028f * t67);
    torque[0] = 1.0521507e-5f * qdd[0] - 0.0029645436f * s9 + (t73 - 0.045f * (s11 * (9.654994e-5f * t33 - 0.006896424f * t30 + (c13 * t61 + s13 * t59)) - c11 * (9.654994e-5f * t31 - 0.006896424f * t27 - t67))) + 1e-5f * qdd[0];
    torque[1] = t73 + 1e-5f * qdd[1] + 0.7f * (t64 + 7e-6f * qdd[1]);
}

/*
 * Torques that hold the robot against gravity.
 *
 * q: positions, rad or m.
 * writes torque: of each coordinate, N·m or N.
 */
static inline void finger_gravity(const float q[2], float torque[2]) {
    const float t2 = 0.7f * q[1];
    float s3, c3;
    finger_sin_cos(q[0], &s3, &c3);
    float s5, c5;
    finger_sin_cos(q[1], &s5, &c5);
    float s7, c7;
    finger_sin_cos(t2, &s7, &c7);
    const float t15 = s3 * c5 + c3 * s5;
    const float t26 = 0.0038000704f * (0.045f * s3 + 0.028f * t15);
    const float t27 = 3.8000704e-5f * (c7 * t15 + s7 * (c3 * c5 - s3 * s5)) + t26;
    const float t28 = 9.654994e-5f * t15 + 0.0003103391f * s3 + t27;
    torque[0] = -(9.81f * (0.00030219607f * s3 + t28));
    torque[1] = 6.867f * (t26 - t27) - 9.81f * (t28 - 0.00048134226f * s3);
}

/*
 * Mass matrix.
 *
 * q: positions, rad or m.
 * writes mass: symmetric, kg·m² of coordinates that turn, kg of those that slide.
 */
static inline void finger_mass_matrix(const float q[2], float mass[2][2]) {
    const float t1 = 0.7f * q[1];
    float s2, c2;
    finger_sin_cos(q[1], &s2, &c2);
    float s4, c4;
    finger_sin_cos(t1, &s4, &c4);
    const float t6 = 3.8000704e-5f * c4;
    const float t17 = 0.028f * (t6 + (0.000106401974f + t6));
    const float t19 = 2.9194039e-6f + t17;
    const float t10 = s2 * (3.8000704e-5f * s4);
    const float t21 = t10 - c2 * (0.00020295191f + t6);
    mass[0][0] = 2.0521506e-5f + (t19 - 0.045f * (t21 - (0.00048134226f - t21)));
    const float t8 = 1.0640198e-6f * c4;
    const float t9 = 6.6798003e-7f + t8;
    const float t31 = t19 - 0.045f * t21 + 0.7f * (t9 - 0.045f * (t10 - c2 * t6));
    mass[0][1] = t31;
    mass[1][0] = t31;
    mass[1][1] = 1.2919404e-5f + t17 + 0.7f * t9 + 0.7f * (8.135566e-6f + t8);
}

/*
 * Regressor: its product with PARAMETERS is the torque of the motion without the inertia of rotors.
 *
 * q: positions, rad or m.
 * qd: velocities, rad/s or m/s.
 * qdd: accelerations, rad/s² or m/s².
 * writes regressor: torque per inertial parameter of each link, in the order of PARAMETERS.
 */
static inline void finger_regressor(const float q[2], const float qd[2], const float qdd[2], float regressor[2][3][10]) {
    const float t6 = 0.7f * q[1];
    float s9, c9;
    finger_sin_cos(q[0], &s9, &c9);
    float s11, c11;
    finger_sin_cos(q[1], &s11, &c11);
    float s13, c13;
    finger_sin_cos(t6, &s13, &c13);
    regressor[0][0][0] = 0.0f;
    const float t35 = 9.81f * c9;
    regressor[0][0][1] = -t35;
    regressor[0][0][2] = 0.0f;
    const float t34 = 9.81f * s9;
    regressor[0][0][3] = -t34;
    regressor[0][0][4] = 0.0f;
    regressor[0][0][5] = 0.0f;
    regressor[0][0][6] = qdd[0];
    regressor[0][0][7] = 0.0f;
    regressor[0][0][8] = 0.0f;
    regressor[0][0][9] = 0.0f;
    const float t40 = t35 - 0.045f * (qd[0] * qd[0]);
    const float t38 = t34 - 0.045f * qdd[0];
    const float t43 = s11 * t40 + c11 * t38;
    const float t16 = 0.045f * c9;
    const float t21 = c9 * c11 - s9 * s11;
    const float t15 = 0.045f * s9;
    const float t23 = s9 * c11 + c9 * s11;
    const float t65 = t16 * t21 + t15 * t23;
    const float t46 = c11 * t40 - s11 * t38;
    const float t68 = t16 * t23 - t15 * t21;
    regressor[0][1][0] = t46 * t68 - t43 * t65;
    const float t48 = qd[0] + qd[1];
    const float t49 = t48 * t48;
    const float t47 = qdd[0] + qdd[1];
    regressor[0][1][1] = -(t46 + (t49 * t65 + t47 * t68));
    regressor[0][1][2] = 0.0f;
    regressor[0][1][3] = t47 * t65 - t49 * t68 - t43;
    regressor[0][1][4] = 0.0f;
    regressor[0][1][5] = 0.0f;
    regressor[0][1][6] = t47;
    regressor[0][1][7] = 0.0f;
    regressor[0][1][8] = 0.0f;
    regressor[0][1][9] = 0.0f;
    const float t53 = t46 - 0.028f * t49;
    const float t51 = t43 - 0.028f * t47;
    const float t56 = s13 * t53 + c13 * t51;
    const float t31 = c13 * t21 - s13 * t23;
    const float t17 = 0.05f + t16;
    const float t27 = t17 + 0.028f * t21;
    const float t99 = 0.05f - t27;
    const float t25 = t15 + 0.028f * t23;
    const float t33 = c13 * t23 + s13 * t21;
    const float t102 = t31 * t99 - t25 * t33;
    const float t59 = c13 * t53 - s13 * t51;
    const float t105 = t33 * t99 + t25 * t31;
    regressor[0][2][0] = t56 * t102 - t59 * t105;
    const float t61 = 0.7f * qd[1] + t48;
    const float t62 = t61 * t61;
    const float t60 = 0.7f * qdd[1] + t47;
    regressor[0][2][1] = t62 * t102 + t60 * t105 - t59;
    regressor[0][2][2] = 0.0f;
    regressor[0][2][3] = -(t56 + (t60 * t102 - t62 * t105));
    regressor[0][2][4] = 0.0f;
    regressor[0][2][5] = 0.0f;
    regressor[0][2][6] = t60;
    regressor[0][2][7] = 0.0f;
    regressor[0][2][8] = 0.0f;
    regressor[0][2][9] = 0.0f;
    regressor[1][0][0] = 0.0f;
    regressor[1][0][1] = 0.0f;
    regressor[1][0][2] = 0.0f;
    regressor[1][0][3] = 0.0f;
    regressor[1][0][4] = 0.0f;
    regressor[1][0][5] = 0.0f;
    regressor[1][0][6] = 0.0f;
    regressor[1][0][7] = 0.0f;
    regressor[1][0][8] = 0.0f;
    regressor[1][0][9] = 0.0f;
    regressor[1][1][0] = 0.0f;
    regressor[1][1][1] = -t46;
    regressor[1][1][2] = 0.0f;
    regressor[1][1][3] = -t43;
    regressor[1][1][4] = 0.0f;
    regressor[1][1][5] = 0.0f;
    regressor[1][1][6] = t47;
    regressor[1][1][7] = 0.0f;
    regressor[1][1][8] = 0.0f;
    regressor[1][1][9] = 0.0f;
    const float t81 = t17 - t27;
    const float t80 = t15 - t25;
    const float t84 = t31 * t81 + t33 * t80;
    const float t87 = t33 * t81 - t31 * t80;
    regressor[1][2][0] = t56 * t84 - t59 * t87;
    regressor[1][2][1] = -(t59 - (t62 * t84 + t60 * t87) + 0.7f * t59);
    regressor[1][2][2] = 0.0f;
    regressor[1][2][3] = -(t56 + (t60 * t84 - t62 * t87) + 0.7f * t56);
    regressor[1][2][4] = 0.0f;
    regressor[1][2][5] = 0.0f;
    regressor[1][2][6] = 1.7f * t60;
    regressor[1][2][7] = 0.0f;
    regressor[1][2][8] = 0.0f;
    regressor[1][2][9] = 0.0f;
}

#endif
