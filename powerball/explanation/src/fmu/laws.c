/* Laws that remember: presliding, and play. The same as in the controller's code in Rust. */

#include "motion.h"
#include <math.h>

static double sign(double x) { return signbit(x) ? -1.0 : 1.0; }

/* Dahl's state at the next position, exact for a step of any size. */
double wind(struct memory *memory, double q, double distance)
{
    const double step = memory->started ? q - memory->place : 0.0;
    memory->started = true;
    memory->place = q;
    if (step != 0.0) {
        const double side = sign(step);
        memory->wound = side + (memory->wound - side) * exp(-fabs(step) / distance);
    }
    return memory->wound;
}

/* Whether the motor has moved less than the gap since its motion last reversed. */
bool crosses(struct memory *memory, double q, double gap)
{
    if (!memory->started) {
        memory->started = true;
        memory->place = q;
    }
    const double step = q - memory->place;
    const double along = step * memory->wound;
    /* A reversal counts once it is larger than encoder steps. */
    if (along < 0.0 && fabs(step) > gap * 0.1) {
        memory->has_turned = true;
        memory->turned = memory->place;
        memory->wound = sign(step);
        memory->place = q;
    } else if (memory->wound == 0.0 && fabs(step) > gap) {
        memory->wound = sign(step);
        memory->place = q;
    } else if (along > 0.0) {
        memory->place = q;
    }
    return memory->has_turned && fabs(q - memory->turned) < gap;
}

/* The torque of a link that flies through its play, of `reach` times its inertia; a flank stops it within a
 * step.
 */
double fly(struct memory *memory, double load, double reach, double time)
{
    const double flank = reach * 0.5;
    if (!memory->started) {
        memory->started = true;
        memory->place = -sign(load) * flank;
    }
    const double step = memory->has_turned ? time - memory->turned : 0.0;
    memory->has_turned = true;
    memory->turned = time;
    if (step <= 0.0) {
        return 0.0;
    }
    const double before = memory->wound;
    memory->wound -= load * step;
    memory->place += memory->wound * step;
    if (fabs(memory->place) >= flank) {
        memory->place = sign(memory->place) * flank;
        memory->wound = 0.0;
    }
    return (memory->wound - before) / step;
}
