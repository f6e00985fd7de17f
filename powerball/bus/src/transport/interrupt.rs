//! Signals that end a program: the arm's master stops the arm first.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether this process was asked to end: Ctrl-C, SIGTERM, SIGHUP, SIGQUIT.
///
/// While a [`Master`](super::Master) with it lives, such a signal stops the arm: quick stop, brakes, no
/// torque. A second signal does not skip the stop, nor the end of the process, which closes its log. Once the
/// master is gone and no signal came, signals end the process as usual. A file-size limit (SIGXFSZ) is an
/// error of the write and does not end the process.
#[derive(Clone, Debug, Default)]
pub struct Interrupt {
    asked: Arc<AtomicBool>,
    /// No arm is moved and none was stopped by a signal: a signal ends the process.
    idle: Arc<AtomicBool>,
}

impl Interrupt {
    /// One that listens to the process's signals.
    ///
    /// # Errors
    /// Where the system does not let them be listened to.
    pub fn install() -> io::Result<Interrupt> {
        use signal_hook::consts;
        use signal_hook::flag;
        let interrupt = Interrupt::default();
        #[cfg(unix)]
        let ending = [consts::SIGINT, consts::SIGTERM, consts::SIGHUP, consts::SIGQUIT];
        #[cfg(not(unix))]
        let ending = [consts::SIGINT, consts::SIGTERM];
        for signal in ending {
            flag::register_conditional_default(signal, Arc::clone(&interrupt.idle))?;
            flag::register(signal, Arc::clone(&interrupt.asked))?;
        }
        file_limit_is_an_error()?;
        Ok(interrupt)
    }

    /// Asks for the end, as a signal does.
    pub fn ask(&self) {
        self.asked.store(true, Ordering::SeqCst);
    }

    /// Whether the end was requested.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.asked.load(Ordering::SeqCst)
    }

    /// Sets whether an arm is moved from now on. A process that was asked to end closes its files after the
    /// first request.
    pub(super) fn guard(&self, moved: bool) {
        self.idle.store(!moved && !self.is_asked(), Ordering::SeqCst);
    }
}

/// Turns a file-size limit (`ulimit -f`) into an error of the write that reaches it. Otherwise it would end
/// this process, which could neither report it nor remove a half-written file.
///
/// # Errors
/// Where the system does not let signals be listened to.
pub fn file_limit_is_an_error() -> io::Result<()> {
    #[cfg(target_os = "linux")]
    signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)))?;
    Ok(())
}

/// A file would become larger than it may; the number on Linux (signal(7)), the same on all of its common
/// machines.
#[cfg(target_os = "linux")]
const SIGXFSZ: i32 = 25;
