//! Real-time priority for the thread that runs the cycle, where the system allows it.

use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// Above everything of the ordinary scheduler, in the middle of the range: below the kernel's own threads
/// that carry the interrupts of the CAN controller where they have been given more.
const PRIORITY: u8 = 50;

/// Runs the calling thread under `SCHED_FIFO` and locks the process's memory, so that neither another program
/// nor a page from a disk keeps a SYNC waiting. Threads that this one starts afterwards inherit it;
/// [`resign`] gives it up.
///
/// # Errors
/// What the system refused, and how to allow it. Rights that it did grant remain.
pub fn claim() -> Result<(), String> {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let mut refused = Vec::new();
    let scheduled = match ThreadPriorityValue::try_from(PRIORITY) {
        Ok(value) => {
            set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy)
                .map_err(|e| format!("{e:?}"))
        }
        Err(e) => Err(e.to_string()),
    };
    if let Err(e) = scheduled {
        refused.push(format!(
            "no real-time priority ({e}): allow it with `ulimit -r {PRIORITY}` or CAP_SYS_NICE"
        ));
    }
    use rustix::mm::{MlockAllFlags, mlockall};
    if let Err(e) = mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE) {
        refused
            .push(format!("memory is not locked ({e}): allow it with `ulimit -l unlimited` or CAP_IPC_LOCK"));
    }
    if refused.is_empty() { Ok(()) } else { Err(refused.join("; ")) }
}

/// The ordinary scheduler again, for a thread that waits for disks.
pub fn resign() {
    let policy = ThreadSchedulePolicy::Normal(thread_priority::NormalThreadSchedulePolicy::Other);
    // 49 of 99 is the ordinary niceness, 0.
    let Ok(priority) = ThreadPriorityValue::try_from(49).map(ThreadPriority::Crossplatform) else { return };
    // A thread that never had more keeps what it has.
    let _ = set_thread_priority_and_policy(thread_native_id(), priority, policy);
}
