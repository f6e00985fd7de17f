//! The arm as a hardware interface sees it: its lifecycle, and one cycle a call.

use powerball::bus::driver::lwa4p::LWA4P;
use powerball::bus::driver::{ControlMode, Driver, Phase, TorqueGuard};
use powerball::bus::transport::{self, Bus, BusUrl, Master, Memory, Moment};
use powerball::identification::excite::Masses;
use powerball::identification::mounting::Mounting;
use powerball::procedure::{Envelope, built_in_masses};
use powerball::virtual_arm::{VirtualArm, lwa4p};
use std::path::Path;

/// The arm's joints.
pub const JOINTS: usize = 6;

/// For booting, configuring and verifying the drives, and for enabling them, µs: joints commutate one after
/// the other.
const PATIENCE: u64 = 60_000_000;
/// For the built-in arm's drives to boot, µs.
const BOOT: u64 = 200_000;

/// What the joints do: rad, rad/s, N·m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// rad
    pub position: [f64; JOINTS],
    /// rad/s
    pub velocity: [f64; JOINTS],
    /// N·m, from the current; as good as the profile's calibration.
    pub effort: [f64; JOINTS],
}

/// An arm on its bus, in interpolated position mode. It has no thread of its own: time passes on the bus
/// while one of its functions is called.
#[derive(Debug)]
pub struct Arm {
    master: Master<Box<dyn Bus>, JOINTS>,
}

impl Arm {
    /// Opens a bus by its name, as `powerball bus --bus` takes it. Nothing is sent.
    ///
    /// # Errors
    /// In words.
    pub fn open(url: &str) -> Result<Arm, String> {
        let url: BusUrl = url.parse().map_err(|e: transport::UrlError| e.to_string())?;
        let bus: Box<dyn Bus> = match url {
            BusUrl::Virtual => {
                let setup = lwa4p::setup([0.0; JOINTS], 1).map_err(|e| e.to_string())?;
                let arm = VirtualArm::new(setup).ok_or("the built-in arm's parts do not fit")?;
                let mut memory = Memory::new(arm, LWA4P.bitrate);
                let until = memory.now() + BOOT;
                while memory.receive(until).map_err(|e| e.to_string())?.is_some() {}
                Box::new(memory)
            }
            other => transport::open(&other).map_err(|e| e.to_string())?,
        };
        let driver = Driver::new(LWA4P).map_err(|e| e.to_string())?;
        Ok(Arm { master: Master::new(driver, bus) })
    }

    /// From now on no set-point leaves for which the model asks more torque of a joint than it has.
    pub fn guard_torque(&mut self, guard: TorqueGuard<JOINTS>) {
        self.master.driver_mut().guard_torque(guard);
    }

    /// As [`Self::guard_torque`], with the model of the built-in arm, mounted as stated (`filed`,
    /// `ROLL,PITCH` in degrees, or gravity in the base frame as `X,Y,Z` in m/s²). Masses and friction are
    /// those of an identified.json or a values file, or, where there is none, the CAD model's and the
    /// published friction. It allocates in each [`Arm::write`].
    ///
    /// # Errors
    /// A mounting or a file that cannot be read, in words.
    pub fn guard_model(&mut self, mounting: &str, values: Option<&Path>) -> Result<(), String> {
        let mounting: Mounting = mounting.parse()?;
        let arm = lwa4p::arm().map_err(|e| e.to_string())?;
        let masses = match values {
            Some(path) => Masses::read(path, &arm).map_err(|e| e.to_string())?,
            None => built_in_masses(),
        };
        let envelope =
            Envelope::<JOINTS>::of(&arm, &mounting, None, Some(&masses)).map_err(|e| e.to_string())?;
        self.guard_torque(envelope.torque_guard().ok_or("the built-in arm has no torque model")?);
        Ok(())
    }

    /// From the next [`Arm::configure`] on, drives whose device type or identity is another than the profile
    /// says are used.
    pub fn accept_other_drives(&mut self) {
        self.master.driver_mut().accept_other_nodes();
    }

    /// Boots, identifies, configures and verifies all drives; nothing moves. SYNC runs from here on:
    /// [`Arm::read`] must be called each cycle.
    ///
    /// # Errors
    /// Why a drive is not as it must be.
    pub fn configure(&mut self) -> Result<(), String> {
        self.master
            .driver_mut()
            .start(ControlMode::InterpolatedPosition, false)
            .map_err(|e| e.to_string())?;
        self.master.wait_for(Phase::Ready, PATIENCE).map_err(|e| e.to_string())
    }

    /// Releases the brakes and holds the arm where it is. THE ARM HAS TORQUE from here on.
    ///
    /// # Errors
    /// Where the arm was not configured, or a drive does not come to "operation enabled".
    pub fn activate(&mut self) -> Result<(), String> {
        self.master.driver_mut().enable().map_err(|e| e.to_string())?;
        self.master.wait_for(Phase::Running, PATIENCE).map_err(|e| e.to_string())
    }

    /// Waits for the next SYNC and the drives' data that follows it, and gives it: a cycle at most.
    ///
    /// # Errors
    /// The cause that stopped the arm, or that the bus is gone.
    pub fn read(&mut self) -> Result<State, String> {
        let period = LWA4P.sync_period;
        let until = self.master.bus().now() + 2 * period;
        let mut synced = false;
        loop {
            match self.master.step(until).map_err(|e| e.to_string())? {
                Moment::Cycle if synced => break,
                Moment::Cycle => synced = true,
                Moment::Data if synced => break,
                Moment::Over => break,
                Moment::Data | Moment::Other => {}
            }
            if matches!(self.master.driver().phase(), Phase::Stopping | Phase::Faulted) {
                return Err(self.stopped());
            }
        }
        let joints = self.master.driver().joints();
        Ok(State {
            position: joints.map(|joint| joint.position),
            velocity: joints.map(|joint| joint.velocity),
            effort: joints.map(|joint| joint.torque),
        })
    }

    /// The positions, rad, to act with the next SYNC; waits until they have left, less than a cycle.
    ///
    /// # Errors
    /// Why they may not leave. The arm goes on as it went; the third such cycle in a row stops it.
    pub fn write(&mut self, position: &[f64; JOINTS]) -> Result<(), String> {
        let set = self.master.driver_mut().set(position).map_err(|e| e.to_string());
        let slot = self.master.driver().synced_at() + self.master.driver().budget().setpoint_slot();
        while self.master.bus().now() < slot {
            if self.master.step(slot).map_err(|e| e.to_string())? == Moment::Cycle {
                break;
            }
        }
        set
    }

    /// Stops the arm: brakes closed, no torque. [`Arm::activate`] may follow.
    ///
    /// # Errors
    /// Where a cause is latched, or the arm does not come to rest.
    pub fn deactivate(&mut self) -> Result<(), String> {
        self.master.stop().map_err(|e| e.to_string())
    }

    /// After an error: waits until the arm stands, says why it was stopped, and acknowledges it. Nothing
    /// moves; [`Arm::activate`] may follow where this gives true, [`Arm::configure`] where it gives false.
    ///
    /// # Errors
    /// Where the arm does not come to rest.
    pub fn on_error(&mut self) -> Result<bool, String> {
        // A cause that is latched is what this is called for.
        if let Err(why) = self.master.stop()
            && self.master.driver().phase() != Phase::Faulted
        {
            return Err(why.to_string());
        }
        if self.master.driver().phase() == Phase::Faulted {
            self.master.driver_mut().acknowledge().map_err(|e| e.to_string())?;
        }
        let until = self.master.bus().now() + 2_000_000;
        while !matches!(self.master.driver().phase(), Phase::Ready | Phase::Idle) {
            if self.master.step(until).map_err(|e| e.to_string())? == Moment::Over {
                return Err(format!("the driver {}", self.master.driver().phase()));
            }
        }
        Ok(self.master.driver().phase() == Phase::Ready)
    }

    fn stopped(&self) -> String {
        match self.master.driver().cause() {
            Some(cause) => format!("the arm was stopped: {cause}"),
            None => "the arm is being stopped".to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn active() -> Arm {
        let mut arm = Arm::open("virtual").unwrap();
        arm.configure().unwrap();
        arm.activate().unwrap();
        arm
    }

    /// Moves joint 6 to `to` at 0.2 rad/s.
    fn go(arm: &mut Arm, to: f64) {
        let mut position = arm.read().unwrap().position;
        let from = position[5];
        let steps = ((to - from).abs() / 0.001).ceil();
        for k in 0..=steps as usize {
            let x = k as f64 / steps;
            position[5] = from + (to - from) * x * x * (3.0 - 2.0 * x);
            arm.write(&position).unwrap();
            arm.read().unwrap();
        }
        for _ in 0..20 {
            arm.write(&position).unwrap();
            arm.read().unwrap();
        }
    }

    #[test]
    fn a_joint_goes_where_it_is_written() {
        let mut arm = active();
        go(&mut arm, 0.1);
        let state = arm.read().unwrap();
        assert!((state.position[5] - 0.1).abs() < 2e-3, "{state:?}");
        arm.deactivate().unwrap();
        arm.activate().unwrap();
        go(&mut arm, 0.05);
        arm.deactivate().unwrap();
    }

    #[test]
    fn set_points_that_must_not_leave_stop_the_arm_and_are_acknowledged() {
        let mut arm = active();
        let mut position = arm.read().unwrap().position;
        position[2] += 0.5;
        let mut refusals = Vec::new();
        let stopped = (0..10).find_map(|_| {
            refusals.extend(arm.write(&position).err());
            arm.read().err()
        });
        assert!(refusals[0].contains("joint 3"), "{refusals:?}");
        assert!(stopped.is_some_and(|why| why.contains("rejected")), "{refusals:?}");
        assert!(arm.activate().is_err());
        assert!(arm.on_error().unwrap());
        arm.activate().unwrap();
        arm.deactivate().unwrap();
    }

    /// A joint that the model says has no torque beyond a place stops before it; the built-in model holds
    /// nothing back that the arm can do, and a mounting or a file that is none is reported.
    #[test]
    fn what_takes_more_torque_than_a_joint_has_does_not_leave() {
        let mut arm = Arm::open("virtual").unwrap();
        arm.guard_torque(TorqueGuard::new(&|q, _, _| {
            [0.0, 0.0, 0.0, 0.0, 0.0, if q[5] > 0.05 { 1e3 } else { 0.0 }]
        }));
        arm.configure().unwrap();
        arm.activate().unwrap();
        let mut position = arm.read().unwrap().position;
        let mut refused = None;
        while refused.is_none() && position[5] < 0.1 {
            position[5] += 1e-4;
            refused = arm.write(&position).err();
            // What goes on as it went would have no torque either: the driver stops the arm.
            assert!(arm.read().is_ok() || refused.is_some());
        }
        let refusal = refused.unwrap();
        assert!(refusal.contains("joint 6") && refusal.contains("N·m"), "{refusal}");
        assert!((position[5] - 0.05).abs() < 2e-4, "{position:?}");

        let mut arm = Arm::open("virtual").unwrap();
        assert!(arm.guard_model("sideways", None).unwrap_err().contains("no mounting"));
        let missing = arm.guard_model("filed", Some(Path::new("nowhere.json"))).unwrap_err();
        assert!(missing.contains("nowhere.json: cannot be read"), "{missing}");
        arm.guard_model("filed", None).unwrap();
        arm.configure().unwrap();
        arm.activate().unwrap();
        go(&mut arm, 0.1);
        arm.deactivate().unwrap();
    }

    #[test]
    fn a_caller_that_is_away_finds_the_arm_stopped_or_going_on() {
        assert!(Arm::open("nowhere").unwrap_err().contains("is not a bus"));
        let mut arm = Arm::open("virtual").unwrap();
        assert!(arm.activate().is_err());
        assert!(arm.write(&[0.0; JOINTS]).is_err());
    }
}
