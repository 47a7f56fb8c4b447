//! From a data sheet to `[axis.drive]`: identity, start-up objects, ratios, reactions, process data.

use super::error::DataSheetError;
use super::sheet::{Access, DataSheet, SheetObject};
use crate::config::{Drive, DrivePdo, Mode, ObjectName, StartUp};
use crate::fieldbus::bring_up::{Kind, is_keepable, is_set};
use crate::fieldbus::canopen::ObjectAddress;
use crate::fieldbus::cia402::objects;

/// A drive as its data sheet describes it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Imported {
    /// The section `[axis.drive]`.
    pub drive: Drive,
    /// Objects that the drive lacks, and what that means.
    pub lacks: Vec<Lack>,
    /// Values of the configuration that were not taken, one sentence each.
    pub remarks: Vec<String>,
}

/// An object that a drive lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lack {
    /// The object.
    pub object: ObjectAddress,
    /// Its name.
    pub name: &'static str,
    /// Consequence.
    pub consequence: &'static str,
}

impl std::fmt::Display for Lack {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { object, name, consequence } = self;
        write!(f, "lacks {object} ({name}): {consequence}")
    }
}

/// Objects without which no drive runs.
const NEEDED: [(u16, u8, &str); 9] = [
    (objects::CONTROLWORD, 0, "to enable it"),
    (objects::STATUSWORD, 0, "to know its state"),
    (objects::MODE_OF_OPERATION, 0, "to choose the mode"),
    (objects::MODE_DISPLAY, 0, "to know that the mode is active"),
    (objects::POSITION_ACTUAL, 0, "to measure the position"),
    (objects::RPDO_COMMUNICATION, 1, "for the command of every cycle"),
    (objects::RPDO_COMMUNICATION, 2, "for the command of every cycle"),
    (objects::TPDO_COMMUNICATION, 1, "for the status of every cycle"),
    (objects::TPDO_COMMUNICATION, 2, "for the status of every cycle"),
];

/// Objects that make a difference.
const WANTED: [(u16, u8, &str); 22] = [
    (
        objects::RPDO_COMMUNICATION,
        5,
        "it watches the heartbeat of the controller ([safety] controller_node) instead of its commands",
    ),
    (objects::CONNECTION_LOSS_OPTION, 0, "its reaction to a lost connection cannot be set"),
    (objects::QUICK_STOP_OPTION, 0, "its quick stop brakes as the drive is made"),
    (objects::FAULT_REACTION_OPTION, 0, "its reaction to a fault is as the drive is made"),
    (objects::QUICK_STOP_DECELERATION, 0, "its quick stop has a deceleration of its own"),
    (objects::PROFILE_DECELERATION, 0, "its slow stop has a deceleration of its own"),
    (objects::ERROR_CODE, 0, "a fault is named by its emergency message only"),
    (objects::ERROR_BEHAVIOUR, 1, "its behaviour after a loss of communication cannot be set"),
    (objects::PRODUCER_HEARTBEAT, 0, "it sends no heartbeat"),
    (objects::FOLLOWING_ERROR_WINDOW, 0, "only the controller monitors the following error"),
    (objects::FOLLOWING_ERROR_TIME, 0, "the drive reacts to a following error at once, or never"),
    (objects::POSITION_LIMIT, 1, "only the controller keeps the position limits"),
    (objects::MAX_VELOCITY, 0, "only the controller keeps the velocity limit"),
    (objects::MAX_DECELERATION, 0, "its deceleration limit is as the drive is made"),
    (objects::INTERPOLATION_PERIOD, 1, "it interpolates over the period of SYNC"),
    (objects::TORQUE_OFFSET, 0, "no torque feed-forward"),
    (objects::TORQUE_ACTUAL, 0, "its torque is not recorded"),
    (objects::VELOCITY_ACTUAL, 0, "its velocity is not recorded"),
    (objects::FOLLOWING_ERROR_ACTUAL, 0, "its own following error is not known after a fault"),
    (objects::HOME_OFFSET, 0, "no home offset"),
    (objects::HOMING_METHOD, 0, "it cannot be homed by [axis.homing] kind = \"drive\""),
    (objects::SUPPORTED_MODES, 0, "its modes are known at bring-up only"),
];

/// Torque limits that a configuration sets on purpose: they are kept at its value.
const TORQUE_LIMITS: [u16; 4] = [
    objects::MAX_TORQUE,
    objects::MAX_CURRENT,
    objects::POSITIVE_TORQUE_LIMIT,
    objects::NEGATIVE_TORQUE_LIMIT,
];

/// Returns the section of a drive that runs in `mode`.
///
/// # Errors
/// [`DataSheetError`] for a drive that could not run, with the object that it lacks.
pub fn import(sheet: &DataSheet, mode: Mode) -> Result<Imported, DataSheetError> {
    check_drive(sheet, mode)?;
    check_supervision(sheet)?;
    let mut found = Imported { drive: identity(sheet), lacks: lacks(sheet), remarks: Vec::new() };
    found.drive.pdo = process_data(sheet, mode)?;
    ratios(sheet, &mut found.drive)?;
    // Another unit than counts is only ever stated, never set.
    let unit = |index| sheet.value(index, 0).and_then(|unit| u32::try_from(unit).ok());
    found.drive.position_unit = unit(objects::POSITION_UNIT).filter(|unit| *unit != 0);
    found.drive.velocity_unit = unit(objects::VELOCITY_UNIT).filter(|unit| *unit != 0);
    for (address, object) in sheet.objects() {
        if let Some(value) = sheet.configured(address, object)? {
            take(&mut found, address, object, value);
        }
    }
    Ok(found)
}

/// Refuses a sheet of another profile, without the mode, or without a needed object.
fn check_drive(sheet: &DataSheet, mode: Mode) -> Result<(), DataSheetError> {
    let unfit = |index, found: String, needed: String| DataSheetError::Unfit {
        file: sheet.file.clone(),
        object: ObjectAddress::new(index, 0),
        name: objects::name(index).unwrap_or(""),
        found,
        needed,
    };
    if let Some(device_type) = sheet.value(objects::DEVICE_TYPE, 0) {
        let profile = device_type & 0xFFFF;
        if profile != i64::from(objects::PROFILE_DRIVE) {
            let needed = format!("a drive has profile {} in it", objects::PROFILE_DRIVE);
            return Err(unfit(objects::DEVICE_TYPE, format!("0x{device_type:08X}"), needed));
        }
    }
    if let Some(modes) = sheet.value(objects::SUPPORTED_MODES, 0)
        && modes & i64::from(mode.supported_bit()) == 0
    {
        let needed = format!("it lacks {mode}, which interface = \"{}\" needs", mode.name());
        return Err(unfit(objects::SUPPORTED_MODES, format!("0x{modes:08X}"), needed));
    }
    let target = (mode.target().0, 0, "for the command of the interface");
    for (index, sub, purpose) in NEEDED.into_iter().chain([target]) {
        if sheet.get(index, sub).is_none() {
            return Err(DataSheetError::Missing {
                file: sheet.file.clone(),
                object: ObjectAddress::new(index, sub),
                name: objects::name(index).unwrap_or(""),
                purpose,
            });
        }
    }
    Ok(())
}

/// Refuses a drive that would not notice that commands stop coming: CiA 301 makes both ways optional.
fn check_supervision(sheet: &DataSheet) -> Result<(), DataSheetError> {
    let (index, sub) = (objects::RPDO_COMMUNICATION, 5);
    if sheet.get(index, sub).is_some() || sheet.get(objects::CONSUMER_HEARTBEAT, 1).is_some() {
        return Ok(());
    }
    Err(DataSheetError::Missing {
        file: sheet.file.clone(),
        object: ObjectAddress::new(index, sub),
        name: objects::name(index).unwrap_or(""),
        purpose: "to stop when no command arrives, as it cannot watch the heartbeat of the controller \
                  (0x1016:01) either; only in lock-step a drive runs without both",
    })
}

fn lacks(sheet: &DataSheet) -> Vec<Lack> {
    let missing = WANTED.into_iter().filter(|(index, sub, _)| sheet.get(*index, *sub).is_none());
    let lack = |(index, sub, consequence)| Lack {
        object: ObjectAddress::new(index, sub),
        name: objects::name(index).unwrap_or(""),
        consequence,
    };
    missing.map(lack).collect()
}

/// Returns the identity; 0 states nothing, and the serial number only that of a configured drive.
fn identity(sheet: &DataSheet) -> Drive {
    let stated = |sub, key| {
        let number = sheet.value(objects::IDENTITY, sub).filter(|number| *number != 0);
        let number = number.or_else(|| sheet.device(key).filter(|number| *number != 0));
        number.and_then(|number| u32::try_from(number).ok())
    };
    let serial = sheet.get(objects::IDENTITY, 4).and_then(|object| {
        let address = ObjectAddress::new(objects::IDENTITY, 4);
        sheet.configured(address, object).ok().flatten()
    });
    Drive {
        vendor: stated(1, "vendornumber"),
        product: stated(2, "productnumber"),
        revision: stated(3, "revisionnumber"),
        serial: serial.and_then(|serial| u32::try_from(serial).ok()).filter(|serial| *serial != 0),
        ..Drive::default()
    }
}

/// Returns the smallest process data that carry what the mode needs; those of the drive if it has them
/// fixed.
fn process_data(sheet: &DataSheet, mode: Mode) -> Result<DrivePdo, DataSheetError> {
    let command = [objects::CONTROLWORD, mode.target().0];
    let command = one(sheet, objects::RPDO_MAPPING, &command)?;
    let status = [objects::STATUSWORD, objects::POSITION_ACTUAL];
    let status = one(sheet, objects::TPDO_MAPPING, &status)?;
    Ok(DrivePdo { command: Some(command), status: Some(status), motion: Some(Vec::new()) })
}

fn one(sheet: &DataSheet, mapping: u16, needed: &[u16]) -> Result<Vec<ObjectName>, DataSheetError> {
    let unfit = |object, found: String, needed: String| DataSheetError::Unfit {
        file: sheet.file.clone(),
        object,
        name: objects::name(object.index)
            .or_else(|| objects::name(mapping))
            .unwrap_or("mapping parameter"),
        found,
        needed,
    };
    let name = |index| ObjectName { index, sub: None };
    let count = sheet.get(mapping, 0);
    if count.is_some_and(|count| count.access == Access::ReadWrite) {
        for index in needed {
            let object = ObjectAddress::new(*index, 0);
            if sheet.get(*index, 0).is_some_and(|found| !found.is_mappable) {
                let needed = "it must be allowed in process data (PDOMapping=1)".to_owned();
                return Err(unfit(object, "not mappable".to_owned(), needed));
            }
        }
        return Ok(needed.iter().copied().map(name).collect());
    }
    let n_mapped = sheet.value(mapping, 0).unwrap_or(0).clamp(0, 64);
    let entries = (1..=u8::try_from(n_mapped).unwrap_or(64)).filter_map(|sub| {
        let entry = u32::try_from(sheet.value(mapping, sub)?).ok()?;
        let [_, sub, low, high] = entry.to_le_bytes();
        Some(ObjectName::of(ObjectAddress::new(u16::from_le_bytes([low, high]), sub)))
    });
    let entries: Vec<ObjectName> = entries.collect();
    for index in needed {
        if !entries.contains(&name(*index)) {
            let list: Vec<String> = entries.iter().map(ToString::to_string).collect();
            let needed = format!(
                "it cannot be changed, and lacks 0x{index:04X} ({})",
                objects::name(*index).unwrap_or("")
            );
            return Err(unfit(ObjectAddress::new(mapping, 0), list.join(" "), needed));
        }
    }
    Ok(entries)
}

/// Takes the ratios of the mechanics if the configuration states one: then all that the drive has.
fn ratios(sheet: &DataSheet, drive: &mut Drive) -> Result<(), DataSheetError> {
    let indices = [objects::ENCODER_RESOLUTION, objects::GEAR_RATIO, objects::FEED_CONSTANT];
    let mut is_configured = false;
    for (address, object) in sheet.objects() {
        if indices.contains(&address.index) && sheet.configured(address, object)?.is_some() {
            is_configured = true;
        }
    }
    if !is_configured {
        return Ok(());
    }
    let part = |index, sub| {
        let part = u32::try_from(sheet.value(index, sub)?).ok()?;
        Some(part).filter(|part| *part > 0)
    };
    let ratio = |index| Some([part(index, 1)?, part(index, 2).unwrap_or(1)]);
    [drive.encoder_resolution, drive.gear_ratio, drive.feed_constant] = indices.map(ratio);
    Ok(())
}

/// Takes a value of the configuration: as a key of its own, as a start-up object, or not at all.
fn take(found: &mut Imported, address: ObjectAddress, object: &SheetObject, value: i64) {
    let drive = &mut found.drive;
    let ObjectAddress { index, sub } = address;
    let option = i16::try_from(value).ok();
    match (index, sub) {
        // Taken above, or no settings at all.
        (
            objects::ENCODER_RESOLUTION
            | objects::GEAR_RATIO
            | objects::FEED_CONSTANT
            | objects::IDENTITY
            | objects::POSITION_UNIT
            | objects::VELOCITY_UNIT,
            _,
        ) => {}
        (objects::HOME_OFFSET, 0) => drive.home_offset = i32::try_from(value).ok(),
        (objects::POLARITY, 0) if value & 0xC0 == value && [0, 0xC0].contains(&value) => {
            drive.polarity = u8::try_from(value).unwrap_or(0);
        }
        (objects::QUICK_STOP_OPTION, 0) if value != 0 => drive.quick_stop_option = option,
        (objects::FAULT_REACTION_OPTION, 0) if value != 0 => drive.fault_reaction_option = option,
        (objects::CONNECTION_LOSS_OPTION, 0) if ![0, 2].contains(&value) => {
            drive.connection_loss_option = option;
        }
        _ if object.access == Access::Read => {
            found.remarks.push(format!("{address} = {value} is left out: it is read only"));
        }
        _ if is_set(index) && !TORQUE_LIMITS.contains(&index) => {
            let hint = if is_keepable(index) { "; keep it to set it yourself" } else { "" };
            found.remarks.push(format!(
                "{address} = {value} is left out: bring-up sets this object itself{hint}"
            ));
        }
        _ => match object.kind {
            Some(kind) => start_up(drive, address, kind, object.access, value),
            None => found.remarks.push(format!(
                "{address} = {value} is left out: its type is no number of up to 32 bits"
            )),
        },
    }
}

fn start_up(drive: &mut Drive, address: ObjectAddress, kind: Kind, access: Access, value: i64) {
    let object = ObjectName::of(address);
    if TORQUE_LIMITS.contains(&address.index) {
        drive.keep.push(object);
    }
    drive.start_up.push(StartUp { object, kind, value, read_back: access == Access::ReadWrite });
}
