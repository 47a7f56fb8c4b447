//! A node during bring-up: reads, writes, and objects with required values.

use super::error::BringUpError;
use super::misfit::{Found, Required};
use super::own::{DriveOwn, StartUpObject};
use super::sdo_client::{SdoClient, SdoError};
use super::setting::{self, Absence, Kind, Need, Setting};
use crate::fieldbus::Bus;
use crate::fieldbus::canopen::{AbortCode, NodeId, ObjectAddress};

/// A node during bring-up.
pub(super) struct Remote<'a> {
    pub(super) bus: &'a mut dyn Bus,
    pub(super) client: SdoClient,
    pub(super) node: NodeId,
    /// Values of this node that the cell description states.
    pub(super) own: DriveOwn,
}

impl Remote<'_> {
    pub(super) fn read(
        &mut self,
        step: &'static str,
        index: u16,
        sub: u8,
    ) -> Result<u32, BringUpError> {
        self.client
            .upload_u32(self.bus, index, sub)
            .map_err(|source| BringUpError::Sdo { step, source })
    }

    /// Reads an optional object.
    pub(super) fn find(
        &mut self,
        step: &'static str,
        index: u16,
        sub: u8,
    ) -> Result<Option<u32>, BringUpError> {
        match self.client.upload_u32(self.bus, index, sub) {
            Ok(value) => Ok(Some(value)),
            Err(SdoError::Aborted { code, .. }) if is_absent(code) => Ok(None),
            Err(source) => Err(BringUpError::Sdo { step, source }),
        }
    }

    /// Returns whether the node has an object, whatever its value.
    pub(super) fn has(&mut self, step: &'static str, index: u16) -> Result<bool, BringUpError> {
        match self.client.upload(self.bus, index, 0) {
            Ok(_) | Err(SdoError::Aborted { code: AbortCode::WriteOnly, .. }) => Ok(true),
            Err(SdoError::Aborted { code, .. }) if is_absent(code) => Ok(false),
            Err(source) => Err(BringUpError::Sdo { step, source }),
        }
    }

    pub(super) fn write(
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

    /// Writes an object, and returns the node's reason for refusing, if it gave one.
    fn try_write(&mut self, setting: &Setting) -> Result<Option<AbortCode>, BringUpError> {
        let ObjectAddress { index, sub } = setting.address;
        let bytes = setting.kind.encode(setting.need.value());
        match self.client.download(self.bus, index, sub, &bytes) {
            Ok(()) => Ok(None),
            Err(SdoError::Aborted { code, .. }) => Ok(Some(code)),
            Err(source) => Err(BringUpError::Sdo { step: setting.name(), source }),
        }
    }

    /// Ensures that an object holds a required value, unless the cell description keeps it; returns
    /// its value, and `None` if it is kept, or missing and optional.
    ///
    /// # Errors
    /// As [`Remote::enforce`].
    pub(super) fn ensure(&mut self, setting: &Setting) -> Result<Option<i64>, BringUpError> {
        if self.own.keeps(setting.address) { Ok(None) } else { self.enforce(setting) }
    }

    /// Ensures that an object holds a required value, and returns its value; `None` if the object
    /// is missing and optional.
    ///
    /// A correct value is not written again: some drives wear out their memory with every write.
    ///
    /// # Errors
    /// [`BringUpError::Value`] if it keeps another value, [`BringUpError::Missing`] if it is
    /// missing and required.
    fn enforce(&mut self, setting: &Setting) -> Result<Option<i64>, BringUpError> {
        let mut refusal = None;
        for is_written in [false, true] {
            if is_written {
                refusal = self.try_write(setting)?;
            }
            let ObjectAddress { index, sub } = setting.address;
            let found = match self.client.upload(self.bus, index, sub) {
                Ok(bytes) => setting.kind.decode(&bytes),
                Err(SdoError::Aborted { code, .. }) if is_absent(code) => {
                    return self.absent(setting);
                }
                // Write-only objects cannot be read back; the node's confirmation has to suffice.
                Err(SdoError::Aborted { code: AbortCode::WriteOnly, .. }) => {
                    return match self.try_write(setting)? {
                        None => Ok(Some(setting.need.value())),
                        refusal => Err(self.unfit(setting, Found::Unreadable, refusal)),
                    };
                }
                Err(source) => return Err(BringUpError::Sdo { step: setting.name(), source }),
            };
            let is_fit =
                if is_written { setting.need.bears(found) } else { setting.need.admits(found) };
            if is_fit {
                return Ok(Some(found));
            }
            if is_written {
                return Err(self.unfit(setting, Found::Number(found), refusal));
            }
        }
        Ok(None)
    }

    /// Writes the start-up objects of the cell description, in order.
    pub(super) fn start_up(&mut self) -> Result<(), BringUpError> {
        for object in self.own.start_up.clone() {
            let setting = start_up_setting(&object);
            if object.read_back {
                self.enforce(&setting)?;
            } else if let Some(refusal) = self.try_write(&setting)? {
                return Err(self.unfit(&setting, Found::Unread, Some(refusal)));
            }
        }
        Ok(())
    }

    /// Checks that the start-up objects still hold their values, after everything else was set.
    pub(super) fn check_start_up(&mut self) -> Result<(), BringUpError> {
        for object in self.own.start_up.clone().iter().filter(|object| object.read_back) {
            let ObjectAddress { index, sub } = object.address;
            let setting = start_up_setting(object);
            match self.client.upload(self.bus, index, sub) {
                Ok(bytes) => {
                    let found = setting.kind.decode(&bytes);
                    if !setting.need.admits(found) {
                        return Err(self.unfit(&setting, Found::NumberAtEnd(found), None));
                    }
                }
                Err(SdoError::Aborted { code: AbortCode::WriteOnly, .. }) => {}
                Err(source) => return Err(BringUpError::Sdo { step: setting.name(), source }),
            }
        }
        Ok(())
    }

    /// Ensures a whole list, in order.
    pub(super) fn ensure_all(&mut self, settings: &[Setting]) -> Result<(), BringUpError> {
        settings.iter().try_for_each(|setting| self.ensure(setting).map(|_| ()))
    }

    /// Reads a ratio of two numbers; `None` if the node has none.
    pub(super) fn ratio(&mut self, index: u16) -> Result<Option<[u32; 2]>, BringUpError> {
        let step = setting::name(ObjectAddress::new(index, 0));
        let Some(numerator) = self.find(step, index, 1)? else { return Ok(None) };
        let denominator = self.find(step, index, 2)?.unwrap_or(1);
        let ratio = [numerator, denominator];
        if ratio.contains(&0) {
            return Err(self.unfit_ratio(index, Found::Ratio(ratio), Required::NonZeroRatio));
        }
        Ok(Some(ratio))
    }

    fn absent(&self, setting: &Setting) -> Result<Option<i64>, BringUpError> {
        match setting.absence {
            Absence::Harmless => Ok(None),
            Absence::Refused(purpose) => Err(BringUpError::Missing {
                node: self.node,
                object: setting.address,
                name: setting.name(),
                purpose,
            }),
        }
    }

    /// Returns the error of an object with a number that it must not have.
    pub(super) fn unfit(
        &self,
        setting: &Setting,
        found: Found,
        refusal: Option<AbortCode>,
    ) -> BringUpError {
        let required = Required::Number(setting.need.clone());
        let (node, object, kind) = (self.node, setting.address, setting.kind);
        BringUpError::Value { node, object, kind, found, required, refusal }
    }

    /// Returns the error of a ratio, which is the object `index` as a whole.
    pub(super) fn unfit_ratio(&self, index: u16, found: Found, required: Required) -> BringUpError {
        let (node, object) = (self.node, ObjectAddress::new(index, 0));
        BringUpError::Value { node, object, kind: Kind::U32, found, required, refusal: None }
    }
}

fn start_up_setting(object: &StartUpObject) -> Setting {
    let ObjectAddress { index, sub } = object.address;
    Setting::new(index, sub, object.kind, Need::Exactly(object.value))
        .needed("as [[axis.drive.start_up]] sets it")
}

/// Returns whether the node said that it has no such object.
pub(super) fn is_absent(code: AbortCode) -> bool {
    matches!(code, AbortCode::NoObject | AbortCode::NoSubIndex)
}
