//! Bring-up: from an unknown node to a drive that waits for NMT start. Cold: it waits for answers.

use std::time::{Duration, Instant};

use super::mode::Mode;
use super::{objects, pdo_map};
use crate::fieldbus::canopen::pdo::{
    COB_INVALID, COB_NO_RTR, MappedObject, PdoNumber, TYPE_EVERY_SYNC,
};
use crate::fieldbus::canopen::{
    AbortCode, Heartbeat, NmtCommand, NmtState, NodeId, SdoClient, SdoError,
};
use crate::fieldbus::{Bus, BusError};

/// How long the following error may exceed its window before the drive faults (object 0x6066), in ms.
pub const FOLLOWING_ERROR_TIME_MS: u16 = 10;

/// What a drive is set up to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveSetup {
    /// The drive.
    pub node: NodeId,
    /// Mode of operation.
    pub mode: Mode,
    /// Servo cycle, in microseconds: the period between two SYNCs.
    pub cycle_us: u32,
    /// Following error at which the drive faults, in counts.
    pub following_error_max_counts: u32,
    /// Period of the drive's heartbeat, in milliseconds; 0: none (lock-step).
    pub heartbeat_ms: u16,
    /// How long the drive goes on without a command before it stops, in milliseconds; 0: for ever
    /// (lock-step).
    pub rpdo_deadline_ms: u16,
    /// How long the drive may take to boot, and to answer each question.
    pub answer_timeout: Duration,
}

/// Who a drive says it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveIdentity {
    /// Device type, object 0x1000.
    pub device_type: u32,
    /// Supported drive modes, object 0x6502.
    pub supported_modes: u32,
    /// Vendor, product, revision and serial number, object 0x1018; 0 where the node gives none.
    pub identity: [u32; 4],
}

/// Who an encoder node says it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderIdentity {
    /// Device type, object 0x1000.
    pub device_type: u32,
    /// Vendor, product, revision and serial number, object 0x1018; 0 where the node gives none.
    pub identity: [u32; 4],
}

/// Why a node could not be brought up: node, step, expected and found.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BringUpError {
    /// Nothing came after the reset.
    #[error(
        "node {node}: no boot-up within {timeout:?} after reset; is it powered, on this bus and set to this number?"
    )]
    NoBootUp {
        /// The node.
        node: NodeId,
        /// How long was waited.
        timeout: Duration,
    },
    /// The node is of another kind.
    #[error(
        "node {node}: device type: expected profile {expected}, found {found} (0x1000 = 0x{device_type:08X})"
    )]
    Profile {
        /// The node.
        node: NodeId,
        /// Profile number that was expected.
        expected: u16,
        /// Profile number that was found.
        found: u16,
        /// The whole object.
        device_type: u32,
    },
    /// The drive lacks the mode.
    #[error(
        "node {node}: supported modes: expected {mode}, found 0x6502 = 0x{supported:08X}, which lacks it"
    )]
    ModeNotSupported {
        /// The node.
        node: NodeId,
        /// The mode that was asked for.
        mode: Mode,
        /// Object 0x6502.
        supported: u32,
    },
    /// The drive does not show the mode it was set to.
    #[error(
        "node {node}: mode of operation: expected {mode}, found 0x6061 = {found} after {timeout:?}"
    )]
    ModeNotShown {
        /// The node.
        node: NodeId,
        /// The mode that was asked for.
        mode: Mode,
        /// Object 0x6061.
        found: i8,
        /// How long was waited.
        timeout: Duration,
    },
    /// 0x60C2 cannot hold the cycle.
    #[error(
        "node {node}: interpolation period: a cycle of {cycle_us} us is not 1 to 255 times a power of ten; choose one that is, as 2000"
    )]
    Cycle {
        /// The node.
        node: NodeId,
        /// The cycle that was asked for.
        cycle_us: u32,
    },
    /// A question to the node failed.
    #[error("{source} (step: {step})")]
    Sdo {
        /// What was being done.
        step: &'static str,
        /// What went wrong, with node and object.
        source: SdoError,
    },
    /// The bus failed.
    #[error("node {node}: {step}: {source}")]
    Bus {
        /// The node.
        node: NodeId,
        /// What was being done.
        step: &'static str,
        /// What went wrong.
        source: BusError,
    },
}

/// Resets a drive, checks what it is and configures it; it is left pre-operational.
///
/// Reset communication, boot-up, identity (0x1000 profile 402, 0x6502), PDOs (each made invalid,
/// remapped and made valid again), interpolation period, following-error window, command deadline,
/// heartbeat and mode. NMT start is the caller's, for all nodes at once. Frames of others that
/// arrive meanwhile are discarded.
///
/// # Errors
/// [`BringUpError`] names node, step, what was expected and what was found.
pub fn bring_up(bus: &mut dyn Bus, setup: &DriveSetup) -> Result<DriveIdentity, BringUpError> {
    let node = setup.node;
    let (period, exponent) = interpolation_period(setup.cycle_us)
        .ok_or(BringUpError::Cycle { node, cycle_us: setup.cycle_us })?;
    reset(bus, node, setup.answer_timeout)?;
    let mut remote = Remote { bus, client: SdoClient::new(node, setup.answer_timeout), node };
    let device_type = remote.check_profile(objects::PROFILE_DRIVE)?;
    let identity = remote.identity()?;
    let supported_modes = remote.read("supported modes", objects::SUPPORTED_MODES, 0)?;
    if supported_modes & setup.mode.supported_bit() == 0 {
        let (mode, supported) = (setup.mode, supported_modes);
        return Err(BringUpError::ModeNotSupported { node, mode, supported });
    }

    remote.map_pdo("mapping RPDO1", pdo_map::COMMAND_PDO, &pdo_map::command_map(setup.mode))?;
    remote.map_pdo("mapping TPDO1", pdo_map::STATUS_PDO, &pdo_map::STATUS_MAP)?;
    remote.map_pdo("mapping TPDO2", pdo_map::EXTRA_PDO, &pdo_map::EXTRA_MAP)?;
    for unused in
        [1, 2, 3].map(PdoNumber::receive).into_iter().chain([2, 3].map(PdoNumber::transmit))
    {
        remote.switch_pdo_off(unused)?;
    }

    let step = "interpolation period";
    remote.write(step, objects::INTERPOLATION_PERIOD, 1, &[period])?;
    remote.write(step, objects::INTERPOLATION_PERIOD, 2, &exponent.to_le_bytes())?;
    let step = "following-error window";
    let window = setup.following_error_max_counts.to_le_bytes();
    remote.write(step, objects::FOLLOWING_ERROR_WINDOW, 0, &window)?;
    remote.write(step, objects::FOLLOWING_ERROR_TIME, 0, &FOLLOWING_ERROR_TIME_MS.to_le_bytes())?;
    remote.write_deadline(setup.rpdo_deadline_ms)?;
    let heartbeat = setup.heartbeat_ms.to_le_bytes();
    remote.write("heartbeat", objects::PRODUCER_HEARTBEAT, 0, &heartbeat)?;
    remote.set_mode(setup.mode, setup.answer_timeout)?;
    Ok(DriveIdentity { device_type, supported_modes, identity })
}

/// Resets an encoder node, checks what it is and maps its two positions; it is left pre-operational.
///
/// # Errors
/// [`BringUpError`] names node, step, what was expected and what was found.
pub fn bring_up_encoder(
    bus: &mut dyn Bus,
    node: NodeId,
    timeout: Duration,
) -> Result<EncoderIdentity, BringUpError> {
    reset(bus, node, timeout)?;
    let mut remote = Remote { bus, client: SdoClient::new(node, timeout), node };
    let device_type = remote.check_profile(objects::PROFILE_ENCODER)?;
    let identity = remote.identity()?;
    remote.map_pdo("mapping TPDO1", pdo_map::ENCODER_PDO, &pdo_map::ENCODER_MAP)?;
    Ok(EncoderIdentity { device_type, identity })
}

/// Sends reset communication and waits for the boot-up that follows it, not one from before.
fn reset(bus: &mut dyn Bus, node: NodeId, timeout: Duration) -> Result<(), BringUpError> {
    let failed = |source| BringUpError::Bus { node, step: "reset", source };
    while bus.recv(Duration::ZERO).map_err(failed)?.is_some() {}
    bus.send(&NmtCommand::ResetCommunication.frame(Some(node))).map_err(failed)?;
    let deadline = Instant::now() + timeout;
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let Some(frame) = bus.recv(left).map_err(failed)? else {
            return Err(BringUpError::NoBootUp { node, timeout });
        };
        if Heartbeat::decode(&frame) == Some(Heartbeat { node, state: NmtState::BootUp }) {
            return Ok(());
        }
        if left.is_zero() {
            return Err(BringUpError::NoBootUp { node, timeout });
        }
    }
}

/// Returns `(value, exponent)` with `value * 10^exponent` seconds equal to the cycle, if there is one.
fn interpolation_period(cycle_us: u32) -> Option<(u8, i8)> {
    [(-3_i8, 1000_u32), (-4, 100), (-5, 10), (-6, 1)].into_iter().find_map(|(exponent, unit_us)| {
        let value = u8::try_from(cycle_us / unit_us).ok()?;
        (value > 0 && cycle_us.is_multiple_of(unit_us)).then_some((value, exponent))
    })
}

/// One node during its bring-up.
struct Remote<'a> {
    bus: &'a mut dyn Bus,
    client: SdoClient,
    node: NodeId,
}

impl Remote<'_> {
    fn read(&mut self, step: &'static str, index: u16, sub: u8) -> Result<u32, BringUpError> {
        self.client
            .upload_u32(self.bus, index, sub)
            .map_err(|source| BringUpError::Sdo { step, source })
    }

    fn write(
        &mut self,
        step: &'static str,
        index: u16,
        sub: u8,
        bytes: &[u8],
    ) -> Result<(), BringUpError> {
        self.client
            .download(self.bus, index, sub, bytes)
            .map_err(|source| BringUpError::Sdo { step, source })
    }

    fn check_profile(&mut self, expected: u16) -> Result<u32, BringUpError> {
        let device_type = self.read("device type", objects::DEVICE_TYPE, 0)?;
        let [low, high, ..] = device_type.to_le_bytes();
        let found = u16::from_le_bytes([low, high]);
        if found == expected {
            Ok(device_type)
        } else {
            Err(BringUpError::Profile { node: self.node, expected, found, device_type })
        }
    }

    /// Reads the identity; all but the vendor are optional in CiA 301.
    fn identity(&mut self) -> Result<[u32; 4], BringUpError> {
        let mut identity = [0; 4];
        for (value, sub) in identity.iter_mut().zip(1..) {
            *value = match self.read("identity", objects::IDENTITY, sub) {
                Err(error) if is_absent(&error) => 0,
                other => other?,
            };
        }
        Ok(identity)
    }

    /// Maps a PDO in the order that CiA 301 asks for: invalid, type, no objects, objects, count, valid.
    fn map_pdo(
        &mut self,
        step: &'static str,
        number: PdoNumber,
        map: &[MappedObject],
    ) -> Result<(), BringUpError> {
        let cob_id = u32::from(number.default_cob_id(self.node)) | COB_NO_RTR;
        let (communication, mapping) = (number.communication_index(), number.mapping_index());
        self.write(step, communication, 1, &(cob_id | COB_INVALID).to_le_bytes())?;
        self.write(step, communication, 2, &[TYPE_EVERY_SYNC])?;
        self.write(step, mapping, 0, &[0])?;
        let mut n_objects = 0;
        for object in map {
            n_objects += 1;
            self.write(step, mapping, n_objects, &object.entry().to_le_bytes())?;
        }
        self.write(step, mapping, 0, &[n_objects])?;
        self.write(step, communication, 1, &cob_id.to_le_bytes())
    }

    /// Makes a PDO that is not used invalid: it would cost bus time that the load check does not know.
    fn switch_pdo_off(&mut self, number: PdoNumber) -> Result<(), BringUpError> {
        let cob_id = u32::from(number.default_cob_id(self.node)) | COB_NO_RTR | COB_INVALID;
        let index = number.communication_index();
        match self.write("switching off unused PDOs", index, 1, &cob_id.to_le_bytes()) {
            Err(error) if is_absent(&error) => Ok(()),
            other => other,
        }
    }

    /// Sets the deadline of commands. A drive without one is accepted only if none is asked for.
    fn write_deadline(&mut self, deadline_ms: u16) -> Result<(), BringUpError> {
        let index = pdo_map::COMMAND_PDO.communication_index();
        match self.write("command deadline", index, 5, &deadline_ms.to_le_bytes()) {
            Err(error) if deadline_ms == 0 && is_absent(&error) => Ok(()),
            other => other,
        }
    }

    /// Sets the mode and waits until the drive shows it.
    fn set_mode(&mut self, mode: Mode, timeout: Duration) -> Result<(), BringUpError> {
        let step = "mode of operation";
        self.write(step, objects::MODE_OF_OPERATION, 0, &mode.code().to_le_bytes())?;
        let deadline = Instant::now() + timeout;
        loop {
            let [byte, ..] = self.read(step, objects::MODE_DISPLAY, 0)?.to_le_bytes();
            let found = byte.cast_signed();
            if found == mode.code() {
                return Ok(());
            }
            if Instant::now() >= deadline {
                return Err(BringUpError::ModeNotShown { node: self.node, mode, found, timeout });
            }
            // Waiting on the bus, as it paces the question on a real one and costs nothing elsewhere.
            let failed = |source| BringUpError::Bus { node: self.node, step, source };
            self.bus.recv(Duration::from_millis(1)).map_err(failed)?;
        }
    }
}

/// Whether the node said that it has no such object.
fn is_absent(error: &BringUpError) -> bool {
    let BringUpError::Sdo { source: SdoError::Aborted { code, .. }, .. } = error else {
        return false;
    };
    matches!(code, AbortCode::NoObject | AbortCode::NoSubIndex)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_become_value_and_exponent() {
        assert_eq!(interpolation_period(1000), Some((1, -3)));
        assert_eq!(interpolation_period(2000), Some((2, -3)));
        assert_eq!(interpolation_period(1250), Some((125, -5)));
        assert_eq!(interpolation_period(500), Some((5, -4)));
        assert_eq!(interpolation_period(125), Some((125, -6)));
        assert_eq!(interpolation_period(1001), None);
        assert_eq!(interpolation_period(0), None);
    }

    #[test]
    fn an_error_is_one_line_that_names_the_node() {
        let node = NodeId::new(1).unwrap();
        let error = BringUpError::NoBootUp { node, timeout: Duration::from_secs(2) };
        assert_eq!(
            error.to_string(),
            "node 1: no boot-up within 2s after reset; is it powered, on this bus and set to this number?"
        );
    }
}
