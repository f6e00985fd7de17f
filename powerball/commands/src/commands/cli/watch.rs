//! `powerball watch`: whether a torque model still holds, along logs or a stream.

use super::Failure;
use super::inputs::{Known, MapArgument};
use super::listen::listen;
use super::output;
use super::serve::{self, Live, Serve};
use clap::Args;
use dyngen::Arm;
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::transport::BusUrl;
use powerball_explanation::torque_model::TorqueModel;
use powerball_explanation::watch::{Event, FIRST, Watch, WatchOptions};
use powerball_logs::log::{ColumnMap, LiveRows, LiveSample, Log, read_logs_as};
use powerball_logs::regression::RigidArm;
use powerball_logs::tables;
use std::io::BufRead;
use std::path::PathBuf;

/// Say when the torque model no longer holds: since when, on which joints and why (a push, a payload, friction,
/// a sensor's zero, a delay, or unknown).
///
/// A line for each change; none where the model holds. It is a sequential test: at most one false alarm in
/// `--hours` of motion on average, as long as the model errs no more than on the logs it was explained on and
/// friction stays within `--friction-range`. Rows at rest say nothing and are not watched.
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  powerball watch --arm arm.toml --model result/model.json --log today.csv --json\n  \
    ros2_to_csv | powerball watch --arm arm.toml --model result/model.json -\n\n\
    With - rows are read from standard input as they come: CSV with a header line, or an object with the same\n\
    keys on each line ({\"t\": 0.005, \"q1\": …, \"tau1\": …} or {\"t\": 0.005, \"q\": […], \"tau\": […]})."
)]
#[command(group(clap::ArgGroup::new("from").required(true).args(["log", "bus", "stream"])))]
pub(crate) struct WatchCommand {
    /// The arm file (TOML).
    #[arg(long, value_name = "ARM.toml")]
    arm: PathBuf,
    /// model.json of `powerball explain`, or identified.json, for the same arm file.
    #[arg(long, value_name = "FILE.json")]
    model: PathBuf,
    /// Logs, each watched by itself (CSV, Parquet, MCAP, a bag of ROS, npz, mat or HDF5).
    #[arg(long, value_name = "FILE", num_args = 1..)]
    log: Vec<PathBuf>,
    /// A bus on which another master moves the LWA 4P: socketcan:can0, slcan:/dev/ttyACM0 or udp:239.74.163.2:43113.
    /// Nothing is sent.
    #[arg(long, value_name = "URL")]
    bus: Option<BusUrl>,
    /// Listen to the bus for so many seconds; else until Ctrl-C.
    #[arg(long = "for", value_name = "SECONDS", requires = "bus")]
    seconds: Option<f64>,
    #[command(flatten)]
    serve: Serve,
    /// Rows from standard input.
    #[arg(value_name = "-", value_parser = ["-"])]
    stream: Option<String>,
    #[command(flatten)]
    map: MapArgument,
    /// One JSON object a line.
    #[arg(long)]
    json: bool,
    /// Mean time between two false alarms, h of motion.
    #[arg(long, default_value_t = 24.0, value_parser = positive)]
    hours: f64,
    /// By what share of itself friction may wander without an alarm.
    #[arg(long, default_value_t = 0.02, value_parser = share)]
    friction_range: f64,
    /// Where the model does not say what it leaves where it holds: so many seconds of motion are taken as good.
    #[arg(long, default_value_t = 20.0, value_parser = positive)]
    learn: f64,
}

fn positive(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|x: &f64| x.is_finite() && *x > 0.0)
        .ok_or_else(|| "give a number above 0".to_string())
}

fn share(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|x| (0.0..1.0).contains(x))
        .ok_or_else(|| "give a share from 0 to 1, 0.05 for 5 %".to_string())
}

impl WatchCommand {
    pub(crate) fn run(self) -> Result<(), Failure> {
        if self.seconds.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
            return Err(Failure::Unusable("--for needs a number of seconds above 0".to_string()));
        }
        let map = self.map.read()?;
        let said = Arm::read(&self.arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        let known = Known::read(&self.arm, Some(&self.model))?;
        let arm = known.arm.clone();
        // Logs before the derivation: what cannot be read is said at once.
        let logs = self.logs(&said, &map)?;
        let body = RigidArm::new(&arm).map_err(|e| Failure::Refused(e.to_string()))?;
        let model = known.model(&body)?;
        let model =
            model.ok_or_else(|| Failure::Unusable(format!("{}: is no model", self.model.display())))?;
        self.same_arm(&model, &said)?;
        let options = WatchOptions {
            hours: self.hours,
            friction_range: self.friction_range,
            learn: self.learn,
            ..WatchOptions::default()
        };
        let live = self.serve.open()?;
        live.start(&format!("{} watched", said.name), &[("position", "rad"), ("torque", "N·m")]);
        for log in &logs {
            self.watch_log(log, &body, &model, &options, &live);
        }
        if self.stream.is_some() {
            self.watch_stream(&said, &map, (&body, &model, &options), &live)?;
        }
        if let Some(bus) = &self.bus {
            self.watch_bus(bus, (&body, &model, &options), &live)?;
        }
        live.end("no more samples");
        Ok(())
    }

    fn logs(&self, arm: &Arm, map: &ColumnMap) -> Result<Vec<Log>, Failure> {
        let (logs, findings) =
            read_logs_as(&self.log, arm, map).map_err(|e| Failure::Unusable(e.to_string()))?;
        findings.iter().for_each(|finding| tracing::warn!("{finding}"));
        Ok(logs)
    }

    fn same_arm(&self, model: &TorqueModel, arm: &Arm) -> Result<(), Failure> {
        let file = self.model.display();
        if !model.arm.is_empty() && !arm.name.is_empty() && model.arm != arm.name {
            return Err(Failure::Unusable(format!(
                "{file}: is a model of the arm '{}', {} is of '{}': give the arm file that the model was made with",
                model.arm,
                self.arm.display(),
                arm.name
            )));
        }
        Ok(())
    }

    fn watch_log(
        &self,
        log: &Log,
        body: &RigidArm,
        model: &TorqueModel,
        options: &WatchOptions,
        live: &Live,
    ) {
        let mut watch = Watch::new(body, model, options, &log.file);
        for (k, sample) in log.samples().enumerate() {
            self.take(&mut watch, &sample, k, live);
        }
        let events = watch.finish();
        self.say(&mut watch, &events, live);
    }

    /// An arm that another master drives, until Ctrl-C or as long as --for says.
    fn watch_bus(
        &self,
        bus: &BusUrl,
        (body, model, options): (&RigidArm, &TorqueModel, &WatchOptions),
        live: &Live,
    ) -> Result<(), Failure> {
        if body.dof() != LWA4P.joints.len() {
            let (has, needs) = (body.dof(), LWA4P.joints.len());
            return Err(Failure::Unusable(format!(
                "the arm file has {has} joints, the arm on the bus {needs}"
            )));
        }
        let name = bus.to_string();
        let (mut watch, mut count) = (Watch::new(body, model, options, &name), 0);
        listen(bus, self.seconds, |sample| {
            self.take(&mut watch, sample, count, live);
            count += 1;
        })?;
        let events = watch.finish();
        self.say(&mut watch, &events, live);
        Ok(())
    }

    /// Sample `k`.
    fn take(&self, watch: &mut Watch<'_>, sample: &LiveSample, k: usize, live: &Live) {
        if k.is_multiple_of(serve::EVERY) {
            live.sample("", sample.t, &[("position", &sample.q), ("torque", &sample.torque)]);
        }
        let events = watch.push(sample);
        self.say(watch, &events, live);
    }

    fn watch_stream(
        &self,
        arm: &Arm,
        map: &ColumnMap,
        (body, model, options): (&RigidArm, &TorqueModel, &WatchOptions),
        live: &Live,
    ) -> Result<(), Failure> {
        const NAME: &str = "standard input";
        let (mut rows, mut watch, mut usable) = (None, Watch::new(body, model, options, NAME), 0);
        let mut format = None;
        for (number, line) in std::io::stdin().lock().lines().enumerate() {
            let line = line.map_err(|e| Failure::Unusable(format!("{NAME}: line {}: {e}", number + 1)))?;
            if line.trim().is_empty() {
                continue;
            }
            let format = format.get_or_insert_with(|| Format::of(&line));
            let wrong = |what: String| Failure::Unusable(format!("{NAME}: line {}: {what}", number + 1));
            if rows.is_none() {
                let made = LiveRows::new(NAME, arm, &format.names(&line).map_err(wrong)?, map);
                rows = Some(made.map_err(|e| Failure::Unusable(e.to_string()))?);
                if format.has_header() {
                    continue;
                }
            }
            let values = format.values(&line);
            let sample = rows.as_mut().and_then(|rows| rows.sample(|k| values.get(k).copied().flatten()));
            let Some(sample) = sample else { continue };
            self.take(&mut watch, &sample, usable, live);
            usable += 1;
        }
        if !watch.has_begun() {
            return Err(Failure::Unusable(format!(
                "{NAME}: {usable} usable samples are too few: at least {FIRST} are needed"
            )));
        }
        let events = watch.finish();
        self.say(&mut watch, &events, live);
        Ok(())
    }

    /// Events on standard output, notes on standard error.
    fn say(&self, watch: &mut Watch<'_>, events: &[Event], live: &Live) {
        watch.notes().iter().for_each(|note| tracing::warn!("{note}"));
        for event in events {
            live.event(&event.sentence());
            match self.json {
                true => output::print(&serde_json::to_string(event).unwrap_or_default()),
                false => output::print(&event.sentence()),
            }
        }
    }
}

/// How the rows of a stream are written.
enum Format {
    /// A header, then numbers between such marks.
    Lines(char),
    /// An object a line; the names of the first one's numbers.
    Objects(Vec<String>),
}

impl Format {
    fn of(first: &str) -> Format {
        if first.trim_start().starts_with('{') {
            return Format::Objects(Vec::new());
        }
        Format::Lines(*[',', ';', '\t', ' '].iter().find(|mark| first.contains(**mark)).unwrap_or(&','))
    }

    fn has_header(&self) -> bool {
        matches!(self, Format::Lines(_))
    }

    /// The names of the columns, by the first line.
    fn names(&mut self, line: &str) -> Result<Vec<String>, String> {
        match self {
            Format::Lines(mark) => Ok(line.split(*mark).map(|name| name.trim().to_string()).collect()),
            Format::Objects(names) => {
                *names = numbers(line)?.into_iter().map(|(name, _)| name).collect();
                Ok(names.clone())
            }
        }
    }

    /// The numbers of a line in the order of the names.
    fn values(&self, line: &str) -> Vec<Option<f64>> {
        match self {
            Format::Lines(mark) => line.split(*mark).map(|field| tables::number(field.trim())).collect(),
            Format::Objects(names) => {
                let all = numbers(line).unwrap_or_default();
                let of = |name: &String| all.iter().find(|(own, _)| own == name).map(|(_, value)| *value);
                names.iter().map(of).collect()
            }
        }
    }
}

/// The numbers of a JSON object; those of a list are named by their places, from 1.
fn numbers(line: &str) -> Result<Vec<(String, f64)>, String> {
    let object: serde_json::Map<String, serde_json::Value> =
        serde_json::from_str(line).map_err(|e| format!("is no JSON object: {e}"))?;
    let mut all = Vec::new();
    for (name, value) in object {
        match value {
            serde_json::Value::Array(list) => {
                let places = list.iter().enumerate();
                all.extend(places.filter_map(|(k, x)| Some((format!("{name}{}", k + 1), x.as_f64()?))));
            }
            other => all.extend(other.as_f64().map(|x| (name, x))),
        }
    }
    Ok(all)
}
