//! The phases of the driver, each with what it holds while it lasts.

use super::arm::Arm;
use super::bringup::{Boot, Script, Scripts};
use super::cause::Cause;
use super::enabling::Enabling;
use super::phase::Phase;
use super::stop::{Diagnosis, Reset, Stop};
use super::stream::Stream;
use crate::canopen::Micros;
use crate::cia402::{Command, Controlword, State};

/// A phase with its data.
#[derive(Clone, Debug)]
pub(super) enum Stage<const N: usize> {
    Idle,
    Listening { since: Micros },
    Boot(Boot),
    Scripts(Scripts<N>),
    Starting { since: Micros },
    Ready,
    Enabling(Enabling<N>),
    Running(Stream),
    Stopping(Stop<N>),
    Faulted(Diagnosis),
    Resetting(Reset),
}

impl<const N: usize> Stage<N> {
    pub(super) const fn phase(&self) -> Phase {
        match self {
            Stage::Idle => Phase::Idle,
            Stage::Listening { .. } => Phase::Listening,
            Stage::Boot(_) => Phase::Boot,
            Stage::Scripts(scripts) => match scripts.script {
                Script::Identify => Phase::Identify,
                Script::Configure => Phase::Configure,
                Script::Verify => Phase::Verify,
            },
            Stage::Starting { .. } => Phase::Starting,
            Stage::Ready => Phase::Ready,
            Stage::Enabling(_) => Phase::Enabling,
            Stage::Running(_) => Phase::Running,
            Stage::Stopping(_) => Phase::Stopping,
            Stage::Faulted(_) => Phase::Faulted,
            Stage::Resetting(_) => Phase::Resetting,
        }
    }

    /// Whether the joints may have torque on the driver's command.
    pub(super) const fn is_live(&self) -> bool {
        matches!(self, Stage::Enabling(_) | Stage::Running(_))
    }

    /// Whether the joints are configured and may be enabled, or are.
    pub(super) const fn is_up(&self) -> bool {
        self.is_live() || matches!(self, Stage::Ready)
    }

    pub(super) const fn is_running(&self) -> bool {
        matches!(self, Stage::Running(_))
    }

    /// Whether an arm that was stopped stays so, or comes back: what goes on is reported once.
    pub(super) const fn is_stopped(&self) -> bool {
        matches!(self, Stage::Stopping(_) | Stage::Faulted(_) | Stage::Resetting(_))
    }

    /// Whether joint `j` has its torque on the driver's command.
    pub(super) fn is_released(&self, j: usize) -> bool {
        match self {
            Stage::Running(_) => true,
            Stage::Enabling(enabling) => enabling.is_released(j),
            _ => false,
        }
    }

    /// The controlword for joint `j` now.
    pub(super) fn word(&self, arm: &Arm<N>, j: usize) -> Controlword {
        let off = Controlword::command(Command::DisableVoltage);
        let running = || Controlword::command(Command::EnableOperation).with(arm.mode().running_bits);
        let Some(joint) = arm.joints.get(j) else { return off };
        match self {
            Stage::Running(_) => running(),
            Stage::Enabling(enabling) => enabling.word(j, joint, running()),
            Stage::Stopping(stop) => stop.word(),
            Stage::Resetting(reset) => reset.word(joint),
            _ => off,
        }
    }

    /// Each statusword of joint `j`: whether the phase allows the drive's state.
    pub(super) fn wrong_state(&self, arm: &Arm<N>, j: usize) -> Option<Cause> {
        let (node, status) = (arm.node(j), arm.joints.get(j)?.status?);
        let state = status.state();
        let allowed = match self {
            Stage::Running(_) => state == State::OperationEnabled,
            Stage::Enabling(enabling) => enabling.allows(j, state),
            Stage::Ready => !state.has_torque(),
            Stage::Starting { .. } | Stage::Stopping(_) => true,
            _ => return None,
        };
        match state {
            State::Fault | State::FaultReactionActive => Some(Cause::DriveFault(node, status)),
            State::Unknown(_) => Some(Cause::UnknownState(node, status)),
            _ => (!allowed).then_some(Cause::StateLost(node, status)),
        }
    }

    /// Each mode display of joint `j`: whether the drive is in another mode, where it must be in the arm's.
    pub(super) fn wrong_mode(&self, arm: &Arm<N>, j: usize) -> Option<Cause> {
        let mode = arm.joints.get(j)?.mode.filter(|mode| *mode != arm.mode().mode)?;
        self.is_up().then_some(Cause::WrongMode(arm.node(j), mode))
    }
}
