//! The event log of a program, with levels: on standard error, and in a file or the system's journal.
//!
//! Events come from the code in which something happens (`tracing`), among them all notes of the driver of an
//! arm. Nothing waits for the disk: a separate thread writes lines, and lines are lost rather than a cycle
//! delayed.

use super::Failure;
use super::output::{SHOWN, Verbosity};
use clap::Args;
use std::fmt;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};
use tracing::{Event, Level, Subscriber};
use tracing_appender::non_blocking::{NonBlocking, NonBlockingBuilder, WorkerGuard};
use tracing_subscriber::filter::{EnvFilter, FilterFn};
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::layer::{Layer, SubscriberExt};
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt;

/// Which events are seen, and where.
#[derive(Args, Clone, Debug)]
pub(super) struct Events {
    /// Add events to this file, a JSON object each (time, level, message), or send them to `journald`.
    /// RUST_LOG says which: info, debug (each drive's state too), warn.
    #[arg(long, global = true, value_name = "FILE|journald")]
    events: Option<PathBuf>,
}

impl Events {
    /// Begins to listen. The returned guards write the remaining lines when they are dropped, and must live
    /// until the program ends.
    pub(super) fn listen(&self, verbosity: Verbosity) -> Result<Vec<WorkerGuard>, Failure> {
        let level = match (verbosity.quiet, verbosity.verbose) {
            (true, _) => "error",
            (_, true) => "info",
            _ => "warn",
        };
        let (lines, guard) = unhurried(std::io::stderr());
        let mut guards = vec![guard];
        let screen = tracing_subscriber::fmt::layer()
            .with_writer(lines)
            .event_format(Line)
            .with_filter(FilterFn::new(|event| event.target() != SHOWN))
            .with_filter(filter(level)?);
        let listeners = tracing_subscriber::registry().with(screen);
        // Another listener of this process, where there is one, stays.
        let _ = match &self.events {
            None => listeners.try_init(),
            Some(target) if target.as_os_str() == "journald" => {
                listeners.with(journal()?.with_filter(filter("info")?)).try_init()
            }
            Some(target) => {
                let (lines, guard) = unhurried(opened(target)?);
                guards.push(guard);
                let file = tracing_subscriber::fmt::layer().json().flatten_event(true).with_writer(lines);
                listeners.with(file.with_filter(filter("info")?)).try_init()
            }
        };
        Ok(guards)
    }
}

/// Lines that another thread writes: a pipe without a reader, or a busy disk, delays no cycle.
fn unhurried(to: impl Write + Send + 'static) -> (NonBlocking, WorkerGuard) {
    NonBlockingBuilder::default().lossy(true).finish(to)
}

/// RUST_LOG, or else this level.
fn filter(level: &str) -> Result<EnvFilter, Failure> {
    match std::env::var(EnvFilter::DEFAULT_ENV) {
        Ok(given) if !given.is_empty() => EnvFilter::try_new(&given).map_err(|e| {
            Failure::Unusable(format!(
                "RUST_LOG={given}: {e}; for example RUST_LOG=debug, or powerball::bus=debug"
            ))
        }),
        _ => Ok(EnvFilter::new(level)),
    }
}

fn opened(file: &Path) -> Result<std::fs::File, Failure> {
    let opened = OpenOptions::new().create(true).append(true).open(file);
    opened.map_err(|e| Failure::Unusable(format!("{}: events cannot be added: {e}", file.display())))
}

#[cfg(target_os = "linux")]
fn journal<S: Subscriber + for<'a> LookupSpan<'a>>() -> Result<impl Layer<S>, Failure> {
    let found = tracing_journald::layer();
    found.map_err(|e| Failure::Unusable(format!("--events journald: the journal cannot be reached: {e}")))
}

#[cfg(not(target_os = "linux"))]
fn journal() -> Result<tracing_subscriber::layer::Identity, Failure> {
    Err(Failure::Unusable("--events journald: only Linux has it; give a file".to_string()))
}

/// `powerball: message`, as errors are printed; milder ones with their level.
struct Line;

impl<S, N> FormatEvent<S, N> for Line
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(
        &self,
        context: &FmtContext<'_, S, N>,
        mut writer: Writer<'_>,
        event: &Event<'_>,
    ) -> fmt::Result {
        let level = *event.metadata().level();
        write!(writer, "powerball: ")?;
        if level > Level::WARN {
            write!(writer, "{}: ", level.as_str().to_ascii_lowercase())?;
        }
        context.format_fields(writer.by_ref(), event)?;
        writeln!(writer)
    }
}
