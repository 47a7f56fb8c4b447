//! Records of iterations: their arrays, their figures, and the events that report them.
//!
//! The campaign fills it, the library stores it, telemetry and Python read it. Imports signal,
//! trajectory and models at most; never the loop, the library or the bus.

mod axes;
mod event;
mod fault;
mod fields;
mod figures;
mod flight;
mod iteration;
mod late;
mod text;

pub use axes::AxisKinds;
pub use event::{DriveState, EndStatus, Event, InputState, SCHEMA, StateName};
pub use fault::{Fault, FaultKind, LastCycles};
pub use fields::{Field, FieldKind, figure_fields};
pub use figures::{Figures, distances_m, infinity_norm, rms};
pub use flight::{CycleRow, FLIGHT_SUFFIX, FlightRecord, LateCase, StageFigures, StopCase};
pub use iteration::{IterationRecord, Meta, fingerprint};
pub use late::{
    AnswerTimes, LateCause, LateCounts, LateCycle, StageSpans, Verdict, judge, judge_stop, spans,
};
pub use text::{NAME_MAX, TEXT_MAX, is_hidden, printable, printable_json, printable_lines};
