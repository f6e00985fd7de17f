//! Long computations: without the interpreter's lock, with progress, and ended by Ctrl-C.

use powerball::logs::Progress;
use pyo3::prelude::*;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// How often Python is asked whether Ctrl-C was pressed.
const LOOK: Duration = Duration::from_millis(50);
/// What a main thread has on Linux.
const STACK: usize = 8 << 20;

/// What a computation sends.
enum Message<T> {
    /// What it is doing now.
    Said(String),
    /// The result of the work.
    Done(T),
}

/// What is being done, for who listens to Python's logger "powerball".
fn log(py: Python<'_>, what: &str) -> PyResult<()> {
    let logger = py.import("logging")?.call_method1("getLogger", ("powerball",))?;
    logger.call_method1("info", (what,)).map(drop)
}

/// Runs a computation on a thread of its own while this one calls `listener` with what is being done and
/// looks for Ctrl-C. Where either raises, the exception is raised at once, and the computation ends when it
/// next says what it does.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    listener: Option<&Bound<'_, PyAny>>,
    task: impl FnOnce(Progress<'_>) -> T + Send + 'static,
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    let (send, messages) = channel();
    let work = move || {
        let say = |what: &str| {
            if stopped.load(Ordering::Relaxed) {
                // No panic: nothing is printed, nobody waits for this thread.
                resume_unwind(Box::new("interrupted"));
            }
            // Nobody may be listening any more.
            let _ = send.send(Message::Said(what.to_string()));
        };
        let done = task(Progress::to(&say));
        let _ = send.send(Message::Done(done));
    };
    let thread = thread::Builder::new().stack_size(STACK).spawn(work)?;
    let messages = Mutex::new(messages);
    let next = || messages.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK);
    loop {
        let heard = match py.detach(next) {
            Ok(Message::Done(done)) => return Ok(done),
            Ok(Message::Said(what)) => {
                log(py, &what).and_then(|()| listener.map_or(Ok(()), |l| l.call1((what,)).map(drop)))
            }
            Err(RecvTimeoutError::Timeout) => Ok(()),
            // It ended without a result.
            Err(RecvTimeoutError::Disconnected) => match thread.join() {
                Err(panic) => resume_unwind(panic),
                Ok(()) => return Err(crate::failure::refused("the computation ended without a result")),
            },
        };
        if let Err(e) = heard.and_then(|()| py.check_signals()) {
            stop.store(true, Ordering::Relaxed);
            return Err(e);
        }
    }
}
