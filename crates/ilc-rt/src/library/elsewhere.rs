//! A run that was made elsewhere, e.g. by another controller or a simulation, as a record of the library.

use super::{Library, LibraryError};
use crate::record::{AxisKinds, Figures, IterationRecord, Meta, distances_m, fingerprint};

/// Longest name of a cell, a campaign or a law.
const NAME_MAX: usize = 200;

/// Signals and names of a run that was made elsewhere.
///
/// # Shapes
/// - `input`, `error_m`, `reference_m`: `n_samples` x `n_axes`, time first
#[derive(Clone, Debug, PartialEq)]
pub struct Elsewhere {
    /// Name of the cell.
    pub cell: String,
    /// Name of the campaign.
    pub campaign: String,
    /// Name of the law.
    pub law: String,
    /// Sample time.
    pub cycle_s: f64,
    /// Number of axes.
    pub n_axes: usize,
    /// Set points.
    pub reference_m: Vec<f64>,
    /// Learned input.
    pub input: Vec<f64>,
    /// Reference minus measurement.
    pub error_m: Vec<f64>,
    /// Measured disturbance; empty if none was measured.
    pub disturbance: Vec<f64>,
}

/// Reason that a run made elsewhere is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ElsewhereError {
    /// A sample time out of range.
    #[error("cycle_s = {0}: a sample time must be finite and above 0")]
    Cycle(f64),
    /// An unusable name.
    #[error(
        "{key} = {}: 1 to {NAME_MAX} bytes without control characters are allowed",
        name.chars().take(40).collect::<String>().escape_debug()
    )]
    Name {
        /// Name of the argument.
        key: &'static str,
        /// Its value.
        name: String,
    },
    /// Figures beyond the largest number.
    #[error("e or reference_m is too large: the figures of this run are not finite")]
    TooLarge,
}

impl Elsewhere {
    /// Returns provenance and record of the run, its number in the campaign left at 0.
    ///
    /// # Errors
    /// - [`ElsewhereError`] for a sample time, a name or figures out of range.
    pub fn record(self) -> Result<(Meta, IterationRecord), ElsewhereError> {
        let Self { cell, campaign, law, cycle_s, n_axes, reference_m, input, error_m, disturbance } =
            self;
        if !(cycle_s.is_finite() && cycle_s > 0.0) {
            return Err(ElsewhereError::Cycle(cycle_s));
        }
        for (key, name) in [("cell", &cell), ("campaign", &campaign), ("law", &law)] {
            if name.is_empty() || name.len() > NAME_MAX || name.chars().any(char::is_control) {
                return Err(ElsewhereError::Name { key, name: name.clone() });
            }
        }
        let encoder_m: Vec<f64> = reference_m.iter().zip(&error_m).map(|(r, e)| r - e).collect();
        let meta = Meta {
            fingerprint: fingerprint(&format!("elsewhere {cell} {campaign} {law}")),
            cell,
            campaign,
            law,
            law_parameters: "{}".to_owned(),
            measure: "encoder".to_owned(),
            program: "[]".to_owned(),
            cycle_s,
            n_axes,
            axis_names: (1..=n_axes).map(|axis| format!("axis {axis}")).collect(),
            input_units: vec!["m".to_owned(); n_axes],
        };
        let kinds = AxisKinds::new(&meta.input_units, n_axes);
        let contour_m = distances_m(&reference_m, &encoder_m, &kinds, cycle_s);
        let mut figures = Figures::default();
        figures.set_tracking(&error_m, &kinds);
        figures.set_places(&reference_m, &encoder_m, &[], &kinds);
        figures.set_contour(&contour_m);
        let told = [figures.tracking_inf_m, figures.tracking_rms_m, figures.encoder_tracking_inf_m];
        let contour = [figures.contour_inf_m, figures.contour_rms_m];
        if told.iter().chain(contour.iter().flatten()).any(|figure| !figure.is_finite()) {
            return Err(ElsewhereError::TooLarge);
        }
        let (index, tool_m) = (0, Vec::new());
        let record = IterationRecord {
            index,
            reference_m,
            input,
            encoder_m,
            tool_m,
            error_m,
            contour_m,
            disturbance,
            figures,
        };
        Ok((meta, record))
    }
}

impl Library {
    /// Appends a record as the next run of its campaign, and returns its key.
    ///
    /// # Errors
    /// - [`LibraryError`] if the file cannot be written.
    pub fn append_next(
        &self,
        meta: &Meta,
        mut record: IterationRecord,
    ) -> Result<i64, LibraryError> {
        record.index = self.next_index(&meta.campaign)?;
        self.append(meta, &record)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run() -> Elsewhere {
        Elsewhere {
            cell: "bench".to_owned(),
            campaign: "one".to_owned(),
            law: "own".to_owned(),
            cycle_s: 1e-3,
            n_axes: 1,
            reference_m: vec![0.0, 1.0, 2.0],
            input: vec![0.0; 3],
            error_m: vec![0.0, 0.5, -1.0],
            disturbance: vec![21.5],
        }
    }

    #[test]
    fn runs_of_a_campaign_are_numbered_and_have_the_figures_of_their_error() {
        let library = Library::in_memory().unwrap();
        for index in 0..2 {
            let (meta, record) = run().record().unwrap();
            assert_eq!(record.encoder_m, [0.0, 0.5, 3.0]);
            let id = library.append_next(&meta, record).unwrap();
            let row = library.load(id).unwrap();
            assert_eq!(row.record.index, index);
            assert_eq!(row.record.figures.tracking_inf_m.to_bits(), 1_f64.to_bits());
        }
    }

    #[test]
    fn what_no_run_can_have_is_refused_one_at_a_time() {
        let refuse = |run: Elsewhere| run.record().unwrap_err().to_string();
        assert!(refuse(Elsewhere { cycle_s: 0.0, ..run() }).contains("cycle_s = 0"));
        assert!(refuse(Elsewhere { law: String::new(), ..run() }).contains("law = : 1 to 200"));
        let cell = "a\x1b[2J".to_owned();
        assert!(refuse(Elsewhere { cell, ..run() }).contains(r"cell = a\u{1b}[2J"));
        let error_m = vec![1e308, -1e308, 1e308];
        assert!(refuse(Elsewhere { error_m, ..run() }).contains("too large"));
    }
}
