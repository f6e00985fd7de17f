//! `powerball bus state` and `powerball bus watch`.

use super::super::output;
use super::{Failure, Where, node, wait};
use clap::Args;
use powerball_bus::canopen::{NodeId, Object, objects};
use powerball_bus::cia402::{Mode, Statusword, objects as drive, schunk};
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::transport::blocking;
use powerball_bus::transport::{Bus, BusUrl};
use serde_json::json;
use std::fmt::Write as _;
use std::io::IsTerminal;
use std::time::Duration;

/// Ask each drive once for its state, mode, position, velocity, torque and errors. Nothing is changed and
/// nothing moves.
#[derive(Args, Debug)]
#[command(after_help = "Example: powerball bus state --bus socketcan:can0 --node 3 --node 4")]
pub(crate) struct Show {
    #[command(flatten)]
    what: What,
}

/// A live table of the drives, by asking again and again. Nothing is changed and nothing moves.
///
/// Ends with Ctrl-C, or after `--for`. With `--json` each table is one object on a line of its own.
#[derive(Args, Debug)]
#[command(after_help = "Example: powerball bus watch --bus udp:239.74.163.2:43113 --every 0.5")]
pub(crate) struct Watch {
    #[command(flatten)]
    what: What,
    /// Seconds between two tables.
    #[arg(long, default_value_t = 0.5, value_name = "SECONDS")]
    every: f64,
    /// Ends after this many seconds.
    #[arg(long = "for", value_name = "SECONDS")]
    seconds: Option<f64>,
}

#[derive(Args, Clone, Debug)]
struct What {
    #[command(flatten)]
    place: Where,
    /// The nodes to ask; those of the LWA 4P (3 to 8) where none is given.
    #[arg(long, value_parser = node)]
    node: Vec<NodeId>,
}

/// The report of one drive.
struct Row {
    node: NodeId,
    status: Statusword,
    mode: Mode,
    /// rad, rad/s, N·m.
    joint: [f64; 3],
    commutated: bool,
    error: u32,
}

impl What {
    fn nodes(&self) -> Vec<NodeId> {
        if self.node.is_empty() {
            LWA4P.joints.iter().map(|joint| joint.node).collect()
        } else {
            self.node.clone()
        }
    }

    /// Asks all drives; who does not answer is left out, and named with the reason.
    fn ask(&self, bus: &mut dyn Bus) -> (Vec<Row>, Vec<String>) {
        let (mut rows, mut silent) = (Vec::new(), Vec::new());
        for node in self.nodes() {
            match row(bus, node) {
                Ok(row) => rows.push(row),
                Err(e) => silent.push(e.to_string()),
            }
        }
        (rows, silent)
    }

    fn in_json(&self, rows: &[Row], silent: &[String]) -> String {
        let nodes: Vec<_> = rows
            .iter()
            .map(|row| {
                let [position, velocity, torque] = row.joint;
                json!({
                    "node": row.node.raw(), "state": row.status.state().to_string(), "statusword": row.status.0,
                    "mode": row.mode.to_string(), "position": position, "velocity": velocity, "torque": torque,
                    "commutated": row.commutated, "error": row.error,
                })
            })
            .collect();
        json!({ "bus": self.place.bus.to_string(), "nodes": nodes, "silent": silent }).to_string()
    }
}

fn row(bus: &mut dyn Bus, node: NodeId) -> Result<Row, blocking::TransferError> {
    let mut ask = |object: Object| blocking::read(bus, node, object);
    let status = Statusword(ask(drive::STATUSWORD)?.unsigned().unwrap_or(0) as u16);
    let mode = Mode::from_code(ask(drive::MODE_DISPLAY)?.signed().unwrap_or(0) as i8);
    let mut signed = |object: Object| ask(object).map(|v| v.signed().unwrap_or(0));
    let counts = [signed(drive::POSITION)?, signed(drive::VELOCITY)?, signed(drive::TORQUE)?];
    let known = LWA4P.joints.iter().find(|joint| joint.node == node).unwrap_or(&LWA4P.joints[0]).units;
    // A missing object that not every drive has does not make it silent.
    let extended = signed(schunk::EXTENDED_STATUS).unwrap_or(i32::from(schunk::COMMUTATED));
    let history = signed(objects::ERROR_HISTORY).unwrap_or(0);
    let error =
        if history > 0 { signed(Object::new(objects::ERROR_HISTORY.index, 1)).unwrap_or(0) } else { 0 };
    Ok(Row {
        node,
        status,
        mode,
        joint: [known.position(counts[0]), known.position(counts[1]), known.torque(counts[2])],
        commutated: extended & i32::from(schunk::COMMUTATED) != 0,
        error: error as u32,
    })
}

fn in_words(rows: &[Row], silent: &[String]) -> String {
    let mut out = String::from(
        "node  state                   mode                    rad      rad/s     N·m  last error\n",
    );
    for row in rows {
        let [position, velocity, torque] = row.joint;
        let search = if row.commutated { "" } else { "  commutation not searched" };
        let error = if row.error == 0 { "-".to_string() } else { format!("0x{:04X}", row.error & 0xFFFF) };
        let _ = writeln!(
            out,
            "{:>4}  {:<22}  {:<21} {position:>8.4} {velocity:>9.4} {torque:>7.2}  {error}{search}",
            row.node.raw(),
            row.status.state().to_string(),
            row.mode.to_string(),
        );
    }
    silent.iter().for_each(|why| {
        let _ = writeln!(out, "{why}");
    });
    out
}

impl Show {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let mut bus = self.what.place.open()?;
        let (rows, silent) = self.what.ask(&mut *bus);
        let json = self.what.place.json;
        match json {
            true => output::data(self.what.in_json(&rows, &silent).trim_end()),
            false => output::print(in_words(&rows, &silent).trim_end()),
        }
        if rows.is_empty() {
            return Err(Failure::Refused(format!("no drive answers on {}", self.what.place.bus)));
        }
        Ok(())
    }
}

impl Watch {
    pub(crate) fn run(self) -> Result<(), Failure> {
        // Beyond a day it is a mistake, and beyond what a clock holds.
        if !(self.every > 0.0 && self.every <= 86_400.0) {
            return Err(Failure::Unusable(
                "--every is a number of seconds above 0, at most 86400".to_string(),
            ));
        }
        let mut bus = self.what.place.open()?;
        let period = Duration::from_secs_f64(self.every);
        let tables = self.seconds.map_or(u64::MAX, |s| (s / self.every).ceil().max(1.0) as u64);
        let redraw = std::io::stdout().is_terminal() && !self.what.place.json && !output::is_quiet();
        for k in 0..tables {
            let (rows, silent) = self.what.ask(&mut *bus);
            if redraw && k > 0 {
                // Back to the top of the table before.
                print!("\x1b[{}A\x1b[J", self.what.nodes().len() + 1);
            }
            let json = self.what.place.json;
            match json {
                true => output::data(self.what.in_json(&rows, &silent).trim_end()),
                false => output::print(in_words(&rows, &silent).trim_end()),
            }
            if self.what.place.bus == BusUrl::Virtual {
                // A clock of its own: the person's passes too.
                std::thread::sleep(period);
            }
            if k + 1 < tables {
                wait(&mut *bus, period.as_micros() as u64)?;
            }
        }
        Ok(())
    }
}
