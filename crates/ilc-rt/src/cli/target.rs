//! Target of a commissioning verb: a cell description or the address of a bus, opened; and its `--json` file.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use serde::Serialize;

use super::figures::FiguresFile;
use super::{EXIT_BAD_INPUT, EXIT_FAILURE, run, show};
use crate::commissioning::{self, Company};
use crate::config::{Axis, Cell};
use crate::fieldbus::bring_up::SdoClient;
use crate::fieldbus::canopen::NodeId;
use crate::fieldbus::{Bus, transport};
use crate::record::{TEXT_MAX, printable};

/// Time-out of a request where no cell gives one.
const ANSWER_TIMEOUT_S: f64 = 0.5;

/// Options of every verb that asks nodes.
#[derive(Args, Clone)]
pub(super) struct Asking {
    /// Bus address in place of the cell's.
    #[arg(long, value_name = "ADDRESS")]
    pub(super) bus: Option<String>,
    /// Time-out of each answer; of the cell, or 0.5 s.
    #[arg(long, value_name = "SECONDS", value_parser = timeout)]
    pub(super) timeout: Option<f64>,
    /// Write the result to a file; - for standard output.
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
}

/// An open bus, and the cell on it if there is one.
pub(super) struct Target {
    pub(super) cell: Option<Cell>,
    pub(super) bus: Box<dyn Bus>,
    /// Bus address.
    pub(super) address: String,
    timeout: Duration,
}

impl Target {
    /// Opens a cell description, or the address of a bus.
    ///
    /// # Errors
    /// One line.
    pub(super) fn open(target: &str, asking: &Asking) -> Result<Self, String> {
        let Some(scheme) = transport::scheme_of(target) else {
            let opened = run::open(Path::new(target), asking.bus.as_deref());
            let (cell, bus) = opened.map_err(|error| error.to_string())?;
            let address = cell.bus.address.clone();
            let timeout = asking.timeout.unwrap_or(cell.safety.answer_timeout_s);
            let timeout = Duration::from_secs_f64(timeout);
            return Ok(Self { cell: Some(cell), bus, address, timeout });
        };
        if let Some(other) = &asking.bus {
            return Err(format!("--bus {other}: {target} is a bus already; allowed with a cell"));
        }
        if scheme.in_process {
            return Err(format!(
                "`{target}` has no drives in this program; allowed: {}",
                transport::syntaxes(false)
            ));
        }
        let bus = transport::open(target).map_err(|error| error.to_string())?;
        let timeout = Duration::from_secs_f64(asking.timeout.unwrap_or(ANSWER_TIMEOUT_S));
        Ok(Self { cell: None, bus, address: target.to_owned(), timeout })
    }

    /// Listens before anything is sent.
    ///
    /// # Errors
    /// One line.
    pub(super) fn listen(&mut self) -> Result<Company, String> {
        commissioning::listen(self.bus.as_mut()).map_err(|error| self.said(&error))
    }

    /// Returns a line with the address in front.
    pub(super) fn said(&self, error: &dyn std::fmt::Display) -> String {
        format!("{}: {error}", self.address)
    }

    /// Returns a client of a node.
    pub(super) fn client(&self, node: NodeId) -> SdoClient {
        SdoClient::new(node, self.timeout)
    }

    /// Returns the time-out of each answer.
    pub(super) fn timeout(&self) -> Duration {
        self.timeout
    }

    /// Returns the axis on a node.
    pub(super) fn axis_of(&self, node: u8) -> Option<&Axis> {
        self.cell.as_ref()?.axes.iter().find(|axis| axis.node == node)
    }

    /// Returns the node of a number, or of the name of an axis.
    ///
    /// # Errors
    /// One line with what is allowed.
    pub(super) fn node(&self, text: &str) -> Result<NodeId, String> {
        let axes = self.cell.as_ref().map_or(&[][..], |cell| &cell.axes);
        let number = axes.iter().find(|axis| axis.name == text).map(|axis| axis.node);
        number.or_else(|| text.parse().ok()).and_then(NodeId::new).ok_or_else(|| {
            let names: Vec<&str> = axes.iter().map(|axis| axis.name.as_str()).collect();
            let names = match names[..] {
                [] => String::new(),
                _ => format!(", or an axis: {}", names.join(", ")),
            };
            format!("node {}: allowed 1 to 127{names}", printable(text, TEXT_MAX))
        })
    }

    /// Returns node and name of the chosen axes of the cell, or of chosen nodes; of all axes if none is chosen.
    ///
    /// # Errors
    /// One line with what is allowed.
    pub(super) fn chosen(&self, choice: &Choice) -> Result<Vec<(NodeId, String)>, String> {
        let named = |node: NodeId| {
            let axis =
                self.axis_of(node.get()).map(|axis| format!("axis {} (node {node})", axis.name));
            (node, axis.unwrap_or_else(|| format!("node {node}")))
        };
        if !choice.axis.is_empty() || !choice.node.is_empty() {
            for name in &choice.axis {
                choice_of(self.cell.as_ref(), name)?;
            }
            let words = choice.axis.iter().chain(&choice.node);
            return words.map(|word| self.node(word).map(named)).collect();
        }
        let Some(cell) = &self.cell else {
            return Err("--node NUMBER is needed, as a bus has no axes".to_owned());
        };
        Ok(cell.axes.iter().filter_map(|axis| NodeId::new(axis.node)).map(named).collect())
    }
}

/// Choice of axes or nodes.
#[derive(Args, Clone, Default)]
pub(super) struct Choice {
    /// Axis of the cell; may be repeated. All axes if neither axis nor node is given.
    #[arg(long, value_name = "NAME")]
    pub(super) axis: Vec<String>,
    /// Node; may be repeated.
    #[arg(long, value_name = "NUMBER")]
    pub(super) node: Vec<String>,
}

/// Refuses a name that no axis has.
fn choice_of(cell: Option<&Cell>, name: &str) -> Result<(), String> {
    let names: Vec<&str> = cell
        .map_or_else(Vec::new, |cell| cell.axes.iter().map(|axis| axis.name.as_str()).collect());
    if names.contains(&name) {
        return Ok(());
    }
    let has = if names.is_empty() { "a bus has none".to_owned() } else { names.join(", ") };
    Err(format!("--axis {}: allowed: {has}", printable(name, TEXT_MAX)))
}

/// Runs a verb that returns its result for `--json` and an exit status; prints a refusal and returns its status.
pub(super) fn answered<T: Serialize>(
    json: Option<&Path>,
    verb: impl FnOnce() -> Result<(T, u8), (String, u8)>,
) -> u8 {
    let file = match json {
        None => None,
        Some(path) => match FiguresFile::reserve(path, false) {
            None => return EXIT_BAD_INPUT,
            reserved => reserved,
        },
    };
    match verb() {
        Ok((result, status)) => {
            let result = serde_json::to_value(result).unwrap_or_default();
            match file {
                Some(file) if !file.write(&result) && status == 0 => EXIT_FAILURE,
                _ => status,
            }
        }
        Err((line, status)) => {
            if let Some(file) = file {
                file.give_up();
            }
            show::complain(&line);
            status
        }
    }
}

fn timeout(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|seconds| (0.01..=60.0).contains(seconds))
        .ok_or_else(|| "allowed 0.01 to 60 s".to_owned())
}
