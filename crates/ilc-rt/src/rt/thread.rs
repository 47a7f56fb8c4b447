//! Requests real-time scheduling of the calling thread and reports what was granted.

use serde::Serialize;

/// Requested scheduling and memory locking.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RtRequest {
    /// `SCHED_FIFO` priority, 1 to 98; kernel threads need the rest.
    pub priority: i32,
    /// Lock all memory of the process (`mlockall`).
    pub lock_memory: bool,
}

impl Default for RtRequest {
    fn default() -> Self {
        Self { priority: 80, lock_memory: true }
    }
}

/// Granted scheduling, and known obstacles to punctuality on this machine.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RtReport {
    /// `SCHED_FIFO` or `SCHED_OTHER`.
    pub policy: String,
    /// Priority granted; 0 for `SCHED_OTHER`.
    pub priority: i32,
    /// True if memory is locked.
    pub mlock: bool,
    /// Kernel release, and whether it is a real-time kernel (`PREEMPT_RT`).
    pub kernel: String,
    /// One sentence for each request that was refused and each setting known to add latency.
    pub notes: Vec<String>,
}

/// Applies `request` to the calling thread (priority) and the process (memory).
///
/// Never fails: refusals are reported, and the loop runs with what it has.
#[expect(unsafe_code, reason = "the scheduler and mlockall have no safe wrapper")]
pub fn enter(request: RtRequest) -> RtReport {
    let mut notes = Vec::new();
    let parameters = libc::sched_param { sched_priority: request.priority };
    // SAFETY: `parameters` is valid for the call; thread 0 means the caller.
    let fifo = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) } == 0;
    if !fifo {
        notes.push(format!(
            "SCHED_FIFO {} refused ({}); give the program CAP_SYS_NICE or an rtprio limit",
            request.priority,
            std::io::Error::last_os_error()
        ));
    }
    // SAFETY: mlockall takes flags only.
    let mlock =
        request.lock_memory && unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) } == 0;
    if request.lock_memory && !mlock {
        notes.push(format!(
            "mlockall refused ({}); give the program CAP_IPC_LOCK or a memlock limit",
            std::io::Error::last_os_error()
        ));
    }
    let release = first_line("/proc/sys/kernel/osrelease").unwrap_or_default();
    let realtime = first_line("/sys/kernel/realtime").as_deref() == Some("1");
    if !realtime {
        notes.push("the kernel is not PREEMPT_RT: wake-ups can be milliseconds late".to_owned());
    }
    if let Some(governor) = first_line("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")
        && governor != "performance"
    {
        notes.push(format!("processor governor is {governor}; \"performance\" wakes faster"));
    }
    let policy = if fifo { "SCHED_FIFO" } else { "SCHED_OTHER" };
    RtReport {
        policy: policy.to_owned(),
        priority: if fifo { request.priority } else { 0 },
        mlock,
        kernel: format!("{release}{}", if realtime { " PREEMPT_RT" } else { "" }),
        notes,
    }
}

fn first_line(path: &str) -> Option<String> {
    let text = std::fs::read_to_string(path).ok()?;
    text.lines().next().map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refused_priority_is_reported_not_hidden() {
        // Runs in its own thread, as the policy would persist in the test runner's.
        let report = std::thread::spawn(|| enter(RtRequest { priority: 1000, lock_memory: false }))
            .join()
            .unwrap();
        assert_eq!(report.policy, "SCHED_OTHER");
        assert!(report.notes.iter().any(|note| note.contains("1000")), "{:?}", report.notes);
    }
}
