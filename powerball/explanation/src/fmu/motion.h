/* An arm that moves as a torque model says. */

#ifndef MOTION_H
#define MOTION_H

#include "arm.h"
#include <stdbool.h>

#define JOINTS ARM_JOINTS

/* What a term remembers from step to step. */
struct memory {
    bool started, has_turned;
    double place, wound, turned;
};

/* What a term is a function of. Positions are those of the arm; an encoder may show others. */
struct instant {
    const double *q, *dq, *ddq, *rigid, *friction;
    double running;
};

/* Of this model (model.c): how many terms there are; Eq. 16 by joint; what encoders show too much, rad. */
extern const unsigned model_terms;
extern const double model_friction[JOINTS][5];
extern const double model_encoder_offset[JOINTS];
/* The identity of the model description that these files belong to. */
extern const char model_token[];
/* Adds what goes beyond rigid arm and friction, N.m. */
void model_effects(const struct instant *now, struct memory *memory, double torque[JOINTS]);

/* Laws with a memory (laws.c). */
double wind(struct memory *memory, double q, double distance);
bool crosses(struct memory *memory, double q, double gap);
double fly(struct memory *memory, double load, double reach, double time);

/* The arm at one time. Positions are as the encoders show them. */
struct motion {
    double q[JOINTS], dq[JOINTS], ddq[JOINTS];
    double time;
};

/* Moves the arm by h seconds under the motors' torques; false where the mass matrix has no inverse or a joint
 * runs away. `memory` has a place for each of the model's terms.
 */
bool motion_step(struct motion *arm, struct memory *memory, const double torque[JOINTS], double h);

#endif
