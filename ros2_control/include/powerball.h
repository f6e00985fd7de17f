/* The driver of the Powerball LWA 4P for a control loop in C or C++.
 *
 * One arm, one thread at a time; the driver has no thread of its own. SYNC leaves every 5 ms while powerball_read and
 * powerball_write are called in turn: powerball_read waits for the next SYNC and the data of all drives, powerball_write
 * until its set-points have left. A caller that stays away for longer finds the arm stopped. Nothing moves again after a
 * stop but by powerball_activate.
 *
 * All functions take null; they give POWERBALL_ERROR then.
 */
#ifndef POWERBALL_H
#define POWERBALL_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#define POWERBALL_JOINTS 6
/* Time from SYNC to SYNC, s. */
#define POWERBALL_PERIOD 0.005

#define POWERBALL_OK 0
/* It is not done; powerball_message says why. */
#define POWERBALL_ERROR 1
/* Of powerball_on_error: powerball_configure must come before powerball_activate. */
#define POWERBALL_CONFIGURE 2

typedef struct powerball_arm powerball_arm;

/* Opens a bus: "virtual", "socketcan:can0", "slcan:/dev/ttyACM0", "udp:239.74.163.2:43113". Nothing is sent. Null where it
 * fails, with the reason in why (room bytes, closing zero included). */
powerball_arm *powerball_open(const char *bus, char *why, size_t room);

/* Stops the arm where it moves and closes the bus. */
void powerball_close(powerball_arm *arm);

/* Inverse dynamics of the arm as it is mounted, friction included: POWERBALL_JOINTS numbers each, rad, rad/s, rad/s^2 in,
 * N m out. Called once in each powerball_write, so it must be quick; it must not throw and must not call these functions. */
typedef void (*powerball_inverse_dynamics)(void *context, const double *position, const double *velocity,
                                           const double *acceleration, double *torque);

/* From now on no set-point leaves for which the model asks more torque of a joint than the joint has; a torque that is no
 * number is too much. The context must live until powerball_close. */
int powerball_guard_torque(powerball_arm *arm, powerball_inverse_dynamics torque, void *context);

/* The same with the built-in model of the arm. mounting says how its base stands: "filed" (upright; null says so too),
 * "ROLL,PITCH" in degrees, or gravity in the base frame as "X,Y,Z" in m/s^2. values is the path of an identified.json or a
 * values file; null takes the masses of the CAD model and the published friction. It allocates in powerball_write. */
int powerball_guard_model(powerball_arm *arm, const char *mounting, const char *values);

/* Before powerball_configure: drives whose device type (0x1000) or identity (0x1018) is another than the profile of the arm says
 * are used all the same. Without it powerball_configure refuses them. */
int powerball_accept_unverified(powerball_arm *arm);

/* Boots, identifies, configures and verifies all drives: some seconds. Nothing moves. */
int powerball_configure(powerball_arm *arm);

/* Releases the brakes and holds the arm: up to a minute where joints commutate. THE ARM HAS TORQUE from here on. */
int powerball_activate(powerball_arm *arm);

/* Each of the arrays is null or has room for POWERBALL_JOINTS numbers: rad, rad/s, N m. Without allocation on SocketCAN. */
int powerball_read(powerball_arm *arm, double *position, double *velocity, double *effort);

/* POWERBALL_JOINTS positions, rad. Those that the arm must not take are refused; the third such cycle in a row stops it. */
int powerball_write(powerball_arm *arm, const double *position);

/* Stops the arm: brakes closed, no torque. */
int powerball_deactivate(powerball_arm *arm);

/* After POWERBALL_ERROR: waits until the arm stands, and acknowledges why. */
int powerball_on_error(powerball_arm *arm);

/* Why the last call that gave POWERBALL_ERROR did so. */
const char *powerball_message(const powerball_arm *arm);

#ifdef __cplusplus
}
#endif

#endif
