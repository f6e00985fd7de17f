//! `--serve`: a page that shows a motion while it goes on.
//!
//! One thread answers requests, one more feeds each page that is open. Who comes late gets what was before. Nothing here is
//! waited for by the cycle: what is sent is put into queues.

use super::Failure;
use crate::report::stream_page;
use clap::Args;
use serde_json::{Value, json};
use std::io::Write;
use std::net::SocketAddr;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tiny_http::{Header, Request, Response, Server};

/// Cycles between two samples of the page: 20 a second at 200 Hz.
pub(super) const EVERY: usize = 10;
/// Messages that late pages still get; the oldest samples go first.
const MOST: usize = 50_000;
/// For pages to take the last messages before the program ends.
const GOODBYE: Duration = Duration::from_millis(500);

/// Where the page is.
#[derive(Args, Clone, Debug)]
pub(super) struct Serve {
    /// Show the motion on a page while it goes on, at this address of this machine; --bus virtual then takes real time.
    #[arg(long, value_name = "127.0.0.1:PORT")]
    serve: Option<SocketAddr>,
}

/// Messages so far, and who gets the next ones.
#[derive(Debug, Default)]
struct Shared {
    history: Vec<String>,
    pages: Vec<Sender<String>>,
}

/// A page that is fed, or none.
#[derive(Clone, Debug)]
pub(super) struct Live {
    shared: Option<Arc<Mutex<Shared>>>,
    began: Instant,
}

impl Serve {
    /// Begins to answer.
    ///
    /// # Errors
    /// An address that is not this machine's own loopback, or that is in use.
    pub(super) fn open(&self) -> Result<Live, Failure> {
        let began = Instant::now();
        let Some(address) = self.serve else { return Ok(Live { shared: None, began }) };
        if !address.ip().is_loopback() {
            return Err(Failure::Unusable(format!(
                "--serve {address}: pages are for this machine alone, 127.0.0.1 or [::1]; from another one take a tunnel (ssh -L)"
            )));
        }
        let server =
            Server::http(address).map_err(|e| Failure::Unusable(format!("--serve {address}: {e}")))?;
        let at = server.server_addr().to_ip().unwrap_or(address);
        eprintln!("powerball: http://{at}/");
        let shared = Arc::new(Mutex::new(Shared::default()));
        let of_server = Arc::clone(&shared);
        std::thread::spawn(move || {
            for request in server.incoming_requests() {
                answer(request, &of_server);
            }
        });
        Ok(Live { shared: Some(shared), began })
    }
}

fn locked(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

fn answer(request: Request, shared: &Mutex<Shared>) {
    // A page that has gone is nobody's loss.
    let _ = match request.url() {
        "/" => {
            let header = Header::from_bytes("Content-Type", "text/html; charset=utf-8");
            let page = Response::from_string(stream_page());
            request.respond(header.into_iter().fold(page, Response::with_header))
        }
        "/events" => {
            let (send, messages) = channel();
            let before = {
                let mut shared = locked(shared);
                shared.pages.push(send);
                shared.history.clone()
            };
            std::thread::spawn(move || feed(request, &before, &messages));
            Ok(())
        }
        _ => request.respond(Response::from_string("nothing is here; / is the page\n").with_status_code(404)),
    };
}

/// Server-sent events (HTML, §9.2) until the page or the program goes.
fn feed(request: Request, before: &[String], messages: &Receiver<String>) -> std::io::Result<()> {
    let mut page = request.into_writer();
    page.write_all(
        b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n",
    )?;
    for message in before {
        write!(page, "data: {message}\n\n")?;
    }
    page.flush()?;
    while let Ok(message) = messages.recv() {
        write!(page, "data: {message}\n\n")?;
        page.flush()?;
    }
    Ok(())
}

impl Live {
    /// Whether somebody may look.
    pub(super) fn is_open(&self) -> bool {
        self.shared.is_some()
    }

    fn send(&self, message: &Value) {
        let Some(shared) = &self.shared else { return };
        let (mut shared, text) = (locked(shared), message.to_string());
        if shared.history.len() >= MOST {
            // What began it all stays.
            shared.history.drain(1..MOST / 10);
        }
        shared.history.push(text.clone());
        shared.pages.retain(|page| page.send(text.clone()).is_ok());
    }

    /// What there is to see: fields with their units, each with a value by joint in every sample.
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

    /// Waits until so much real time has passed since the page was opened: a virtual bus has a clock of its own.
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
