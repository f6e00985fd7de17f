//! `powerball bus timing`.

use super::super::output;
use super::{Consent, Failure, Where, master, refused};
use clap::Args;
use powerball_bus::cia402::objects::STATUSWORD;
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::driver::{ControlMode, Phase};
use powerball_bus::transport::blocking;
use powerball_bus::transport::{BusUrl, Moment};
use serde_json::json;
use std::fmt::Write as _;
use std::time::Instant;

/// For the configuration of all drives, µs.
const PATIENCE: u64 = 20_000_000;
/// SDO round trips that are measured.
const TRIPS: usize = 500;

/// Measure the bus with all drives configured and none enabled: how even SYNC is, how soon all process data
/// is there after it, and how long an SDO takes. Nothing moves.
///
/// On `virtual` the clock is not the wall's: there the figures are the time to compute a cycle of master,
/// drives and arm.
#[derive(Args, Debug)]
#[command(after_help = "Example: powerball bus timing --bus udp:239.74.163.2:43113 --for 20")]
pub(crate) struct Timing {
    #[command(flatten)]
    place: Where,
    #[command(flatten)]
    consent: Consent,
    /// Measures for this many seconds.
    #[arg(long = "for", default_value_t = 10.0, value_name = "SECONDS")]
    seconds: f64,
}

/// Times, µs.
#[derive(Default)]
struct Times(Vec<f64>);

impl Times {
    fn at(&self, share: f64) -> f64 {
        let last = self.0.len().saturating_sub(1);
        self.0.get((share * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
    }

    fn in_json(&self) -> serde_json::Value {
        json!({ "count": self.0.len(), "min": self.at(0.0), "median": self.at(0.5), "p90": self.at(0.9),
            "p99": self.at(0.99), "max": self.at(1.0) })
    }

    /// A line of percentiles and, for each class, a bar.
    fn in_words(&self, name: &str) -> String {
        let mut out = format!(
            "{name} (n = {}), µs: min {:.0}, median {:.0}, 90 % {:.0}, 99 % {:.0}, max {:.0}\n",
            self.0.len(),
            self.at(0.0),
            self.at(0.5),
            self.at(0.9),
            self.at(0.99),
            self.at(1.0)
        );
        // Ten classes over the middle 98 %, and what lies beyond.
        let (low, high) = (self.at(0.01), self.at(0.99));
        let width = ((high - low) / 10.0).max(1.0);
        for class in 0..=10 {
            let (from, to) = (low + f64::from(class) * width, low + f64::from(class + 1) * width);
            let inside = |x: f64| (class == 0 || x >= from) && (class == 10 || x < to);
            let count = self.0.iter().filter(|x| inside(**x)).count();
            let share = 100.0 * count as f64 / self.0.len().max(1) as f64;
            let bound = if class == 10 { format!("from {from:.0}") } else { format!("to {to:.0}") };
            let _ =
                writeln!(out, "  {bound:>12}  {share:5.1} %  {}", "#".repeat((share / 2.0).round() as usize));
        }
        out
    }
}

impl Timing {
    pub(crate) fn run(self) -> Result<(), Failure> {
        if !(self.seconds.is_finite() && self.seconds > 0.0) {
            return Err(Failure::Unusable("--for must be above 0".to_string()));
        }
        let mut master = master(&self.place, self.consent)?;
        let (mut cycles, mut data, mut trips) = (Times::default(), Times::default(), Times::default());
        for k in 0..TRIPS {
            let node = LWA4P.joints[k % LWA4P.joints.len()].node;
            let start = Instant::now();
            blocking::read(master.bus_mut(), node, STATUSWORD)?;
            trips.0.push(start.elapsed().as_secs_f64() * 1e6);
        }
        master.driver_mut().start(ControlMode::InterpolatedPosition, false).map_err(refused)?;
        master.wait_for(Phase::Ready, PATIENCE).map_err(refused)?;
        let count = (self.seconds / LWA4P.period_seconds()).round() as usize;
        let mut last: Option<Instant> = None;
        let mut missing = 0usize;
        let mut complete = true;
        while cycles.0.len() < count {
            let until = master.bus().now() + 100_000;
            match master.step(until).map_err(refused)? {
                Moment::Cycle => {
                    let now = Instant::now();
                    missing += usize::from(!complete);
                    complete = false;
                    cycles.0.extend(last.replace(now).map(|before| (now - before).as_secs_f64() * 1e6));
                }
                Moment::Data => {
                    complete = true;
                    data.0.extend(last.map(|sync| sync.elapsed().as_secs_f64() * 1e6));
                }
                _ => master.check().map_err(refused)?,
            }
        }
        let counters = *master.driver().counters();
        master.stop().map_err(refused)?;
        [&mut cycles, &mut data, &mut trips].into_iter().for_each(|times| times.0.sort_by(f64::total_cmp));
        if self.place.json {
            let result = json!({
                "bus": self.place.bus.to_string(), "sync_interval": cycles.in_json(), "sync_to_data": data.in_json(),
                "sdo": trips.in_json(), "missing": missing, "late": counters.late, "skipped": counters.skipped,
            });
            output::data(&result.to_string());
        } else {
            let clock =
                if self.place.bus == BusUrl::Virtual { "time to compute a cycle" } else { "SYNC to SYNC" };
            output::print(&format!(
                "{}\n{}\n{}\n{missing} cycles with data missing, {} SYNCs late by more than {:.0} µs, {} \
                    left out",
                cycles.in_words(clock),
                data.in_words("SYNC to the data of all six drives"),
                trips.in_words("SDO round trip"),
                counters.late,
                1e6 * LWA4P.period_seconds() * master.driver().profile().reactions.late_fraction,
                counters.skipped
            ));
        }
        Ok(())
    }
}
