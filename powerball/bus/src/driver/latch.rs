//! What was latched: why the arm was stopped, and what must come before it moves again.

use super::cause::{Cause, Details};

/// The cause, until it is acknowledged, and what follows from it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Latch {
    cause: Option<Cause>,
    /// The nodes' configuration can no longer be trusted.
    restart: bool,
    /// The program was asked to end, and the arm was stopped for it.
    pub(super) interrupted: bool,
    /// Nothing is sent any more, not even a heartbeat.
    pub(super) silent: bool,
    /// The error details of the drive that the last cause named.
    pub(super) details: Details,
}

impl Latch {
    pub(super) const fn cause(&self) -> Option<&Cause> {
        self.cause.as_ref()
    }

    pub(super) const fn needs_restart(&self) -> bool {
        self.restart
    }

    /// The first cause stays. Only missing data is replaced by a cause that explains it: data of a node that
    /// restarts is missing before the node reports it. A cause that needs a restart is never forgotten.
    /// `starting`: the first process data is awaited.
    pub(super) fn take(&mut self, cause: Cause, starting: bool) {
        let tells_more = |first| match first {
            Cause::DataMissing(node) => cause.needs_restart() && cause.node() == Some(node),
            _ => false,
        };
        if self.cause.is_none_or(tells_more) {
            self.cause = Some(cause);
        }
        // If first data is missing for a reason that a fault reset cannot correct, the nodes must be
        // configured again.
        let resettable = matches!(cause, Cause::DriveFault(..) | Cause::Emergency(..));
        self.restart |= cause.needs_restart() || starting && !resettable;
    }

    /// The caller has seen the cause; `restarts` where the nodes are configured again.
    pub(super) fn acknowledge(&mut self, restarts: bool) {
        (self.cause, self.interrupted) = (None, false);
        if restarts {
            (self.restart, self.silent) = (false, false);
        }
    }
}
