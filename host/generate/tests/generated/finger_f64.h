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

/* Sine and cosine, within 2.3e-16; not a number beyond 1e5 rad. */
static inline void finger_sin_cos(double x, double *sine, double *cosine) {
    x = fabs(x) < 1e5 ? x : (double)NAN;
    const double rounded = x * 0.6366197723675814 + 6755399441055744.0;
    uint64_t quarters, a, b;
    memcpy(&quarters, &rounded, sizeof quarters);
    const double k = rounded - 6755399441055744.0;
    const double r = ((x - k * 1.5707963267341256) - k * 6.077100506303966e-11) - k * 2.0222662487959506e-21;
    const double z = r * r;
    const double zz = z * z;
    const double s = r + r * z * ((-0.16666666666666632 + z * 0.00833333333332249)
        + zz * ((-0.0001984126982985795 + z * 2.7557313707070068e-6)
            + zz * (-2.5050760253406863e-8 + z * 1.58969099521155e-10)));
    const double tail = zz * ((0.0416666666666666 + z * -0.001388888888887411)
        + zz * ((2.480158728947673e-5 + z * -2.7557314351390663e-7)
            + zz * (2.087572321298175e-9 + z * -1.1359647557788195e-11)));
    const double half = 0.5 * z;
    const double leading = 1.0 - half;
    const double c = leading + (((1.0 - leading) - half) + tail);
    memcpy(&a, &s, sizeof a);
    memcpy(&b, &c, sizeof b);
    const uint64_t swap = (a ^ b) & ((uint64_t)0 - (quarters & 1u));
    a ^= swap ^ ((quarters & 2u) << 62);
    b ^= swap ^ (((quarters + 1u) & 2u) << 62);
    memcpy(sine, &a, sizeof a);
    memcpy(cosine, &b, sizeof b);
}

/*
 * Ten inertial parameters of each link in the frame of its joint: m (kg), m·c_x, m·c_y, m·c_z (kg·m), I_xx, I_xy, I_yy,
 * I_xz, I_yz, I_zz about the frame's origin (kg·m²).
 */
static const double FINGER_PARAMETERS[3][10] = {
    {0.013430936912627084, 0.0, 0.0, 0.0003021960805341094, 1.0521506448173102e-5, 0.0, 1.0521506448173102e-5, 0.0, 0.0, 4.1331898791241386e-7},
    {0.006896424193160314, 0.0, 0.0, 9.65499387042444e-5, 2.2514238831595993e-6, 0.0, 2.2514238831595993e-6, 0.0, 0.0, 1.6051427309580635e-7},
    {0.0038000704737822136, 0.0, 0.0, 3.800070473782214e-5, 6.679800069961745e-7, 0.0, 6.679800069961745e-7, 0.0, 0.0, 6.449262461218956e-8},
};

/*
 * Pose of the tool in the frame of the base.
 *
 * q: positions, rad or m.
 * writes rotation: axes of the tool as columns.
 * writes position: origin of the tool, m.
 */
static inline void finger_forward_kinematics(const double q[2], double rotation[3][3], double position[3]) {
    const double t2 = 0.7 * q[1];
    double s3, c3;
    finger_sin_cos(q[0], &s3, &c3);
    double s5, c5;
    finger_sin_cos(q[1], &s5, &c5);
    double s7, c7;
    finger_sin_cos(t2, &s7, &c7);
    const double t14 = c5 * s7 + s5 * c7;
    const double t11 = s5 * s7 - c5 * c7;
    const double t20 = s3 * t14 + c3 * t11;
    rotation[0][0] = -t20;
    rotation[0][1] = 0.0;
    const double t23 = c3 * t14 - s3 * t11;
    rotation[0][2] = t23;
    rotation[1][0] = 0.0;
    rotation[1][1] = 1.0;
    rotation[1][2] = 0.0;
    rotation[2][0] = -t23;
    rotation[2][1] = 0.0;
    rotation[2][2] = -t20;
    const double t17 = 0.045 + 0.028 * c5;
    const double t15 = 0.028 * s5;
    position[0] = s3 * t17 + c3 * t15;
    position[1] = 0.0;
    position[2] = 0.05 + (c3 * t17 - s3 * t15);
}

/*
 * Jacobian of the tool along the axes of the base.
 *
 * q: positions, rad or m.
 * writes jacobian: angular velocity (rows 0 to 2, rad/s) and velocity (rows 3 to 5, m/s) of the tool per rad/s or m/s.
 */
static inline void finger_jacobian(const double q[2], double jacobian[6][2]) {
    double s2, c2;
    finger_sin_cos(q[0], &s2, &c2);
    double s4, c4;
    finger_sin_cos(q[1], &s4, &c4);
    jacobian[0][0] = 0.0;
    jacobian[0][1] = 0.0;
    jacobian[1][0] = 1.0;
    jacobian[1][1] = 1.7;
    jacobian[2][0] = 0.0;
    jacobian[2][1] = 0.0;
    const double t8 = 0.05 + 0.045 * c2;
    const double t18 = t8 + 0.028 * (c2 * c4 - s2 * s4);
    jacobian[3][0] = t18 - 0.05;
    jacobian[3][1] = t18 - t8;
    jacobian[4][0] = 0.0;
    jacobian[4][1] = 0.0;
    const double t6 = 0.045 * s2;
    const double t16 = t6 + 0.028 * (s2 * c4 + c2 * s4);
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
static inline void finger_kinematics(const double q[2], double rotation[3][3], double position[3], double jacobian[6][2]) {
    const double t2 = 0.7 * q[1];
    double s3, c3;
    finger_sin_cos(q[0], &s3, &c3);
    double s5, c5;
    finger_sin_cos(q[1], &s5, &c5);
    double s7, c7;
    finger_sin_cos(t2, &s7, &c7);
    const double t15 = c3 * c5 - s3 * s5;
    const double t17 = s3 * c5 + c3 * s5;
    const double t25 = c7 * t15 - s7 * t17;
    rotation[0][0] = t25;
    rotation[0][1] = 0.0;
    const double t27 = c7 * t17 + s7 * t15;
    rotation[0][2] = t27;
    rotation[1][0] = 0.0;
    rotation[1][1] = 1.0;
    rotation[1][2] = 0.0;
    rotation[2][0] = -t27;
    rotation[2][1] = 0.0;
    rotation[2][2] = t25;
    const double t9 = 0.045 * s3;
    const double t19 = t9 + 0.028 * t17;
    position[0] = t19;
    position[1] = 0.0;
    const double t11 = 0.05 + 0.045 * c3;
    const double t21 = t11 + 0.028 * t15;
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

/*
 * Torques of a motion.
 *
 * q: positions, rad or m.
 * qd: velocities, rad/s or m/s.
 * qdd: accelerations, rad/s² or m/s².
 * writes torque: of each coordinate, N·m or N.
 */
static inline void finger_inverse_dynamics(const double q[2], const double qd[2], const double qdd[2], double torque[2]) {
    const double t6 = 0.7 * q[1];
    double s9, c9;
    finger_sin_cos(q[0], &s9, &c9);
    double s11, c11;
    finger_sin_cos(q[1], &s11, &c11);
    double s13, c13;
    finger_sin_cos(t6, &s13, &c13);
    const double t31 = qdd[0] + qdd[1];
    const double t24 = 9.81 * c9 - 0.045 * (qd[0] * qd[0]);
    const double t22 = 9.81 * s9 - 0.045 * qdd[0];
    const double t27 = s11 * t24 + c11 * t22;
    const double t53 = 0.7 * qdd[1] + t31;
    const double t30 = c11 * t24 - s11 * t22;
    const double t32 = qd[0] + qd[1];
    const double t33 = t32 * t32;
    const double t46 = t30 - 0.028 * t33;
    const double t44 = t27 - 0.028 * t31;
    const double t49 = s13 * t46 + c13 * t44;
    const double t64 = 6.679800069961745e-7 * t53 - 3.800070473782214e-5 * t49;
    const double t54 = 0.7 * qd[1] + t32;
    const double t61 = 3.800070473782214e-5 * (t54 * t54) - 0.0038000704737822136 * (c13 * t46 - s13 * t44);
    const double t59 = 3.800070473782214e-5 * t53 - 0.0038000704737822136 * t49;
    const double t67 = s13 * t61 - c13 * t59;
    const double t73 = 2.2514238831595993e-6 * t31 - 9.65499387042444e-5 * t27 + (t64 - 0.028 * t67);
    torque[0] = 1.0521506448173102e-5 * qdd[0] - 0.0029645435500396133 * s9 + (t73 - 0.045 * (s11 * (9.65499387042444e-5 * t33 - 0.006896424193160314 * t30 + (c13 * t61 + s13 * t59)) - c11 * (9.65499387042444e-5 * t31 - 0.006896424193160314 * t27 - t67))) + 1e-5 * qdd[0];
    torque[1] = t73 + 1e-5 * qdd[1] + 0.7 * (t64 + 7e-6 * qdd[1]);
}

/*
 * Torques that hold the robot against gravity.
 *
 * q: positions, rad or m.
 * writes torque: of each coordinate, N·m or N.
 */
static inline void finger_gravity(const double q[2], double torque[2]) {
    const double t2 = 0.7 * q[1];
    double s3, c3;
    finger_sin_cos(q[0], &s3, &c3);
    double s5, c5;
    finger_sin_cos(q[1], &s5, &c5);
    double s7, c7;
    finger_sin_cos(t2, &s7, &c7);
    const double t15 = s3 * c5 + c3 * s5;
    const double t26 = 0.0038000704737822136 * (0.045 * s3 + 0.028 * t15);
    const double t27 = 3.800070473782214e-5 * (c7 * t15 + s7 * (c3 * c5 - s3 * s5)) + t26;
    const double t28 = 9.65499387042444e-5 * t15 + 0.00031033908869221413 * s3 + t27;
    torque[0] = -(9.81 * (0.0003021960805341094 * s3 + t28));
    torque[1] = 6.867 * (t26 - t27) - 9.81 * (t28 - 0.0004813422600124137 * s3);
}

/*
 * Mass matrix.
 *
 * q: positions, rad or m.
 * writes mass: symmetric, kg·m² of coordinates that turn, kg of those that slide.
 */
static inline void finger_mass_matrix(const double q[2], double mass[2][2]) {
    const double t1 = 0.7 * q[1];
    double s2, c2;
    finger_sin_cos(q[1], &s2, &c2);
    double s4, c4;
    finger_sin_cos(t1, &s4, &c4);
    const double t6 = 3.800070473782214e-5 * c4;
    const double t17 = 0.028 * (t6 + (0.00010640197326590198 + t6));
    const double t19 = 2.919403890155774e-6 + t17;
    const double t10 = s2 * (3.800070473782214e-5 * s4);
    const double t21 = t10 - c2 * (0.00020295191197014636 + t6);
    mass[0][0] = 2.05215064481731e-5 + (t19 - 0.045 * (t21 - (0.0004813422600124137 - t21)));
    const double t8 = 1.06401973265902e-6 * c4;
    const double t9 = 6.679800069961745e-7 + t8;
    const double t31 = t19 - 0.045 * t21 + 0.7 * (t9 - 0.045 * (t10 - c2 * t6));
    mass[0][1] = t31;
    mass[1][0] = t31;
    mass[1][1] = 1.2919403890155774e-5 + t17 + 0.7 * t9 + 0.7 * (8.135566011893497e-6 + t8);
}

/*
 * Regressor: its product with PARAMETERS is the torque of the motion without the inertia of rotors.
 *
 * q: positions, rad or m.
 * qd: velocities, rad/s or m/s.
 * qdd: accelerations, rad/s² or m/s².
 * writes regressor: torque per inertial parameter of each link, in the order of PARAMETERS.
 */
static inline void finger_regressor(const double q[2], const double qd[2], const double qdd[2], double regressor[2][3][10]) {
    const double t6 = 0.7 * q[1];
    double s9, c9;
    finger_sin_cos(q[0], &s9, &c9);
    double s11, c11;
    finger_sin_cos(q[1], &s11, &c11);
    double s13, c13;
    finger_sin_cos(t6, &s13, &c13);
    regressor[0][0][0] = 0.0;
    const double t35 = 9.81 * c9;
    regressor[0][0][1] = -t35;
    regressor[0][0][2] = 0.0;
    const double t34 = 9.81 * s9;
    regressor[0][0][3] = -t34;
    regressor[0][0][4] = 0.0;
    regressor[0][0][5] = 0.0;
    regressor[0][0][6] = qdd[0];
    regressor[0][0][7] = 0.0;
    regressor[0][0][8] = 0.0;
    regressor[0][0][9] = 0.0;
    const double t40 = t35 - 0.045 * (qd[0] * qd[0]);
    const double t38 = t34 - 0.045 * qdd[0];
    const double t43 = s11 * t40 + c11 * t38;
    const double t16 = 0.045 * c9;
    const double t21 = c9 * c11 - s9 * s11;
    const double t15 = 0.045 * s9;
    const double t23 = s9 * c11 + c9 * s11;
    const double t65 = t16 * t21 + t15 * t23;
    const double t46 = c11 * t40 - s11 * t38;
    const double t68 = t16 * t23 - t15 * t21;
    regressor[0][1][0] = t46 * t68 - t43 * t65;
    const double t48 = qd[0] + qd[1];
    const double t49 = t48 * t48;
    const double t47 = qdd[0] + qdd[1];
    regressor[0][1][1] = -(t46 + (t49 * t65 + t47 * t68));
    regressor[0][1][2] = 0.0;
    regressor[0][1][3] = t47 * t65 - t49 * t68 - t43;
    regressor[0][1][4] = 0.0;
    regressor[0][1][5] = 0.0;
    regressor[0][1][6] = t47;
    regressor[0][1][7] = 0.0;
    regressor[0][1][8] = 0.0;
    regressor[0][1][9] = 0.0;
    const double t53 = t46 - 0.028 * t49;
    const double t51 = t43 - 0.028 * t47;
    const double t56 = s13 * t53 + c13 * t51;
    const double t31 = c13 * t21 - s13 * t23;
    const double t17 = 0.05 + t16;
    const double t27 = t17 + 0.028 * t21;
    const double t99 = 0.05 - t27;
    const double t25 = t15 + 0.028 * t23;
    const double t33 = c13 * t23 + s13 * t21;
    const double t102 = t31 * t99 - t25 * t33;
    const double t59 = c13 * t53 - s13 * t51;
    const double t105 = t33 * t99 + t25 * t31;
    regressor[0][2][0] = t56 * t102 - t59 * t105;
    const double t61 = 0.7 * qd[1] + t48;
    const double t62 = t61 * t61;
    const double t60 = 0.7 * qdd[1] + t47;
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
    const double t81 = t17 - t27;
    const double t80 = t15 - t25;
    const double t84 = t31 * t81 + t33 * t80;
    const double t87 = t33 * t81 - t31 * t80;
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

#endif
