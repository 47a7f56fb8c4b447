//! Requests real-time scheduling of the calling thread and reports what was granted.

use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::Write as _;

use serde::Serialize;

use super::processor;

/// Device that keeps the processors awake enough for a latency, in microseconds, while it is open.
const LATENCY_DEVICE: &str = "/dev/cpu_dma_latency";

/// More than the usual limit of locked memory, 8 MB.
const PROBE_MAX: usize = 1 << 26;
/// A page, or more.
const PAGE: usize = 1 << 16;
/// Stack of a tick, several times over; threads have 2 MB.
const STACK: usize = 1 << 18;

/// Requested scheduling and memory locking.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RtRequest {
    /// `SCHED_FIFO` priority, 1 to 98; kernel threads need the rest.
    pub priority: i32,
    /// Lock all memory of the process (`mlockall`).
    pub lock_memory: bool,
    /// Processor for this thread alone, of all in the program.
    pub cpu: Option<usize>,
}

impl Default for RtRequest {
    fn default() -> Self {
        Self { priority: 80, lock_memory: true, cpu: None }
    }
}

/// Granted scheduling, and known obstacles to punctuality on this machine.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RtReport {
    /// `SCHED_FIFO` or `SCHED_OTHER`.
    pub policy: String,
    /// Priority granted; 0 for `SCHED_OTHER`.
    pub priority: i32,
    /// True if memory is locked.
    pub mlock: bool,
    /// True if the processors are kept from sleeping deeply.
    pub awake: bool,
    /// Processor that the thread has to itself, of all in the program.
    pub cpu: Option<usize>,
    /// Time before a tick for which the thread busy-waits.
    pub spin_us: f64,
    /// Kernel release, and whether it is a real-time kernel (`PREEMPT_RT`).
    pub kernel: String,
    /// Parts of the request that were refused.
    #[serde(skip)]
    pub refused: Vec<Refused>,
    /// One sentence for each request that was refused and each setting known to add latency.
    pub notes: Vec<String>,
}

/// Part of a request that was refused, and the system's reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Refused {
    /// `SCHED_FIFO` priority.
    Priority(i32, String),
    /// Locked memory.
    Memory(String),
    /// A processor of its own.
    Processor(usize, String),
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Priority(priority, reason) => {
                let hint = "give the program CAP_SYS_NICE or an rtprio limit";
                write!(f, "SCHED_FIFO {priority} refused ({reason}); {hint}")
            }
            Self::Memory(reason) => {
                let hint = "give the program CAP_IPC_LOCK or a memlock limit";
                write!(f, "mlockall refused ({reason}); {hint}")
            }
            Self::Processor(cpu, reason) => {
                let hint = "[realtime] cpu names one that this program may use";
                write!(f, "processor {cpu} refused ({reason}); {hint}")
            }
        }
    }
}

impl RtReport {
    /// Returns the report of a thread that was granted nothing of a request.
    pub fn refusing(request: RtRequest, reason: &str) -> Self {
        let mut refused = vec![Refused::Priority(request.priority, reason.to_owned())];
        if request.lock_memory {
            refused.push(Refused::Memory(reason.to_owned()));
        }
        refused.extend(request.cpu.map(|cpu| Refused::Processor(cpu, reason.to_owned())));
        let notes = refused.iter().map(Refused::to_string).collect();
        Self { refused, notes, ..Self::default() }
    }
}

/// Applies `request` to the calling thread (priority) and the process (memory).
///
/// Never fails: refusals are reported, and the loop runs with what it has.
#[expect(unsafe_code, reason = "the scheduler and mlockall have no safe wrapper")]
pub fn enter(request: RtRequest) -> RtReport {
    let mut refused = Vec::new();
    let parameters = libc::sched_param { sched_priority: request.priority };
    // SAFETY: `parameters` is valid for the call; thread 0 means the caller.
    let fifo = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) } == 0;
    if !fifo {
        let reason = std::io::Error::last_os_error().to_string();
        refused.push(Refused::Priority(request.priority, reason));
    }
    // SAFETY: mlockall takes flags only.
    let mlock =
        request.lock_memory && unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) } == 0;
    if request.lock_memory && !mlock {
        refused.push(Refused::Memory(std::io::Error::last_os_error().to_string()));
    }
    let mut cpu = request.cpu;
    if let Some(asked) = cpu
        && let Err(error) = processor::claim(asked)
    {
        refused.push(Refused::Processor(asked, error.to_string()));
        cpu = None;
    }
    let mut notes: Vec<String> = refused.iter().map(Refused::to_string).collect();
    sleep_exactly();
    touch_stack();
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
        awake: false,
        cpu,
        spin_us: 0.0,
        kernel: format!("{release}{}", if realtime { " PREEMPT_RT" } else { "" }),
        refused,
        notes,
    }
}

/// Lets sleeps of this thread end as asked, and not up to 50 us later; a real-time priority implies it.
#[expect(unsafe_code, reason = "prctl has no safe wrapper in the standard library")]
fn sleep_exactly() {
    // SAFETY: takes a number only.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1_u64) };
}

/// Touches the stack that a tick may use, so that no tick waits for its pages.
#[inline(never)]
#[expect(clippy::large_stack_arrays, reason = "its purpose")]
fn touch_stack() {
    let mut stack = [0_u8; STACK];
    for page in stack.chunks_mut(4096) {
        page[0] = 1;
    }
    std::hint::black_box(&mut stack);
}

/// Keeps the processors from sleeping deeply while the result is held, where this is permitted, and notes it in
/// the report.
pub fn keep_awake(report: &mut RtReport) -> Option<File> {
    match awake() {
        Ok(held) => {
            report.awake = true;
            Some(held)
        }
        // There is none in a container, and on some kernels.
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => None,
        Err(error) => {
            report.notes.push(format!(
                "{LATENCY_DEVICE} refused ({error}): the processors sleep deeply and wake slowly; `setfacl -m \
                 u:$USER:rw {LATENCY_DEVICE}` permits it"
            ));
            None
        }
    }
}

/// Keeps the processors from sleeping deeply while the result is held.
///
/// # Errors
/// That of the system.
pub fn awake() -> std::io::Result<File> {
    let mut device = OpenOptions::new().write(true).open(LATENCY_DEVICE)?;
    device.write_all(&0_i32.to_ne_bytes())?;
    Ok(device)
}

/// Returns whether this process may lock its memory, without locking it.
///
/// # Errors
/// The reason.
#[expect(unsafe_code, reason = "mlock and munlock have no safe wrapper")]
pub fn memory_lockable() -> Result<(), String> {
    let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: `limit` is a valid, exclusively borrowed rlimit for the whole call.
    let is_known = unsafe { libc::getrlimit(libc::RLIMIT_MEMLOCK, &raw mut limit) } == 0;
    if is_known && limit.rlim_cur == libc::RLIM_INFINITY {
        return Ok(());
    }
    let probe = vec![1_u8; usize::try_from(limit.rlim_cur).unwrap_or(0).min(PROBE_MAX) + PAGE];
    // SAFETY: the range is that of `probe`, which outlives the call.
    let locked = unsafe { libc::mlock(probe.as_ptr().cast(), probe.len()) } == 0;
    let error = std::io::Error::last_os_error();
    if locked {
        // SAFETY: the same range.
        unsafe { libc::munlock(probe.as_ptr().cast(), probe.len()) };
        return Ok(());
    }
    Err(error.to_string())
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
        let request = RtRequest { priority: 1000, lock_memory: false, cpu: None };
        let report = std::thread::spawn(move || enter(request)).join().unwrap();
        assert_eq!(report.policy, "SCHED_OTHER");
        assert!(matches!(report.refused[..], [Refused::Priority(1000, _)]), "{report:?}");
        assert_eq!(report.notes[0], report.refused[0].to_string());
    }

    #[test]
    fn a_thread_that_died_was_granted_nothing() {
        let request = RtRequest { cpu: Some(1), ..RtRequest::default() };
        let refused = RtReport::refusing(request, "its thread ended").refused;
        assert_eq!(refused.len(), 3, "{refused:?}");
    }
}
