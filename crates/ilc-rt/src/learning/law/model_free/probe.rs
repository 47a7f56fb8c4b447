//! Inputs that measure: their direction, their size within a bound, and whether a run had them.

/// Deviation of an input from the one asked for, squared and relative to the part that measures, from which
/// it counts as limited: one per cent.
const LIMITED: f64 = 1e-4;

/// Comparison of the input of a run with the one asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Came {
    /// The same, but for rounding.
    AsAsked,
    /// Nearly the same: a limit changed some of it.
    Limited,
    /// Another one, such as that of an earlier run.
    Other,
}

/// Compares the input of a run with that asked for; `base` is the learned input inside it. The worst channel
/// decides.
pub(super) fn came(base: &[f64], asked: &[f64], input: &[f64], n_channels: usize) -> Came {
    let of_channel = |channel: usize| {
        let of = |signal: &'_ [f64], k: usize| signal[k * n_channels + channel];
        let (mut apart, mut part) = (0.0, 0.0);
        for k in 0..input.len() / n_channels {
            apart += (of(input, k) - of(asked, k)).powi(2);
            part += (of(asked, k) - of(base, k)).powi(2);
        }
        if apart <= LIMITED * part {
            Came::AsAsked
        } else if apart < 0.99 * part {
            Came::Limited
        } else {
            Came::Other
        }
    };
    let any = |wanted: Came| (0..n_channels).any(|channel| of_channel(channel) == wanted);
    if any(Came::Limited) {
        Came::Limited
    } else if any(Came::Other) {
        Came::Other
    } else {
        Came::AsAsked
    }
}

/// Returns the size of largest magnitude, up to `wanted`, with which `input + size * along` is within the
/// bound at every sample: positive if both signs have the same room, 0 if the bound leaves none.
pub(super) fn largest_within(
    bound: f64,
    wanted: f64,
    samples: impl Iterator<Item = (f64, f64)>,
) -> f64 {
    let (mut plus, mut minus) = (wanted, wanted);
    for (input, along) in samples {
        if along == 0.0 || bound == f64::INFINITY {
            continue;
        }
        // A learned input that its bound has cut may lie on it, or by rounding beyond.
        let up = (bound - input).max(0.0) / along.abs();
        let down = (bound + input).max(0.0) / along.abs();
        let (with, against) = if along > 0.0 { (up, down) } else { (down, up) };
        (plus, minus) = (plus.min(with), minus.min(against));
    }
    if plus >= minus { plus } else { -minus }
}

/// Writes a signal backward in time, each channel divided by its size; without sizes as it is.
pub(super) fn scaled_reverse(signal: &[f64], sizes: &[f64], out: &mut [f64], n_channels: usize) {
    let rows = signal.chunks_exact(n_channels).rev();
    for (row, out) in rows.zip(out.chunks_exact_mut(n_channels)) {
        for (channel, (value, out)) in row.iter().zip(out).enumerate() {
            *out = match sizes.get(channel) {
                Some(0.0) => 0.0,
                Some(size) => value / size,
                None => *value,
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_size_keeps_every_sample_within_the_bound() {
        let within = |bound, wanted, samples: &[(f64, f64)]| {
            largest_within(bound, wanted, samples.iter().copied())
        };
        let free = [(0.0, 1.0), (0.0, -1.0)];
        assert!((within(1.0, 0.5, &free) - 0.5).abs() < 1e-15);
        assert!((within(0.2, 0.5, &free) - 0.2).abs() < 1e-15);
        assert!((within(f64::INFINITY, 0.5, &free) - 0.5).abs() < 1e-15);
        // At the bound upward there is room downward.
        let up = [(1.0, 1.0), (0.5, 0.1)];
        assert!((within(1.0, 0.5, &up) + 0.5).abs() < 1e-15);
        assert!(within(1.0, 0.5, &[(1.0, 1.0), (-1.0, 1.0)]).abs() < 1e-15);
    }

    #[test]
    fn an_input_is_recognised_by_its_distance_from_the_one_asked_for() {
        let (base, asked) = ([1.0, 1.0, 1.0], [1.0, 2.0, 3.0]);
        assert_eq!(came(&base, &asked, &asked, 1), Came::AsAsked);
        assert_eq!(came(&base, &asked, &[1.0, 2.0, 3.000_1], 1), Came::AsAsked);
        assert_eq!(came(&base, &asked, &[1.0, 2.0, 2.5], 1), Came::Limited);
        assert_eq!(came(&base, &asked, &base, 1), Came::Other);
        assert_eq!(came(&base, &asked, &[7.0, 0.0, 0.0], 1), Came::Other);
        // A channel of small numbers counts as much as one of large ones.
        let (base, asked) = ([0.0, 0.0, 0.0, 0.0], [1e3, 1e-6, 1e3, 1e-6]);
        assert_eq!(came(&base, &asked, &[1e3, 1e-6, 1e3, 5e-7], 2), Came::Limited);
    }

    #[test]
    fn time_runs_backward_in_every_channel() {
        let mut out = [0.0; 4];
        scaled_reverse(&[1.0, 2.0, 3.0, 4.0], &[], &mut out, 2);
        assert_eq!(out.map(f64::to_bits), [3.0, 4.0, 1.0, 2.0].map(f64::to_bits));
        scaled_reverse(&[1.0, 2.0, 3.0, 4.0], &[0.5, 0.0], &mut out, 2);
        assert_eq!(out.map(f64::to_bits), [6.0, 0.0, 2.0, 0.0].map(f64::to_bits));
    }
}
