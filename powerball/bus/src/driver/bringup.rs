//! From silence to process data: the nodes boot, are identified, configured and verified.

use super::arm::{Arm, may_be_enabled};
use super::budget::worst_bits;
use super::cause::{Cause, Hindrance};
use super::joint::Transmit;
use super::script::{Write, configuration, questions};
use crate::canopen::client::{SdoError, Value};
use crate::canopen::objects::{DEVICE_TYPE, PRODUCT_CODE, REVISION, SERIAL_NUMBER, VENDOR_ID};
use crate::canopen::sdo::AbortCode;
use crate::canopen::{Frame, Micros, Object, nmt};
use crate::cia402::{State, objects};

/// The device profile of drives, CiA 402: the low 16 bits of 0x1000.
const DRIVES: u32 = 402;

/// A node that does not boot is reset once more: supplies come late.
const RESETS: u8 = 2;

/// The nodes are reset; their boot-up messages are awaited.
#[derive(Clone, Copy, Debug)]
pub(super) struct Boot {
    /// How often they were reset.
    resets: u8,
    /// When last.
    since: Micros,
}

impl Boot {
    pub(super) const fn new(now: Micros) -> Boot {
        Boot { resets: 0, since: now }
    }

    /// Takes the nodes further; true when all have booted.
    ///
    /// # Errors
    /// The cause, where one of them does not boot.
    pub(super) fn poll<const N: usize>(
        &mut self,
        arm: &mut Arm<N>,
        tx: &mut impl Transmit,
    ) -> Result<bool, Cause> {
        if self.resets == 0 {
            for joint in &mut arm.joints {
                joint.client.cancel();
                joint.presence.release();
                (joint.booted, joint.status, joint.mode, joint.emergency) = (None, None, None, None);
                (joint.current_limit, joint.declined) = (None, 0);
            }
            if arm.manage(nmt::Command::ResetNode, tx) {
                *self = Boot { resets: 1, since: arm.now };
            }
            return Ok(false);
        }
        let Some(missing) = arm.joints.iter().position(|joint| joint.booted.is_none()) else {
            // Nodes go there by themselves after their boot-up; some (python-canopen's) repeat it until they
            // are commanded.
            return Ok(arm.manage(nmt::Command::EnterPreOperational, tx));
        };
        if arm.elapsed(self.since) < arm.profile.reactions.boot_timeout {
            return Ok(false);
        }
        let asleep = |arm: &Arm<N>, j: usize| arm.joints.get(j).is_some_and(|joint| joint.booted.is_none());
        if self.resets >= RESETS {
            for j in missing + 1..N {
                if asleep(arm, j) {
                    arm.note(Cause::NoBoot(arm.node(j)));
                }
            }
            return Err(Cause::NoBoot(arm.node(missing)));
        }
        *self = Boot { resets: self.resets + 1, since: arm.now };
        for j in 0..N {
            if asleep(arm, j) {
                arm.send(nmt::Command::ResetNode.frame(Some(arm.node(j))), tx);
            }
        }
        Ok(false)
    }
}

/// The scripts, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Script {
    /// Who the nodes are and what they offer is read.
    Identify,
    /// Nodes are configured.
    Configure,
    /// The configuration is read back.
    Verify,
}

/// How far a joint is in its script.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    step: usize,
    retries: u8,
    /// Earliest time of the next step.
    next: Micros,
}

/// The scripts of all joints, side by side.
#[derive(Clone, Debug)]
pub(super) struct Scripts<const N: usize> {
    pub(super) script: Script,
    places: [Place; N],
}

impl<const N: usize> Scripts<N> {
    pub(super) fn new() -> Self {
        Scripts { script: Script::Identify, places: [Place::default(); N] }
    }

    /// When the next step of an idle joint is due, after now.
    pub(super) fn due(&self, arm: &Arm<N>) -> Option<Micros> {
        let idle = self.places.iter().zip(&arm.joints).filter(|(_, joint)| joint.client.is_idle());
        idle.map(|(place, _)| place.next).filter(|next| *next > arm.now).min()
    }

    /// The write that joint `j` is at, while configuring and verifying.
    fn write_of(&self, arm: &Arm<N>, j: usize) -> Option<Write> {
        let step = self.places.get(j)?.step;
        let verifying = self.script == Script::Verify;
        let declined = arm.joints.get(j).map_or(0, |joint| joint.declined);
        let kept =
            |write: &Write| write.verify != 0 && write.optional().is_none_or(|bit| declined & bit == 0);
        configuration(&arm.profile, arm.mode(), arm.control, j)
            .filter(|write| !verifying || kept(write))
            .nth(step)
    }

    /// Begins joint `j`'s next step; `None` where its script is done.
    fn begin_step(&mut self, arm: &mut Arm<N>, j: usize) -> Option<Frame> {
        let (now, pause) = (arm.now, pause(arm));
        let frame = match self.script {
            Script::Identify => {
                let object = questions(arm.mode(), arm.control).nth(self.places.get(j)?.step)?;
                arm.joints.get_mut(j)?.client.read(object, now)
            }
            Script::Configure => {
                let write = self.write_of(arm, j)?;
                arm.joints.get_mut(j)?.client.write(write.object, write.value(), now)
            }
            Script::Verify => {
                let write = self.write_of(arm, j)?;
                arm.joints.get_mut(j)?.client.read(write.object, now)
            }
        };
        self.places.get_mut(j)?.next = now + pause;
        Some(frame)
    }

    /// Takes the joints further, script after script; true when all are done.
    ///
    /// # Errors
    /// The cause, where a drive does not answer as it must.
    pub(super) fn poll(&mut self, arm: &mut Arm<N>, tx: &mut impl Transmit) -> Result<bool, Cause> {
        while self.poll_joints(arm, tx)? {
            self.script = match self.script {
                Script::Identify => Script::Configure,
                Script::Configure => Script::Verify,
                Script::Verify => return Ok(true),
            };
            self.places.iter_mut().for_each(|place| (place.step, place.retries) = (0, 0));
        }
        Ok(false)
    }

    /// True when this script is done.
    fn poll_joints(&mut self, arm: &mut Arm<N>, tx: &mut impl Transmit) -> Result<bool, Cause> {
        let (mut done, now) = (true, arm.now);
        for j in 0..N {
            let (Some(joint), Some(place)) = (arm.joints.get_mut(j), self.places.get(j)) else { continue };
            if !joint.client.is_idle() {
                done = false;
                let step = joint.client.poll(now);
                if let Some(frame) = step.send {
                    arm.send(frame, tx);
                }
                if let Some(result) = step.done {
                    self.answer(arm, j, result)?;
                }
            } else if now < place.next {
                done = false;
            } else if let Some(frame) = self.begin_step(arm, j) {
                done = false;
                arm.send(frame, tx);
            }
        }
        Ok(done)
    }

    /// The end of a transfer of joint `j`.
    ///
    /// # Errors
    /// The cause, where it is not as it must be.
    pub(super) fn answer(
        &mut self,
        arm: &mut Arm<N>,
        j: usize,
        result: Result<Value, SdoError>,
    ) -> Result<(), Cause> {
        let retries = arm.profile.reactions.sdo_retries;
        let (Some(joint), Some(place)) = (arm.joints.get(j), self.places.get_mut(j)) else { return Ok(()) };
        let object = joint.client.object();
        if result == Err(SdoError::Timeout) && place.retries < retries {
            place.retries += 1;
            return Ok(());
        }
        match self.script {
            Script::Identify => judge_answer(arm, j, object, result),
            Script::Configure => self.judge_write(arm, j, object, result),
            Script::Verify => self.judge_read_back(arm, j, object, result),
        }?;
        if let Some(place) = self.places.get_mut(j) {
            (place.step, place.retries) = (place.step + 1, 0);
        }
        Ok(())
    }

    fn judge_write(
        &self,
        arm: &mut Arm<N>,
        j: usize,
        object: Object,
        result: Result<Value, SdoError>,
    ) -> Result<(), Cause> {
        let write = self.write_of(arm, j);
        if let (Err(SdoError::Aborted(_)), Some(bit)) = (result, write.and_then(|write| write.optional())) {
            if let Some(joint) = arm.joints.get_mut(j) {
                joint.declined |= bit;
            }
            return Ok(());
        }
        let cause = if write.is_some_and(|write| write.is_watch()) { Cause::NoWatch } else { Cause::Sdo };
        result.map(|_| ()).map_err(|error| cause(arm.node(j), object, error))
    }

    fn judge_read_back(
        &self,
        arm: &Arm<N>,
        j: usize,
        object: Object,
        result: Result<Value, SdoError>,
    ) -> Result<(), Cause> {
        let node = arm.node(j);
        let value = result.map_err(|error| Cause::Sdo(node, object, error))?;
        let Some(write) = self.write_of(arm, j) else { return Ok(()) };
        let read = value.unsigned().unwrap_or(0) & write.verify;
        if read == write.expected() && !value.as_slice().is_empty() {
            Ok(())
        } else {
            Err(Cause::NotTaken(node, object, write.expected(), read))
        }
    }
}

/// Between two steps of one joint: as long as a round of all joints takes, and half of that again. Transfers
/// without a pause would fill the bus, and the master's heartbeat, lowest in priority, would be missed by the
/// drives.
fn pause<const N: usize>(arm: &Arm<N>) -> Micros {
    let round_trip = arm.budget.duration(2 * worst_bits(8));
    round_trip * N as u64 * 3 / 2
}

/// Judges what a drive says of itself; what is used later is kept.
fn judge_answer<const N: usize>(
    arm: &mut Arm<N>,
    j: usize,
    object: Object,
    result: Result<Value, SdoError>,
) -> Result<(), Cause> {
    let number = result.and_then(|value| value.unsigned().ok_or(SdoError::Protocol(AbortCode::LENGTH)));
    if matches!(object, DEVICE_TYPE | VENDOR_ID | PRODUCT_CODE | REVISION | SERIAL_NUMBER) {
        return judge_identity(arm, j, object, number);
    }
    let (node, mode) = (arm.node(j), *arm.mode());
    let failed = |error| Cause::Sdo(node, object, error);
    let (Some(profile), Some(joint)) = (arm.profile.joints.get(j), arm.joints.get_mut(j)) else {
        return Ok(());
    };
    // A drive need not report it; the profile's limit is used then.
    if object == objects::MAX_CURRENT {
        let stated = number.ok().filter(|n| (1..=u32::from(u16::MAX)).contains(n));
        joint.current_limit =
            stated.map(|n| joint.units.current(n as i32).abs()).filter(|limit| *limit > 0.0);
        return match number {
            Ok(_) | Err(SdoError::Aborted(_)) => Ok(()),
            Err(error) => Err(failed(error)),
        };
    }
    // A target that is there and cannot be read: that it is followed is watched anyway.
    if object == mode.setpoint
        && let Err(SdoError::Aborted(code)) = number
        && !matches!(code, AbortCode::NO_OBJECT | AbortCode::NO_SUB_INDEX)
    {
        return Ok(());
    }
    let number = number.map_err(failed)?;
    match object {
        objects::SUPPORTED_MODES if mode.mode.is_in(number) == Some(false) => {
            return Err(Cause::ModeNotOffered(node, mode.mode, number));
        }
        objects::RATED_CURRENT if number > 0 => joint.units.rated_current = f64::from(number) / 1000.0,
        // Without a scale of its own the drive's currents are nonsense, and a current set-point more so.
        objects::RATED_CURRENT if profile.units.rated_current <= 0.0 => {
            return Err(Cause::Implausible(node, object, number));
        }
        objects::VL_FACTOR_NUMERATOR => joint.velocity_numerator = number as i32,
        objects::VL_FACTOR_DENOMINATOR => {
            let scale = arm.profile.velocity_scale.at(joint.velocity_numerator, number as i32);
            joint.velocity_count = scale.ok_or(Cause::Implausible(node, object, number))?;
        }
        _ => {}
    }
    Ok(())
}

/// Judges the device type and the identity.
fn judge_identity<const N: usize>(
    arm: &mut Arm<N>,
    j: usize,
    object: Object,
    number: Result<u32, SdoError>,
) -> Result<(), Cause> {
    let node = arm.node(j);
    let (Some(profile), Some(joint)) = (arm.profile.joints.get(j), arm.joints.get_mut(j)) else {
        return Ok(());
    };
    let (id, [vendor, product, revision, serial]) = (profile.identity, &mut joint.identity);
    let (place, expected) = match object {
        DEVICE_TYPE => (&mut joint.device_type, Some(DRIVES)),
        VENDOR_ID => (vendor, id.vendor),
        PRODUCT_CODE => (product, id.product),
        REVISION => (revision, id.revision),
        _ => (serial, id.serial),
    };
    *place = number.ok();
    // The high bits of the device type say what kind of drive it is.
    let same = |found: u32, expected| match object {
        DEVICE_TYPE => found & 0xFFFF == expected,
        _ => found == expected,
    };
    // A drive need not have every part; what the profile knows, it must have.
    let (deviation, acceptable) = match (number, expected) {
        (Ok(found), Some(expected)) if !same(found, expected) => {
            (Cause::WrongIdentity(node, object, expected, found), true)
        }
        (Ok(_), _) | (Err(SdoError::Aborted(_)), None) => return Ok(()),
        (Err(error), _) => (Cause::Sdo(node, object, error), matches!(error, SdoError::Aborted(_))),
    };
    if arm.other_nodes && acceptable {
        arm.note(deviation);
        return Ok(());
    }
    Err(deviation)
}

/// Configured and verified: process data begins.
pub(super) fn begin_cycles<const N: usize>(arm: &mut Arm<N>, tx: &mut impl Transmit) {
    let now = arm.now;
    for joint in &mut arm.joints {
        joint.presence.begin(now);
        (joint.status, joint.mode, joint.nmt) = (None, None, None);
    }
    arm.manage(nmt::Command::Start, tx);
}

/// While the first process data is awaited, since `since`: whether a joint has come too late, and why.
pub(super) fn first_data<const N: usize>(arm: &Arm<N>, since: Micros) -> Option<Cause> {
    let expected = arm.mode().mode;
    let missing = || arm.joints.iter().position(|joint| joint.presence.missing() > 0);
    let j = arm.unready().or_else(missing)?;
    if arm.elapsed(since) < arm.profile.reactions.transition_timeout {
        return None;
    }
    let (node, joint) = (arm.node(j), arm.joints.get(j)?);
    Some(match (joint.state(), joint.mode) {
        (None, _) | (_, None) => Cause::DataMissing(node),
        (Some(state), _) if !may_be_enabled(state) => {
            Cause::Transition(node, state, State::SwitchOnDisabled, Hindrance::of(joint.status, true))
        }
        (_, Some(mode)) if mode != expected => Cause::WrongMode(node, mode),
        _ => Cause::DataMissing(node),
    })
}
