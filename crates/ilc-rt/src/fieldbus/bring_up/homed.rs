//! Evidence that a drive is homed: it tells so itself in homing mode, and was homed by the method that is configured.
//!
//! For bring-up, and for `campaign`, which homes drives.

use std::time::{Duration, Instant};

use super::error::BringUpError;
use super::own::HomingObjects;
use super::remote::{Remote, is_absent};
use super::sdo_client::{SdoClient, SdoError};
use crate::fieldbus::Bus;
use crate::fieldbus::cia402::{Statusword, objects};

/// Mode of operation in which a drive homes.
const HOMING_MODE: i8 = 6;
/// Polling period of the mode shown.
const ASK_EVERY: Duration = Duration::from_millis(1);

/// Puts a disabled drive into homing mode.
///
/// # Errors
/// [`BringUpError::NotHomed`] if it does not show the mode within the time-out.
pub fn enter_homing_mode(
    bus: &mut dyn Bus,
    client: &SdoClient,
    timeout: Duration,
) -> Result<(), BringUpError> {
    let step = "homing mode";
    let failed = |source| BringUpError::Sdo { step, source };
    client
        .download(bus, objects::MODE_OF_OPERATION, 0, &HOMING_MODE.to_le_bytes())
        .map_err(failed)?;
    let deadline = Instant::now() + timeout;
    loop {
        let shown = client.upload_u32(bus, objects::MODE_DISPLAY, 0).map_err(failed)?;
        let [shown, ..] = shown.to_le_bytes();
        if shown.cast_signed() == HOMING_MODE {
            return Ok(());
        }
        if Instant::now() >= deadline {
            let why = format!(
                "it does not enter homing mode: 0x6061 = {} after {timeout:?}",
                shown.cast_signed()
            );
            return Err(BringUpError::NotHomed { node: client.node(), why });
        }
        std::thread::sleep(ASK_EVERY);
    }
}

/// Returns true if a drive in homing mode tells that its home was found since power-on.
///
/// # Errors
/// [`BringUpError::Sdo`] if it does not answer.
pub fn is_homed(bus: &mut dyn Bus, client: &SdoClient) -> Result<bool, BringUpError> {
    let word = client
        .upload_u32(bus, objects::STATUSWORD, 0)
        .map_err(|source| BringUpError::Sdo { step: "homing mode", source })?;
    let [low, high, ..] = word.to_le_bytes();
    let word = Statusword(u16::from_le_bytes([low, high]));
    Ok(word.has(Statusword::HOMING_ATTAINED) && !word.has(Statusword::HOMING_ERROR))
}

impl Remote<'_> {
    /// Refuses a drive that does not tell that it is homed, or was homed in another way.
    pub(super) fn check_homed(
        &mut self,
        homing: &HomingObjects,
        timeout: Duration,
    ) -> Result<(), BringUpError> {
        let node = self.node;
        let refused = |why: String| Err(BringUpError::NotHomed { node, why });
        let wanted = [
            ("homing method", objects::HOMING_METHOD, i64::from(homing.method)),
            ("home offset", objects::HOME_OFFSET, self.own.home_offset.unwrap_or(0).into()),
        ];
        for (name, index, wanted) in wanted {
            if self.own.keeps(crate::fieldbus::canopen::ObjectAddress::new(index, 0)) {
                continue;
            }
            let found = match self.client.upload(self.bus, index, 0) {
                Ok(bytes) => signed(&bytes),
                // Bring-up refuses the lack of an object that it needs.
                Err(SdoError::Aborted { code, .. }) if is_absent(code) => continue,
                Err(source) => return Err(BringUpError::Sdo { step: name, source }),
            };
            if found != wanted {
                return refused(format!(
                    "its {name} (0x{index:04X}) is {found}, that of the cell description {wanted}"
                ));
            }
        }
        enter_homing_mode(self.bus, &self.client, timeout)?;
        if is_homed(self.bus, &self.client)? {
            return Ok(());
        }
        refused("it has found no home since power-on (0x6041 bit 12 in homing mode)".to_owned())
    }
}

/// Returns a little-endian signed number of up to eight bytes.
fn signed(bytes: &[u8]) -> i64 {
    let fill = if bytes.last().is_some_and(|byte| byte & 0x80 != 0) { 0xFF } else { 0 };
    let mut all = [fill; 8];
    for (room, byte) in all.iter_mut().zip(bytes) {
        *room = *byte;
    }
    i64::from_le_bytes(all)
}
