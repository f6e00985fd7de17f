//! Commands that talk with an arm, real or virtual, or listen to one as it moves; and what explains one that
//! moved.

mod bus;
mod demo;
mod envelope;
pub(super) mod experiment;
mod float;
mod follow;
mod friction;
mod listen;
mod live_server;
mod model_on_bus;
mod motion;
mod profile;
mod record;
mod serve;
mod virtual_arm;
mod warm_up;
mod watch;

use super::{Failure, excite, explain, inputs, log, output, replace};
use clap::Subcommand;

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// The whole loop on the built-in virtual arm: record, identify, explain, compare with the truth.
    Demo(demo::DemoCommand),
    /// Look at the drives on a CAN bus, read and write their objects, enable, stop and move them.
    Bus(bus::BusCommand),
    /// Put the virtual arm on a bus for others.
    VirtualArm(virtual_arm::VirtualArmCommand),
    /// Follow a trajectory on a bus and log it.
    Record(record::RecordCommand),
    /// Follow a trajectory with a torque model; tracking error with it and with a base model. Never run on
    /// hardware.
    Follow(follow::FollowCommand),
    /// Take weight and friction off the hand that guides the arm. Never run on hardware.
    Float(float::FloatCommand),
    /// Swing the arm until its friction has settled.
    WarmUp(warm_up::WarmUp),
    /// Measure every joint's friction at constant velocities and fit its law.
    Friction(friction::Friction),
    /// Make an arm's constant tables for the bus driver from its drives' DCF and one TOML.
    Profile(profile::ProfileCommand),
    /// Say when a model no longer holds, along logs or a stream: since when, on which joints and why.
    Watch(watch::WatchCommand),
}

impl Command {
    pub(super) fn run(self) -> Result<(), Failure> {
        match self {
            Command::Demo(command) => command.run(),
            Command::Bus(command) => command.run(),
            Command::VirtualArm(command) => command.run(),
            Command::Record(command) => command.run(),
            Command::Follow(command) => command.run(),
            Command::Float(command) => command.run(),
            Command::WarmUp(command) => command.run(),
            Command::Friction(command) => command.run(),
            Command::Profile(command) => command.run(),
            Command::Watch(command) => command.run(),
        }
    }
}
