//! Faults in fields, for programs; `reason` makes the sentence of the same stop.

use crate::config::Cell;
use crate::fieldbus::BusError;
use crate::fieldbus::canopen::{NodeId, emcy};
use crate::interpolate::MAX_AXES;
use crate::record::{Fault, FaultKind, LastCycles};
use crate::servo::{Sample, StopReason, Stranger};

/// Returns the fields of a fault; `None` for a requested stop.
pub(super) fn fault(reason: StopReason, cell: &Cell) -> Option<Fault> {
    let of_axis = |kind, index: usize| {
        let axis = cell.axes.get(index);
        Fault {
            axis: axis.map(|axis| axis.name.clone()),
            node: axis.map(|axis| axis.node),
            unit: axis.map(|axis| axis.unit.symbol().to_owned()),
            ..Fault::new(kind)
        }
    };
    let of_node = |kind, node: u8| {
        let axis = cell.axes.iter().find(|axis| axis.node == node);
        Fault { axis: axis.map(|axis| axis.name.clone()), node: Some(node), ..Fault::new(kind) }
    };
    let counted = |fault: Fault, cycles: u32, limit: u32| Fault {
        value: Some(cycles.into()),
        limit: Some(limit.into()),
        unit: Some("cycles".to_owned()),
        ..fault
    };
    let limits = |index: usize| cell.axes.get(index).map(|axis| axis.limits);
    let silent_max = cell.safety.silent_cycles_max;
    Some(match reason {
        StopReason::Asked(_) | StopReason::StopButton { .. } => return None,
        StopReason::GuardOpen { input } => of_input(FaultKind::GuardOpen, input, cell),
        StopReason::LimitSwitch { input, .. } => of_input(FaultKind::LimitSwitch, input, cell),
        StopReason::DriveFault { axis, code, following_error_m } => Fault {
            code: Some(code.into()),
            value: Some(following_error_m),
            limit: limits(axis).map(|limits| limits.following_error_max_m),
            ..of_axis(FaultKind::DriveFault, axis)
        },
        StopReason::NotEnabled { axis, statusword } => {
            Fault { code: Some(statusword.into()), ..of_axis(FaultKind::NotEnabled, axis) }
        }
        StopReason::SilentAxis { axis, cycles } => {
            counted(of_axis(FaultKind::SilentDrive, axis), cycles, silent_max)
        }
        StopReason::SilentPdo { axis, pdo, cycles } => {
            let silent = counted(of_axis(FaultKind::SilentPdo, axis), cycles, silent_max);
            Fault { code: Some(pdo.into()), ..silent }
        }
        StopReason::WrongLength { node, pdo, n_bytes, needed } => Fault {
            code: Some(pdo.into()),
            value: Some(n_bytes.into()),
            limit: Some(needed.into()),
            unit: Some("bytes".to_owned()),
            ..of_node(FaultKind::WrongLength, node)
        },
        StopReason::SilentTool { cycles } => {
            let node = cell.tcp_encoder.map(|tool| tool.node);
            let silent = Fault { node, ..Fault::new(FaultKind::SilentTool) };
            counted(silent, cycles, silent_max)
        }
        StopReason::NodeLeft { node } => of_node(FaultKind::NodeRestarted, node),
        StopReason::NodeStopped { node, state } => {
            let code = Some(u32::from(state as u8));
            Fault { code, ..of_node(FaultKind::NodeStopped, node) }
        }
        StopReason::OtherMaster(stranger) => match addressed(stranger) {
            Some(node) => of_node(FaultKind::OtherMaster, node.get()),
            None => Fault::new(FaultKind::OtherMaster),
        },
        StopReason::FollowingError { axis, error_m } => Fault {
            value: Some(error_m),
            limit: limits(axis).map(|limits| limits.following_error_max_m),
            ..of_axis(FaultKind::FollowingError, axis)
        },
        StopReason::OutsideLimits { axis, position_m } => Fault {
            value: Some(position_m),
            limit: limits(axis)
                .map(|limits| position_m.clamp(limits.position_min_m, limits.position_max_m)),
            ..of_axis(FaultKind::OutsideLimits, axis)
        },
        StopReason::Jump { axis, step_m } => {
            Fault { value: Some(step_m), ..of_axis(FaultKind::PositionJump, axis) }
        }
        StopReason::NotFinite { axis } => of_axis(FaultKind::NotFinite, axis),
        StopReason::Stalled { axis, cycles } => Fault {
            code: Some(emcy::CODE_RPDO_TIMEOUT.into()),
            value: Some(cycles.into()),
            unit: Some("cycles".to_owned()),
            ..of_axis(FaultKind::Stall, axis)
        },
        StopReason::Overrun { cycles } => {
            counted(Fault::new(FaultKind::Overrun), cycles, cell.safety.overrun_cycles_max)
        }
        StopReason::Bus(error) => {
            let code = match error {
                BusError::Os(number) => u32::try_from(number).ok(),
                BusError::Full | BusError::Closed => None,
            };
            Fault { code, ..Fault::new(FaultKind::Bus) }
        }
    })
}

/// Returns the node that another master speaks to, if it is a single one.
fn addressed(stranger: Stranger) -> Option<NodeId> {
    match stranger {
        Stranger::Sync => None,
        Stranger::Nmt(_, node) => node,
        Stranger::Command(node) | Stranger::Request(node) => Some(node),
    }
}

/// Returns the fault that an input tells.
fn of_input(kind: FaultKind, index: usize, cell: &Cell) -> Fault {
    let input = cell.inputs.get(index);
    let axis = cell.axes.iter().find(|axis| input.is_some_and(|own| own.axis == axis.name));
    Fault {
        axis: axis.map(|axis| axis.name.clone()),
        node: axis.map(|axis| axis.node),
        code: input.map(|input| input.bit.into()),
        input: input.map(|input| input.name.clone()),
        ..Fault::new(kind)
    }
}

/// Returns the last cycles before a stop, one row each.
pub(super) fn last_cycles(samples: &[Sample], n_axes: usize) -> LastCycles {
    let rows = |of: fn(&Sample) -> &[f64; MAX_AXES]| {
        samples.iter().map(|sample| of(sample)[..n_axes].to_vec()).collect()
    };
    LastCycles {
        first_sync: samples.first().map(|sample| sample.sync),
        reference_m: rows(|sample| &sample.reference_m),
        input: rows(|sample| &sample.input),
        encoder_m: rows(|sample| &sample.encoder_m),
        tool_m: rows(|sample| &sample.tool_m),
        missing: samples.iter().map(|sample| sample.missing).collect(),
    }
}
