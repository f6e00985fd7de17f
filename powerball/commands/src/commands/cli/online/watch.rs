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
use powerball_controller::JointNumber;
use powerball_explanation::torque_model::TorqueModel;
use powerball_explanation::watch::{Event, FIRST, Watch, WatchOptions};
use powerball_logs::log::{ColumnMap, LiveRows, LiveSample, Log, Taken, read_logs_as};
use powerball_logs::regression::RigidArm;
use powerball_logs::tables;
use std::io::{BufRead, Read};
use std::path::PathBuf;

/// Report when the torque model no longer holds: since when, on which joints and why (a push, a payload,
/// friction, a sensor's zero, a delay, or unknown).
///
/// A line for each change, and a last one: `holds` or `changed`. The exit code is 0 where the model holds, 1
/// where something changed, 3 where that cannot be determined. It is a sequential test: at most one false
/// alarm in `--hours` of motion on average, as long as the model's error is no larger than on the logs it was
/// explained on and friction stays within `--friction-range`. Rows at rest are not watched.
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  \
    powerball watch --arm arm.toml --model result/model.json --log today.csv --json\n  \
    ros2_to_csv | powerball watch --arm arm.toml --model result/model.json --log -\n\n\
    With - rows are read from standard input as they come: CSV with a header line, or an object with the \
    same\n\
    keys on each line ({\"t\": 0.005, \"q1\": …, \"tau1\": …} or {\"t\": 0.005, \"q\": […], \"tau\": […]}).")]
#[command(group(clap::ArgGroup::new("from").required(true).args(["log", "bus", "stream"])))]
pub(crate) struct WatchCommand {
    /// The arm file (TOML).
    #[arg(long, value_name = "ARM.toml")]
    arm: PathBuf,
    /// model.json of `powerball explain`, or identified.json, for the same arm file.
    #[arg(long, value_name = "FILE.json")]
    model: PathBuf,
    /// Logs, each watched on its own (CSV, Parquet, MCAP, a bag of ROS, npz, mat or HDF5); - is standard
    /// input.
    #[arg(long, value_name = "FILE|-", num_args = 1..)]
    log: Vec<PathBuf>,
    /// A bus on which another master moves the LWA 4P: socketcan:can0, slcan:/dev/ttyACM0 or
    /// udp:239.74.163.2:43113. Nothing is sent.
    #[arg(long, value_name = "URL")]
    bus: Option<BusUrl>,
    /// Listen to the bus for this many seconds; else until Ctrl-C.
    #[arg(long = "for", value_name = "SECONDS", requires = "bus")]
    seconds: Option<f64>,
    #[command(flatten)]
    serve: Serve,
    /// Rows from standard input, as --log -.
    #[arg(value_name = "-", value_parser = ["-"])]
    stream: Option<String>,
    #[command(flatten)]
    map: MapArgument,
    /// One JSON object a line for each change; the last line goes to standard error.
    #[arg(long)]
    json: bool,
    /// One word a line for each change: `load` for a payload, `collision` for a push, else the name of the
    /// effect; the last line goes to standard error.
    #[arg(long, conflicts_with = "json")]
    word: bool,
    /// Exit with 0 even if something changed: for pipes that stop at the first command that fails.
    #[arg(long)]
    exit_zero: bool,
    /// Mean time between two false alarms, h of motion.
    #[arg(long, default_value_t = 24.0, value_parser = positive)]
    hours: f64,
    /// Share of the friction by which it may change slowly without an alarm.
    #[arg(long, default_value_t = 0.02, value_parser = share)]
    friction_range: f64,
    /// Where the model file does not state the usual residual: this many seconds of motion are taken as good.
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
    pub(crate) fn run(mut self) -> Result<(), Failure> {
        if self.seconds.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
            return Err(Failure::Unusable("--for needs a number of seconds above 0".to_string()));
        }
        let files = self.log.len();
        self.log.retain(|file| file.as_os_str() != "-");
        let streams = self.stream.is_some() || self.log.len() < files;
        let map = self.map.read()?;
        let said = Arm::read(&self.arm).map_err(|e| Failure::Unusable(e.to_string()))?;
        let known = Known::read(&self.arm, Some(&self.model))?;
        let arm = known.arm.clone();
        // Logs before the derivation: what cannot be read is reported at once.
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
        let mut seen = Seen::default();
        for log in &logs {
            seen.add(self.watch_log(log, &body, &model, &options, &live));
        }
        if streams {
            seen.add(self.watch_stream(&said, &map, (&body, &model, &options), &live)?);
        }
        if let Some(bus) = &self.bus {
            seen.add(self.watch_bus(bus, (&body, &model, &options), &live)?);
        }
        live.end("no more samples");
        self.conclude(&seen)
    }

    /// The last line, and the exit code.
    fn conclude(&self, seen: &Seen) -> Result<(), Failure> {
        let stale = match seen.stale {
            0 => String::new(),
            count => format!(
                "{count} of {} samples have a time that does not increase and were left out: give the times \
                    at which samples were taken",
                count + seen.samples
            ),
        };
        if seen.stale as f64 > MOST_STALE * (seen.stale + seen.samples) as f64 {
            return Err(Failure::Doubtful(stale));
        }
        if !stale.is_empty() {
            tracing::warn!("{stale}");
        }
        let joints = seen.joints.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        if seen.joints.is_empty() && seen.events == 0 {
            return Err(Failure::Doubtful(format!(
                "no joint was watched in {:.0} s: the residual of the unchanged arm is not known",
                seen.seconds
            )));
        }
        if !seen.unjudged.is_empty() && seen.events == 0 {
            return Err(Failure::Doubtful(seen.unjudged.join("; ")));
        }
        let of = format!("{:.0} s, joint {joints}", seen.seconds);
        let line = match seen.events {
            0 => format!("holds: {of}"),
            1 => format!("changed: 1 event in {of}"),
            several => format!("changed: {several} events in {of}"),
        };
        match self.json || self.word {
            true => output::notice(&line),
            false => output::print(&line),
        }
        if seen.events == 0 || self.exit_zero { Ok(()) } else { Err(Failure::Negative) }
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
                "{file}: is a model of the arm '{}', {} is of '{}': give the arm file that the model was \
                made with",
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
    ) -> Seen {
        let (mut watch, mut seen) = (Watch::new(body, model, options, &log.file), Seen::default());
        for sample in log.samples() {
            self.take(&mut watch, &sample, &mut seen, live);
        }
        self.finish(&mut watch, &log.file, &mut seen, live);
        seen
    }

    fn finish(&self, watch: &mut Watch<'_>, name: &str, seen: &mut Seen, live: &Live) {
        let events = watch.finish();
        self.say(watch, &events, seen, live);
        seen.joints = watch.watched();
        seen.unjudged.extend(watch.unjudged().map(|why| format!("{name}: {why}")));
    }

    /// An arm that another master drives, until Ctrl-C or as long as --for says.
    fn watch_bus(
        &self,
        bus: &BusUrl,
        (body, model, options): (&RigidArm, &TorqueModel, &WatchOptions),
        live: &Live,
    ) -> Result<Seen, Failure> {
        if body.dof() != LWA4P.joints.len() {
            let (has, needs) = (body.dof(), LWA4P.joints.len());
            return Err(Failure::Unusable(format!(
                "the arm file has {has} joints, the arm on the bus {needs}"
            )));
        }
        let name = bus.to_string();
        let (mut watch, mut seen) = (Watch::new(body, model, options, &name), Seen::default());
        listen(bus, self.seconds, |sample| self.take(&mut watch, sample, &mut seen, live))?;
        self.finish(&mut watch, &name, &mut seen, live);
        Ok(seen)
    }

    /// The next sample.
    fn take(&self, watch: &mut Watch<'_>, sample: &LiveSample, seen: &mut Seen, live: &Live) {
        if seen.samples.is_multiple_of(serve::EVERY) {
            live.sample("", sample.t, &[("position", &sample.q), ("torque", &sample.torque)]);
        }
        seen.sample(sample.t);
        let events = watch.push(sample);
        self.say(watch, &events, seen, live);
    }

    fn watch_stream(
        &self,
        arm: &Arm,
        map: &ColumnMap,
        (body, model, options): (&RigidArm, &TorqueModel, &WatchOptions),
        live: &Live,
    ) -> Result<Seen, Failure> {
        const NAME: &str = "standard input";
        let (mut watch, mut seen) = (Watch::new(body, model, options, NAME), Seen::default());
        let (mut rows, mut format) = (None, None);
        for (number, line) in lines(std::io::stdin().lock()).enumerate() {
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
            let taken = rows.as_mut().map(|rows| rows.sample(|k| values.get(k).copied().flatten()));
            match taken {
                Some(Taken::Sample { sample, restarted }) => {
                    if restarted {
                        tracing::warn!(
                            "{NAME}: line {}: the clock restarts: times continue from here",
                            number + 1
                        );
                    }
                    self.take(&mut watch, &sample, &mut seen, live);
                }
                Some(Taken::Stale) => seen.stale += 1,
                Some(Taken::Nothing) | None => {}
            }
        }
        let usable = seen.samples;
        if !watch.has_started() {
            return Err(Failure::Unusable(format!(
                "{NAME}: {usable} usable samples are too few: at least {FIRST} are needed"
            )));
        }
        self.finish(&mut watch, NAME, &mut seen, live);
        Ok(seen)
    }

    /// Events on standard output, notes on standard error.
    fn say(&self, watch: &mut Watch<'_>, events: &[Event], seen: &mut Seen, live: &Live) {
        seen.events += events.len();
        watch.notes().iter().for_each(|note| tracing::warn!("{note}"));
        for event in events {
            let sentence = event.sentence(watch.arm());
            live.event(&sentence);
            match (self.json, self.word) {
                (true, _) => output::data(&serde_json::to_string(event).unwrap_or_default()),
                // The end of a push is no new one.
                (_, true) if event.evidence.ends => {}
                (_, true) => output::data(word(&event.what)),
                _ => output::print(&sentence),
            }
        }
    }
}

/// A change in one word.
fn word(what: &str) -> &str {
    match what {
        "payload" => "load",
        "contact_wrench" => "collision",
        other => other,
    }
}

/// A longer line is not a row, bytes.
const LONGEST_LINE: u64 = 1 << 20;

/// The lines of a stream; none is held that is longer than a row can be.
fn lines(mut input: impl BufRead) -> impl Iterator<Item = std::io::Result<String>> {
    std::iter::from_fn(move || {
        let mut line = Vec::new();
        match input.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line) {
            Ok(0) => None,
            Ok(read) if read as u64 == LONGEST_LINE && line.last() != Some(&b'\n') => {
                Some(Err(std::io::Error::other("is longer than 1 MB: rows of a log are expected")))
            }
            Ok(_) => Some(String::from_utf8(line).map_err(std::io::Error::other)),
            Err(e) => Some(Err(e)),
        }
    })
}

/// A stream with a larger share of samples whose time does not increase is not judged.
const MOST_STALE: f64 = 0.05;

/// The part of the logs that was watched.
#[derive(Default)]
struct Seen {
    samples: usize,
    /// Samples whose time does not rise.
    stale: usize,
    /// The time that samples are apart, without gaps, s.
    seconds: f64,
    last: Option<f64>,
    events: usize,
    joints: Vec<JointNumber>,
    /// By log with too little motion: its name and how much is needed.
    unjudged: Vec<String>,
}

impl Seen {
    fn sample(&mut self, t: f64) {
        self.samples += 1;
        // A gap was not watched.
        self.seconds += self.last.map_or(0.0, |last| t - last).min(GAP);
        self.last = Some(t);
    }

    /// Adds the result of another log.
    fn add(&mut self, other: Seen) {
        self.samples += other.samples;
        self.stale += other.stale;
        self.seconds += other.seconds;
        self.events += other.events;
        self.unjudged.extend(other.unjudged);
        self.joints.extend(other.joints);
        self.joints.sort_unstable();
        self.joints.dedup();
    }
}

/// Samples further apart have a gap between them, s.
const GAP: f64 = 0.5;

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
        serde_json::from_str(line).map_err(|e| format!("is not a JSON object: {e}"))?;
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
