//! JSON schemas of the channels, of plain types only: viewers of recordings know no unions and no references.

use serde_json::{Map, Value, json};

/// Types and names of the fields of a channel; `[T]` is a list.
type Fields = &'static [(&'static str, &'static str)];

/// Name and fields of each schema.
pub(super) const CYCLE: (&str, Fields) = (
    "ilc.Cycle",
    &[
        ("integer", "cycle"),
        ("integer", "missed"),
        ("integer", "asked"),
        ("integer", "released"),
        ("integer", "feed_percent"),
        ("boolean", "paused"),
        ("integer", "table"),
        ("string", "phase"),
        ("integer", "run"),
        ("integer", "sample"),
        ("integer", "overruns"),
        ("integer", "scaled_cycles"),
        ("number", "scale"),
        ("number", "tool_x_m"),
        ("number", "tool_y_m"),
        ("integer", "inputs_known"),
        ("integer", "inputs_on"),
        ("string", "stopping"),
        ("integer", "lost"),
    ],
);
pub(super) const AXIS: (&str, Fields) = (
    "ilc.Axis",
    &[
        ("integer", "cycle"),
        ("number", "reference_m"),
        ("number", "reference_m_s"),
        ("number", "correction"),
        ("number", "position_m"),
        ("number", "velocity_m_s"),
        ("number", "error_m"),
        ("number", "following_error_m"),
        ("number", "command"),
        ("integer", "controlword"),
        ("integer", "target_counts"),
        ("integer", "torque_offset"),
        ("integer", "velocity_offset_counts_s"),
        ("integer", "statusword"),
        ("integer", "drive_velocity_counts_s"),
        ("integer", "drive_torque"),
    ],
);
pub(super) const FRAMES: (&str, Fields) = (
    "ilc.Frames",
    &[
        ("integer", "cycle"),
        ("[string]", "received"),
        ("[integer]", "received_ns"),
        ("[string]", "sent"),
        ("[integer]", "sent_ns"),
    ],
);
pub(super) const TABLE: (&str, Fields) =
    ("ilc.Table", &[("integer", "table"), ("[number]", "input"), ("[string]", "digests")]);
pub(super) const TIMING: (&str, Fields) = (
    "ilc.Timing",
    &[
        ("integer", "cycle"),
        ("integer", "due_ns"),
        ("integer", "woke_ns"),
        ("integer", "received_ns"),
        ("integer", "controlled_ns"),
        ("integer", "sent_ns"),
        ("integer", "ended_ns"),
        ("integer", "missed"),
        ("[integer]", "answer_ns"),
        ("integer", "late_answers"),
        ("integer", "waited_ns"),
        ("integer", "waited_for"),
        ("boolean", "refused"),
        ("integer", "preemptions"),
        ("integer", "minor_faults"),
        ("integer", "major_faults"),
        ("boolean", "late"),
        ("boolean", "stopped"),
    ],
);
/// Events have the fields of `docs/events.schema.json`.
pub(super) const EVENT: (&str, Fields) = ("ilc.Event", &[("string", "event")]);

/// Returns a schema as text.
pub(super) fn text(fields: Fields) -> String {
    let property = |&(kind, name): &(&str, &str)| {
        let inner = kind.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
        let value = match inner {
            Some(kind) => json!({ "type": "array", "items": { "type": kind } }),
            None => json!({ "type": kind }),
        };
        (name.to_owned(), value)
    };
    let properties: Map<String, Value> = fields.iter().map(property).collect();
    json!({ "type": "object", "properties": properties }).to_string()
}
