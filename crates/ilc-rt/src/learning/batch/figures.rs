//! Figures of a run, rounded as NumPy rounds them.

/// Numbers that are summed in one pass; longer sums are halved.
const BLOCK: usize = 128;
/// Partial sums of a pass.
const PARTS: usize = 8;

/// Returns the largest absolute value; infinite if a value is not a number.
pub(super) fn largest(values: &[f64]) -> f64 {
    // Partial results, as one comparison would wait for another.
    let mut most = [0.0_f64; PARTS];
    let chunks = values.chunks_exact(PARTS);
    let rest = chunks.remainder();
    for chunk in chunks {
        for (most, value) in most.iter_mut().zip(chunk) {
            let size = value.abs();
            // No number is larger than NaN, which so remains.
            *most = if size > *most || size.is_nan() { size } else { *most };
        }
    }
    let sizes = most.into_iter().chain(rest.iter().map(|value| value.abs()));
    sizes.fold(0.0, |most, size| if size.is_nan() { f64::INFINITY } else { most.max(size) })
}

/// Returns the RMS over time of the Euclidean norm of all channels; `squares` is a workspace of one number per
/// sample.
///
/// `numpy.sqrt(numpy.mean(numpy.sum(e * e, axis=1)))`
pub(super) fn rms(error: &[f64], n_channels: usize, squares: &mut [f64]) -> f64 {
    if n_channels == 1 {
        for (square, value) in squares.iter_mut().zip(error) {
            *square = value * value;
        }
    } else {
        for (square, sample) in squares.iter_mut().zip(error.chunks_exact(n_channels)) {
            *square = sum_of(sample, |value| value * value);
        }
    }
    (sum_of(squares, |square| square) / squares.len() as f64).sqrt()
}

/// Returns a sum in the order in which NumPy adds (pairwise summation).
fn sum_of(values: &[f64], term: impl Fn(f64) -> f64 + Copy) -> f64 {
    let n = values.len();
    if n > BLOCK {
        let half = n / 2 - n / 2 % PARTS;
        let (first, second) = values.split_at(half);
        return sum_of(first, term) + sum_of(second, term);
    }
    let chunks = values.chunks_exact(PARTS);
    let rest = chunks.remainder();
    let mut parts: Option<[f64; PARTS]> = None;
    for chunk in chunks {
        let terms: [f64; PARTS] = std::array::from_fn(|i| term(chunk[i]));
        parts = Some(match parts {
            None => terms,
            Some(parts) => std::array::from_fn(|i| parts[i] + terms[i]),
        });
    }
    let [a, b, c, d, e, f, g, h] = parts.unwrap_or_default();
    rest.iter().fold(((a + b) + (c + d)) + ((e + f) + (g + h)), |sum, value| sum + term(*value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_numpy() {
        // v = (numpy.arange(n) % 97) * 0.1 + 1e-3; numpy.sum(v * v), whose last digits depend on the order.
        for (n, expected) in [
            (1, 1e-06),
            (7, 0.914_207_000_000_000_2),
            (8, 1.405_608_000_000_000_4),
            (9, 2.047_209_000_000_000_5),
            (100, 2_996.341_900_000_001),
            (127, 3_081.928_327_000_000_5),
            (128, 3_090.934_328_000_000_3),
            (129, 3_100.550_529),
            (200, 5_993.135_600_000_001),
            (1300, 39_142.125_100_000_005),
            (9001, 277_151.644_601),
        ] {
            let values: Vec<f64> = (0..n).map(|k| f64::from(k % 97) * 0.1 + 1e-3).collect();
            let found = sum_of(&values, |value| value * value);
            assert_eq!(found.to_bits(), f64::to_bits(expected), "{n}");
        }
    }

    #[test]
    fn the_largest_value_is_found_everywhere_and_nan_is_infinite() {
        for place in 0..20 {
            let mut values = vec![0.5; 20];
            values[place] = -3.0;
            assert_eq!(largest(&values).to_bits(), 3.0_f64.to_bits());
            for bad in [f64::NAN, f64::NEG_INFINITY] {
                values[place] = bad;
                assert!(largest(&values).is_infinite(), "{place}");
            }
        }
        assert_eq!(largest(&[]).to_bits(), 0);
    }
}
