//! The values of objects that a drive uses in each of its steps, read and converted again only when an
//! object has changed. For the drive.

use super::drive::DriveNode;
use super::drive_mode::DriveMode;

/// Value of the window that disables the following-error monitor.
const WINDOW_OFF: i64 = 0xFFFF_FFFF;

/// The objects of a step, as they were at a version of the dictionary.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepObjects {
    version: u64,
    /// Active mode.
    pub(super) mode: Option<DriveMode>,
    /// Velocity fed forward to a target.
    pub(super) velocity_offset_m_s: f64,
    /// Force fed forward to a target of position or velocity; 0 in other modes.
    pub(super) force_offset_n: f64,
    /// Window of the following error; `None`: nothing is monitored.
    pub(super) error_window: Option<i64>,
    /// The controller has taken over the brake, and applied it.
    pub(super) is_braked: bool,
}

impl DriveNode {
    /// Returns the objects of this step.
    #[inline]
    pub(super) fn step_objects(&mut self) -> StepObjects {
        let version = self.communication.dictionary().version();
        match self.step_objects {
            Some(objects) if objects.version == version => objects,
            _ => {
                let objects = self.read_step_objects(version);
                self.step_objects = Some(objects);
                objects
            }
        }
    }

    fn read_step_objects(&self, version: u64) -> StepObjects {
        let mode = self.mode();
        let window = self.number(self.slots.error_window);
        let controls_position = match mode {
            Some(DriveMode::ProfilePosition | DriveMode::Homing) => true,
            Some(DriveMode::Cyclic(mode)) => mode.targets_position(),
            Some(DriveMode::ProfileVelocity) | None => false,
        };
        let takes_force = matches!(mode, Some(DriveMode::Cyclic(mode)) if !mode.targets_torque());
        let offset = self.number(self.slots.torque_offset);
        StepObjects {
            version,
            mode,
            velocity_offset_m_s: self.units.velocity_m_s(self.number(self.slots.velocity_offset)),
            force_offset_n: if takes_force { self.force_n(offset) } else { 0.0 },
            error_window: (controls_position && window != WINDOW_OFF).then_some(window),
            is_braked: self.is_braked(),
        }
    }
}
