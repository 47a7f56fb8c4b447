//! The bus of a cell as its controller opens it, with the simulated drives in this process if they belong there.

use ilc_rt::campaign::{self, CampaignError};
use ilc_rt::config::Cell;
use ilc_rt::fieldbus::Bus;
use ilc_rt::fieldbus::transport::{self, GroupSide, in_process};

use crate::machine::{ClockMode, Machine};

/// Capacity of a bus in memory towards the controller, in frames.
const ANSWERS: usize = 1024;

/// Opens the bus of a cell; one in this process has the simulated machine at its other end, in lock-step.
///
/// # Errors
/// - [`CampaignError::Bus`] if the bus cannot be opened.
/// - [`CampaignError::Simulation`] if the cell cannot be simulated.
pub fn open(cell: &Cell) -> Result<Box<dyn Bus>, CampaignError> {
    if transport::scheme_of(&cell.bus.address).is_none_or(|scheme| !scheme.in_process) {
        return campaign::open_buses(cell, GroupSide::Controller)
            .map_err(|(place, source)| CampaignError::Bus { place, source });
    }
    let machine = Machine::from_cell(cell, ClockMode::LockStep).map_err(|error| {
        let (file, reason) = (cell.file.display().to_string(), error.to_string());
        CampaignError::Simulation { file, reason }
    })?;
    Ok(in_process(&cell.bus.address, machine, cell.cell.cycle_us, ANSWERS))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bus_in_this_process_needs_no_other_and_an_unknown_one_is_refused() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut cell = Cell::load(&root.join("../examples/01_gantry.toml")).unwrap();
        cell.bus.address = "loopback:".to_owned();
        assert!(open(&cell).is_ok());
        cell.bus.address = "nowhere:".to_owned();
        assert!(matches!(open(&cell), Err(CampaignError::Bus { .. })));
    }
}
