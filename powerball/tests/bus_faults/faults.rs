//! The faults, how each is made, and what must follow in each phase.

use super::world::{CYCLE, VICTIM, Wire, World};
use powerball::bus::canopen::{Cob, Frame, Micros, cob};
use powerball::bus::cia402::{Mode, Statusword};
use powerball::bus::driver::cause::Hindrance;
use powerball::bus::driver::{BusEvent, Cause, ControlMode, Foreign, Phase};
use powerball::virtual_arm::slave;

/// What is made to happen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    DropOne,
    DropFive,
    DelayOne,
    Duplicate,
    Reorder,
    ShortOne,
    ShortFive,
    Reboot,
    EmcyStorm,
    Silent,
    QueueFull,
    BusOff,
    WrongMode,
    UnknownStatus,
    LateOnce,
    LateLong,
    NanOnce,
    NanAgain,
    JumpOnce,
    JumpAgain,
    LostMaster,
    NoVoltage,
    NotRemote,
    InternalLimit,
    PositionJump,
    TwoNodes,
    OtherSync,
    OtherSetpoints,
    VelocityHuge,
    Frozen,
    Drift,
    TorqueFull,
}

impl Fault {
    /// Faults that every mode answers in the same way, but for how soon.
    pub(crate) const ALL: [(Fault, &'static str); 29] = [
        (Fault::DropOne, "one frame dropped"),
        (Fault::DropFive, "5 cycles of frames dropped"),
        (Fault::DelayOne, "one frame 2 ms late"),
        (Fault::Duplicate, "duplicated frames"),
        (Fault::Reorder, "reordered frames"),
        (Fault::ShortOne, "one frame of wrong length"),
        (Fault::ShortFive, "5 cycles of wrong length"),
        (Fault::Reboot, "node reboots"),
        (Fault::EmcyStorm, "EMCY storm"),
        (Fault::Silent, "node silent"),
        (Fault::QueueFull, "TX queue full"),
        (Fault::BusOff, "bus-off"),
        (Fault::WrongMode, "mode refused or changed"),
        (Fault::UnknownStatus, "unknown statusword"),
        (Fault::LateOnce, "one late cycle"),
        (Fault::LateLong, "4 cycles left out"),
        (Fault::NanOnce, "one NaN set-point"),
        (Fault::NanAgain, "NaN set-points"),
        (Fault::JumpOnce, "one jumping set-point"),
        (Fault::JumpAgain, "jumping set-points"),
        (Fault::LostMaster, "master lost"),
        (Fault::NoVoltage, "voltage bit lost"),
        (Fault::NotRemote, "remote bit lost"),
        (Fault::InternalLimit, "internal limit"),
        (Fault::PositionJump, "position jumps"),
        (Fault::TwoNodes, "two nodes with one id"),
        (Fault::OtherSync, "SYNC of another master"),
        (Fault::OtherSetpoints, "set-points of another master"),
        (Fault::VelocityHuge, "velocity reads 2³¹"),
    ];

    /// What can happen in a mode: in current mode also what its guard is for.
    pub(crate) fn of(control: ControlMode) -> impl Iterator<Item = Fault> + Clone {
        let own: &[Fault] = match control {
            ControlMode::Current => &[Fault::Frozen, Fault::Drift, Fault::TorqueFull],
            _ => &[],
        };
        Fault::ALL.into_iter().map(|(fault, _)| fault).chain(own.iter().copied())
    }

    pub(crate) fn inject(self, world: &mut World) {
        let now = world.now();
        let cycles = |n: Micros| now + n * CYCLE;
        let wire = |world: &mut World, wire| world.bus.peer_mut().wire = wire;
        let slave = |world: &mut World, fault| world.bus.peer_mut().arm.fault(VICTIM, fault);
        let bad = |world: &mut World, count, value| (world.pilot.bad, world.pilot.bad_value) = (count, value);
        // Beyond what may change in a cycle, in every mode; in profile position beyond the limits.
        let jump = match world.driver.control() {
            ControlMode::ProfilePosition | ControlMode::InterpolatedPosition => 5.0,
            ControlMode::Velocity => 1.2,
            ControlMode::Current => 4.9,
        };
        match self {
            Fault::DropOne => wire(world, Wire::Drop { until: Micros::MAX, frames: 1 }),
            Fault::DropFive => wire(world, Wire::Drop { until: cycles(5), frames: u32::MAX }),
            Fault::DelayOne => wire(world, Wire::Delay { by: 2000, frames: 1 }),
            Fault::Duplicate => wire(world, Wire::Duplicate { frames: 4 }),
            Fault::Reorder => wire(world, Wire::Swap { frames: 2 }),
            Fault::ShortOne => wire(world, Wire::Shorten { until: Micros::MAX, frames: 1 }),
            Fault::ShortFive => wire(world, Wire::Shorten { until: cycles(5), frames: u32::MAX }),
            Fault::Reboot => slave(world, slave::Fault::Reboot),
            Fault::EmcyStorm => world.bus.peer_mut().storm = 60,
            Fault::Silent => slave(world, slave::Fault::Silent(true)),
            Fault::QueueFull => world.full_until = now + 2 * CYCLE - 1000,
            Fault::BusOff => world.event(BusEvent::BusOff),
            Fault::WrongMode => wire(world, Wire::Mode(Mode::ProfileVelocity.code() as u8)),
            Fault::UnknownStatus => slave(world, slave::Fault::Statusword(Some(0x0001))),
            Fault::LateOnce => world.run_without_driver(CYCLE / 2),
            Fault::LateLong => world.run_without_driver(4 * CYCLE),
            Fault::NanOnce => bad(world, 1, f64::NAN),
            Fault::NanAgain => bad(world, u32::MAX, f64::NAN),
            Fault::JumpOnce => bad(world, 1, jump),
            Fault::JumpAgain => bad(world, u32::MAX, jump),
            Fault::LostMaster => world.run_without_driver(800_000),
            Fault::NoVoltage => wire(world, Wire::Status { set: 0, clear: Statusword::VOLTAGE_ENABLED }),
            Fault::NotRemote => wire(world, Wire::Status { set: 0, clear: Statusword::REMOTE }),
            Fault::InternalLimit => wire(world, Wire::Status { set: Statusword::INTERNAL_LIMIT, clear: 0 }),
            Fault::TwoNodes => wire(world, Wire::Twice),
            Fault::OtherSync => world.bus.peer_mut().foreign = Some(cob::SYNC),
            Fault::OtherSetpoints => {
                world.bus.peer_mut().foreign = Frame::from_raw(Cob::Rpdo(1, VICTIM).id(), &[0; 6])
            }
            Fault::PositionJump => wire(world, Wire::Shift { by: 5000, frames: 12 }),
            Fault::VelocityHuge => wire(world, Wire::Velocity(i32::MIN)),
            Fault::Frozen => wire(world, Wire::Freeze(None)),
            Fault::Drift => wire(world, Wire::Drift(None)),
            Fault::TorqueFull => wire(world, Wire::Torque(i16::MAX)),
        }
    }

    /// Ends it, so that the arm can be taken into service again.
    pub(crate) fn repair(self, world: &mut World) {
        world.bus.peer_mut().wire = Wire::Good;
        world.bus.peer_mut().storm = 0;
        world.bus.peer_mut().foreign = None;
        world.pilot.bad = 0;
        world.bus.peer_mut().arm.fault(VICTIM, slave::Fault::Silent(false));
        world.bus.peer_mut().arm.fault(VICTIM, slave::Fault::Statusword(None));
    }

    /// Whether `cause` reports this fault.
    pub(crate) fn is_reported_by(self, cause: &Cause) -> bool {
        let victim = cause.node().is_none_or(|node| node == VICTIM);
        victim
            && match self {
                Fault::DropFive | Fault::ShortFive => matches!(cause, Cause::DataMissing(_)),
                Fault::Reboot => matches!(cause, Cause::Rebooted(_)),
                Fault::EmcyStorm => matches!(cause, Cause::Emergency(_, emcy) if emcy.code == 0x3222),
                Fault::Silent => matches!(
                    cause,
                    Cause::HeartbeatLost(_)
                        | Cause::NoBoot(_)
                        | Cause::Sdo(..)
                        | Cause::NoWatch(..)
                        | Cause::DataMissing(_)
                ),
                Fault::QueueFull => matches!(cause, Cause::TransmitQueueFull),
                Fault::BusOff => matches!(cause, Cause::BusOff),
                Fault::WrongMode => matches!(cause, Cause::WrongMode(_, Mode::ProfileVelocity)),
                Fault::UnknownStatus => matches!(cause, Cause::UnknownState(..)),
                Fault::LateLong => matches!(cause, Cause::Late),
                Fault::NanAgain | Fault::JumpAgain => matches!(cause, Cause::Setpoints(_)),
                Fault::NoVoltage => matches!(cause, Cause::Hindered(_, Hindrance::NoVoltage, _)),
                Fault::NotRemote => matches!(cause, Cause::Hindered(_, Hindrance::NotRemote, _)),
                Fault::InternalLimit => matches!(cause, Cause::Hindered(_, Hindrance::InternalLimit, _)),
                Fault::TwoNodes => matches!(cause, Cause::TwoNodes(_)),
                Fault::OtherSync => matches!(cause, Cause::OtherMaster(Foreign::Sync)),
                Fault::OtherSetpoints => matches!(cause, Cause::OtherMaster(Foreign::Setpoints(VICTIM))),
                Fault::PositionJump => matches!(cause, Cause::PositionJump(..)),
                Fault::VelocityHuge => matches!(cause, Cause::Overspeed(..) | Cause::ImplausibleVelocity(..)),
                Fault::Drift => matches!(cause, Cause::PositionAgainstVelocity(..)),
                Fault::TorqueFull => matches!(cause, Cause::CurrentError(..)),
                _ => false,
            }
    }

    /// What must follow where the arm is in `phase`.
    pub(crate) fn expected(self, phase: Stage, control: ControlMode) -> Expected {
        use Expected::{GoesOn, Refused, SlavesStop, Stays, Stops};
        use Stage::{
            Boot, Commutating, Configure, Enabling, Faulted, Identify, Resetting, Running, Starting,
            Stopping, Verify,
        };
        let early = matches!(phase, Boot | Identify | Configure | Verify);
        let live = matches!(phase, Enabling | Commutating | Running);
        let stop = |cycles| match phase {
            _ if live => Stops { cycles },
            Faulted => Stays,
            _ => Refused,
        };
        match self {
            Fault::DropOne | Fault::DelayOne | Fault::Duplicate | Fault::Reorder | Fault::ShortOne => {
                match phase {
                    Faulted => Stays,
                    _ => GoesOn,
                }
            }
            // SDO and boot are repeated, first data is waited for.
            // In current mode the caller carries the state of a joint on over five cycles.
            Fault::DropFive | Fault::ShortFive if phase == Running && control == ControlMode::Current => {
                GoesOn
            }
            Fault::Reboot | Fault::Silent if phase == Running && control == ControlMode::Current => {
                Stops { cycles: 7 }
            }
            Fault::DropFive | Fault::ShortFive if early || phase == Starting => GoesOn,
            // An answer of the commutation search may be on the wire when the stop leaves.
            Fault::DropFive | Fault::ShortFive => stop(if phase == Commutating { 5 } else { 4 }),
            Fault::Reboot if phase == Boot => GoesOn,
            // The node is silent while it boots: missed within three cycles, and reported as what it is when
            // it has booted.
            Fault::Reboot | Fault::Silent => stop(4),
            // Nodes may complain while they boot: what counts is their state later.
            Fault::EmcyStorm if early => GoesOn,
            // Emergencies come before set-points on the wire, and so before the stop.
            Fault::EmcyStorm => stop(2),
            // Without torque the frames are repeated. With it the stop leaves as soon as the queue takes it.
            Fault::QueueFull if live => Stops { cycles: 3 },
            Fault::BusOff => match phase {
                Faulted => Stays,
                _ if live || phase == Stopping => SlavesStop,
                _ => Refused,
            },
            // The reset ends it.
            Fault::UnknownStatus if phase == Boot => GoesOn,
            Fault::WrongMode | Fault::UnknownStatus => stop(2),
            Fault::LateLong if live => Stops { cycles: 5 },
            Fault::NanAgain | Fault::JumpAgain if phase == Running => Stops { cycles: 4 },
            // They meet an arm that comes to run later.
            Fault::NanAgain | Fault::JumpAgain if !matches!(phase, Stopping | Faulted | Resetting) => Refused,
            Fault::LostMaster => SlavesStop,
            // What the victim shows counts once it has torque, or its brake is open.
            Fault::VelocityHuge => match phase {
                Stopping | Resetting => GoesOn,
                _ => stop(5),
            },
            Fault::NoVoltage | Fault::NotRemote | Fault::InternalLimit => match phase {
                Running | Commutating => Stops { cycles: 5 },
                Enabling => Stops { cycles: 40 },
                Stopping | Resetting => GoesOn,
                _ => stop(0),
            },
            Fault::TwoNodes => stop(7),
            Fault::OtherSync | Fault::OtherSetpoints => stop(3),
            Fault::PositionJump => match phase {
                Stopping | Resetting => GoesOn,
                _ => stop(3),
            },
            // Used in histories alone.
            Fault::Frozen | Fault::Drift | Fault::TorqueFull => stop(0),
            Fault::QueueFull | Fault::LateOnce | Fault::LateLong => match phase {
                Faulted => Stays,
                _ => GoesOn,
            },
            Fault::NanOnce | Fault::NanAgain | Fault::JumpOnce | Fault::JumpAgain => match phase {
                Faulted => Stays,
                _ => GoesOn,
            },
        }
    }
}

/// When it happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    Boot,
    Identify,
    Configure,
    Verify,
    Starting,
    Ready,
    Enabling,
    Commutating,
    Running,
    Stopping,
    Faulted,
    Resetting,
}

impl Stage {
    pub(crate) const ALL: [(Stage, &'static str); 12] = [
        (Stage::Boot, "boot"),
        (Stage::Identify, "identify"),
        (Stage::Configure, "configure"),
        (Stage::Verify, "verify"),
        (Stage::Starting, "starting"),
        (Stage::Ready, "ready"),
        (Stage::Enabling, "enabling"),
        (Stage::Commutating, "commutating"),
        (Stage::Running, "running"),
        (Stage::Stopping, "stopping"),
        (Stage::Faulted, "faulted"),
        (Stage::Resetting, "resetting"),
    ];

    /// Brings the arm there.
    pub(crate) fn reach(self, world: &mut World, control: ControlMode) {
        world.run(100_000);
        world.driver.start(control, true).unwrap();
        let until = |world: &mut World, phase: Phase| {
            let came = world.run_until(20_000_000, |w| w.driver.phase() == phase);
            assert!(came, "{phase:?} not reached: {:?}", world.driver.cause());
        };
        world.pilot.enable = !matches!(self, Stage::Ready);
        match self {
            Stage::Boot => until(world, Phase::Boot),
            Stage::Identify => until(world, Phase::Identify),
            Stage::Configure => until(world, Phase::Configure),
            Stage::Verify => until(world, Phase::Verify),
            Stage::Starting => until(world, Phase::Starting),
            Stage::Ready => {
                until(world, Phase::Ready);
                world.run(4 * CYCLE);
            }
            Stage::Enabling => {
                until(world, Phase::Enabling);
                world.run(2 * CYCLE);
            }
            Stage::Commutating => {
                until(world, Phase::Enabling);
                // The victim is the third joint: the search has come to it.
                let came = world.run_until(5_000_000, |w| !w.bus.peer().arm.nodes()[2].brake_closed());
                assert!(came);
            }
            Stage::Running => {
                until(world, Phase::Running);
                world.run(20 * CYCLE);
            }
            Stage::Stopping => {
                until(world, Phase::Running);
                world.run(20 * CYCLE);
                world.pilot.enable = false;
                world.stop();
            }
            Stage::Faulted | Stage::Resetting => {
                until(world, Phase::Running);
                world.pilot.enable = false;
                let emergency = slave::Fault::Emergency { code: 0x8611, register: 0x21 };
                world.bus.peer_mut().arm.fault(powerball::bus::canopen::NodeId::clamped(3), emergency);
                until(world, Phase::Faulted);
                world.run(20 * CYCLE);
                if self == Stage::Resetting {
                    world.driver.acknowledge().unwrap();
                    world.run(CYCLE);
                }
            }
        }
    }
}

/// What must follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Expected {
    /// The fault does no harm: the arm comes to run, runs on, or comes to rest as commanded.
    GoesOn,
    /// Quick stop reaches every drive within this many cycles, the cause is latched.
    Stops { cycles: u64 },
    /// Nothing moves yet, or any more: the cause is latched and nothing may be enabled.
    Refused,
    /// The arm stays stopped, and the cause that it was stopped for stays latched, or a graver one.
    Stays,
    /// The drives stop by themselves.
    SlavesStop,
}
