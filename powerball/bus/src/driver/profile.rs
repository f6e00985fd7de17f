//! The data of an arm that the driver needs: constant tables, made offline from the drive's
//! DCF and one TOML ([`super::import`] with `std`; [`super::lwa4p`] is the result for the SCHUNK Powerball
//! LWA 4P).

use super::cause::Refusal;
use super::demand::ControlMode;
use super::units::{JointUnits, VelocityScale};
use crate::canopen::pdo::{Entry, Mapping};
use crate::canopen::{Micros, NodeId, Object};
use crate::cia402::{Controlword, Mode, objects};

/// One mode as this drive has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModeProfile {
    /// Number in 0x6060.
    pub mode: Mode,
    /// The object of the set-point; it and the controlword must be in `rpdo`.
    pub setpoint: Object,
    /// The mapping of the receive PDO in this mode.
    pub rpdo: Mapping,
    /// Bits of the controlword, in addition to "enable operation", while the joint follows set-points.
    pub running_bits: u16,
    /// Whether this was seen to work on the arm itself. What was not is refused unless the caller accepts it.
    pub verified_on_hardware: bool,
}

impl ModeProfile {
    /// The placeholder until a mode was chosen: nothing is received and nothing is sent.
    pub(super) const NONE: ModeProfile = ModeProfile {
        mode: Mode::None,
        setpoint: Object::new(0, 0),
        rpdo: Mapping::EMPTY,
        running_bits: 0,
        verified_on_hardware: false,
    };
}

/// The expected identity (0x1018), as far as it is known. Entries that are `None` are read and reported, but
/// not compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Sub 1.
    pub vendor: Option<u32>,
    /// Sub 2.
    pub product: Option<u32>,
    /// Sub 3.
    pub revision: Option<u32>,
    /// Sub 4.
    pub serial: Option<u32>,
}

/// One joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointProfile {
    /// The joint's drive.
    pub node: NodeId,
    /// The expected identity (0x1018).
    pub identity: Identity,
    /// Counts, currents and torques.
    pub units: JointUnits,
    /// Least and greatest position, rad; written to 0x607D.
    pub position: [f64; 2],
    /// Greatest velocity, rad/s.
    pub velocity: f64,
    /// Greatest acceleration, rad/s².
    pub acceleration: f64,
    /// Greatest torque, N·m: what a model may require of the joint ([`super::TorqueGuard`]); infinite where
    /// it is not known.
    pub torque: f64,
    /// Greatest current, A.
    pub current: f64,
    /// Greatest following error, rad: beyond the delay with which a drive follows. Written to 0x6065 where
    /// the drive has it, and watched by the driver in interpolated position mode always.
    pub following_error: f64,
    /// Greatest velocity error, rad/s, watched in velocity mode.
    pub velocity_error: f64,
}

/// Times and limits of the driver's reactions. [`Reactions::DEFAULT`] is what `docs/bus.md` argues for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reactions {
    /// Consecutive cycles without a joint's data after which the arm is stopped.
    pub missing_cycles: u8,
    /// A SYNC later than this part of the period counts as late.
    pub late_fraction: f64,
    /// Number of late SYNCs that stop the arm, without [`Reactions::forgiving_cycles`] good ones between
    /// them.
    pub late_limit: u8,
    /// Number of SYNCs in a row that could not be sent at all and stop the arm.
    pub skipped_limit: u64,
    /// Good cycles after which late ones and rejected set-points are forgotten.
    pub forgiving_cycles: u16,
    /// Consecutive rejected set-points that stop the arm.
    pub rejected_limit: u8,
    /// Consecutive cycles without a new set-point (once streaming began; not in profile position) that stop
    /// the arm.
    pub starved_cycles: u8,
    /// Set-points may leave the limits by this much, rad.
    pub position_margin: f64,
    /// A step of a position may be this many times v_max·T, to allow for rounding.
    pub step_factor: f64,
    /// Greatest change of a current set-point in a cycle, as part of the joint's greatest current.
    pub current_step: f64,
    /// A joint measured faster than this times its greatest velocity, for [`Reactions::missing_cycles`]
    /// cycles, stops the arm.
    pub overspeed_factor: f64,
    /// Commanded travel in velocity mode, rad, before it is compared with the measured travel.
    pub scale_travel: f64,
    /// Cycles in a row beyond [`JointProfile::following_error`] that stop the arm; their time is written to
    /// 0x6066 where the drive has it.
    pub following_cycles: u8,
    /// Cycles in a row beyond [`JointProfile::velocity_error`] that stop the arm.
    pub velocity_cycles: u8,
    /// Profile position: a joint away from its target that moves less than this, rad, …
    pub still_travel: f64,
    /// … in this time stops the arm.
    pub still_time: Micros,
    /// Cycles in a row with an internal limit, or without interpolation, that stop the arm.
    pub status_cycles: u8,
    /// A position may jump by this much, rad, in addition to what the greatest velocity explains.
    pub jump_margin: f64,
    /// A measured position may be this far beyond its limits, rad.
    pub position_tolerance: f64,
    /// A current above this part of the greatest one …
    pub current_limit_part: f64,
    /// … for this long stops the arm.
    pub current_limit_time: Micros,
    /// Nothing is sent for this long before the start, to hear whether another master is there.
    pub listen_time: Micros,
    /// Cycles in a row in which process data of a node comes twice that stop the arm.
    pub duplicate_cycles: u8,
    /// For a node to boot.
    pub boot_timeout: Micros,
    /// For an SDO answer.
    pub sdo_timeout: Micros,
    /// Times that a silent SDO transfer is started again.
    pub sdo_retries: u8,
    /// For a transition of the drive's state machine, and for the mode to be shown.
    pub transition_timeout: Micros,
    /// For the arm to come to rest on the quick-stop ramp.
    pub stop_timeout: Micros,
    /// For the brakes to close.
    pub brake_time: Micros,
    /// After a fault reset, before the state is checked.
    pub fault_reset_time: Micros,
    /// Tries of the commutation search.
    pub commutation_tries: u8,
    /// Between two tries.
    pub commutation_interval: Micros,
    /// After a search, before the next joint: the supply recovers.
    pub commutation_settle: Micros,
    /// Enable and commutate one joint after the other, from the base on.
    pub one_at_a_time: bool,
    /// Below this velocity, rad/s, a joint counts as at rest.
    pub rest_velocity: f64,
    /// Limits of the guard of current mode.
    pub torque_mode: TorqueMode,
}

/// Limits of the guard of current mode, where the caller closes the loop and no drive holds a position: a
/// measurement that is wrong becomes a motion at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueMode {
    /// Cycles in a row beyond a limit that stop the arm, where no other number is given.
    pub cycles: u8,
    /// Cycles in a row without a joint's data that stop the arm: the caller carries its state on until then.
    pub missing_cycles: u8,
    /// A joint measured faster than this times its greatest velocity stops the arm.
    pub overspeed_factor: f64,
    /// A velocity that grows in one cycle by more than this part of the greatest one is not a measurement: it
    /// is not used.
    pub velocity_step: f64,
    /// Way by which position and integrated velocity may drift apart, rad, next to a cycle at the greatest
    /// velocity …
    pub slip_margin: f64,
    /// … forgotten with this time constant, s.
    pub slip_time: f64,
    /// The measured current may differ from the commanded one by this part of the greatest current.
    pub current_error: f64,
    /// The torque that acted may be off what the model needs for the measured motion by this part of the
    /// joint's torque, …
    pub torque_error: f64,
    /// … or, if that is less, by the torque of its own inertia at this part of its greatest acceleration, …
    pub acceleration_error: f64,
    /// … this part of the torque of weight and Coriolis forces, …
    pub rigid_error: f64,
    /// … this part of the torque of the acceleration: a gear with play moves its motor alone, …
    pub inertial_error: f64,
    /// … this part of the friction in motion …
    pub friction_error: f64,
    /// … and this multiple of the dry friction where the joint rests.
    pub sticking: f64,
}

impl TorqueMode {
    /// The limits that docs/control.md derives.
    pub const DEFAULT: TorqueMode = TorqueMode {
        cycles: 3,
        missing_cycles: 6,
        overspeed_factor: 1.2,
        velocity_step: 0.4,
        slip_margin: 0.01,
        slip_time: 1.0,
        current_error: 0.03,
        torque_error: 0.1,
        acceleration_error: 0.5,
        rigid_error: 0.3,
        inertial_error: 0.8,
        friction_error: 0.5,
        sticking: 1.3,
    };
}

impl Reactions {
    /// Three cycles without data, five late ones, three rejected set-points and three cycles without one stop
    /// the arm.
    pub const DEFAULT: Reactions = Reactions {
        missing_cycles: 3,
        late_fraction: 0.2,
        late_limit: 5,
        skipped_limit: 3,
        forgiving_cycles: 200,
        rejected_limit: 3,
        starved_cycles: 3,
        position_margin: 0.0,
        step_factor: 1.05,
        current_step: 0.25,
        overspeed_factor: 1.5,
        scale_travel: 0.1,
        following_cycles: 4,
        velocity_cycles: 20,
        still_travel: 0.002,
        still_time: 500_000,
        status_cycles: 3,
        jump_margin: 0.01,
        position_tolerance: 0.02,
        current_limit_part: 0.98,
        current_limit_time: 300_000,
        listen_time: 300_000,
        duplicate_cycles: 5,
        boot_timeout: 5_000_000,
        sdo_timeout: 100_000,
        sdo_retries: 2,
        transition_timeout: 1_000_000,
        stop_timeout: 1_000_000,
        brake_time: 100_000,
        fault_reset_time: 150_000,
        commutation_tries: 50,
        commutation_interval: 100_000,
        commutation_settle: 1_000_000,
        one_at_a_time: true,
        rest_velocity: 0.01,
        torque_mode: TorqueMode::DEFAULT,
    };
}

/// An arm of `N` joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile<const N: usize> {
    /// The arm's name.
    pub name: &'static str,
    /// bit/s.
    pub bitrate: u32,
    /// Period of SYNC, µs. A multiple of 100, because 0x60C2 is written from it.
    pub sync_period: Micros,
    /// The node id of the master's heartbeat.
    pub master: NodeId,
    /// Period of the master's heartbeat, µs.
    pub master_heartbeat: Micros,
    /// A drive that misses the master's heartbeat for this long reacts; 0x1016, ms.
    pub master_watch_ms: u16,
    /// Cycles without a fresh interpolation point before a drive stops quickly; 0x200E, not 0. `None` for
    /// drives of another maker: 0x200E and the commutation search of 0x2050 are SCHUNK's, and neither is
    /// required then.
    pub sync_timeout_factor: Option<u8>,
    /// Period of the drives' heartbeats, 0x1017, ms.
    pub node_heartbeat_ms: u16,
    /// Profile position. Each of the modes is `None` if the drive does not have it or nothing is known of it.
    pub profile_position: Option<ModeProfile>,
    /// Velocity.
    pub velocity: Option<ModeProfile>,
    /// Interpolated position.
    pub interpolated_position: Option<ModeProfile>,
    /// Current.
    pub current: Option<ModeProfile>,
    /// The value that 0x604C must have: velocities are scaled by it as [`VelocityScale`] says.
    pub velocity_scale: VelocityScale,
    /// The transmit PDOs that the drives send at each SYNC; empty ones are switched off. Statusword, position
    /// and mode display must be in them.
    pub tpdos: [Mapping; 4],
    /// The joints from the base on.
    pub joints: [JointProfile; N],
    /// Times and limits.
    pub reactions: Reactions,
}

impl<const N: usize> Profile<N> {
    /// The profile of `mode`, if the arm has it.
    pub const fn mode(&self, mode: ControlMode) -> Option<&ModeProfile> {
        match mode {
            ControlMode::ProfilePosition => self.profile_position.as_ref(),
            ControlMode::Velocity => self.velocity.as_ref(),
            ControlMode::InterpolatedPosition => self.interpolated_position.as_ref(),
            ControlMode::Current => self.current.as_ref(),
        }
    }

    /// This profile with the drives' torque offset (0x60B2) in the receive PDO of interpolated position mode,
    /// for [`Driver::set_with_torque`](super::Driver::set_with_torque): two bytes more a joint and cycle.
    #[must_use]
    pub const fn with_torque_offset(mut self) -> Self {
        if let Some(mode) = &mut self.interpolated_position {
            mode.rpdo = Mapping::of(&[
                Entry::new(objects::CONTROLWORD, 16),
                Entry::new(objects::TORQUE_OFFSET, 16),
                Entry::new(mode.setpoint, 32),
            ]);
        }
        self
    }

    /// Period of SYNC in s.
    pub fn period_seconds(&self) -> f64 {
        self.sync_period as f64 * 1e-6
    }

    /// Value and power of ten of the interpolation period 0x60C2, or `None` where it cannot be written.
    pub const fn interpolation_period(&self) -> Option<(u8, i8)> {
        let (ms, tenths) = (self.sync_period / 1000, self.sync_period / 100);
        if self.sync_period.is_multiple_of(1000) && ms >= 1 && ms <= 255 {
            Some((ms as u8, -3))
        } else if self.sync_period.is_multiple_of(100) && tenths >= 1 && tenths <= 255 {
            Some((tenths as u8, -4))
        } else {
            None
        }
    }

    /// Whether the driver can work with this profile at all.
    pub(super) fn check(&self) -> Result<(), Refusal> {
        let wrong = |what| Err(Refusal::Profile(what));
        for (j, joint) in self.joints.iter().enumerate() {
            let others = self.joints.iter().skip(j + 1).map(|other| other.node);
            if others.chain([self.master]).any(|node| node == joint.node) {
                return wrong("a node id is used twice");
            }
            let [low, high] = joint.position;
            let positive = [
                joint.velocity,
                joint.acceleration,
                joint.current,
                joint.following_error,
                joint.velocity_error,
                joint.units.counts_per_radian.abs(),
            ];
            if low.partial_cmp(&high) != Some(core::cmp::Ordering::Less)
                || positive.iter().any(|value| !(value.is_finite() && *value > 0.0))
                || joint.torque.partial_cmp(&0.0) != Some(core::cmp::Ordering::Greater)
            {
                return wrong(
                    "a joint's limits are not a range, or its velocity, acceleration, torque, current, \
                        greatest following or velocity error or scale is not positive",
                );
            }
        }
        if self.interpolation_period().is_none() {
            return wrong(
                "the SYNC period cannot be written to 0x60C2: whole ms to 255, or tenths to 25.5 are \
                    expected",
            );
        }
        if self.sync_timeout_factor == Some(0) || self.master_watch_ms == 0 || self.node_heartbeat_ms == 0 {
            return wrong("the drives must watch the master and be watched: none of these times may be 0");
        }
        if self.master_heartbeat == 0 || self.master_heartbeat > Micros::from(self.master_watch_ms) * 500 {
            return wrong(
                "the master's heartbeat must come at least twice in the time that the drives wait for it",
            );
        }
        let sent = |object| self.tpdos.iter().any(|mapping| mapping.contains(object));
        if ![objects::STATUSWORD, objects::POSITION, objects::VELOCITY, objects::MODE_DISPLAY]
            .into_iter()
            .all(sent)
        {
            return wrong("the transmit PDOs must hold statusword, position, velocity and mode display");
        }
        if ControlMode::ALL.into_iter().all(|mode| self.mode(mode).is_none()) {
            return wrong("it has no mode");
        }
        for mode in ControlMode::ALL.into_iter().filter_map(|mode| self.mode(mode)) {
            if !(mode.rpdo.contains(objects::CONTROLWORD) && mode.rpdo.contains(mode.setpoint)) {
                return wrong("a receive PDO must hold controlword and set-point");
            }
        }
        Ok(())
    }
}

/// Running bits of interpolated position: interpolate.
pub const INTERPOLATED_POSITION_BITS: u16 = Controlword::MODE_4;
/// Running bits of velocity: without all three the ramp is held (0x7F).
pub const VELOCITY_BITS: u16 = Controlword::MODE_4 | Controlword::MODE_5 | Controlword::MODE_6;
/// Running bits of profile position: a new target is taken at once. The new set-point bit itself is a
/// handshake.
pub const PROFILE_POSITION_BITS: u16 = Controlword::MODE_5;
