//! Cyclic traffic of a cell: the process data of each drive, and the time that it takes on each bus.

use crate::config::{Axis, BusSection, Cell};
use crate::fieldbus::cia402::{OptionalObjects, PdoMap};
use crate::fieldbus::frame::PAYLOAD_MAX;
use crate::fieldbus::load::{self, BitRates, Load, LoadError};
use crate::fieldbus::transport::{format_of, scheme_of};

/// Bytes of SYNC, and of the frame reserved for SDO, heartbeat and EMCY.
const EVERY_CYCLE: [usize; 2] = [0, PAYLOAD_MAX];
/// Bit rate of a data phase that every transceiver for CAN FD has, in bit/s.
const FD_DATA_BIT_S: u32 = 5_000_000;
/// Bytes of the answer of an encoder node.
const TOOL_BYTES: usize = 8;

/// Traffic of one bus of a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct BusTraffic {
    /// Address of the bus.
    pub address: String,
    /// Its bit rates; of a bus without any, for comparison.
    pub rates: BitRates,
    /// Worst-case bus time of a cycle; of a bus without a bit rate, for comparison.
    pub load: Load,
    /// True if the small maps are used, as the full ones do not fit.
    pub small: bool,
}

/// Returns the process data of an axis: everything that the profile offers, or the smallest map if its
/// bus has no time for that.
///
/// A drive without one of the optional objects gets a smaller map at bring-up.
pub fn pdo_map(cell: &Cell, axis: &Axis) -> PdoMap {
    one_map(cell, axis, is_small(cell, axis.bus))
}

/// Returns the process data that the cell description states, or those that the bus has time for, with the
/// digital inputs of an axis that has named ones.
fn one_map(cell: &Cell, axis: &Axis, small: bool) -> PdoMap {
    let payload_max = cell.format(axis.bus).payload_max();
    let all = OptionalObjects::ALL;
    let map = match axis.drive.pdo.map(axis.interface, payload_max) {
        Ok(Some(map)) => map,
        _ if small => {
            // The loop cannot do without an offset that it commands.
            let torque_offset = axis.has_torque_offset();
            let wanted = OptionalObjects { torque_offset, ..OptionalObjects::NONE };
            PdoMap::choose(axis.interface, wanted, all, payload_max)
        }
        _ => PdoMap::choose(axis.interface, all, all, payload_max),
    };
    let map = if axis.has_velocity_offset() { map.with_velocity_offset() } else { map };
    let has_inputs = cell.inputs.iter().any(|input| input.axis == axis.name);
    if has_inputs { map.with_inputs(payload_max) } else { map }
}

/// Returns the traffic of each bus.
///
/// # Errors
/// The table of the first bus that cannot carry its frames, with [`LoadError`].
pub(super) fn of(cell: &Cell) -> Result<Vec<BusTraffic>, (String, LoadError)> {
    let numbers = 0..=u8::try_from(cell.extra_buses.len()).unwrap_or(u8::MAX);
    numbers
        .map(|number| {
            let bus = cell.bus(number);
            let small = is_small(cell, number);
            let frames = payloads(cell, number, small);
            let load = if has_bits(bus) {
                check(cell, bus, number, &frames).map_err(|source| (key(number), source))?
            } else {
                // As fast as the machine; stated for comparison.
                Load::of(&frames, cell.cycle_s(), rates(bus))
            };
            Ok(BusTraffic { address: bus.address.clone(), rates: rates(bus), load, small })
        })
        .collect()
}

fn key(number: u8) -> String {
    if number == 0 { "[bus]".to_owned() } else { format!("[[extra_bus]] {number}") }
}

/// Returns whether a bus has a bit rate of its own.
fn has_bits(bus: &BusSection) -> bool {
    format_of(&bus.address).kept_bit_s.is_some()
        || scheme_of(&bus.address).is_some_and(|scheme| scheme.has_bits)
}

/// Returns the bit rates of a bus: those that its address states, or else those of its section.
fn rates(bus: &BusSection) -> BitRates {
    let format = format_of(&bus.address);
    format.rates_at(format.kept_bit_s.unwrap_or(bus.bitrate_bit_s))
}

/// Returns whether a bus carries the small maps, as it has no time for the full ones.
fn is_small(cell: &Cell, number: u8) -> bool {
    let bus = cell.bus(number);
    let full = payloads(cell, number, false);
    has_bits(bus) && !Load::of(&full, cell.cycle_s(), rates(bus)).fits(bus.load_max)
}

/// Returns the lengths of the frames of a cycle on a bus: SYNC, a reserve, command and answers of each
/// drive, and the answer of the tool, which is on `[bus]`.
fn payloads(cell: &Cell, number: u8, small: bool) -> Vec<usize> {
    let own = cell.axes.iter().filter(|axis| axis.bus == number);
    let tool = cell.tcp_encoder.iter().filter(|_| number == 0).map(|_| TOOL_BYTES);
    let drives = own.flat_map(|axis| one_map(cell, axis, small).frame_bytes().collect::<Vec<_>>());
    EVERY_CYCLE.into_iter().chain(drives).chain(tool).collect()
}

/// Checks the frames of a bus; the refusal names each change that would help.
fn check(cell: &Cell, bus: &BusSection, number: u8, frames: &[usize]) -> Result<Load, LoadError> {
    let rates = rates(bus);
    match load::check(frames, cell.cycle_s(), rates, bus.load_max) {
        Err(LoadError::TooMuch { load, load_max, .. }) => {
            let mut ways = vec![format!(
                "what fits: [cell] cycle_us = {:.0} with the smallest process data",
                load.cycle_needed_us(load_max)
            )];
            let faster = BitRates { nominal_bit_s: 1_000_000, ..rates };
            if rates != faster && Load::of(frames, cell.cycle_s(), faster).fits(load_max) {
                ways.push("bitrate_bit_s = 1000000".to_owned());
            }
            let fd = BitRates { data_bit_s: Some(FD_DATA_BIT_S), ..rates };
            if rates.data_bit_s.is_none() && Load::of(frames, cell.cycle_s(), fd).fits(load_max) {
                ways.push(format!(
                    "CAN FD, if every drive takes it (`?fd=1&data_bitrate={FD_DATA_BIT_S}` in the address)"
                ));
            }
            let n_axes = cell.axes.iter().filter(|axis| axis.bus == number).count();
            let per_bus = (1..n_axes).rev().find(|&n| {
                let few: Vec<usize> =
                    EVERY_CYCLE.into_iter().chain(std::iter::repeat_n(6, 2 * n)).collect();
                Load::of(&few, cell.cycle_s(), rates).fits(load_max)
            });
            if let Some(n) = per_bus {
                ways.push(format!(
                    "{} buses ([[extra_bus]]) of {n} axes at most",
                    n_axes.div_ceil(n)
                ));
            }
            if load.ratio() <= 1.0 {
                ways.push(format!("load_max = {:.2}", (load.ratio() * 100.0).ceil() / 100.0));
            }
            Err(LoadError::TooMuch { load, load_max, remedies: ways.join(", or ") })
        }
        checked => checked,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::BusSection;

    const GANTRY: &str =
        include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/01_gantry.toml"));

    /// Some axes on a classical bus at 1 kHz, numbered from node 1.
    fn cell(n_axes: u8) -> Cell {
        let mut cell = Cell::parse(GANTRY, "cell.toml").unwrap();
        cell.cell.cycle_us = 1000;
        cell.bus.address = "can:can0".to_owned();
        cell.tcp_encoder = None;
        let first = cell.axes[0].clone();
        cell.axes = (1..=n_axes).map(|node| Axis { node, ..first.clone() }).collect();
        cell
    }

    fn extra(address: &str) -> BusSection {
        BusSection { address: address.to_owned(), bitrate_bit_s: 1_000_000, load_max: 0.8 }
    }

    #[test]
    fn six_axes_at_1_khz_are_refused_with_what_would_fit() {
        let (key, error) = of(&cell(6)).unwrap_err();
        let line = error.to_string();
        assert_eq!(key, "[bus]");
        for part in [
            "need 1570 us at worst, 800 us are allowed (80 % of 1000 us)",
            "[cell] cycle_us = 2000 with the smallest process data",
            "3 buses ([[extra_bus]]) of 2 axes at most",
            "CAN FD, if every drive takes it (`?fd=1&data_bitrate=5000000` in the address)",
        ] {
            assert!(line.contains(part), "{line}");
        }
        let mut slower = cell(6);
        slower.cell.cycle_us = 2000;
        assert!(of(&slower).unwrap()[0].small);
        slower.cell.cycle_us = 4000;
        assert!(!of(&slower).unwrap()[0].small);
    }

    #[test]
    fn two_axes_at_1_khz_fit_with_the_small_maps() {
        let cell = cell(2);
        let traffic = of(&cell).unwrap();
        assert!(traffic[0].small && (traffic[0].load.us_per_cycle - 650.0).abs() < 1e-9);
        assert_eq!(pdo_map(&cell, &cell.axes[1]), PdoMap::small(cell.axes[1].interface));
        let mut simulated = cell.clone();
        simulated.bus.address = "udp:239.74.163.2".to_owned();
        assert!(!of(&simulated).unwrap()[0].small, "only a real bus has a bit rate");
    }

    #[test]
    fn can_fd_carries_six_axes_at_1_khz_with_all_that_the_drives_offer() {
        let mut cell = cell(6);
        cell.bus.address = "can:can0?fd=1&data_bitrate=5000000".to_owned();
        cell.bus.load_max = 0.9;
        let traffic = of(&cell).unwrap();
        // SYNC, the reserve, and for each axis a command of 8 and an answer of 16 bytes.
        let expected_us = 40.6 + 56.6 + 6.0 * (56.6 + 72.6);
        assert!((traffic[0].load.us_per_cycle - expected_us).abs() < 0.5, "{traffic:?}");
        assert!(!traffic[0].small);
        let map = pdo_map(&cell, &cell.axes[0]);
        assert_eq!(map.frame_bytes().collect::<Vec<_>>(), [8, 16]);
        cell.bus.address = "can:can0?fd=1".to_owned();
        let line = of(&cell).unwrap_err().1.to_string();
        assert!(!line.contains("CAN FD") && line.contains("are allowed"), "{line}");
    }

    #[test]
    fn a_bus_in_memory_has_the_bit_rate_of_its_address() {
        let mut cell = cell(6);
        cell.bus.address = "loopback:".to_owned();
        assert!(of(&cell).is_ok());
        cell.bus.address = "loopback:?bitrate=1000000".to_owned();
        let (_, error) = of(&cell).unwrap_err();
        assert!(error.to_string().contains("need 1570 us at worst"), "{error}");
    }

    #[test]
    fn three_buses_carry_six_axes_at_1_khz() {
        let mut cell = cell(6);
        cell.extra_buses = vec![extra("can:can1"), extra("can:can2")];
        for (axis, bus) in cell.axes.iter_mut().zip([0, 0, 1, 1, 2, 2]) {
            axis.bus = bus;
        }
        let traffic = of(&cell).unwrap();
        assert_eq!(traffic.len(), 3);
        assert!(traffic.iter().all(|bus| (bus.load.us_per_cycle - 650.0).abs() < 1e-9));
        cell.axes[5].bus = 1;
        let (key, _) = of(&cell).unwrap_err();
        assert_eq!(key, "[[extra_bus]] 1");
    }
}
