//! The record of one run: arrays on the servo grid, and their provenance.

use sha2::{Digest, Sha256};

use super::figures::Figures;

/// Provenance of a record: the same for all runs of a campaign.
#[derive(Clone, Debug, PartialEq)]
pub struct Meta {
    /// Name of the cell.
    pub cell: String,
    /// Identifier of the campaign.
    pub campaign: String,
    /// Hash of everything that affects the input: axes, program, law; equal means comparable.
    pub fingerprint: String,
    /// Name of the law.
    pub law: String,
    /// Parameters of the law as JSON.
    pub law_parameters: String,
    /// Measurement learned from: `encoder` or `tcp`.
    pub measure: String,
    /// The program's segments as JSON.
    pub program: String,
    /// Servo cycle.
    pub cycle_s: f64,
    /// Number of axes.
    pub n_axes: usize,
    /// Names of the axes.
    pub axis_names: Vec<String>,
    /// Unit of each axis' learned input: `m`, `m/s`, `rad` or `rad/s`.
    pub input_units: Vec<String>,
}

/// One run.
///
/// # Shapes
/// All arrays are time first, `n_samples * n_axes`, row by row; `contour_m` is `n_samples`, or
/// empty if the path has no contour.
/// # Units
/// Positions and errors in metres. `input` in metres (csp) or metres per second (csv).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IterationRecord {
    /// Number of the run in its campaign, from 0.
    pub index: u32,
    /// Set points of the program, without the learned input.
    pub reference_m: Vec<f64>,
    /// Learned input as applied.
    pub input: Vec<f64>,
    /// Positions measured in the drives.
    pub encoder_m: Vec<f64>,
    /// Positions measured at the tool centre point; empty without such a measurement.
    pub tool_m: Vec<f64>,
    /// Error learned from: reference minus the chosen measurement.
    pub error_m: Vec<f64>,
    /// Distance of the tool (of the encoders, without a tool measurement) from the reference path, in the
    /// linear axes.
    pub contour_m: Vec<f64>,
    /// Measured disturbance before the run, e.g. a temperature; empty if none was measured.
    pub disturbance: Vec<f64>,
    /// Figures.
    pub figures: Figures,
}

impl IterationRecord {
    /// Returns the SHA-256 over index and arrays: equal exactly if two runs are bit-identical.
    pub fn digest(&self) -> String {
        let mut hash = Sha256::new();
        hash.update(self.index.to_le_bytes());
        for array in [
            &self.reference_m,
            &self.input,
            &self.encoder_m,
            &self.tool_m,
            &self.error_m,
            &self.contour_m,
        ] {
            hash.update((array.len() as u64).to_le_bytes());
            for value in array {
                hash.update(value.to_le_bytes());
            }
        }
        // Only if there is one, so that runs stored before disturbances existed still match.
        for value in &self.disturbance {
            hash.update(value.to_le_bytes());
        }
        hex(&hash.finalize())
    }
}

/// Returns the SHA-256 of a text, in hexadecimal.
pub fn fingerprint(text: &str) -> String {
    hex(&Sha256::digest(text.as_bytes()))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
        let digit = |nibble: u8| char::from_digit(u32::from(nibble), 16).unwrap_or('?');
        text.push(digit(byte >> 4));
        text.push(digit(byte & 15));
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_digest_sees_one_bit_and_the_border_between_arrays() {
        let a = IterationRecord { input: vec![1.0, 2.0], ..Default::default() };
        let mut b = a.clone();
        assert_eq!(a.digest(), b.digest());
        b.input[1] = f64::from_bits(2.0_f64.to_bits() + 1);
        assert_ne!(a.digest(), b.digest());
        let c = IterationRecord { input: vec![1.0], encoder_m: vec![2.0], ..Default::default() };
        assert_ne!(a.digest(), c.digest());
        let warm = IterationRecord { disturbance: vec![20.0], ..a.clone() };
        assert_ne!(a.digest(), warm.digest());
    }
}
