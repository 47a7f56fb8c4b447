//! `ilc-rt sdo`: one object of a node, read or written.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};
use serde_json::json;

use super::target::{Asking, Target, answered};
use super::{EXIT_BAD_INPUT, EXIT_FAILURE, show};
use crate::commissioning::{
    CommissioningError, DataType, parse_address, read_object, write_object,
};
use crate::fieldbus::cia402::objects;

#[derive(Args)]
#[command(after_help = "INDEX is hexadecimal, SUB and VALUE decimal or hexadecimal with 0x.
Exit status: 0 done, 1 the node refused or did not answer, 2 bad input (nothing was sent).

Examples:
  ilc-rt sdo read gantry.toml x 6041
  ilc-rt sdo read can:can0 1 1018:1 --json -
  ilc-rt sdo write gantry.toml x 6065 5000 --type u32")]
pub(super) struct SdoArguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    /// Read an object; may run beside a running controller.
    Read(Transfer),
    /// Write an object; refused while another master is at work.
    Write {
        #[command(flatten)]
        transfer: Transfer,
        /// Value to write.
        #[arg(allow_hyphen_values = true)]
        value: String,
    },
}

#[derive(Args)]
struct Transfer {
    /// Cell description, or address of a bus.
    #[arg(value_name = "CELL|BUS")]
    target: String,
    /// Node number, or name of an axis of the cell.
    node: String,
    /// Object.
    #[arg(value_name = "INDEX[:SUB]")]
    object: String,
    /// Type of the value; that of the object's size if not given.
    #[arg(long = "type", value_name = "TYPE", value_parser = kinds())]
    kind: Option<DataType>,
    #[command(flatten)]
    asking: Asking,
}

fn kinds() -> impl TypedValueParser<Value = DataType> {
    PossibleValuesParser::new(DataType::names())
        .map(|name| DataType::named(&name).unwrap_or(DataType::Bytes))
}

/// Reads or writes an object; returns the exit status.
pub(super) fn sdo(arguments: &SdoArguments) -> u8 {
    let (transfer, value) = match &arguments.action {
        Action::Read(transfer) => (transfer, None),
        Action::Write { transfer, value } => (transfer, Some(value.as_str())),
    };
    answered(transfer.asking.json.as_deref(), || exchange(transfer, value))
}

fn exchange(
    transfer: &Transfer,
    value: Option<&str>,
) -> Result<(serde_json::Value, u8), (String, u8)> {
    let bad = |line: String| (line, EXIT_BAD_INPUT);
    let address = parse_address(&transfer.object).map_err(|error| bad(error.to_string()))?;
    if let (Some(kind), Some(value)) = (transfer.kind, value) {
        kind.encode(value).map_err(|error| bad(error.to_string()))?;
    }
    let mut target = Target::open(&transfer.target, &transfer.asking).map_err(bad)?;
    let node = target.node(&transfer.node).map_err(bad)?;
    let company = target.listen().map_err(bad)?;
    let allowed = if value.is_some() { company.lets_change() } else { company.lets_read() };
    allowed.map_err(|error| bad(target.said(&error)))?;
    let client = target.client(node);
    let failed = |target: &Target, error: &CommissioningError| {
        let status = match error {
            CommissioningError::Sdo(_) => EXIT_FAILURE,
            _ => EXIT_BAD_INPUT,
        };
        (target.said(error), status)
    };
    if let Some(value) = value {
        write_object(target.bus.as_mut(), &client, address, transfer.kind, value)
            .map_err(|error| failed(&target, &error))?;
    }
    // A drive may round or clip: the value that it holds now is reported.
    let (kind, held) = match read_object(target.bus.as_mut(), &client, address, transfer.kind) {
        Ok((kind, held)) => (Some(kind), Some(held)),
        Err(CommissioningError::Sdo(_)) if value.is_some() => (transfer.kind, None),
        Err(error) => return Err(failed(&target, &error)),
    };
    let name = objects::name(address.index);
    let shown = held.as_ref().map_or_else(|| "written".to_owned(), ToString::to_string);
    let kind = kind.map_or("", DataType::name);
    show::say(&format!(
        "node {node}, object {address}{}: {shown} [{kind}]",
        name.map_or_else(String::new, |name| format!(" {name}"))
    ));
    let text = json!({
        "node": node.get(), "index": address.index, "sub": address.sub, "name": name,
        "type": kind, "value": held, "written": value,
    });
    Ok((text, 0))
}
