//! `powerball friction`: the friction experiment on an arm, and the laws that fit.

use super::bus::{Consent, Where, virtual_bus};
use super::envelope::Surroundings;
use super::output::{self, Progress};
use super::{Failure, motion, replace};
use crate::procedure::friction::{
    Experiment, FrictionError, JointFriction, analyse, is_complete, log_file, plan, run,
};
use crate::procedure::gravity_free;
use crate::procedure::{Columns, RecordError, Recorder};
use crate::report::{Figure, Ink, Page, Panel, Series, Table, number};
use clap::Args;
use dyngen::Model;
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::transport::{Bus, BusUrl};
use powerball_identification::mounting::Mounting;
use powerball_virtual_arm::{VirtualArm, lwa4p};
use serde_json::json;
use std::path::PathBuf;

/// Move each joint at 18 constant velocities each way where gravity does not load it, and fit friction laws
/// (Eq. 15, Eq. 16, Stribeck).
///
/// Writes friction_K.csv for each joint as it is recorded, friction.json and report.html. An interrupted run
/// continues with its joint. Joints that need another mounting of the base are named; the virtual arm is
/// mounted as they need it. THE ARM MOVES.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  powerball friction --out friction\n  \
    powerball friction --bus socketcan:can0 --mounting 0,90 --joints 2,3 --out friction")]
pub(crate) struct Friction {
    /// How the base stands, on a real arm: filed, ROLL,PITCH in degrees, or gravity in the base frame as
    /// X,Y,Z in m/s²; the virtual arm is mounted as each joint needs it.
    #[arg(long, default_value = "filed", allow_hyphen_values = true)]
    mounting: Mounting,
    /// The joints, from 1, with commas between; all of them where this is left out.
    #[arg(long, value_delimiter = ',')]
    joints: Option<Vec<usize>>,
    /// Folder for the logs and results; made if missing.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    surroundings: Surroundings,
    #[command(flatten)]
    place: Where,
    #[command(flatten)]
    consent: Consent,
}

impl Friction {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let progress = Progress::new();
        let arm = self.surroundings.arm()?;
        let n = arm.dof();
        if n != LWA4P.joints.len() {
            return Err(Failure::Unusable(format!(
                "the arm on the bus has {} joints, the arm file {n}",
                LWA4P.joints.len()
            )));
        }
        let wanted = self.joints.clone().unwrap_or_else(|| (1..=n).collect());
        if let Some(wrong) = wanted.iter().find(|j| !(1..=n).contains(*j)) {
            return Err(Failure::Unusable(format!(
                "--joints: there is no joint {wrong}; there are 1 to {n}"
            )));
        }
        progress.say("deriving the arm");
        let model = Model::derive(arm).map_err(|e| Failure::Refused(e.to_string()))?;
        output::make_folder(&self.out)?;
        for joint in wanted.iter().map(|j| j - 1) {
            let header = Columns::Everything.header(n);
            replace::check(&log_file(&self.out, joint), Some(header.as_bytes()))?;
        }
        let (experiments, notes) = self.plan(&model, &wanted)?;
        self.record(&model, &experiments, &progress)?;
        let mut found = Vec::new();
        for experiment in &experiments {
            let path = log_file(&self.out, experiment.plan.joint);
            found.push(analyse(&model, experiment, &path).map_err(failure)?);
        }
        let result = json!({
            "arm": model.arm().name, "joints": found.iter().map(JointFriction::json).collect::<Vec<_>>(),
            "notes": notes,
        });
        let text = output::json(&result)?;
        output::write(&self.out, "friction.json", text.as_bytes())?;
        output::write(
            &self.out,
            "report.html",
            page(&model.arm().name, &found, &notes).to_html().as_bytes(),
        )?;
        match self.place.json {
            true => output::data(&text),
            false => print(&found, &notes),
        }
        Ok(())
    }

    /// The joints' experiments in their mountings, and a note on each joint that has none.
    fn plan(&self, model: &Model, wanted: &[usize]) -> Result<(Vec<Experiment>, Vec<String>), Failure> {
        let mut notes = Vec::new();
        let mut experiments = Vec::new();
        for joint in wanted.iter().map(|j| j - 1) {
            let mounting = match self.place.bus {
                BusUrl::Virtual => gravity_free::find(model, joint).map(|found| found.mounting),
                _ => Some(self.mounting),
            };
            let planned = match mounting {
                Some(mounting) => plan(model, joint, mounting, LWA4P.period_seconds()).map_err(failure)?,
                None => None,
            };
            match planned {
                Some(experiment) => experiments.push(experiment),
                None => notes.push(match gravity_free::find(model, joint) {
                    Some(found) => format!(
                        "joint {} needs the base mounted {} (--mounting {})",
                        joint + 1,
                        found.mounting,
                        found.mounting.text()
                    ),
                    None => format!("joint {}: no pose in any mounting frees it from gravity", joint + 1),
                }),
            }
        }
        if experiments.is_empty() {
            return Err(Failure::Refused(format!(
                "nothing can be measured in this mounting: {}",
                notes.join("; ")
            )));
        }
        Ok((experiments, notes))
    }

    /// Records what is not there yet, one mounting after the other.
    fn record(&self, model: &Model, experiments: &[Experiment], progress: &Progress) -> Result<(), Failure> {
        let mut mountings: Vec<Mounting> = Vec::new();
        for mounting in experiments.iter().map(|e| e.place.mounting) {
            if !mountings.contains(&mounting) {
                mountings.push(mounting);
            }
        }
        for mounting in mountings {
            let open: Vec<&Experiment> = experiments
                .iter()
                .filter(|e| {
                    e.place.mounting == mounting && !is_complete(&log_file(&self.out, e.plan.joint), e)
                })
                .collect();
            if open.is_empty() {
                continue;
            }
            let envelope = self.surroundings.envelope(model.arm(), &mounting)?;
            let mut motions = Vec::new();
            for plan in open.iter().map(|experiment| &experiment.plan) {
                let wrong = |e: RecordError| Failure::Refused(format!("joint {}: {e}", plan.joint + 1));
                motions.push(envelope.clear(&LWA4P, plan.motion.clone()).map_err(wrong)?);
            }
            let bus: Box<dyn Bus> = match self.place.bus {
                BusUrl::Virtual => {
                    let broken = |e: String| Failure::Refused(format!("the built-in arm: {e}"));
                    let mut setup = lwa4p::setup([0.0; 6], 1).map_err(|e| broken(e.to_string()))?;
                    setup.plant =
                        lwa4p::mounted(mounting.gravity(model.arm())).map_err(|e| broken(e.to_string()))?;
                    let arm = VirtualArm::new(setup).ok_or_else(|| broken("its parts do not fit".into()))?;
                    virtual_bus(arm)?
                }
                _ => self.place.open()?,
            };
            let refused = |e: RecordError| Failure::Refused(e.to_string());
            let mut recorder = Recorder::enable(self.place.driver(bus, self.consent)?, envelope)
                .map_err(refused)?
                .with_progress(motion::live());
            let joints = open.iter().map(|experiment| experiment.plan.joint);
            // The first that fails is the last. No log is waited for before the arm stands.
            let mut done = Ok(());
            let mut logs = Vec::new();
            for (joint, motion) in joints.zip(&motions) {
                progress.say(&format!("joint {}, base {mounting}", joint + 1));
                match run(&mut recorder, joint, motion, &self.out) {
                    Ok(log) => logs.push((joint, log)),
                    Err(e) => {
                        done = Err(e);
                        break;
                    }
                }
            }
            let stopped = recorder.finish();
            let closed = logs.into_iter().try_for_each(|(joint, log)| {
                log.close().1.map_err(|e| FrictionError::Write(log_file(&self.out, joint), e))
            });
            done.and(closed).map_err(failure)?;
            stopped.map_err(refused)?;
        }
        Ok(())
    }
}

fn failure(e: FrictionError) -> Failure {
    match e {
        FrictionError::Arm(_) | FrictionError::Write(..) | FrictionError::Log(_) => {
            Failure::Unusable(e.to_string())
        }
        _ => Failure::Refused(e.to_string()),
    }
}

fn print(found: &[JointFriction], notes: &[String]) {
    notes.iter().for_each(|note| output::print(&format!("note: {note}")));
    for joint in found {
        let chosen = &joint.laws[joint.chosen];
        output::print(&format!(
            "joint {}: {} fits best on velocities left out ({:.4} N·m); tanh friction (Eq. 16): {}",
            joint.joint + 1,
            chosen.fitted.law.name(),
            chosen.held_out,
            joint.laws[0].fitted.gamma().map_or(String::new(), |g| g.map(number).join(", "))
        ));
    }
}

/// Points, curves and bands of every joint (Fig. 4 to 6), and the laws side by side.
fn page(arm: &str, found: &[JointFriction], notes: &[String]) -> Page {
    let mut page = Page::new(format!("Friction of {arm}"));
    page.lead(
        "Mean torques at constant velocities where gravity does not load the joint. Laws are compared on \
            velocities that were left out of their fit, both directions of a velocity together. If laws \
            cannot be distinguished, tanh friction (Eq. 16) is used.",
    );
    for note in notes {
        page.paragraph(note);
    }
    for joint in found {
        page.heading(&format!("Joint {}", joint.joint + 1));
        let chosen = &joint.laws[joint.chosen];
        let top = joint.points.iter().map(|p| p.velocity.abs()).fold(0.0, f64::max);
        let velocities: Vec<f64> = (-200..=200).map(|k| f64::from(k) / 200.0 * top).collect();
        let curve = |f: &dyn Fn(f64) -> f64| velocities.iter().map(|v| (*v, f(*v))).collect::<Vec<_>>();
        let offset = chosen.fitted.offset;
        let panel = Panel::new("torque [N·m]")
            .series(Series::dashed(
                "band (95 %)",
                Ink::Grey,
                curve(&|v| chosen.fitted.torque(v) + offset + 2.0 * chosen.band(v)),
            ))
            .series(Series::dashed(
                "",
                Ink::Grey,
                curve(&|v| chosen.fitted.torque(v) + offset - 2.0 * chosen.band(v)),
            ))
            .series(Series::line(
                chosen.fitted.law.name(),
                Ink::Orange,
                curve(&|v| chosen.fitted.torque(v) + offset),
            ))
            .series(Series::points(
                "measured",
                Ink::Blue,
                joint.points.iter().map(|p| (p.velocity, p.torque)).collect(),
            ));
        page.figure(
            &Figure::new("Friction against velocity", "velocity [rad/s]").panel(panel),
            &format!("Base {}.", joint.place.mounting),
        );
        let mut table = Table::new([
            "law",
            "held-out error [N·m]",
            "levels [N·m, N·m, N·m·s/rad]",
            "shapes",
            "constant torque [N·m]",
        ]);
        for (k, rated) in joint.laws.iter().enumerate() {
            let list = |values: &[f64]| values.iter().map(|x| number(*x)).collect::<Vec<_>>().join(", ");
            let mark = if k == joint.chosen { " (chosen)" } else { "" };
            table.push([
                format!("{}{mark}", rated.fitted.law.name()),
                number(rated.held_out),
                list(&rated.fitted.levels),
                list(&rated.fitted.shapes),
                number(rated.fitted.offset),
            ]);
        }
        page.table(&table);
    }
    page
}
