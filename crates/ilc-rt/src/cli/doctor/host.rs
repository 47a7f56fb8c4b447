//! Kernel, processors and rights of this computer.

use std::path::Path;

use super::{Finding, first_line, names};
use crate::rt::{RtRequest, thread};

const PROCESSORS: &str = "/sys/devices/system/cpu";
const CLOCK_SOURCE: &str = "/sys/devices/system/clocksource/clocksource0/current_clocksource";
/// Clock source that is read without a call into the kernel and drifts least.
const BEST_CLOCKS: [&str; 2] = ["tsc", "arch_sys_counter"];

/// Examines what the files of the system tell, below a root.
pub(super) fn examine(root: &Path) -> Vec<Finding> {
    vec![kernel(root), governor(root), isolation(root), throttling(root), clock_source(root)]
}

fn kernel(root: &Path) -> Finding {
    let release = first_line(root, "/proc/sys/kernel/osrelease").unwrap_or_default();
    if first_line(root, "/sys/kernel/realtime").as_deref() == Some("1") {
        return Finding::good("kernel", format!("{release}, PREEMPT_RT"));
    }
    Finding::poor(
        "kernel",
        format!("{release}, not PREEMPT_RT: wake-ups can be milliseconds late"),
        "apt install linux-image-rt-amd64 (Debian), pro enable realtime-kernel (Ubuntu)",
    )
}

fn governor(root: &Path) -> Finding {
    let is_processor =
        |name: &String| name.strip_prefix("cpu").is_some_and(|rest| rest.parse::<u32>().is_ok());
    let mut governors: Vec<String> = names(root, PROCESSORS)
        .into_iter()
        .filter(is_processor)
        .filter_map(|name| {
            first_line(root, &format!("{PROCESSORS}/{name}/cpufreq/scaling_governor"))
        })
        .collect();
    governors.sort();
    governors.dedup();
    match governors.as_slice() {
        [] => Finding::unknown("governor", "the kernel does not change the clock rate"),
        [one] if one == "performance" => Finding::good("governor", one.clone()),
        _ => Finding::poor(
            "governor",
            format!("{}: the processor wakes slowly", governors.join(", ")),
            "cpupower frequency-set --governor performance",
        ),
    }
}

fn isolation(root: &Path) -> Finding {
    match first_line(root, &format!("{PROCESSORS}/isolated")) {
        None => Finding::unknown("isolation", "the kernel does not tell"),
        Some(isolated) if !isolated.is_empty() => {
            Finding::good("isolation", format!("processors {isolated} have no other threads"))
        }
        Some(_) => Finding::poor(
            "isolation",
            "no processor is kept free of other threads",
            "isolcpus=managed_irq,domain,N nohz_full=N on the kernel's command line, then [realtime] cpu = N",
        ),
    }
}

fn throttling(root: &Path) -> Finding {
    let read = |name: &str| -> Option<i64> {
        first_line(root, &format!("/proc/sys/kernel/{name}"))?.parse().ok()
    };
    match (read("sched_rt_runtime_us"), read("sched_rt_period_us")) {
        (Some(runtime_us), _) if runtime_us < 0 => {
            Finding::good("throttling", "real-time threads are never held back")
        }
        (Some(runtime_us), Some(period_us)) => Finding::poor(
            "throttling",
            format!(
                "real-time threads get {runtime_us} us of every {period_us}: one that spins longer is held back"
            ),
            "sysctl -w kernel.sched_rt_runtime_us=-1",
        ),
        _ => Finding::unknown("throttling", "the kernel does not tell"),
    }
}

fn clock_source(root: &Path) -> Finding {
    match first_line(root, CLOCK_SOURCE) {
        None => Finding::unknown("clock", "the kernel does not tell"),
        Some(source) if BEST_CLOCKS.contains(&source.as_str()) => Finding::good("clock", source),
        Some(source) => Finding::poor(
            "clock",
            format!("{source}: reading the time is a slow call into the kernel or its host"),
            "clocksource=tsc tsc=reliable on the kernel's command line",
        ),
    }
}

/// Tries what the loop's thread asks for, on a thread that ends at once.
pub(super) fn rights() -> Vec<Finding> {
    let request = RtRequest { lock_memory: false, ..RtRequest::default() };
    let granted = std::thread::spawn(move || {
        let report = thread::enter(request);
        (report.policy, report.priority)
    })
    .join()
    .unwrap_or_default();
    let priority = if granted.1 == request.priority {
        Finding::good("priority", format!("{} {}", granted.0, granted.1))
    } else {
        Finding::poor(
            "priority",
            format!("SCHED_FIFO {} is refused", request.priority),
            "setcap cap_sys_nice,cap_ipc_lock+ep $(command -v ilc-rt)",
        )
    };
    vec![priority, memory(), sleep()]
}

fn memory() -> Finding {
    match thread::memory_lockable() {
        Ok(()) => Finding::good("memory", "can be locked"),
        Err(reason) => Finding::poor(
            "memory",
            format!("cannot be locked ({reason}): page faults stop the loop"),
            "setcap cap_sys_nice,cap_ipc_lock+ep $(command -v ilc-rt), or ulimit -l unlimited",
        ),
    }
}

fn sleep() -> Finding {
    match thread::awake() {
        Ok(_) => Finding::good("sleep", "the loop keeps the processors from sleeping deeply"),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            Finding::unknown("sleep", "the kernel has no /dev/cpu_dma_latency")
        }
        Err(error) => Finding::poor(
            "sleep",
            format!("/dev/cpu_dma_latency cannot be held ({error}): processors sleep deeply"),
            "setfacl -m u:$USER:rw /dev/cpu_dma_latency",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Verdict;
    use super::super::tests::System;
    use super::*;

    fn verdicts(files: &[(&str, &str)], name: &str) -> Vec<(String, Verdict)> {
        let system = System::new(name, files);
        examine(&system.0).into_iter().map(|finding| (finding.what, finding.verdict)).collect()
    }

    #[test]
    fn a_computer_that_is_set_up_has_nothing_to_mend() {
        let found = verdicts(
            &[
                ("proc/sys/kernel/osrelease", "6.12.1-rt\n"),
                ("sys/kernel/realtime", "1\n"),
                ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n"),
                ("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "performance\n"),
                ("sys/devices/system/cpu/isolated", "3\n"),
                ("proc/sys/kernel/sched_rt_runtime_us", "-1\n"),
                ("proc/sys/kernel/sched_rt_period_us", "1000000\n"),
                ("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n"),
            ],
            "doctor-good",
        );
        assert!(found.iter().all(|(_, verdict)| *verdict == Verdict::Good), "{found:?}");
    }

    #[test]
    fn a_usual_computer_has_much_to_mend_and_an_unknown_one_nothing() {
        let system = System::new(
            "doctor-poor",
            &[
                ("proc/sys/kernel/osrelease", "6.12.1\n"),
                ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n"),
                ("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave\n"),
                ("sys/devices/system/cpu/isolated", "\n"),
                ("proc/sys/kernel/sched_rt_runtime_us", "950000\n"),
                ("proc/sys/kernel/sched_rt_period_us", "1000000\n"),
                ("sys/devices/system/clocksource/clocksource0/current_clocksource", "hpet\n"),
            ],
        );
        for finding in examine(&system.0) {
            assert!(finding.verdict == Verdict::Poor && finding.mend.is_some(), "{finding:?}");
        }
        let found = verdicts(&[("proc/sys/kernel/osrelease", "6.12.1\n")], "doctor-unknown");
        assert!(found[1..].iter().all(|(_, verdict)| *verdict == Verdict::Unknown), "{found:?}");
    }
}
