//! `powerball warm-up`: swings the arm until its friction has settled.

use super::Failure;
use super::bus::{Consent, Where, virtual_bus};
use super::envelope::Surroundings;
use super::output::{self, Progress};
use super::replace;
use crate::procedure::warm_up::{Seen, WarmUpSettings, Warmth, swing, warm_up};
use crate::procedure::{Behind, Columns, RecordError, Recorder, resume};
use crate::report::{Figure, Ink, Page, Panel, Series};
use clap::Args;
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::transport::{Bus, BusUrl};
use powerball_identification::mounting::Mounting;
use powerball_virtual_arm::{PlantEffect, VirtualArm, lwa4p};
use std::fs::File;
use std::path::PathBuf;

/// Swing every joint until its mean torque over a cycle no longer changes (Fig. 3), and report when the arm
/// is warm.
///
/// Writes warm_up.csv, warm_up.json and report.html. The end is a test of the trend, not a fixed time: the
/// arm is warm when, at 95 %, no joint's torque can still change by more than the tolerance. Exit code 1
/// where that is not reached. An interrupted warm-up, or one that did not get warm, continues with its log,
/// unless the arm had time to cool. THE ARM MOVES.
#[derive(Args, Debug)]
#[command(after_help = "Example:\n  powerball warm-up --out warm --bus socketcan:can0")]
pub(crate) struct WarmUp {
    /// Folder for the log and the results; made if missing.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Length of a cycle, s.
    #[arg(long, default_value_t = 5.0)]
    period: f64,
    /// Share of each joint's range, velocity and acceleration that is used.
    #[arg(long, default_value_t = 0.6)]
    share: f64,
    /// Change of the torque that may still be to come, as a share of it.
    #[arg(long, default_value_t = 0.01)]
    tolerance: f64,
    /// Longest time, s.
    #[arg(long, default_value_t = 3600.0)]
    most: f64,
    /// How the base stands: filed, ROLL,PITCH in degrees, or gravity in the base frame as X,Y,Z in m/s².
    #[arg(long, default_value = "filed", allow_hyphen_values = true)]
    mounting: Mounting,
    #[command(flatten)]
    surroundings: Surroundings,
    #[command(flatten)]
    place: Where,
    #[command(flatten)]
    consent: Consent,
}

impl WarmUp {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let settings = self.settings()?;
        output::make_folder(&self.out)?;
        let progress = Progress::new();
        let refused = |e: RecordError| Failure::Refused(e.to_string());
        let envelope = self.surroundings.envelope(&self.surroundings.arm()?, &self.mounting)?;
        envelope.check(&LWA4P, &swing(&LWA4P, &settings)).map_err(refused)?;
        let path = self.out.join("warm_up.csv");
        let unwritable =
            |e: std::io::Error| Failure::Unusable(format!("{}: cannot be written: {e}", path.display()));
        replace::check(&path, Some(Columns::Everything.header(LWA4P.joints.len()).as_bytes()))?;
        let (seen, start) = self.earlier(&settings);
        let log = match start > 0.0 {
            true => resume::append(&path).map_err(unwritable)?,
            false => File::create(&path).map_err(unwritable)?,
        };
        // From here on the record is one that is not finished.
        match std::fs::remove_file(self.out.join("warm_up.json")) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(unwritable(e)),
            _ => {}
        }
        if start > 0.0 && !self.place.json {
            output::print(&format!("continuing {} after {start:.0} s", path.display()));
        }
        let bus = self.bus(start)?;
        let mut recorder =
            Recorder::enable(self.place.driver(bus, self.consent)?, envelope).map_err(refused)?;
        let mut log = Behind::new(log);
        let done = warm_up(&mut recorder, &settings, seen, start, &mut log, |seconds, change| {
            let change = change
                .map_or("too early to say".to_string(), |c| format!("up to {:.1} % to come", 100.0 * c));
            progress.say(&format!("{seconds:.0} s: {change}"));
        });
        let stopped = recorder.finish();
        let (_, written) = log.close();
        let warmth = done.map_err(refused)?;
        stopped.map_err(refused)?;
        written.map_err(unwritable)?;
        let text = output::json(&warmth.json())?;
        output::write(&self.out, "warm_up.json", text.as_bytes())?;
        output::write(&self.out, "report.html", page(&warmth).to_html().as_bytes())?;
        match self.place.json {
            true => output::data(&text),
            false => print(&warmth),
        }
        if warmth.warm {
            return Ok(());
        }
        Err(Failure::Refused(format!(
            "not warm after {:.0} s: a joint's torque may still change by more than {} %; give more time \
                with --most",
            warmth.seconds,
            100.0 * self.tolerance
        )))
    }

    fn settings(&self) -> Result<WarmUpSettings, Failure> {
        let settings = WarmUpSettings {
            period: self.period,
            share: self.share,
            tolerance: self.tolerance,
            most: self.most,
        };
        for (name, value, most) in [
            ("--period", self.period, 60.0),
            ("--share", self.share, 0.95),
            ("--tolerance", self.tolerance, 1.0),
            ("--most", self.most, f64::MAX),
        ] {
            if !(value > 0.0 && value <= most) {
                return Err(Failure::Unusable(format!("{name} must be above 0 and at most {most}")));
            }
        }
        Ok(settings)
    }

    /// The bus; the built-in arm has swung for `start` s. At 0 it is cold, or there would be nothing to see.
    fn bus(&self, start: f64) -> Result<Box<dyn Bus>, Failure> {
        if self.place.bus != BusUrl::Virtual {
            return self.place.open();
        }
        let broken = |e: String| Failure::Refused(format!("the built-in arm: {e}"));
        let mut setup = lwa4p::setup([0.0; 6], 1).map_err(|e| broken(e.to_string()))?;
        setup.plant = setup.plant.with(PlantEffect::Temperature { change: -0.25, time_constant: 120.0 });
        setup.age = start;
        virtual_bus(VirtualArm::new(setup).ok_or_else(|| broken("its parts do not fit".into()))?)
    }

    /// The result of an unfinished warm-up in the same folder, and the time at which this one continues, s;
    /// nothing and 0 if it starts from the beginning.
    ///
    /// An arm cools about as slowly as it warms: it counts as warm as before if it has stood for less than a
    /// fifth of the time of its swinging. The small cooling shows in the trend.
    fn earlier(&self, settings: &WarmUpSettings) -> (Seen, f64) {
        let path = self.out.join("warm_up.csv");
        let nothing = || Seen::new(swing(&LWA4P, settings));
        let json = std::fs::read_to_string(self.out.join("warm_up.json")).unwrap_or_default();
        let finished =
            serde_json::from_str::<serde_json::Value>(&json).is_ok_and(|json| json["warm"] == true);
        let rows = resume::rows(&path);
        let (Some(last), Some(stood)) = (rows.last().map(|row| row[0]), resume::silence(&path)) else {
            return (nothing(), 0.0);
        };
        // Virtual time does not pass between commands.
        let stood = if self.place.bus == BusUrl::Virtual { 0.0 } else { stood };
        if finished || stood > 0.2 * last {
            return (nothing(), 0.0);
        }
        // A second lies between the interrupted part and the continued one.
        nothing().earlier(&rows).map_or((nothing(), 0.0), |seen| (seen, last + stood.max(1.0)))
    }
}

fn print(warmth: &Warmth) {
    for (j, joint) in warmth.joints.iter().enumerate() {
        let Some(curve) = joint.curve else { continue };
        output::print(&format!(
            "joint {}: {:.3} N·m when warm, {:+.3} at the start, time constant {:.0} s",
            j + 1,
            curve.settled,
            curve.excess,
            curve.time_constant
        ));
    }
    if warmth.warm {
        output::print(&format!("warm after {:.0} s", warmth.seconds));
    }
}

/// Fig. 3 of every joint.
fn page(warmth: &Warmth) -> Page {
    let mut page = Page::new("Warm-up");
    page.lead(
        "Mean torque against the motion over each cycle; gravity does the same work both ways and \
        cancels. The curve is an exponential.",
    );
    for (j, joint) in warmth.joints.iter().enumerate() {
        let points: Vec<(f64, f64)> = joint.cycles.iter().map(|c| (c.time, c.torque)).collect();
        let mut panel = Panel::new("torque [N·m]");
        if let (Some(curve), Some(first)) = (joint.curve, joint.cycles.first()) {
            let value =
                |t: f64| curve.settled + curve.excess * (-(t - first.time) / curve.time_constant).exp();
            panel = panel.series(Series::line(
                "exponential",
                Ink::Orange,
                points.iter().map(|(t, _)| (*t, value(*t))).collect(),
            ));
        }
        let panel = panel.series(Series::points("cycles", Ink::Blue, points));
        page.figure(&Figure::new(format!("Joint {}", j + 1), "time [s]").panel(panel), "");
    }
    page
}
