//! Contradictions within `[[input]]`.

use super::checker::Checker;
use crate::config::input::INPUTS_MAX;
use crate::config::{Cell, ConfigError, InputUse};
use crate::fieldbus::cia402::objects;
use crate::record::{NAME_MAX, is_hidden};

/// Bits of object 0x60FD that the profile reserves.
const RESERVED: std::ops::RangeInclusive<u8> = 4..=15;

/// Checks names, axes, bits and directions of the inputs, and that their drives can send them.
pub(super) fn check(cell: &Cell, v: &Checker) -> Result<(), ConfigError> {
    v.that(
        cell.inputs.len() <= INPUTS_MAX,
        "[[input]] count",
        &cell.inputs.len(),
        &format!("at most {INPUTS_MAX} inputs"),
    )?;
    for (number, input) in cell.inputs.iter().enumerate() {
        let (name, before) = (input.name.as_str(), &cell.inputs[..number]);
        v.that(
            !name.is_empty()
                && name.trim() == name
                && name.chars().take(NAME_MAX + 1).count() <= NAME_MAX
                && !name.chars().any(is_hidden)
                && before.iter().all(|other| other.name != name),
            "[[input]] name",
            &name,
            &format!(
                "1 to {NAME_MAX} characters without control characters and spaces around, unique"
            ),
        )?;
        let at = |key: &str| format!("[[input]] {name}: {key}");
        let Some(axis) = cell.axes.iter().find(|axis| axis.name == input.axis) else {
            let names: Vec<&str> = cell.axes.iter().map(|axis| axis.name.as_str()).collect();
            let allowed = format!("the name of an axis: {}", names.join(", "));
            return Err(v.refuse(&at("axis"), &input.axis, &allowed));
        };
        let allowed = "0 to 3, or 16 to 31: the profile reserves 4 to 15";
        v.that(!RESERVED.contains(&input.bit), &at("bit"), &input.bit, allowed)?;
        let taken = before.iter().find(|other| other.axis == input.axis && other.bit == input.bit);
        if let Some(other) = taken {
            let allowed = format!("a bit of its own; {} has it already", other.name);
            return Err(v.refuse(&at("bit"), &input.bit, &allowed));
        }
        match (input.purpose, input.direction) {
            (InputUse::Limit, _) => v.that(
                input.direction_of(axis).is_some(),
                &at("direction"),
                &"missing",
                "negative or positive: only bits 0 and 1 have a direction of their own",
            )?,
            (_, Some(direction)) => {
                let allowed = "for use = \"limit\" only; remove it";
                return Err(v.refuse(&at("direction"), &direction.name(), allowed));
            }
            (_, None) => {}
        }
        let payload_max = cell.format(axis.bus).payload_max();
        let stated = axis.drive.pdo.map(axis.interface, payload_max).ok().flatten();
        v.that(
            stated.is_none_or(|map| map.carries(objects::DIGITAL_INPUTS)),
            &format!("[[axis]] {}: drive.pdo", axis.name),
            &"without 0x60FD",
            &format!("0x60FD in status or motion: input {name} is read from it in every cycle"),
        )?;
    }
    Ok(())
}
