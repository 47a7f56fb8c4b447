//! The two sweeps for one input and one output, with everything in registers.

use super::factor::Gains;
use super::record::Record;
use super::{Channels, Run, Sweep};

/// The most states, that of a rate penalty included, for which [`single`] has a solver.
const MAX_STATES: usize = 6;

/// Returns the solver for one axis by itself.
///
/// `None` unless the gains are for one input, one output and 1 to [`MAX_STATES`] states: the caller
/// then takes [`super::General`].
pub(super) fn single(gains: &Gains, channels: &Channels) -> Option<Box<dyn Sweep>> {
    let ([input], [output], [shift]) =
        (&channels.inputs[..], &channels.outputs[..], &channels.shifts[..])
    else {
        return None;
    };
    let at = (*input, *output, *shift);
    Some(match gains.n_states() {
        1 => Box::new(Single::<1>::new(gains, at)),
        2 => Box::new(Single::<2>::new(gains, at)),
        3 => Box::new(Single::<3>::new(gains, at)),
        4 => Box::new(Single::<4>::new(gains, at)),
        5 => Box::new(Single::<5>::new(gains, at)),
        6 => Box::new(Single::<6>::new(gains, at)),
        _ => return None,
    })
}

/// The gains of one sample with its sizes known to the compiler.
#[derive(Debug, Clone, Copy)]
struct Fixed<const N: usize> {
    /// By columns: column `j` is what state `j` becomes.
    transition: [[f64; N]; N],
    feedback: [f64; N],
    from_error: [f64; N],
    from_input: [f64; N],
    costate: [f64; N],
    b: [f64; N],
    error: f64,
    input: f64,
}

impl<const N: usize> Fixed<N> {
    fn new(record: Record, is_held: bool) -> Self {
        let rows = N + 1;
        let fore = |row: usize, col: usize| record.fore[col * rows + row];
        let back = |row: usize, col: usize| record.back[col * rows + row];
        let held = |row: usize| if is_held { back(row, N + 1) } else { 0.0 };
        Self {
            transition: std::array::from_fn(|col| std::array::from_fn(|row| fore(row, col))),
            feedback: std::array::from_fn(|col| -fore(N, col)),
            from_error: std::array::from_fn(|row| back(row, N)),
            from_input: std::array::from_fn(held),
            costate: std::array::from_fn(|col| back(N, col)),
            b: std::array::from_fn(|row| record.fore[rows * N + row]),
            error: back(N, N),
            input: -held(N),
        }
    }

    #[inline]
    fn backward(&self, costate: &mut [f64; N], input: f64, error: f64) -> f64 {
        let kappa = self.error * error - self.input * input + dot(&self.costate, costate);
        let earlier = std::array::from_fn(|i| {
            // The part that does not wait for the previous sample first: it shortens the chain.
            let fresh = self.from_error[i] * error + self.from_input[i] * input;
            fresh + dot(&self.transition[i], costate)
        });
        *costate = earlier;
        kappa
    }

    #[inline]
    fn forward(&self, state: &mut [f64; N], kappa: f64) -> f64 {
        let change = kappa - dot(&self.feedback, state);
        let mut next: [f64; N] = std::array::from_fn(|i| self.b[i] * kappa);
        for (column, value) in self.transition.iter().zip(*state) {
            for (entry, gain) in next.iter_mut().zip(column) {
                *entry += gain * value;
            }
        }
        *state = next;
        change
    }
}

#[inline]
fn dot<const N: usize>(left: &[f64; N], right: &[f64; N]) -> f64 {
    let mut sum = 0.0;
    for i in 0..N {
        sum += left[i] * right[i];
    }
    sum
}

#[derive(Debug)]
struct Single<const N: usize> {
    /// Each set of gains and for how many samples it serves, in order of time.
    sets: Vec<(usize, Fixed<N>)>,
    n_samples: usize,
    input: usize,
    output: usize,
    shift: usize,
    kappa: Vec<f64>,
}

impl<const N: usize> Single<N> {
    fn new(gains: &Gains, (input, output, shift): (usize, usize, usize)) -> Self {
        let is_held = gains.sizes().held > 0;
        let sets = (0..gains.n_stored())
            .rev()
            .map(|place| {
                let (count, at) = gains.set(place);
                (count, Fixed::new(at, is_held))
            })
            .collect();
        let n_samples = gains.n_samples();
        Self { sets, n_samples, input, output, shift, kappa: vec![0.0; n_samples] }
    }
}

impl<const N: usize> Sweep for Single<N> {
    fn solve(&mut self, run: &mut Run) {
        let last = self.n_samples.saturating_sub(1);
        let mut k = self.n_samples;
        let mut costate = [0.0; N];
        for (count, at) in self.sets.iter().rev() {
            let at = *at;
            for _ in 0..*count {
                k -= 1;
                // Past the end of the run the weight is zero: any finite value will do.
                let error = run.error[(k + self.shift).min(last) * run.n_outputs + self.output];
                let input = run.input[k * run.n_inputs + self.input];
                self.kappa[k] = at.backward(&mut costate, input, error);
            }
        }
        let mut state = [0.0; N];
        for (count, at) in &self.sets {
            let at = *at;
            for _ in 0..*count {
                let index = k * run.n_inputs + self.input;
                run.next[index] = run.input[index] + at.forward(&mut state, self.kappa[k]);
                k += 1;
            }
        }
    }
}
