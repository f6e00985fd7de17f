//! The phases of the driver, as a caller sees them. What each of them holds is in [`super::stage`].

use core::fmt;

/// The phases of the driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Phase {
    /// The driver is idle: no frame is sent.
    Idle,
    /// Nothing is sent: another master would be heard.
    Listening,
    /// The nodes were reset; their boot-up messages are awaited.
    Boot,
    /// Who they are and what they offer is read.
    Identify,
    /// The nodes are configured.
    Configure,
    /// The configuration is read back.
    Verify,
    /// SYNC runs; the first process data is awaited.
    Starting,
    /// Configured, without torque, brakes closed.
    Ready,
    /// On the way to "operation enabled"; brakes closed but for a joint that commutates.
    Enabling,
    /// Following set-points.
    Running,
    /// Quick stop, brakes, torque off.
    Stopping,
    /// Stopped, with a cause latched.
    Faulted,
    /// The drives' faults are reset, once.
    Resetting,
}

impl Phase {
    /// All of them.
    pub const ALL: [Phase; 13] = [
        Phase::Idle,
        Phase::Listening,
        Phase::Boot,
        Phase::Identify,
        Phase::Configure,
        Phase::Verify,
        Phase::Starting,
        Phase::Ready,
        Phase::Enabling,
        Phase::Running,
        Phase::Stopping,
        Phase::Faulted,
        Phase::Resetting,
    ];

    /// The phase in words that continue "the driver …".
    pub const fn text(self) -> &'static str {
        match self {
            Phase::Idle => "is idle",
            Phase::Listening => "listens for another master",
            Phase::Boot => "waits for the nodes to boot",
            Phase::Identify => "identifies the nodes",
            Phase::Configure => "configures the nodes",
            Phase::Verify => "verifies the configuration",
            Phase::Starting => "waits for process data",
            Phase::Ready => "is ready, not enabled",
            Phase::Enabling => "is enabling",
            Phase::Running => "is running",
            Phase::Stopping => "is stopping",
            Phase::Faulted => "is stopped by a fault",
            Phase::Resetting => "resets faults",
        }
    }
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}
