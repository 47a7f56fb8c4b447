//! Source of the measured disturbance of each run.

use std::fmt;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use crate::config::{Cell, read_file};

/// Largest file with the disturbance of a run.
const FILE_BYTES_MAX: u64 = 4096;

/// Function from the number of the next run to its disturbance, or to the reason why it has none.
type Ask = dyn FnMut(u32) -> Result<Vec<f64>, String> + Send;

/// Reason that the disturbance of a run is unavailable.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DisturbanceError {
    /// Its source failed.
    #[error("the disturbance of run {run}: {reason}")]
    NotMeasured {
        /// Number of the run.
        run: u32,
        /// Reason given by the source.
        reason: String,
    },
    /// Nothing was measured.
    #[error("the disturbance of run {run} holds no number")]
    Empty {
        /// Number of the run.
        run: u32,
    },
    /// A value is not a finite number.
    #[error("the disturbance of run {run} holds {value}")]
    NotFinite {
        /// Number of the run.
        run: u32,
        /// The value.
        value: f64,
    },
}

/// Measured disturbance of each run, one number per quantity, e.g. a temperature; or none.
///
/// Measured once before each run, in order, while the axes return: never in the loop.
#[derive(Clone, Default)]
pub struct Disturbance(Option<Arc<Mutex<Ask>>>);

impl Disturbance {
    /// Creates a source that calls a function.
    pub fn measured(ask: impl FnMut(u32) -> Result<Vec<f64>, String> + Send + 'static) -> Self {
        Self(Some(Arc::new(Mutex::new(ask))))
    }

    /// Reads the file that the cell names, unless a function is given.
    #[must_use]
    pub(super) fn or_file(self, cell: &Cell) -> Self {
        match &cell.learning.disturbance_file {
            Some(name) if self.0.is_none() => {
                // A relative name is beside the cell description, an absolute one stays as it is.
                let folder = cell.file.parent().unwrap_or(Path::new(""));
                let path = folder.join(name);
                Self::measured(move |_| read(&path))
            }
            _ => self,
        }
    }

    /// Returns the disturbance of a run that is about to begin; empty if none is measured.
    pub(super) fn of(&self, run: u32) -> Result<Vec<f64>, DisturbanceError> {
        let Some(ask) = &self.0 else {
            return Ok(Vec::new());
        };
        let mut ask = ask.lock().unwrap_or_else(PoisonError::into_inner);
        let disturbance =
            (*ask)(run).map_err(|reason| DisturbanceError::NotMeasured { run, reason })?;
        match disturbance.iter().find(|value| !value.is_finite()) {
            None if disturbance.is_empty() => Err(DisturbanceError::Empty { run }),
            None => Ok(disturbance),
            Some(&value) => Err(DisturbanceError::NotFinite { run, value }),
        }
    }
}

/// Reads the numbers of a file.
fn read(path: &Path) -> Result<Vec<f64>, String> {
    let refused = |reason: String| format!("{}: {reason}", path.display());
    let bytes = read_file(path, FILE_BYTES_MAX).map_err(refused)?;
    let text = String::from_utf8_lossy(&bytes);
    let numbers =
        text.split(|c: char| c.is_whitespace() || c == ',').filter(|part| !part.is_empty());
    numbers
        .map(|part| part.parse().map_err(|_| refused(format!("{part:?} is not a number"))))
        .collect()
}

impl fmt::Debug for Disturbance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "measured" } else { "not measured" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_disturbance_is_refused() {
        assert_eq!(Disturbance::default().of(3), Ok(Vec::new()));
        let mut told = vec![vec![1.0, f64::NAN], Vec::new(), vec![21.5]];
        let source = Disturbance::measured(move |_| told.pop().ok_or_else(|| "gone".to_owned()));
        assert_eq!(source.of(0), Ok(vec![21.5]));
        assert!(source.of(1).unwrap_err().to_string().contains("run 1 holds no number"));
        assert!(source.of(2).unwrap_err().to_string().contains("run 2 holds NaN"));
        assert_eq!(source.of(3).unwrap_err().to_string(), "the disturbance of run 3: gone");
    }
}
