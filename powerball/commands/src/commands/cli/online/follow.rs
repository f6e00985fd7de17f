//! `powerball follow`: a trajectory with a torque model.

use super::float::PUSH;
use super::model_on_bus::{ModelOnBus, failed};
use super::serve::{self, Live, Serve};
use super::{Failure, motion, output};
use crate::commands::model_arm::{self, ModelArm};
use crate::procedure::Envelope;
use crate::procedure::follow::{Followed, Law, Parts, Path, Run, Sample, Track};
use crate::report::followed;
use clap::{Args, ValueEnum};
use nalgebra::SVector;
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::transport::BusUrl;
use powerball_controller::dynamics::{ArmModel, Reference};
use powerball_controller::laws::{ComputedTorque, ContactDetector, JointImpedance};
use powerball_logs::motion::Motion;
use std::path::PathBuf;

/// Springs of the joint impedance: swings of the joints, rad/s.
const SOFT: f64 = 8.0;

/// How the model is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum With {
    /// Interpolated positions with the model's torque as the drives' torque offset (0x60B2).
    Feedforward,
    /// Computed torque in the drives' current mode.
    Torque,
    /// Joint impedance in the drives' current mode.
    Impedance,
}

/// Follow a trajectory with a torque model and report the tracking error by joint; with --compare also with a
/// base model or with no model, one after the other.
///
/// Nothing of this was run on hardware by this project: try --bus virtual first. Writes follow.json,
/// report.html, and log.csv with the columns of `powerball record`, a whole line a cycle, also where the arm
/// is stopped: `identify` and `explain` read it. Before anything moves, the model is compared with the arm
/// file, the gains with the cycle (largest pole of the sampled loop over 300 poses), and the trajectory is
/// checked as by `powerball record`. Set-points, torque offsets and currents pass the driver's guards; Ctrl-C
/// stops the arm. THE ARM MOVES.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  powerball demo --effect spring --out demo\n  \
    powerball excite --arm demo/arm.toml --out path.csv\n  \
    powerball follow --trajectory path.csv --arm demo/arm.toml --model demo/model.json --plant \
    demo/virtual_arm.json --with torque --compare base --out followed\n\n\
    The delay of drives that interpolate (the same for all joints and runs) is estimated and removed from \
    the error.")]
pub(crate) struct FollowCommand {
    /// The trajectory: CSV with t, q1…q6 (rad), as `powerball excite` writes it at the arm's rate.
    #[arg(long, value_name = "FILE")]
    trajectory: PathBuf,
    #[command(flatten)]
    on: ModelOnBus,
    /// How the model is used.
    #[arg(long = "with", value_enum, default_value = "feedforward")]
    with: With,
    /// What to compare with: `base` (the model's rigid arm and friction alone), another model's file
    /// (reported as base), or `feedback` (nothing fed forward). May be repeated.
    #[arg(long, value_name = "base|FILE.json|feedback")]
    compare: Vec<String>,
    /// Bandwidth of the feedback in current mode, rad/s: 20 for computed torque at 200 Hz, 8 for impedance.
    #[arg(long, value_name = "RAD/S", allow_negative_numbers = true)]
    bandwidth: Option<f64>,
    /// Damping ratio of the feedback in current mode.
    #[arg(long, value_name = "RATIO", default_value_t = 1.0, allow_negative_numbers = true)]
    damping: f64,
    /// Stop the arm where its external torque is more than the model's error can be, in current mode:
    /// something touches it.
    #[arg(long)]
    stop_at_contact: bool,
    /// How far a push may take a joint off its path in current mode before the arm is stopped, rad, 0 to 0.5,
    /// in addition to what gains and model explain. For --with impedance, where somebody is to push the arm.
    #[arg(long, value_name = "RAD", default_value_t = 0.0, allow_negative_numbers = true)]
    give: f64,
    /// Time that the arm has been working, s: 3600 counts as warm. For models with a temperature effect.
    #[arg(long, value_name = "SECONDS", default_value_t = 3600.0)]
    running: f64,
    #[command(flatten)]
    serve: Serve,
    /// Folder for the results; made if missing.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// One of the runs: its name, its model, and the torques that it predicts for the path.
struct Entry {
    name: &'static str,
    model: ModelArm,
    parts: Option<Parts<6>>,
    contact: Option<ContactDetector<f64, 6>>,
}

/// The signals of a run on the page of --serve.
const FIELDS: [(&str, &str); 6] = [
    ("error", "mrad"),
    ("external_torque", "N·m"),
    ("rigid_arm", "N·m"),
    ("friction", "N·m"),
    ("effects", "N·m"),
    ("feedback", "N·m"),
];

fn show(live: &Live, run: &str, sample: &Sample<6>, reference: &Reference<f64, 6>) {
    let error = (sample.q - reference.q) * 1e3;
    let external = sample.external.unwrap_or_else(SVector::zeros);
    let [rigid, friction, effects] = &sample.forward;
    let values = [&error, &external, rigid, friction, effects, &sample.feedback];
    let mut fields = FIELDS.iter().zip(values).map(|((name, _), values)| (*name, values.as_slice()));
    let fields: [(&str, &[f64]); 6] = std::array::from_fn(|_| fields.next().unwrap_or_default());
    live.sample(run, sample.t, &fields);
}

impl FollowCommand {
    pub(crate) fn run(mut self) -> Result<(), Failure> {
        let file = self.trajectory.clone();
        let name = file.display();
        let text = dyngen::file::text(&file)
            .map_err(|e| Failure::Unusable(format!("{name}: cannot be read: {e}")))?;
        let motion = Motion::from_csv(&text, LWA4P.joints.len())
            .map_err(|why| Failure::Unusable(format!("{name}: {why}")))?;
        if self.stop_at_contact && self.with == With::Feedforward {
            let what = "--stop-at-contact needs --with torque or impedance: in interpolated position mode \
                the drives' own loops keep pushing";
            return Err(Failure::Unusable(what.to_string()));
        }
        if !(0.0..=0.5).contains(&self.give) {
            return Err(Failure::Unusable(format!("--give {}: give 0 to 0.5 rad", self.give)));
        }
        let (arm, model, mut envelope) = self.on.read()?;
        let profile = match self.with {
            With::Feedforward => LWA4P.with_torque_offset(),
            With::Torque | With::Impedance => LWA4P,
        };
        let path = Path::clear(&motion, &envelope, &profile).map_err(|e| failed(e, &file))?;
        let law = self.law(&model, path.start())?;
        let pole = self.judge(&law, &model, &path)?;
        let guard = model_arm::torque_guard(&model);
        let guard = if self.give > 0.0 { guard.with_push(PUSH) } else { guard };
        let entries = self.entries(&arm, model, &path)?;
        output::make_folder(&self.out)?;
        // All runs are compared with the torques of the explained model, which is the last one.
        let best = entries.last().and_then(|entry| entry.parts.clone()).unwrap_or_default();
        let live = self.serve.open()?;
        let (mut shown, mut seconds) = (0, 0.0);

        let mut log = motion::motion_log(&self.out, &[&self.trajectory])?;
        let mut master = self.on.master(profile, [0.0; 6], None)?;
        let terminal = output::Progress::new();
        let mut tracks: Vec<(&str, Track<6>)> = Vec::new();
        for Entry { name, model, parts, contact } in &entries {
            terminal.say(&format!("following with {name}"));
            live.start(&format!("{} along a path, {name}", arm.name), &FIELDS);
            let (path, arm, best) = (&path, &model.numeric, &best);
            let contact = *contact;
            let run = Run {
                path,
                arm,
                parts: parts.as_ref(),
                best,
                give: self.give,
                guard: Some(guard),
                law,
                contact,
                accept_unverified: self.on.accepts(),
            };
            let (back, track, kept): (_, _, Envelope<6>) = run
                .follow(master, envelope, Some(&mut log), |sample, reference| {
                    shown += 1;
                    seconds += path.motion().period;
                    if shown % serve::EVERY == 0 {
                        show(&live, name, sample, reference);
                    }
                    if self.on.place.bus == BusUrl::Virtual {
                        live.wait_until(seconds);
                    }
                })
                .map_err(|e| Failure::Refused(e.to_string()))?;
            (master, envelope) = (back, kept);
            let touched = track.contact.is_some();
            tracks.push((name, track));
            if touched {
                break;
            }
        }
        drop(master);
        motion::close(log)?;
        let done = self.report(&arm.name, &law, &path, &tracks, pole);
        live.end(&match &done {
            Ok(()) => format!("done: {}", self.out.join("report.html").display()),
            Err(failure) => failure.reason().to_string(),
        });
        done
    }

    fn law(&self, model: &ModelArm, start: SVector<f64, 6>) -> Result<Law<6>, Failure> {
        let period = LWA4P.period_seconds();
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let bandwidth = self.bandwidth();
        if bandwidth.is_some_and(|w| !positive(w)) || !positive(self.damping) {
            return Err(Failure::Unusable(format!(
                "--bandwidth and --damping must be above 0: a loop with {} rad/s and a ratio of {} is not \
                stable",
                bandwidth.unwrap_or_default(),
                self.damping
            )));
        }
        Ok(match self.with {
            With::Feedforward => Law::Feedforward,
            With::Torque => {
                let mut law = match self.bandwidth {
                    Some(w) => ComputedTorque::of_bandwidth(w),
                    None => ComputedTorque::for_period(period),
                };
                law.derivative *= self.damping;
                Law::Torque(law)
            }
            With::Impedance => {
                let inertia = model.numeric.mass_matrix(&start);
                Law::Impedance(JointImpedance::of_inertia(
                    &inertia,
                    self.bandwidth.unwrap_or(SOFT),
                    self.damping,
                ))
            }
        })
    }

    /// Bandwidth of the feedback, if this program closes the loop, rad/s.
    fn bandwidth(&self) -> Option<f64> {
        match self.with {
            With::Feedforward => None,
            With::Torque => Some(self.bandwidth.unwrap_or(0.1 / LWA4P.period_seconds())),
            With::Impedance => Some(self.bandwidth.unwrap_or(SOFT)),
        }
    }

    /// The largest pole of the loop, where this program closes it.
    fn judge(&self, law: &Law<6>, model: &ModelArm, path: &Path<6>) -> Result<Option<f64>, Failure> {
        let along = path.motion().samples().step_by(20).map(|[q, ..]| SVector::from_column_slice(q));
        let poses = model_arm::poses().into_iter().chain(along);
        let pole = law.judge(&model.numeric, poses, LWA4P.period_seconds()).map_err(Failure::Unusable)?;
        Ok((*law != Law::Feedforward).then_some(pole))
    }

    /// The runs, in order.
    fn entries(&self, arm: &dyngen::Arm, model: ModelArm, path: &Path<6>) -> Result<Vec<Entry>, Failure> {
        let mut entries = Vec::new();
        let read =
            |file: &std::path::Path, effects| model_arm::read(arm, file, effects).map_err(Failure::Unusable);
        for what in &self.compare {
            let (name, other) = match what.as_str() {
                "feedback" => ("feedback", read(&self.on.model, true)?),
                "base" => ("base", read(&self.on.model, false)?),
                file => ("base", read(file.as_ref(), true)?),
            };
            if entries.iter().any(|entry: &Entry| entry.name == name) {
                return Err(Failure::Unusable(format!("--compare: {name} is there twice")));
            }
            entries.push(Entry { name, model: other, parts: None, contact: None });
        }
        // The least first; the explained model is shown in detail, last.
        entries.sort_by_key(|entry| entry.name != "feedback");
        entries.push(Entry { name: "explained", model, parts: None, contact: None });
        for entry in entries.iter_mut().filter(|entry| entry.name != "feedback") {
            if self.stop_at_contact {
                entry.contact = Some(model_arm::contact_detector(&entry.model).map_err(Failure::Unusable)?);
            }
            let parts = model_arm::parts(&entry.model, path, self.running);
            entry.parts =
                Some(parts.map_err(|e| Failure::Refused(format!("by the {} model {e}", entry.name)))?);
        }
        Ok(entries)
    }

    fn report(
        &self,
        arm: &str,
        law: &Law<6>,
        path: &Path<6>,
        tracks: &[(&str, Track<6>)],
        largest_pole: Option<f64>,
    ) -> Result<(), Failure> {
        let (bandwidth, plant) = (self.bandwidth(), self.on.plant());
        let result = Followed { bandwidth, largest_pole, plant, ..Followed::of(arm, law, path, tracks) };
        let files = followed::files(&result, path, tracks).map_err(Failure::Refused)?;
        output::write_all(&files, &self.out)?;
        if self.on.place.json {
            output::data(&files.first());
        } else {
            Self::in_words(&result, tracks);
        }
        match result.contact.iter().next() {
            None => Ok(()),
            Some((name, contact)) => Err(Failure::Refused(format!(
                "stopped at {:.2} s with the {name} model: something touches the arm at link {} or beyond, \
                {:.1} N·m at joint {}",
                contact.t, contact.link, contact.torque, contact.joint
            ))),
        }
    }

    fn in_words(result: &Followed, tracks: &[(&str, Track<6>)]) {
        for joint in 0..6 {
            let of = |(name, _): &(&str, _)| {
                format!("{name} {:.3}", 1e3 * result.tracking_error.get(*name).map_or(f64::NAN, |e| e[joint]))
            };
            let errors: Vec<String> = tracks.iter().map(of).collect();
            output::print(&format!("joint {}: off by {} mrad rms", joint + 1, errors.join(", ")));
        }
        for (name, cycles) in &result.carried_on {
            output::print(&format!(
                "{name}: data of a joint was missing in {cycles} cycles; its state was extrapolated with \
                    its last velocity"
            ));
        }
    }
}
