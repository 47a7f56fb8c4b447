//! Arrays of a run as they are stored: what follows from the others, bit by bit, is left out.

use crate::record::IterationRecord;

/// The array that is left out, and computed again when a run is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Computed {
    /// All arrays are stored.
    Nothing,
    /// `error_m = reference_m - encoder_m`.
    ErrorOfEncoder,
    /// `error_m = reference_m - tool_m`.
    ErrorOfTool,
    /// `encoder_m = reference_m - error_m`, as for runs made elsewhere.
    Encoder,
}

impl Computed {
    /// Returns the array that can be left out: only if the same bits follow from the others.
    pub(super) fn from(record: &IterationRecord) -> Self {
        let IterationRecord { reference_m, encoder_m, tool_m, error_m, .. } = record;
        // The bits of NaN are not the same on every processor.
        if error_m.is_empty() || !error_m.iter().chain(encoder_m).all(|value| value.is_finite()) {
            Self::Nothing
        } else if is_difference(error_m, reference_m, tool_m) {
            Self::ErrorOfTool
        } else if is_difference(error_m, reference_m, encoder_m) {
            Self::ErrorOfEncoder
        } else if is_difference(encoder_m, reference_m, error_m) {
            Self::Encoder
        } else {
            Self::Nothing
        }
    }

    /// Returns the number that stands for it in the file.
    pub(super) fn number(self) -> i64 {
        match self {
            Self::Nothing => 0,
            Self::ErrorOfEncoder => 1,
            Self::ErrorOfTool => 2,
            Self::Encoder => 3,
        }
    }

    /// Returns the meaning of a number; of an unknown one, as in a damaged file, that nothing is
    /// left out, so that the digest of the run does not match.
    pub(super) fn of(number: i64) -> Self {
        [Self::ErrorOfEncoder, Self::ErrorOfTool, Self::Encoder]
            .into_iter()
            .find(|computed| computed.number() == number)
            .unwrap_or(Self::Nothing)
    }

    /// Computes what was left out.
    pub(super) fn restore(self, record: &mut IterationRecord) {
        let IterationRecord { reference_m, encoder_m, tool_m, error_m, .. } = record;
        match self {
            Self::Nothing => {}
            Self::ErrorOfEncoder => *error_m = difference(reference_m, encoder_m),
            Self::ErrorOfTool => *error_m = difference(reference_m, tool_m),
            Self::Encoder => *encoder_m = difference(reference_m, error_m),
        }
    }
}

fn difference(of: &[f64], and: &[f64]) -> Vec<f64> {
    of.iter().zip(and).map(|(a, b)| a - b).collect()
}

/// Returns true if `values = of - and`, bit by bit.
fn is_difference(values: &[f64], of: &[f64], and: &[f64]) -> bool {
    values.len() == of.len()
        && values.len() == and.len()
        && values.iter().zip(of.iter().zip(and)).all(|(v, (a, b))| v.to_bits() == (a - b).to_bits())
}

/// Returns the sum of all squares, in the order of the samples.
pub(super) fn squares(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum()
}

/// Returns numbers as little-endian float64.
pub(super) fn blob(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Reads numbers written by [`blob`].
pub(super) fn floats(bytes: &[u8]) -> Vec<f64> {
    let (words, _) = bytes.as_chunks();
    words.iter().map(|word| f64::from_le_bytes(*word)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Set points and measurements whose difference is rounded.
    fn run() -> IterationRecord {
        let reference_m = vec![0.1, 0.2, -0.3];
        let encoder_m = vec![0.100_000_1, 0.199_999_7, -0.3];
        IterationRecord { reference_m, encoder_m, ..Default::default() }
    }

    fn is_restored(record: &IterationRecord, computed: Computed) {
        assert_eq!(Computed::from(record), computed);
        assert_eq!(Computed::of(computed.number()), computed);
        let mut stored = record.clone();
        match computed {
            Computed::Nothing => {}
            Computed::Encoder => stored.encoder_m.clear(),
            _ => stored.error_m.clear(),
        }
        computed.restore(&mut stored);
        assert_eq!(stored.digest(), record.digest());
    }

    #[test]
    fn what_is_left_out_is_computed_again_bit_by_bit() {
        let mut record = run();
        record.error_m = difference(&record.reference_m, &record.encoder_m);
        is_restored(&record, Computed::ErrorOfEncoder);
        record.tool_m = vec![0.3, 0.1, 1e-9];
        is_restored(&record, Computed::ErrorOfEncoder);
        record.error_m = difference(&record.reference_m, &record.tool_m);
        is_restored(&record, Computed::ErrorOfTool);
        let mut elsewhere = run();
        elsewhere.error_m = vec![1e-7, 3e-9, -1e-30];
        elsewhere.encoder_m = difference(&elsewhere.reference_m, &elsewhere.error_m);
        is_restored(&elsewhere, Computed::Encoder);
    }

    #[test]
    fn what_does_not_follow_bit_by_bit_is_stored() {
        let mut record = run();
        record.error_m = difference(&record.reference_m, &record.encoder_m);
        record.error_m[1] += 1e-15;
        is_restored(&record, Computed::Nothing);
        record.error_m = vec![f64::NAN; 3];
        record.encoder_m = vec![f64::NAN; 3];
        is_restored(&record, Computed::Nothing);
        // Zero has a sign.
        let signed = IterationRecord {
            reference_m: vec![0.0],
            encoder_m: vec![-0.0],
            error_m: vec![-0.0],
            ..Default::default()
        };
        is_restored(&signed, Computed::Nothing);
        is_restored(&IterationRecord::default(), Computed::Nothing);
    }
}
