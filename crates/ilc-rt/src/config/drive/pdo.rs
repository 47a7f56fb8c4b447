//! `[axis.drive.pdo]`: the objects that a drive exchanges in every cycle.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ObjectName;
use crate::fieldbus::canopen::pdo::MappedObject;
use crate::fieldbus::cia402::{Mode, PdoLayout, PdoMap, objects};
use crate::schema::field_order;

/// `[axis.drive.pdo]`: the objects that the drive exchanges in every cycle, in order. With one of the
/// keys the process data are those stated; a list that is not given is the smallest one.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct DrivePdo {
    /// Objects of RPDO1: the controlword (0x6040), the target of the interface, and what the drive
    /// takes beside them.
    pub command: Option<Vec<ObjectName>>,
    /// Objects of TPDO1: the statusword (0x6041), the position (0x6064), and what the drive sends
    /// beside them.
    pub status: Option<Vec<ObjectName>>,
    /// Objects of TPDO2; an empty list for none.
    pub motion: Option<Vec<ObjectName>>,
}

impl DrivePdo {
    /// Returns the process data in a mode, in frames of up to `payload_max` bytes; `None` if none are stated.
    ///
    /// # Errors
    /// Key and reason, if an object is unknown, missing, or does not fit.
    pub fn map(
        &self,
        mode: Mode,
        payload_max: usize,
    ) -> Result<Option<PdoMap>, (&'static str, String)> {
        if self.command.is_none() && self.status.is_none() && self.motion.is_none() {
            return Ok(None);
        }
        let mut map = PdoMap::small(mode);
        let [status, motion] = &mut map.answers;
        for (key, list, part) in [
            ("command", &self.command, &mut map.command),
            ("status", &self.status, status),
            ("motion", &self.motion, motion),
        ] {
            let Some(list) = list else { continue };
            let mapped: Result<Vec<MappedObject>, String> =
                list.iter().copied().map(mapped).collect();
            let mapped = mapped.map_err(|reason| (key, reason))?;
            *part = PdoLayout::new(&mapped).map_err(|error| (key, error.to_string()))?;
        }
        let key = if self.command.is_some() { "command" } else { "status" };
        map.check(mode, payload_max).map_err(|error| (key, error.to_string()))?;
        Ok(Some(map))
    }
}

/// Returns an object with its length in the profile.
fn mapped(name: ObjectName) -> Result<MappedObject, String> {
    let bits = match name.index {
        objects::MODE_OF_OPERATION | objects::MODE_DISPLAY => 8,
        objects::CONTROLWORD
        | objects::STATUSWORD
        | objects::ERROR_CODE
        | objects::TARGET_TORQUE
        | objects::TORQUE_OFFSET
        | objects::TORQUE_ACTUAL => 16,
        objects::TARGET_POSITION
        | objects::TARGET_VELOCITY
        | objects::POSITION_OFFSET
        | objects::VELOCITY_OFFSET
        | objects::POSITION_ACTUAL
        | objects::VELOCITY_ACTUAL
        | objects::FOLLOWING_ERROR_ACTUAL
        | objects::DIGITAL_INPUTS => 32,
        _ => return Err(format!("{name} is no object that the loop exchanges")),
    };
    Ok(MappedObject { address: name.address(), bits })
}
