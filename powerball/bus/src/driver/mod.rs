//! The master of the arm on its CAN bus: a CANopen master for CiA 402 drives, without clock, I/O or
//! allocation.
//!
//! A [`Driver`] is given the time and frames; it gives back frames ([`Transmit`]). The data of the arm are in
//! a [`Profile`]. Set-points and measurements are in SI.
//!
//! ```text
//! Idle ─start→ Listening → Boot → Identify → Configure → Verify → Starting → Ready
//! Ready ─enable→ Enabling → Running (set each cycle)
//! Enabling, Running ─stop→ Stopping → Ready
//! any phase ─cause→ Stopping (where joints may move) → Faulted
//! Faulted ─acknowledge→ Resetting → Starting, or Idle, where the cause needs a restart
//! ```
//!
//! # A cycle
//!
//! SYNC leaves on a fixed raster. The drives answer with their data, [`Driver::cycle_complete`] says when all
//! of it is there, [`Driver::set`] takes the next set-points, and at [`Budget::setpoint_slot`] one receive
//! PDO a drive leaves, to act with the next SYNC. There is one slot a cycle: two set-points never meet in one
//! SYNC, and a slot that was missed is left out.
//!
//! # Reactions
//!
//! "Stop" is: queued frames are discarded, quick stop to all joints at once, not waiting for the slot; at
//! rest Halt, which closes the brakes; then 0x0000. The cause is latched. Moving again needs
//! [`Driver::acknowledge`] and [`Driver::enable`]. Cycles count from the first sign of the fault.
//!
//! | event | detected by | reaction | within |
//! |---|---|---|---|
//! | a drive's heartbeat lost | three of its periods | stop, [`Cause::HeartbeatLost`], restart needed | at once |
//! | process data missing | not there when the next SYNC is due | data held, counted; after 3 cycles stop, [`Cause::DataMissing`] | 3 cycles |
//! | master lost | the drives: 0x1016, and SCHUNK's 0x200E, written and verified | the drives stop; without both no enabling ([`Cause::NoWatch`]) | 0x1016, 0x200E |
//! | SYNC late, left out | the driver's own raster | counted; 5 late or 3 left out: stop, [`Cause::Late`]; a missed slot is left out | the limit |
//! | emergency, code ≠ 0 | 0x80 + id | latched with its code, stop; the drive's error details are read after it; repeats are counted only | at once |
//! | boot-up while running | 0x700 + id, 0x00 | stop, [`Cause::Rebooted`], restart needed | at once |
//! | unexpected state or mode | each statusword and mode display | stop, [`Cause::DriveFault`], [`Cause::StateLost`], [`Cause::UnknownState`], [`Cause::WrongMode`] | at once |
//! | left NMT operational | heartbeat | stop, [`Cause::NotOperational`], restart needed | at once |
//! | error passive, received frames lost | transport | counted | |
//! | another master: SYNC, NMT, set-points for our nodes, our own heartbeat | listening before the start, and always | before: refused, nothing was sent; later: stop, [`Cause::OtherMaster`], restart needed | at once |
//! | two nodes with one id | process data twice in a cycle, 5 cycles in a row | stop, [`Cause::TwoNodes`], restart needed | 5 cycles |
//! | bus-off | transport | queue discarded, silence (also of the heartbeat, so that the drives stop themselves), [`Cause::BusOff`], restart needed | at once |
//! | transmit queue full | transport | queue discarded, stop, repeated until it could be queued | at once |
//! | set-point NaN, jumping, outside the limits, more torque than a joint has | before it leaves | rejected, the last one held, counted; 3 cycles in a row: stop, [`Cause::Setpoints`] | 3 cycles |
//! | torque offset NaN, beyond the joint's torque, jumping | before it leaves | as a set-point | 3 cycles |
//! | no new set-point | in the slot | the last one held; 3 cycles in a row: stop, [`Cause::Starved`] (not in profile position) | 3 cycles |
//! | velocities mean something else | commanded and measured travel, while the scale is not verified on hardware | stop, [`Cause::WrongVelocityScale`] | 0.1 rad |
//! | joint not where or not as fast as commanded, stuck, jumping, beyond its limits, at its current limit | each cycle | stop, [`Cause::FollowingError`], [`Cause::VelocityError`], [`Cause::Stuck`], [`Cause::PositionJump`], [`Cause::PositionLimit`], [`Cause::TorqueLimit`] | [`profile::Reactions`] |
//! | current mode: a joint that does not move as its torque says, measurements that no joint can have | each cycle | stop, [`Cause::ImplausibleVelocity`], [`Cause::PositionAgainstVelocity`], [`Cause::CurrentError`], [`Cause::TorqueError`], [`Cause::OffPath`] | [`profile::TorqueMode`] |
//! | voltage, remote, internal limit, interpolation, following error in the statusword | each statusword of a joint with torque | stop, [`Cause::Hindered`] | at once, 3 cycles |
//! | the program is asked to end | the caller, by a signal | stop, [`Cause::Interrupted`] | at once |
//! | joint too fast | measured velocity | 3 cycles in a row: stop, [`Cause::Overspeed`] | 3 cycles |
//! | refused transition | state and time | stop, [`Cause::Transition`] with the reason that the statusword gives | its time limit |
//!
//! The numbers are [`profile::Reactions::DEFAULT`].
//!
//! # Files
//!
//! In the order in which they may use each other: each uses those above it. What checks something says what
//! it has found; one place, in `machine`, acts on it.
//!
//! | file | contents |
//! |---|---|
//! | `units`, `dictionary`, `demand` | numbers on the wire; a drive's objects; the modes, and the last commands of a joint |
//! | `cause`, `notes`, `phase` | what is reported: causes, refusals, rejections; counts and notes; the phase |
//! | `profile`, `lwa4p`, `import`, `budget` | an arm's data; the load of its bus |
//! | `script`, `guard`, `listen` | what each drive is asked and written; the limits of a set-point; another master's data |
//! | `presence`, `joint`, `torque`, `arm` | one node; one joint; the arm's model; the arm and the way to its bus |
//! | `watch`, `torque_mode` | what each joint does, against what it should: a cause, or nothing |
//! | `bringup`, `enabling`, `stream`, `stop` | the phases, each with its data |
//! | `raster`, `latch`, `stage` | the cycles in time; the latched cause; the present phase |
//! | `machine`, `cycle`, `receive` | the driver: commands and reactions; what is due; frames |

mod arm;
mod bringup;
pub mod budget;
pub mod cause;
mod cycle;
mod demand;
pub mod dictionary;
mod enabling;
mod guard;
#[cfg(feature = "std")]
pub mod import;
mod joint;
mod latch;
mod listen;
pub mod lwa4p;
mod machine;
mod notes;
mod phase;
mod presence;
pub mod profile;
mod raster;
mod receive;
mod script;
mod stage;
mod stop;
mod stream;
mod torque;
mod torque_mode;
pub mod units;
mod watch;

pub use budget::{Budget, Verdict};
pub use cause::{Cause, Details, Foreign, Refusal, Rejection};
pub use demand::ControlMode;
pub use guard::check_path;
pub use joint::{BusEvent, Joint, JointCounters, QueueFull, Transmit};
pub use listen::{Heard, Listener, OtherMapping};
pub use machine::Driver;
pub use notes::{Counters, Note};
pub use phase::Phase;
pub use profile::{JointProfile, Profile};
pub use torque::TorqueGuard;
pub use torque_mode::Tracking;
