//! A second process that stops the arm if the process that moves it dies.

use signal_hook::consts::{SIGABRT, SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use signal_hook::low_level::{pipe, unregister};
use signal_hook::{SigId, flag};
use std::io::{self, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

/// The handler that ends this process at SIGABRT, after all other handlers.
static END: Mutex<Option<SigId>> = Mutex::new(None);

/// A second process that stops the arm where this one dies before the arm rests: SIGKILL, an abort, a stack
/// overflow, no memory left.
///
/// The watchdog shares nothing with this process but a pipe, and sends nothing while this process lives.
/// Dropped without [`dismiss`](Self::dismiss) it takes this process for dead, so that what is forgotten stops
/// the arm too.
#[derive(Debug)]
pub struct Watchdog {
    child: Child,
    on_abort: Option<SigId>,
}

impl Watchdog {
    /// Starts `command`, a program that calls [`wait`](Self::wait) and then stops the arm, and waits until it
    /// is there.
    ///
    /// # Errors
    /// Where it cannot be started, or ends at once.
    pub fn start(mut command: Command) -> io::Result<Watchdog> {
        // The child has its own process group: Ctrl-C is for this process, which stops the arm itself.
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).process_group(0).spawn()?;
        let heard = child.stdout.take().map_or(Ok(0), |mut ready| ready.read(&mut [0]))?;
        if heard == 0 {
            let status = child.wait()?;
            return Err(io::Error::other(format!("it has ended, {status}")));
        }
        // The pipe closes by itself when the process is gone, but a core dump of a large process comes before
        // that.
        let pipe = child.stdin.as_ref().map(|stdin| stdin.as_fd().try_clone_to_owned()).transpose()?;
        let on_abort = pipe.map(|end| pipe::register(SIGABRT, end)).transpose()?;
        let mut end = END.lock().unwrap_or_else(PoisonError::into_inner);
        end.take().map(unregister);
        *end = Some(flag::register_conditional_default(SIGABRT, Arc::new(AtomicBool::new(true)))?);
        Ok(Watchdog { child, on_abort })
    }

    /// Waits in the second process, and returns when the first one has died. Signals that end both leave this
    /// one alive until then.
    ///
    /// # Errors
    /// Where the system does not let signals be listened to, or no process waits for this one.
    pub fn wait() -> io::Result<()> {
        for signal in [SIGINT, SIGTERM, SIGHUP, SIGQUIT] {
            flag::register(signal, Arc::default())?;
        }
        let mut ready = io::stdout();
        ready.write_all(b"\n")?;
        ready.flush()?;
        // A word or the end of the pipe: both mean the same.
        let _ = io::stdin().read_exact(&mut [0]);
        Ok(())
    }

    /// The arm rests: ends the second process.
    pub fn dismiss(mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        self.on_abort.take().map(unregister);
    }
}
