//! CAN interfaces of this computer: state, and the queue that commands wait in.

use std::path::Path;

use super::{Finding, first_line, names};

const INTERFACES: &str = "/sys/class/net";
/// `ARPHRD_CAN` of Linux.
const TYPE_CAN: &str = "280";
/// Frames that the commands of a cycle and its SYNC may be.
const QUEUE_MIN: u32 = 32;
/// Longest queue: a command behind so many frames is worth nothing.
const QUEUE_MAX: u32 = 1000;

/// Examines every CAN interface, below a root.
pub(super) fn examine(root: &Path) -> Vec<Finding> {
    let found: Vec<String> = names(root, INTERFACES)
        .into_iter()
        .filter(|name| {
            first_line(root, &format!("{INTERFACES}/{name}/type")).as_deref() == Some(TYPE_CAN)
        })
        .collect();
    if found.is_empty() {
        return vec![Finding::unknown("can", "there is no CAN interface")];
    }
    found.iter().flat_map(|name| interface(root, name)).collect()
}

fn interface(root: &Path, name: &str) -> Vec<Finding> {
    let read = |key: &str| first_line(root, &format!("{INTERFACES}/{name}/{key}"));
    let driver = std::fs::read_link(root.join(format!("sys/class/net/{name}/device/driver"))).ok();
    let driver = driver.and_then(|path| Some(path.file_name()?.to_string_lossy().into_owned()));
    let driver = driver.map_or_else(|| "virtual".to_owned(), |driver| format!("driver {driver}"));
    let mut findings = Vec::new();
    let state = read("operstate").unwrap_or_default();
    findings.push(if state == "down" {
        Finding::poor(
            name,
            format!("{driver}, down"),
            format!("ip link set {name} up type can bitrate 1000000 restart-ms 100"),
        )
    } else {
        Finding::good(name, driver)
    });
    let queue = read("tx_queue_len").and_then(|text| text.parse::<u32>().ok());
    if let Some(queue) = queue.filter(|queue| !(QUEUE_MIN..=QUEUE_MAX).contains(queue)) {
        findings.push(Finding::poor(
            name,
            format!(
                "its queue has {queue} frames: {}",
                if queue < QUEUE_MIN {
                    "commands of many axes do not fit"
                } else {
                    "commands wait there too long"
                }
            ),
            format!("ip link set {name} txqueuelen 128"),
        ));
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::super::Verdict;
    use super::super::tests::System;
    use super::*;

    #[test]
    fn interfaces_are_judged_by_state_and_queue() {
        let system = System::new(
            "doctor-can",
            &[
                ("sys/class/net/eth0/type", "1\n"),
                ("sys/class/net/can0/type", "280\n"),
                ("sys/class/net/can0/operstate", "up\n"),
                ("sys/class/net/can0/tx_queue_len", "128\n"),
                ("sys/class/net/can1/type", "280\n"),
                ("sys/class/net/can1/operstate", "down\n"),
                ("sys/class/net/can1/tx_queue_len", "10\n"),
            ],
        );
        let found: Vec<_> = examine(&system.0)
            .into_iter()
            .map(|finding| (finding.what, finding.verdict, finding.mend.unwrap_or_default()))
            .collect();
        let poor = |mend: &str| ("can1".to_owned(), Verdict::Poor, mend.to_owned());
        assert_eq!(
            found,
            [
                ("can0".to_owned(), Verdict::Good, String::new()),
                poor("ip link set can1 up type can bitrate 1000000 restart-ms 100"),
                poor("ip link set can1 txqueuelen 128"),
            ]
        );
        let nothing = System::new("doctor-no-can", &[("sys/class/net/lo/type", "772\n")]);
        assert_eq!(examine(&nothing.0)[0].verdict, Verdict::Unknown);
    }
}
