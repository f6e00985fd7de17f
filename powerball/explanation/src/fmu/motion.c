/* B(q) ddq + C dq + g + friction + effects = torque, in steps that are linearly implicit in the friction: it
 * is s * dq' against the new velocity dq', with s = f(dq')/dq' found by iteration, so that a joint sticks
 * without chatter. Effects are taken at the old velocity.
 */

#include "motion.h"
#include <math.h>
#include <string.h>

/* Iterations for the friction of a step. */
#define ITERATIONS 8
/* Below this a joint rests, rad/s: friction is its slope there. */
#define REST 1e-9
/* A joint that is faster than this is lost, rad/s. */
#define LOST 1e3

static double friction(const double *gamma, double dq)
{
    return gamma[0] * tanh(gamma[1] * dq) + gamma[2] * tanh(gamma[3] * dq) + gamma[4] * dq;
}

/* Friction by velocity. */
static double secant(const double *gamma, double dq)
{
    if (fabs(dq) < REST) {
        return gamma[0] * gamma[1] + gamma[2] * gamma[3] + gamma[4];
    }
    return friction(gamma, dq) / dq;
}

/* Solves a x = b in place of b by Cholesky's factor, which takes the place of a's lower half. */
static bool solve(double a[JOINTS][JOINTS], double b[JOINTS])
{
    for (int i = 0; i < JOINTS; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = a[i][j];
            for (int k = 0; k < j; k++) {
                sum -= a[i][k] * a[j][k];
            }
            if (i > j) {
                a[i][j] = sum / a[j][j];
            } else if (sum > 0.0) {
                a[i][i] = sqrt(sum);
            } else {
                return false;
            }
        }
    }
    for (int i = 0; i < JOINTS; i++) {
        for (int k = 0; k < i; k++) {
            b[i] -= a[i][k] * b[k];
        }
        b[i] /= a[i][i];
    }
    for (int i = JOINTS - 1; i >= 0; i--) {
        for (int k = i + 1; k < JOINTS; k++) {
            b[i] -= a[k][i] * b[k];
        }
        b[i] /= a[i][i];
    }
    return true;
}

static void times(double a[JOINTS][JOINTS], const double x[JOINTS], double result[JOINTS])
{
    for (int i = 0; i < JOINTS; i++) {
        result[i] = 0.0;
        for (int j = 0; j < JOINTS; j++) {
            result[i] += a[i][j] * x[j];
        }
    }
}

/* What is left of the torque for acceleration and friction. */
static void free_torque(const struct motion *arm, struct memory *memory, double inertia[JOINTS][JOINTS],
                        const double place[JOINTS], const double torque[JOINTS], double result[JOINTS])
{
    double coriolis[JOINTS], gravity[JOINTS], rigid[JOINTS], rubbed[JOINTS], effects[JOINTS] = { 0.0 };
    arm_coriolis_times_velocity(place, arm->dq, coriolis);
    arm_gravity(place, gravity);
    times(inertia, arm->ddq, rigid);
    for (int j = 0; j < JOINTS; j++) {
        rigid[j] += coriolis[j] + gravity[j];
        rubbed[j] = friction(model_friction[j], arm->dq[j]);
    }
    const struct instant now = { place, arm->dq, arm->ddq, rigid, rubbed, arm->time };
    model_effects(&now, memory, effects);
    for (int j = 0; j < JOINTS; j++) {
        result[j] = torque[j] - coriolis[j] - gravity[j] - effects[j];
    }
}

bool motion_step(struct motion *arm, struct memory *memory, const double torque[JOINTS], double h)
{
    double place[JOINTS], inertia[JOINTS][JOINTS], given[JOINTS], momentum[JOINTS], next[JOINTS];
    for (int j = 0; j < JOINTS; j++) {
        place[j] = arm->q[j] - model_encoder_offset[j];
    }
    arm_mass_matrix(place, inertia);
    free_torque(arm, memory, inertia, place, torque, given);
    times(inertia, arm->dq, momentum);
    memcpy(next, arm->dq, sizeof next);
    for (int k = 0; k < ITERATIONS; k++) {
        double left[JOINTS][JOINTS], right[JOINTS];
        memcpy(left, inertia, sizeof left);
        for (int j = 0; j < JOINTS; j++) {
            left[j][j] += h * secant(model_friction[j], next[j]);
            right[j] = momentum[j] + h * given[j];
        }
        if (!solve(left, right)) {
            return false;
        }
        memcpy(next, right, sizeof next);
    }
    for (int j = 0; j < JOINTS; j++) {
        if (!(fabs(next[j]) < LOST)) {
            return false;
        }
        arm->ddq[j] = (next[j] - arm->dq[j]) / h;
        arm->q[j] += next[j] * h;
        arm->dq[j] = next[j];
    }
    arm->time += h;
    return true;
}
