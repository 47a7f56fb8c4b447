//! Bring-up: from an unknown node to a drive that waits for NMT start. Cold: it waits for answers.

use std::time::{Duration, Instant};

use super::error::BringUpError;
use super::own::DriveOwn;
use super::remote::Remote;
use super::sdo_client::SdoClient;
use super::{process_data, scaling, settings};
use crate::fieldbus::Bus;
use crate::fieldbus::canopen::{Heartbeat, NmtCommand, NmtState, NodeId};
use crate::fieldbus::cia402::{
    Controlword, Mode, PdoMap, State, Statusword, Supervision, objects, pdo_map,
};

/// Time that the following error may exceed its window before the drive faults (object 0x6066), in ms.
pub const FOLLOWING_ERROR_TIME_MS: u16 = 10;

/// Time for a drive that was left moving to come to rest before its power is switched off.
const REST: Duration = Duration::from_millis(500);
/// Polling period of a request whose completion takes time.
const ASK_EVERY: Duration = Duration::from_millis(1);

/// Bit of the homing mode in the supported modes.
const HOMING_MODE: u32 = 1 << 5;
/// Number of doubly answered requests that proves two nodes.
const TWIN_QUESTIONS: u32 = 4;
/// Time after an answer during which a second one is awaited.
const TWIN_WAIT: Duration = Duration::from_millis(20);

/// Configuration of a drive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DriveSetup {
    /// The drive.
    pub node: NodeId,
    /// Mode of operation.
    pub mode: Mode,
    /// Process data; what the drive does not have of the optional objects is left out.
    pub map: PdoMap,
    /// Servo cycle, in microseconds: the period between two SYNCs.
    pub cycle_us: u32,
    /// Following error at which the drive faults, in counts.
    pub following_error_max_counts: u32,
    /// Lowest position, in counts.
    pub position_min_counts: i32,
    /// Highest position, in counts.
    pub position_max_counts: i32,
    /// Velocity limit, in counts/s.
    pub velocity_max_counts_s: u32,
    /// Acceleration limit, in counts/s²: the deceleration of every stop.
    pub acceleration_max_counts_s2: u32,
    /// The SI unit equal to one count, coded as in object 0x60A8, if there is one.
    pub position_unit: Option<u32>,
    /// The SI unit equal to one count per second, coded as in object 0x60A9, if there is one.
    pub velocity_unit: Option<u32>,
    /// Largest torque that is commanded, in thousandths of the rated torque; 0: none.
    pub torque_max: u16,
    /// True if the loop commands a torque offset (object 0x60B2) that must arrive.
    pub needs_torque_offset: bool,
    /// Heartbeat period of the drive, in milliseconds; 0: off (lock-step).
    pub heartbeat_ms: u16,
    /// Time without a command after which the drive stops, in milliseconds; 0: never
    /// (lock-step).
    pub rpdo_deadline_ms: u16,
    /// Node number of the controller, whose heartbeat is watched by a drive without a time-out of its commands.
    pub controller: NodeId,
    /// Time-out for the drive to boot, and to answer each request.
    pub answer_timeout: Duration,
    /// Values of this drive that the cell description states.
    pub own: DriveOwn,
    /// True if the caller may home the drive next; otherwise one that has to be homed is refused until it is.
    pub is_to_be_homed: bool,
}

/// Identity of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveIdentity {
    /// Device type, object 0x1000.
    pub device_type: u32,
    /// Supported drive modes, object 0x6502.
    pub supported_modes: u32,
    /// Vendor, product, revision and serial number, object 0x1018; 0 where not supported.
    pub identity: [u32; 4],
    /// Error code (object 0x603F) of a drive that was found in fault; 0 if it states none.
    pub fault: Option<u16>,
    /// Process data as mapped.
    pub map: PdoMap,
    /// It told that it is homed, or needs no homing.
    pub is_homed: bool,
}

/// Identity of an encoder node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderIdentity {
    /// Device type, object 0x1000.
    pub device_type: u32,
    /// Vendor, product, revision and serial number, object 0x1018; 0 where not supported.
    pub identity: [u32; 4],
}

/// Resets a drive, checks its identity and configures it; leaves it pre-operational and disabled.
///
/// Reset communication, boot-up, identity (0x1000 profile 402, 0x6502), power off, PDOs (all
/// disabled, then those of the loop mapped), and every object that shapes motion or the stop after
/// a fault: read, corrected where wrong, read again. NMT start is left to the caller, for all nodes
/// at once. Foreign frames that arrive meanwhile are discarded.
///
/// # Errors
/// [`BringUpError`] names node, object or step, the value found and the value required.
pub fn bring_up(bus: &mut dyn Bus, setup: &DriveSetup) -> Result<DriveIdentity, BringUpError> {
    let node = setup.node;
    let period = interpolation_period(setup.cycle_us)
        .ok_or(BringUpError::Cycle { node, cycle_us: setup.cycle_us })?;
    reset(bus, node, setup.answer_timeout)?;
    let client = SdoClient::new(node, setup.answer_timeout);
    let mut remote = Remote { bus, client, node, own: setup.own.clone() };
    let device_type = remote.check_profile(objects::PROFILE_DRIVE)?;
    remote.refuse_twins(setup.answer_timeout)?;
    let identity = remote.identity()?;
    remote.check_identity(identity)?;
    let supported_modes = remote.read("supported modes", objects::SUPPORTED_MODES, 0)?;
    if supported_modes & setup.mode.supported_bit() == 0 {
        let (mode, supported) = (setup.mode, supported_modes);
        return Err(BringUpError::ModeNotSupported { node, mode, supported });
    }
    if setup.own.homing.is_some() && supported_modes & HOMING_MODE == 0 {
        return Err(BringUpError::HomingNotSupported { node, supported: supported_modes });
    }
    let fault = remote.fault()?;
    remote.take_power(setup)?;
    // Before the settings of the homing are written: they tell by which method it was homed.
    let is_homed = match setup.own.homing {
        None => true,
        Some(homing) => match remote.check_homed(&homing, setup.answer_timeout) {
            Err(BringUpError::NotHomed { .. }) if setup.is_to_be_homed => false,
            checked => checked.map(|()| true)?,
        },
    };

    process_data::close_all(&mut remote)?;
    remote.ensure_all(&settings::communication(node, setup.heartbeat_ms, setup.cycle_us))?;
    remote.forget_heartbeats()?;
    let mut map = remote.supported(setup)?;
    let mut deadline_ms = setup.rpdo_deadline_ms;
    if deadline_ms > 0 && !remote.has_command_timeout()? {
        remote.watch_heartbeat(setup.controller, deadline_ms)?;
        (map.supervision, deadline_ms) = (Supervision::Heartbeat, 0);
    }
    for (number, layout, deadline_ms) in [
        (pdo_map::COMMAND_PDO, map.command, deadline_ms),
        (pdo_map::OFFSET_PDO, map.offset, 0),
        (pdo_map::STATUS_PDO, map.answers[0], 0),
        (pdo_map::DRIVE_MOTION_PDO, map.answers[1], 0),
    ] {
        if !layout.is_empty() {
            process_data::open(&mut remote, number, layout.objects(), deadline_ms)?;
        }
    }

    remote.start_up()?;
    scaling::check(&mut remote, setup)?;
    remote.ensure_all(&settings::interpolation(period))?;
    remote.ensure_all(&settings::reactions(setup))?;
    remote.ensure_all(&settings::motion(setup))?;
    if let Some(homing) = &setup.own.homing {
        remote.ensure_all(&settings::homing(homing))?;
    }
    remote.set_mode(setup.mode, setup.answer_timeout)?;
    remote.ensure_all(&settings::offsets())?;
    if setup.mode.targets_torque() {
        remote.ensure(&settings::no_torque())?;
    }
    remote.check_start_up()?;
    Ok(DriveIdentity { device_type, supported_modes, identity, fault, map, is_homed })
}

/// Resets an encoder node, checks its identity and maps its two positions; leaves it
/// pre-operational.
///
/// # Errors
/// [`BringUpError`] names node, step, the value expected and the value found.
pub fn bring_up_encoder(
    bus: &mut dyn Bus,
    node: NodeId,
    timeout: Duration,
) -> Result<EncoderIdentity, BringUpError> {
    reset(bus, node, timeout)?;
    let client = SdoClient::new(node, timeout);
    let mut remote = Remote { bus, client, node, own: DriveOwn::default() };
    let device_type = remote.check_profile(objects::PROFILE_ENCODER)?;
    remote.refuse_twins(timeout)?;
    let identity = remote.identity()?;
    process_data::close_all(&mut remote)?;
    remote.ensure_all(&settings::communication(node, 0, 0))?;
    remote.forget_heartbeats()?;
    process_data::open(&mut remote, pdo_map::ENCODER_PDO, &pdo_map::ENCODER_MAP, 0)?;
    Ok(EncoderIdentity { device_type, identity })
}

/// Sends reset communication and waits for the following boot-up, not an earlier one.
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

/// Returns `(value, exponent)` with `value * 10^exponent` seconds equal to the cycle, if it exists.
fn interpolation_period(cycle_us: u32) -> Option<(u8, i8)> {
    [(-3_i8, 1000_u32), (-4, 100), (-5, 10), (-6, 1)].into_iter().find_map(|(exponent, unit_us)| {
        let value = u8::try_from(cycle_us / unit_us).ok()?;
        (value > 0 && cycle_us.is_multiple_of(unit_us)).then_some((value, exponent))
    })
}

impl Remote<'_> {
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

    /// Repeats a request a few times and refuses a node that always answers twice: it is two nodes.
    /// A single duplicate may come from the bus.
    fn refuse_twins(&mut self, timeout: Duration) -> Result<(), BringUpError> {
        for _ in 0..TWIN_QUESTIONS {
            if self.client.count_answers(self.bus, objects::DEVICE_TYPE, timeout, TWIN_WAIT) < 2 {
                return Ok(());
            }
        }
        Err(BringUpError::TwoNodes { node: self.node })
    }

    /// Reads the identity; all but the vendor are optional in CiA 301.
    fn identity(&mut self) -> Result<[u32; 4], BringUpError> {
        let mut identity = [0; 4];
        for (value, sub) in identity.iter_mut().zip(1..) {
            *value = self.find("identity", objects::IDENTITY, sub)?.unwrap_or(0);
        }
        Ok(identity)
    }

    /// Refuses a drive that is not the one of the cell description.
    fn check_identity(&self, identity: [u32; 4]) -> Result<(), BringUpError> {
        let names = ["vendor", "product", "revision", "serial"];
        for (((name, sub), found), required) in
            names.into_iter().zip(1..).zip(identity).zip(self.own.identity)
        {
            if let Some(required) = required.filter(|required| *required != found) {
                return Err(BringUpError::Identity { node: self.node, name, sub, found, required });
            }
        }
        Ok(())
    }

    /// Returns the error code of a drive in fault, 0 if it has none.
    fn fault(&mut self) -> Result<Option<u16>, BringUpError> {
        if !matches!(self.state()?.1, Some(State::Fault | State::FaultReactionActive)) {
            return Ok(None);
        }
        let code = self.find("error code", objects::ERROR_CODE, 0)?.unwrap_or(0);
        let [low, high, ..] = code.to_le_bytes();
        Ok(Some(u16::from_le_bytes([low, high])))
    }

    /// Returns the map without the optional objects that the node does not have.
    fn supported(&mut self, setup: &DriveSetup) -> Result<PdoMap, BringUpError> {
        let mut map = setup.map;
        for index in process_data::OPTIONAL {
            // One that cannot be done without is refused where it is mapped.
            if index == objects::TORQUE_OFFSET && setup.needs_torque_offset {
                continue;
            }
            if map.carries(index) && !self.has("process data", index)? {
                map = map.without(index);
            }
        }
        Ok(map)
    }

    /// Clears every consumed heartbeat: that of a missing master would stop the node.
    fn forget_heartbeats(&mut self) -> Result<(), BringUpError> {
        let step = "watched heartbeats";
        let n_watched = self.find(step, objects::CONSUMER_HEARTBEAT, 0)?.unwrap_or(0);
        for sub in 1..=u8::try_from(n_watched).unwrap_or(u8::MAX) {
            self.ensure(&settings::watched_heartbeat(sub))?;
        }
        Ok(())
    }

    /// Returns whether the drive can watch its commands: the event timer of an RPDO is optional in CiA 301.
    fn has_command_timeout(&mut self) -> Result<bool, BringUpError> {
        let index = pdo_map::COMMAND_PDO.communication_index();
        Ok(self.find("time-out of the commands", index, 5)?.is_some())
    }

    /// Lets the drive watch the heartbeat of the controller, from the first one on.
    fn watch_heartbeat(
        &mut self,
        controller: NodeId,
        deadline_ms: u16,
    ) -> Result<(), BringUpError> {
        self.ensure(&settings::controller_heartbeat(controller, deadline_ms))?;
        Ok(())
    }

    /// Stops a drive that an earlier master left enabled, and disables it.
    fn take_power(&mut self, setup: &DriveSetup) -> Result<(), BringUpError> {
        if !has_power(self.state()?.1) {
            return Ok(());
        }
        // The braking objects may have been left wrong as well. A refusal here is reported later,
        // after the whole list.
        for setting in settings::reactions(setup) {
            match self.ensure(&setting) {
                Ok(_) | Err(BringUpError::Value { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        self.command(Controlword::QUICK_STOP, REST)?;
        let (word, state) = self.command(Controlword::DISABLE_VOLTAGE, setup.answer_timeout)?;
        if !has_power(state) {
            return Ok(());
        }
        Err(BringUpError::UnderPower { node: self.node, statusword: word })
    }

    /// Writes a controlword and waits until the drive is disabled, or the timeout.
    fn command(
        &mut self,
        controlword: Controlword,
        timeout: Duration,
    ) -> Result<(Statusword, Option<State>), BringUpError> {
        self.write("taking power", objects::CONTROLWORD, 0, &controlword.0.to_le_bytes())?;
        let deadline = Instant::now() + timeout;
        loop {
            let (word, state) = self.state()?;
            if !has_power(state) || Instant::now() >= deadline {
                return Ok((word, state));
            }
            std::thread::sleep(ASK_EVERY);
        }
    }

    fn state(&mut self) -> Result<(Statusword, Option<State>), BringUpError> {
        let [low, high, ..] = self.read("state", objects::STATUSWORD, 0)?.to_le_bytes();
        let word = Statusword(u16::from_le_bytes([low, high]));
        Ok((word, word.state()))
    }

    /// Sets the mode and waits until the drive reports it.
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
            std::thread::sleep(ASK_EVERY);
        }
    }
}

/// Returns whether a drive in this state may move its axis.
fn has_power(state: Option<State>) -> bool {
    match state {
        Some(
            State::SwitchedOn
            | State::OperationEnabled
            | State::QuickStopActive
            | State::FaultReactionActive,
        )
        | None => true,
        Some(
            State::NotReadyToSwitchOn
            | State::SwitchOnDisabled
            | State::ReadyToSwitchOn
            | State::Fault,
        ) => false,
    }
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
}
