/* Control laws over an arm's generated model, for a control loop in C or C++: torques for the joints, and what pushes them
 * from outside. Nothing here knows a bus or a drive.
 *
 * One control at a time in one thread. All functions take null; they give POWERBALL_ERROR then. powerball_control_start and
 * powerball_control_update neither allocate nor wait.
 */
#ifndef POWERBALL_CONTROL_H
#define POWERBALL_CONTROL_H

#include "powerball.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The most joints that a control takes. */
#define POWERBALL_CONTROL_JOINTS 8

/* The functions of an arm in double precision, which `powerball generate --c-header` emits with
 * `--functions mass_matrix,coriolis_times_velocity,coriolis_transpose_times_velocity,gravity` for a header my_arm.h as
 * my_arm_mass_matrix and so on. Each gives 0 where it is done; they must not throw. */
typedef struct powerball_arm_model {
  size_t joints;
  /* B, kg m^2, column by column. */
  int (*mass_matrix)(const double *q, double *result);
  /* C q', N m. */
  int (*coriolis_times_velocity)(const double *q, const double *dq, double *result);
  /* C^T q', N m. */
  int (*coriolis_transpose_times_velocity)(const double *q, const double *dq, double *result);
  /* g, N m. */
  int (*gravity)(const double *q, double *result);
  /* The whole torque with friction and effects, my_arm_start and my_arm_torque: all three, or 0 and null for a rigid arm. A
   * control holds such models of its own, of model_size = sizeof(my_arm_model) bytes. */
  size_t model_size;
  int (*begin)(void *model);
  int (*torque)(void *model, const double *q, const double *dq, const double *ddq, double running,
                const double *temperature, double *torque);
} powerball_arm_model;

/* The weight alone: joints are moved by hand against their friction. */
#define POWERBALL_GRAVITY 0
/* Inverse dynamics with a PD of the acceleration, friction and effects of the reference added. */
#define POWERBALL_COMPUTED_TORQUE 1

typedef struct powerball_control_options {
  /* POWERBALL_GRAVITY or POWERBALL_COMPUTED_TORQUE. */
  int law;
  /* Time between two cycles, s: gains are refused that are unstable with it and a cycle of delay. */
  double period;
  /* Of computed torque: angular frequency of the errors, rad/s (0: 0.1/period), and their damping ratio (1: critical). */
  double bandwidth, damping;
  /* Angular frequency of the low pass over external torques, rad/s. */
  double observer_bandwidth;
  /* The most torque of each joint, N m, and its most change, N m/s. */
  const double *effort_limits, *effort_rate_limits;
} powerball_control_options;

typedef struct powerball_control powerball_control;

/* A control; model and options are copied. Null where they do not fit, with the reason in why (room bytes, closing zero
 * included). It allocates. */
powerball_control *powerball_control_open(const powerball_arm_model *model, const powerball_control_options *options,
                                          char *why, size_t room);

void powerball_control_close(powerball_control *control);

/* Begins anew at these positions, rad: the reference is to hold them, nothing is remembered. POWERBALL_ERROR where one is no
 * number. */
int powerball_control_start(powerball_control *control, const double *position);

/* A cycle, period s after the last: positions and velocities as measured, the reference (rad, rad/s, rad/s^2) or null for the
 * last one; effort is what the joints shall give, external what pushes them from outside, both N m. A reference that is no
 * number holds the last positions at rest. POWERBALL_ERROR where a state or the period is no number, or before
 * powerball_control_start: nothing is written then and nothing changes. */
int powerball_control_update(powerball_control *control, const double *position, const double *velocity,
                             const double *reference_position, const double *reference_velocity,
                             const double *reference_acceleration, double period, double *effort, double *external);

#ifdef __cplusplus
}
#endif

#endif
