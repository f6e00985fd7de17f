//! `powerball float`: hand guiding.

use super::model_on_bus::{ModelOnBus, failed};
use super::serve::{self, Serve};
use super::{Failure, motion, output};
use crate::commands::model_arm::{self, ModelArm};
use crate::procedure::torque_loop::TorqueLoop;
use crate::procedure::{Envelope, Recorder};
use clap::Args;
use nalgebra::SVector;
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::transport::BusUrl;
use powerball_controller::correction::Memory;
use powerball_controller::dynamics::ArmModel;
use powerball_controller::friction::TanhFriction;
use powerball_controller::laws::{HandGuiding, Softening};
use powerball_logs::motion::Motion;
use powerball_virtual_arm::slave::{Hand, HandLog, HandSample};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// The hand of --push: N·m/rad and N·m·s/rad.
const HAND: [f64; 2] = [300.0, 20.0];
/// A hand may push with this part of each joint's torque before the driver's guard takes it for a drive that
/// does not obey.
pub(super) const PUSH: f64 = 0.4;
/// Drift counts from this long after the hand let go, s.
const SETTLE: f64 = 1.0;
/// Without a hand and without --for the virtual arm floats for this long, s.
const ALONE: f64 = 10.0;

/// Take weight and friction off the hand that guides the arm, in the drives' current mode; an arm that rests
/// is not pushed.
///
/// Nothing of this was run on hardware by this project: try --bus virtual first. Effects of the model that
/// depend on positions alone (springs, ripple, constant torques) are taken off as well, those that are
/// friction are left to the hand. The arm is enabled where it stands. Set-points pass the driver's guards,
/// which stop the arm beyond its limits; Ctrl-C stops it. THE ARM IS LOOSE: WHATEVER THE MODEL GETS WRONG OF
/// ITS WEIGHT MOVES IT.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  \
    powerball float --arm demo/arm.toml --model demo/model.json --plant demo/virtual_arm.json --push \
    push.csv\n  powerball float --model model.json --bus socketcan:can0 --accept-unverified --for 60\n\n\
    --push: CSV with t and q1…q6 (rad). A hand (300 N·m/rad, 20 N·m·s/rad at each joint) pulls the virtual \
    arm along it, from where it begins, and lets go at its end.")]
pub(crate) struct FloatCommand {
    #[command(flatten)]
    on: ModelOnBus,
    /// A hand that pulls the virtual arm's joints along a path.
    #[arg(long, value_name = "FILE")]
    push: Option<PathBuf>,
    /// Floats for this many seconds; else until Ctrl-C, or 10 s after the hand has let go.
    #[arg(long = "for", value_name = "SECONDS")]
    seconds: Option<f64>,
    /// Share of the friction that is taken off, 0 to 0.95.
    #[arg(long, value_name = "SHARE", default_value_t = 0.85)]
    friction: f64,
    /// Folder for log.csv, with the columns of `powerball record`, a whole line a cycle; made if missing.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    serve: Serve,
}

impl FloatCommand {
    pub(crate) fn run(mut self) -> Result<(), Failure> {
        if self.seconds.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
            return Err(Failure::Unusable("--for needs a number of seconds above 0".to_string()));
        }
        if !(0.0..=0.95).contains(&self.friction) {
            return Err(Failure::Unusable(format!(
                "--friction {}: give 0 to 0.95; with more, an arm with less friction than its model would \
                    start to move by itself",
                self.friction
            )));
        }
        let virtual_bus = self.on.place.bus == BusUrl::Virtual;
        if self.push.is_some() && !virtual_bus {
            return Err(Failure::Unusable("--push works only with --bus virtual".to_string()));
        }
        let (_, model, envelope) = self.on.read()?;
        let push = self.push.as_deref().map(read_push).transpose()?;
        let log = HandLog::default();
        let start = push.as_ref().map_or([0.0; 6], |path| std::array::from_fn(|j| path.q[j]));
        let until = push.as_ref().map_or(0.0, Motion::duration);
        let hand = push.map(|path| Hand::new(path, HAND, log.clone()));
        let seconds = self.seconds.or(virtual_bus.then_some(until + ALONE));

        let positions = self.float(&model, start, hand, envelope, seconds)?;
        let hand = log.lock().map(|log| guided(&model, &log, until)).unwrap_or_default();
        let period = LWA4P.period_seconds();
        let rest = positions.get(((until + SETTLE) / period) as usize..).unwrap_or_default();
        let drift: Vec<f64> =
            (0..6).map(|j| rest.iter().fold(0.0f64, |most, q| most.max((q[j] - rest[0][j]).abs()))).collect();
        let position = positions.last().map(|q| q.as_slice().to_vec()).unwrap_or_default();
        let result = json!({
            "seconds": positions.len() as f64 * period, "position": position, "drift": drift,
            "drift_time": rest.len() as f64 * period, "hand": hand, "plant": self.on.plant(),
        });
        match self.on.place.json {
            true => output::data(&result.to_string()),
            false => said(&result),
        }
        Ok(())
    }

    /// Positions by cycle, rad.
    fn float(
        &self,
        model: &ModelArm,
        start: [f64; 6],
        hand: Option<Hand>,
        envelope: Envelope<6>,
        seconds: Option<f64>,
    ) -> Result<Vec<SVector<f64, 6>>, Failure> {
        let refused = |e: crate::procedure::RecordError| Failure::Refused(e.to_string());
        // Before a motor is switched on: a folder of others ends the command.
        let mut log = self.out.as_deref().map(|out| motion::motion_log(out, &[])).transpose()?;
        let master = self.on.master(LWA4P, start, hand)?;
        // In interpolated position mode the motors find their commutation while their drives hold the arm.
        let master = Recorder::enable(master, envelope).and_then(Recorder::finish).map_err(refused)?;
        let mut arm = TorqueLoop::bring_up(master, self.on.accepts()).map_err(refused)?;
        arm.guard(model_arm::torque_guard(model).with_push(PUSH));
        let laws: [TanhFriction<f64>; 6] =
            std::array::from_fn(|j| TanhFriction::new(model.model.gammas()[j]));
        let softening = laws.each_ref().map(|law| Softening { share: self.friction, ..Softening::of(law) });
        let mut law = HandGuiding::new(laws, softening);
        let terms = model.model.holding_terms();
        let mut memory = vec![Memory::default(); terms.len()];
        let changes = &model.model.additions.log_changes;
        let live = self.serve.open()?;
        live.start("an arm guided by hand", &[("position", "rad"), ("velocity", "rad/s"), ("torque", "N·m")]);
        let most = seconds.map(|s| (s / LWA4P.period_seconds()) as usize);
        let mut positions = Vec::new();
        arm.run(log.as_mut(), |measured| {
            if most.is_some_and(|most| positions.len() >= most) {
                return None;
            }
            positions.push(measured.state.q);
            let mut torque = law.torque(&model.numeric, &measured.state);
            model_arm::hold(changes, &terms, &mut memory, &measured.state, &mut torque);
            let t = positions.len() as f64 * LWA4P.period_seconds();
            if positions.len() % serve::EVERY == 0 {
                let q = measured.state.q.as_slice();
                live.sample(
                    "",
                    t,
                    &[
                        ("position", q),
                        ("velocity", measured.state.dq.as_slice()),
                        ("torque", torque.as_slice()),
                    ],
                );
            }
            if self.on.place.bus == BusUrl::Virtual {
                live.wait_until(t);
            }
            Some(torque)
        })
        .map_err(refused)?;
        if arm.carried_on() > 0 {
            let cycles = arm.carried_on();
            tracing::warn!(
                "data of a joint was missing in {cycles} cycles: its state was extrapolated with its last \
                    velocity"
            );
        }
        arm.finish().map_err(refused)?;
        log.map_or(Ok(()), motion::close)?;
        live.end("brakes closed");
        Ok(positions)
    }
}

fn read_push(file: &Path) -> Result<Motion, Failure> {
    let name = file.display();
    let text =
        dyngen::file::text(file).map_err(|e| Failure::Unusable(format!("{name}: cannot be read: {e}")))?;
    let path = Motion::from_csv(&text, 6).map_err(|why| Failure::Unusable(format!("{name}: {why}")))?;
    if path.len() < 2 || path.period <= 0.0 {
        return Err(failed(
            crate::procedure::RecordError::Motion("at least two samples are needed".into()),
            file,
        ));
    }
    Ok(path)
}

/// The load of the hand while it pulled: its torque, and the torque of friction and inertia alone, N·m rms by
/// joint.
fn guided(model: &ModelArm, log: &[HandSample], until: f64) -> Value {
    let held: Vec<&HandSample> = log.iter().filter(|s| s.t < until).collect();
    if held.is_empty() {
        return Value::Null;
    }
    let gammas = model.model.gammas();
    let rms = |of: &dyn Fn(&HandSample, usize) -> f64| -> Vec<f64> {
        let mean = |j: usize| held.iter().map(|s| of(s, j).powi(2)).sum::<f64>() / held.len() as f64;
        (0..6).map(|j| mean(j).sqrt()).collect()
    };
    let peak = |j: usize| held.iter().fold(0.0f64, |most, s| most.max(s.torque[j].abs()));
    let gravity = |s: &HandSample, j: usize| model.numeric.gravity(&SVector::from_column_slice(&s.q))[j];
    json!({
        "seconds": until,
        "rms": rms(&|s, j| s.torque[j]),
        "peak": (0..6).map(peak).collect::<Vec<f64>>(),
        "friction_rms": rms(&|s, j| TanhFriction::new(gammas[j]).torque(s.dq[j])),
        "weight_rms": rms(&gravity),
    })
}

fn said(result: &Value) {
    let list = |value: &Value, scale: f64| -> String {
        let numbers = value.as_array().into_iter().flatten().filter_map(Value::as_f64);
        numbers.map(|x| format!("{:.2}", scale * x)).collect::<Vec<_>>().join(", ")
    };
    if !result["hand"].is_null() {
        let hand = &result["hand"];
        output::print(&format!("the hand gave {} N·m rms", list(&hand["rms"], 1.0)));
        output::print(&format!("friction alone takes {} N·m rms", list(&hand["friction_rms"], 1.0)));
        output::print(&format!("the weight is {} N·m rms", list(&hand["weight_rms"], 1.0)));
    }
    let time = result["drift_time"].as_f64().unwrap_or(0.0);
    output::print(&format!("hands off, it drifted by {} mrad in {time:.1} s", list(&result["drift"], 1e3)));
}
