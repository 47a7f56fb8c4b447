//! Status of an axis: state, position, following error, faults and inputs of its drive. Only reads.

use serde::Serialize;

use super::error::CommissioningError;
use super::faults::{Faults, faults, find};
use super::words::{input_names, mode_name, warning_names};
use crate::config::Input;
use crate::fieldbus::Bus;
use crate::fieldbus::bring_up::SdoClient;
use crate::fieldbus::cia402::{Scale, Statusword, objects};
use crate::record::InputState;

/// Status of an axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisStatus {
    /// Name of the axis.
    pub axis: String,
    /// Node of its drive.
    pub node: u8,
    /// NMT state from its heartbeat, if it sends one.
    pub nmt: Option<String>,
    /// State of the drive in words.
    pub state: String,
    /// Remarks of the statusword.
    pub remarks: Vec<&'static str>,
    /// Mode of operation.
    pub mode: Option<String>,
    /// Position in the unit of the axis.
    pub position_m: Option<f64>,
    /// Unit of the position.
    pub unit: &'static str,
    /// Following error that the drive reports.
    pub following_error_m: Option<f64>,
    /// Inputs that are active, object 0x60FD.
    pub inputs: Option<Vec<String>>,
    /// Inputs that the cell description names.
    pub named_inputs: Vec<InputState>,
    /// Statusword, error code and history.
    #[serde(flatten)]
    pub faults: Faults,
}

/// Reads the status of an axis; its name, unit, inputs and NMT state are the caller's.
///
/// # Errors
/// [`CommissioningError`] if the drive does not answer, or is not a drive.
pub fn axis_status(
    bus: &mut dyn Bus,
    client: &SdoClient,
    axis: &str,
    unit: &'static str,
    scale: Scale,
    named: &[&Input],
    nmt: Option<String>,
) -> Result<AxisStatus, CommissioningError> {
    let faults = faults(bus, client)?;
    let mut counts = |index: u16| -> Result<Option<i32>, CommissioningError> {
        Ok(find(bus, client, index, 0)?.map(u32::cast_signed))
    };
    let position_m = counts(objects::POSITION_ACTUAL)?.map(|counts| scale.position_m(counts));
    let following_error_m =
        counts(objects::FOLLOWING_ERROR_ACTUAL)?.map(|counts| scale.to_si(counts));
    let mode = find(bus, client, objects::MODE_DISPLAY, 0)?;
    let inputs = find(bus, client, objects::DIGITAL_INPUTS, 0)?;
    Ok(AxisStatus {
        axis: axis.to_owned(),
        node: client.node().get(),
        nmt,
        state: Statusword(faults.statusword)
            .state()
            .map_or_else(|| "no known state".to_owned(), |state| state.to_string()),
        remarks: warning_names(faults.statusword),
        mode: mode.map(|code| mode_name(code.to_le_bytes()[0].cast_signed())),
        position_m,
        unit,
        following_error_m,
        inputs: inputs.map(input_names),
        named_inputs: named
            .iter()
            .map(|input| InputState {
                name: input.name.clone(),
                purpose: input.purpose.name().to_owned(),
                on: inputs.map(|word| input.is_on(word)),
            })
            .collect(),
        faults,
    })
}
