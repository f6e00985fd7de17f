//! `--serve`: a page that shows a motion while it runs.
//!
//! A page that is opened late gets the earlier samples. The cycle waits for nothing here: messages go into a
//! finite queue, and are lost if the server has no time for them.

use super::{Failure, live_server};
use clap::Args;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::net::{SocketAddr, TcpListener};
use std::time::{Duration, Instant};
use tokio::sync::mpsc::{Sender, channel};

/// Cycles between two samples of the page: 20 a second at 200 Hz.
pub(super) const EVERY: usize = 10;
/// Messages that wait for the server: those of 50 s.
const QUEUE: usize = 1000;
/// For pages to take the last messages before the program ends.
const GOODBYE: Duration = Duration::from_millis(500);

/// The address of the page.
#[derive(Args, Clone, Debug)]
pub(super) struct Serve {
    /// Show the motion on a page while it runs, at this address of this machine; --bus virtual then takes
    /// real time. The page's whole address, with the token that it needs, is printed.
    #[arg(long, value_name = "127.0.0.1:PORT")]
    serve: Option<SocketAddr>,
}

/// A page that is fed, or none.
#[derive(Clone, Debug)]
pub(super) struct Live {
    server: Option<Sender<String>>,
    began: Instant,
}

impl Serve {
    /// Begins to answer.
    ///
    /// # Errors
    /// An address that is not this machine's own loopback, or that is in use.
    pub(super) fn open(&self) -> Result<Live, Failure> {
        let began = Instant::now();
        let Some(address) = self.serve else { return Ok(Live { server: None, began }) };
        if !address.ip().is_loopback() {
            return Err(Failure::Unusable(format!(
                "--serve {address}: the page is only for this machine, 127.0.0.1 or [::1]; from another \
                    machine use a tunnel (ssh -L)"
            )));
        }
        let failed = |e: &dyn std::fmt::Display| Failure::Unusable(format!("--serve {address}: {e}"));
        let listener = TcpListener::bind(address).map_err(|e| failed(&e))?;
        let at = listener.local_addr().map_err(|e| failed(&e))?;
        let token = token().map_err(|e| failed(&e))?;
        eprintln!("powerball: http://{at}/?token={token}");
        let (server, messages) = channel(QUEUE);
        std::thread::spawn(move || {
            // It must not have the priority of the cycle, which the thread that opened it may have.
            #[cfg(target_os = "linux")]
            powerball_bus::transport::realtime::resign();
            if let Err(e) = live_server::serve(listener, &token, messages) {
                tracing::warn!("--serve {at}: {e}; there is no page");
            }
        });
        Ok(Live { server: Some(server), began })
    }
}

/// 128 random bits: only who was given the page's address has it.
fn token() -> Result<String, getrandom::Error> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    }))
}

impl Live {
    /// Whether somebody may look.
    pub(super) fn is_open(&self) -> bool {
        self.server.is_some()
    }

    fn send(&self, message: &Value) {
        if let Some(server) = &self.server {
            // A sample that the server has no time for is lost.
            let _ = server.try_send(message.to_string());
        }
    }

    /// Announces the fields of the page with their units; each has a value by joint in every sample.
    pub(super) fn start(&self, title: &str, fields: &[(&str, &str)]) {
        let fields: serde_json::Map<String, Value> =
            fields.iter().map(|(name, unit)| ((*name).to_string(), json!(unit))).collect();
        self.send(&json!({"kind": "start", "title": title, "fields": fields}));
    }

    /// A sample at `t` s of the run `run`.
    pub(super) fn sample(&self, run: &str, t: f64, fields: &[(&str, &[f64])]) {
        if !self.is_open() {
            return;
        }
        let mut message = json!({"kind": "sample", "run": run, "t": t});
        for (name, values) in fields {
            message[*name] = json!(values);
        }
        self.send(&message);
    }

    /// Something happened.
    pub(super) fn event(&self, text: &str) {
        self.send(&json!({"kind": "event", "text": text}));
    }

    /// Waits until `seconds` of real time have passed since the page was opened: a virtual bus has a clock of
    /// its own.
    pub(super) fn wait_until(&self, seconds: f64) {
        if self.is_open() && seconds.is_finite() && seconds > 0.0 {
            let left = Duration::from_secs_f64(seconds).saturating_sub(self.began.elapsed());
            std::thread::sleep(left);
        }
    }

    /// The last word.
    pub(super) fn end(&self, text: &str) {
        self.send(&json!({"kind": "end", "text": text}));
        if self.is_open() {
            std::thread::sleep(GOODBYE);
        }
    }
}
