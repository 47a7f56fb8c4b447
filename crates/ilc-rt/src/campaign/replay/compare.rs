//! Comparison of a tick with its recording, and the name of what differs.

use serde::Serialize;
use serde_json::Value;

use super::Difference;
use super::line::Unlike;
use crate::design::Plan;
use crate::fieldbus::Frame;
use crate::fieldbus::cia402::pdo_map::{COMMAND_PDO, OFFSET_PDO};
use crate::fieldbus::cia402::{PdoLayout, PdoMap, objects};
use crate::recording::frame_text;

/// Returns the first field in which two messages differ, in the order of their struct, with both values.
pub(super) fn field<T: Serialize>(recorded: &T, replayed: &T) -> Option<(String, String, String)> {
    let text = |message: &T| serde_json::to_string(message).unwrap_or_default();
    // The shortest decimal form of a float is as exact as its bits.
    let (then, now) = (text(recorded), text(replayed));
    if then == now {
        return None;
    }
    let of = |text: &str| serde_json::from_str::<Value>(text).unwrap_or_default();
    let (recorded, replayed) = (of(&then), of(&now));
    let names = |value: &Value| -> Vec<String> {
        value.as_object().map(|fields| fields.keys().cloned().collect()).unwrap_or_default()
    };
    let mut all = names(&recorded);
    all.extend(names(&replayed));
    // In the order of the text: what a message begins with is nearer to the cause.
    all.sort_by_key(|name| {
        let key = format!("\"{name}\":");
        then.find(&key).or_else(|| now.find(&key)).unwrap_or(usize::MAX)
    });
    let differs = |name: &&String| recorded.get(name.as_str()) != replayed.get(name.as_str());
    let name = all.iter().find(differs)?;
    let shown = |value: &Value| value.get(name).map_or("absent".to_owned(), Value::to_string);
    Some((name.clone(), shown(&recorded), shown(&replayed)))
}

/// Returns the difference of a frame that the loop sent, with the axis and the object that it commands.
pub(super) fn frame(
    cycle: u64,
    (recorded, replayed): Unlike,
    (plan, maps, names): (&Plan, &[PdoMap], &[String]),
) -> Difference {
    let shown =
        |frame: Option<Frame>| frame.map_or("no frame".to_owned(), |frame| frame_text(&frame));
    let mut difference = Difference {
        cycle,
        axes: names.to_vec(),
        field: "frame sent".to_owned(),
        recorded: shown(recorded),
        replayed: shown(replayed),
    };
    let ids = [recorded, replayed].map(|frame| frame.map(|frame| frame.id()));
    let mut axes = Vec::new();
    for ((axis, spec), map) in plan.servo.axes.iter().enumerate().zip(maps) {
        for (pdo, layout, what) in
            [(COMMAND_PDO, &map.command, "RPDO1"), (OFFSET_PDO, &map.offset, "RPDO2")]
        {
            if !ids.contains(&Some(pdo.default_cob_id(spec.node))) {
                continue;
            }
            axes.push(names[axis].clone());
            if let (Some(then), Some(now)) = (recorded, replayed)
                && then.id() == now.id()
            {
                difference.field = format!("{what}, {}", object(layout, &then, &now));
            }
        }
    }
    // Without a command among them it concerns all.
    if !axes.is_empty() {
        axes.dedup();
        difference.axes = axes;
    }
    difference
}

/// Returns the name of the first object in which two payloads differ.
fn object(layout: &PdoLayout, then: &Frame, now: &Frame) -> String {
    let differs = |at: usize| then.payload().get(at) != now.payload().get(at);
    let mut at = 0;
    for object in layout.objects() {
        let end = at + usize::from(object.bits / 8);
        if (at..end).any(differs) {
            let name = match object.address.index {
                objects::CONTROLWORD => "controlword ",
                objects::TARGET_POSITION => "target position ",
                objects::TARGET_VELOCITY => "target velocity ",
                objects::TARGET_TORQUE => "target torque ",
                objects::TORQUE_OFFSET => "torque offset ",
                objects::VELOCITY_OFFSET => "velocity offset ",
                _ => "",
            };
            return format!("{name}{}", object.address);
        }
        at = end;
    }
    "its length".to_owned()
}
