/*
 * Pose of the tool of platform3, model 0.
 * Positions in m, angles in rad. The first digit of a word is the actuator next to the base.
 * Platforms solved in closed form: 1.
 * On 400 random words, with the supply within 20 %, the temperature within 20 K and a load up to 1 kg of those that the
 * arm works with, it differs from the iterations of `darm-core` by at most 9.4e-16 m and 5.8e-16 rad, before the
 * rounding of its numbers.
 * Arrays are by rows. Names begin with the robot's. With -ffp-contract=off the results are those of the generated Rust,
 * bit by bit.
 */
#ifndef PLATFORM3_H
#define PLATFORM3_H

#include <math.h>
#include <stdint.h>
#include <string.h>

/* Sine and cosine, within 1.2e-7; not a number beyond 6434 rad. */
static inline void platform3_sin_cos(float x, float *sine, float *cosine) {
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
 * The conditions that the arm works with: supply (Pa), temperature (K), load besides the payload (kg).
 */
static const float PLATFORM3_CONDITIONS[1][3] = {
    {600000.0f, 293.15f, 0.0f},
};

/*
 * Pose of the tool in the frame of the base for a word, with the effects of the model.
 *
 * `word` and `previous`: the digit of each actuator now, and in the word before; one that is no state counts as the
 * last.
 * conditions: supply (Pa), temperature (K), mass that the tool carries besides the payload (kg).
 * writes rotation: axes of the tool as columns.
 * writes position: origin of the tool, m.
 */
static inline void platform3_pose(const uint8_t word[3], const uint8_t previous[3], const float conditions[3], float rotation[3][3], float position[3]) {
    const float t2 = 1.0f - 1.6666667e-6f * conditions[0];
    const float t11 = (word[1] == 0 ? 1.4142135f : 1.767767f - 0.01767767f * t2);
    const float t13 = t11 * t11;
    const float t3 = 0.0125f * t2;
    const float t4 = 1.25f - t3;
    const float t12 = (word[2] == 0 ? 1.0f : t4);
    const float t16 = 0.5f * (t13 - t12 * t12);
    const float t17 = 0.5f + t16;
    const float t18 = t17 * t17;
    const float t20 = sqrtf(t13 - t18);
    const float t23 = 1.0f / (t18 + t20 * t20);
    const float t8 = (word[0] == 0 ? (previous[0] == 0 ? 1.001f : 1.0f) : (previous[0] == 0 ? t4 : 1.249f - t3));
    const float t24 = t8 * t8;
    const float t28 = 0.5f - 0.5f * (t23 * (1.0f - t24));
    const float t32 = sqrtf(t23 * t24 - t28 * t28);
    const float t40 = t16 + (0.5f - t17 * t28 + t20 * t32);
    rotation[0][0] = t40;
    const float t41 = t20 - (t20 * t28 + t17 * t32);
    rotation[0][1] = -t41;
    rotation[0][2] = 0.0f;
    rotation[1][0] = t41;
    rotation[1][1] = t40;
    rotation[1][2] = 0.0f;
    rotation[2][0] = 0.0f;
    rotation[2][1] = 0.0f;
    rotation[2][2] = 1.0f;
    position[0] = t16 - 0.5f * t40;
    position[1] = t20 - 0.5f * t41;
    position[2] = 0.0f;
}

#endif
