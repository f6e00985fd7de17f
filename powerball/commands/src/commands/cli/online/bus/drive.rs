//! `powerball bus enable`, `stop` and `move`.

use super::super::envelope::Surroundings;
use super::super::{motion, output};
use super::{Consent, Failure, Where, master, refused};
use crate::procedure::{RecordError, Recorder};
use clap::Args;
use powerball_bus::canopen::{NodeId, nmt};
use powerball_bus::cia402::{Command, Controlword, Statusword};
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::driver::{ControlMode, Phase};
#[cfg(unix)]
use powerball_bus::transport;
use powerball_bus::transport::{ArmError, Bus, BusUrl, Master, Moment};
use powerball_identification::mounting::Mounting;
use serde_json::json;
#[cfg(unix)]
use std::io::Write as _;
use std::time::Duration;

/// For bringing the arm up and for enabling it, µs: joints commutate one after the other.
const PATIENCE: u64 = 60_000_000;

/// Configure all drives, enable them, hold the arm where it is, and let go again.
///
/// Boots and configures the nodes, verifies it, releases the brakes, searches the commutation where it is
/// lost (a small jerk of each joint), holds for `--hold` seconds, then closes the brakes. THE ARM HAS TORQUE
/// MEANWHILE.
#[derive(Args, Debug)]
#[command(after_help = "Example: powerball bus enable --bus socketcan:can0 --hold 5")]
pub(crate) struct Enable {
    #[command(flatten)]
    place: Where,
    #[command(flatten)]
    consent: Consent,
    /// Holds the arm for this many seconds.
    #[arg(long, default_value_t = 2.0, value_name = "SECONDS")]
    hold: f64,
}

/// Stop whatever the drives do: quick stop to all of them at once, then their brakes, then no torque.
///
/// Needs no configuration and changes none: an SDO to each drive, as for a program that died.
#[derive(Args, Debug)]
#[command(after_help = "Example: powerball bus stop --bus socketcan:can0")]
pub(crate) struct Stop {
    #[command(flatten)]
    place: Where,
    /// Stop them when the process at the other end of standard input has died, not before.
    #[cfg(unix)]
    #[arg(long, hide = true)]
    watchdog: bool,
}

/// Move one joint slowly to a position, and let go again.
///
/// As `enable`, and the joint goes to `--to` (or by `--by`) at `--speed` in interpolated position mode.
/// Before the brakes open the way is checked as by `powerball record`: limits, torque, floor, links.
#[derive(Args, Debug)]
#[command(after_help = "Example: powerball bus move --joint 6 --by 0.1 --speed 0.1 --bus socketcan:can0")]
pub(crate) struct Move {
    #[command(flatten)]
    place: Where,
    #[command(flatten)]
    consent: Consent,
    /// The joint, from 1 at the base.
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=6))]
    joint: u8,
    /// Where to, rad.
    #[arg(
        long,
        value_name = "RAD",
        allow_negative_numbers = true,
        required_unless_present = "by",
        conflicts_with = "by"
    )]
    to: Option<f64>,
    /// How far, rad.
    #[arg(long, value_name = "RAD", allow_negative_numbers = true)]
    by: Option<f64>,
    /// Share of the joint's greatest velocity and acceleration, 0.01 to 0.5.
    #[arg(long = "speed", value_name = "SHARE", default_value_t = 0.1)]
    velocity: f64,
    /// How the base stands: filed, ROLL,PITCH in degrees, or gravity in the base frame as X,Y,Z in m/s².
    #[arg(long, default_value = "filed", allow_hyphen_values = true)]
    mounting: Mounting,
    #[command(flatten)]
    surroundings: Surroundings,
}

impl Enable {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let hold = Duration::try_from_secs_f64(self.hold)
            .map_err(|_| Failure::Unusable("--hold needs a number of seconds".to_string()))?;
        let mut master = master(&self.place, self.consent)?;
        let arm = |e: ArmError| refused(e);
        master.driver_mut().start(ControlMode::InterpolatedPosition, false).map_err(refused)?;
        master.wait_for(Phase::Ready, PATIENCE).map_err(arm)?;
        master.driver_mut().enable().map_err(refused)?;
        master.wait_for(Phase::Running, PATIENCE).map_err(arm)?;
        output::notice(&format!("powerball: enabled; holding for {} s", self.hold));
        let held = master.driver().positions();
        let until = master.bus().now() + hold.as_micros() as u64;
        while master.bus().now() < until {
            if master.step(until).map_err(refused)? == Moment::Cycle {
                master.driver_mut().set(&held).map_err(refused)?;
            }
            master.check().map_err(arm)?;
        }
        let [position, torque] = joints(&master);
        master.stop().map_err(arm)?;
        if self.place.json {
            let result = json!({
                "bus": self.place.bus.to_string(), "position": position, "torque": torque, "seconds": self.hold,
                "cycles": master.driver().counters().cycles, "late": master.driver().counters().late,
            });
            output::data(&result.to_string());
        } else {
            output::print(&format!("held for {} s at {}; brakes closed", self.hold, list(&position)));
        }
        Ok(())
    }
}

/// Positions, rad, and torques, N·m.
fn joints(master: &Master<Box<dyn Bus>, 6>) -> [Vec<f64>; 2] {
    let joints = master.driver().joints();
    [joints.iter().map(|joint| joint.position).collect(), joints.iter().map(|joint| joint.torque).collect()]
}

fn list(values: &[f64]) -> String {
    let words: Vec<String> = values.iter().map(|q| format!("{q:.4}")).collect();
    format!("({}) rad", words.join(", "))
}

impl Stop {
    /// The bus, when it is time to stop the arm. Nothing may be in the way then, not even a word on standard
    /// error.
    fn bus(&self) -> Result<Box<dyn Bus>, Failure> {
        #[cfg(unix)]
        if self.watchdog {
            let open = || transport::open(&self.place.bus).map_err(refused);
            // This shows that it can be opened. Then it is opened again, without old data to read.
            drop(open()?);
            transport::Watchdog::wait().map_err(refused)?;
            return open();
        }
        self.place.open()
    }

    pub(crate) fn run(self) -> Result<(), Failure> {
        use powerball_bus::canopen::client::Value;
        use powerball_bus::cia402::objects::{CONTROLWORD, STATUSWORD};
        use powerball_bus::transport::blocking;
        let mut bus = self.bus()?;
        let nodes: Vec<NodeId> = LWA4P.joints.iter().map(|joint| joint.node).collect();
        // In one frame for all of them: leaving "operational" ends the set-points of whoever gives them. Then
        // the stop, to all drives before any answer is awaited.
        bus.send(&nmt::Command::EnterPreOperational.frame(None)).map_err(refused)?;
        let words = [
            (Controlword::command(Command::QuickStop), 400_000),
            (Controlword::command(Command::QuickStop).with(Controlword::HALT), 100_000),
            (Controlword::command(Command::DisableVoltage), 50_000),
        ];
        for (word, pause) in words {
            blocking::write_all(&mut *bus, &nodes, CONTROLWORD, Value::number(i64::from(word.0), 2));
            super::wait(&mut *bus, pause)?;
        }
        #[cfg(unix)]
        if self.watchdog {
            let message =
                "powerball: the process that moved the arm has died; all drives were commanded to stop";
            let _ = writeln!(std::io::stderr(), "{message}");
        }
        let answers = blocking::read_all(&mut *bus, &nodes, STATUSWORD);
        let (mut states, mut stopped, mut failed) = (Vec::new(), Vec::new(), Vec::new());
        for (node, answer) in nodes.iter().zip(answers) {
            match answer {
                Ok(value) => {
                    let status = Statusword(value.unsigned().unwrap_or(0) as u16);
                    states.push((node.raw(), status.state()));
                    if status.state().has_torque() {
                        failed.push(format!("node {node}: still has torque, statusword {status:?}"));
                    } else {
                        stopped.push(node.raw());
                    }
                }
                Err(e) => failed.push(e.to_string()),
            }
        }
        if self.place.json {
            let states: Vec<_> = states
                .iter()
                .map(|(node, state)| json!({ "node": node, "state": state.to_string() }))
                .collect();
            let result = json!({
                "bus": self.place.bus.to_string(), "stopped": stopped, "silent": failed, "states": states,
            });
            output::data(&result.to_string());
        } else {
            let states: Vec<String> =
                states.iter().map(|(node, state)| format!("node {node}: {state}")).collect();
            output::print(&format!("stopped: nodes {stopped:?}\n{}", states.join("\n")));
        }
        if failed.is_empty() { Ok(()) } else { Err(Failure::Refused(failed.join("\n"))) }
    }
}

impl Move {
    pub(crate) fn run(self) -> Result<(), Failure> {
        if !(0.01..=0.5).contains(&self.velocity) {
            return Err(Failure::Unusable("--speed is a share from 0.01 to 0.5".to_string()));
        }
        let index = usize::from(self.joint) - 1;
        let limits = LWA4P.joints[index].position;
        let wrong = |to: f64| {
            Failure::Unusable(format!(
                "{to:.4} rad is not within the limits of joint {}, {:.3} to {:.3} rad",
                self.joint, limits[0], limits[1]
            ))
        };
        let allowed = |to: f64| (limits[0]..=limits[1]).contains(&to);
        if let Some(to) = self.to.filter(|to| !allowed(*to)) {
            return Err(wrong(to));
        }
        if self.by.is_some_and(|by| !by.is_finite()) {
            return Err(Failure::Unusable("--by needs a number of rad".to_string()));
        }
        let arm = |e: RecordError| refused(e);
        let envelope = self.surroundings.envelope(&self.surroundings.arm()?, &self.mounting)?;
        let mut recorder = Recorder::bring_up(master(&self.place, self.consent)?, envelope)
            .map_err(arm)?
            .with_progress(motion::live());
        let from = recorder.master().driver().positions();
        let mut to = from;
        to[index] = self.to.unwrap_or(from[index] + self.by.unwrap_or(0.0));
        if !allowed(to[index]) {
            return Err(Failure::Refused(wrong(to[index]).reason().to_string()));
        }
        recorder.way_to(&to, self.velocity, 1.0).map_err(arm)?;
        recorder.release().map_err(arm)?;
        recorder.go(&to, self.velocity, 1.0).map_err(arm)?;
        // Until the drives' interpolation has caught up.
        recorder.go(&to, self.velocity, 0.3).map_err(arm)?;
        let at = recorder.master().driver().positions();
        let master = recorder.finish().map_err(arm)?;
        let off = (at[index] - to[index]).abs();
        if off > LWA4P.joints[index].following_error {
            return Err(Failure::Refused(format!(
                "joint {} is at {:.4} rad and not at {:.4} rad: is it blocked?",
                self.joint, at[index], to[index]
            )));
        }
        if self.place.json {
            let result = json!({
                "bus": self.place.bus.to_string(), "joint": self.joint, "from": from[index], "to": to[index],
                "at": at[index], "position": at, "late": master.driver().counters().late,
            });
            output::data(&result.to_string());
        } else {
            let clock = if self.place.bus == BusUrl::Virtual { " (virtual)" } else { "" };
            output::print(&format!(
                "joint {} went from {:.4} to {:.4} rad in {:.1} s{clock}; brakes closed",
                self.joint,
                from[index],
                at[index],
                master.bus().now() as f64 * 1e-6
            ));
        }
        Ok(())
    }
}
