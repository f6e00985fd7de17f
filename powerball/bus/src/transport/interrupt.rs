//! Signals that end a program, as a wish that the arm's master fulfils first.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether this process was asked to end: Ctrl-C, SIGTERM, SIGHUP, SIGQUIT.
///
/// While a [`Master`](super::Master) with it lives, such a signal stops the arm: quick stop, brakes, no torque. A
/// second signal asks for the same again and does not skip it, nor what the process then does to end: its log is
/// closed. Once the master is gone and no signal came, signals end the process as usual. A file-size limit (SIGXFSZ) is
/// an error of the write, and no end of the process.
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

    /// Whether the end was asked for.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        self.asked.load(Ordering::SeqCst)
    }

    /// Whether an arm is moved from now on. A process that was asked to end closes its files without being asked twice.
    pub(super) fn guard(&self, moved: bool) {
        self.idle.store(!moved && !self.is_asked(), Ordering::SeqCst);
    }
}

/// Makes a file-size limit (`ulimit -f`) an error of the write that meets it, and no end of this process, which could then
/// neither say so nor take away what it has half written.
///
/// # Errors
/// Where the system does not let signals be listened to.
pub fn file_limit_is_an_error() -> io::Result<()> {
    #[cfg(target_os = "linux")]
    signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)))?;
    Ok(())
}

/// A file would become larger than it may; the number on Linux (signal(7)), the same on all of its common machines.
#[cfg(target_os = "linux")]
const SIGXFSZ: i32 = 25;
