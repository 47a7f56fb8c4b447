//! The rows of the bounds: limits, slacks and multipliers, and the interior-point operations on
//! them.

/// Kinds of rows; first the change of the input.
pub(super) const CHANGE: usize = 0;
/// The difference from the sample before.
pub(super) const STEP: usize = 1;
/// The second difference.
pub(super) const BEND: usize = 2;
/// The predicted output.
pub(super) const OUTPUT: usize = 3;

/// Distance of a slack from zero at the start, relative to the width between two limits.
const START_WIDTH: f64 = 0.1;
/// Rows that are worked on at a time; their number is filled up with rows without limits.
const LANES: usize = 8;
/// Initial slack relative to the largest violation of any row of its kind.
const START_OVERSHOOT: f64 = 0.1;

/// One side of all rows: `slack = limit - T v` for the upper one, `T v - limit` for the lower one.
#[derive(Debug)]
pub(super) struct Side {
    /// +1 for the upper side, -1 for the lower.
    pub(super) sign: f64,
    /// 1 with a limit, 0 without.
    pub(super) is_on: Vec<f64>,
    /// The limit; 0 without.
    pub(super) limit: Vec<f64>,
    /// Multiplier of the last solution.
    pub(super) kept: Vec<f64>,
    /// The row is at its limit: in the last solution, or in an active-set step.
    pub(super) is_held: Vec<bool>,
    pub(super) slack: Vec<f64>,
    pub(super) multiplier: Vec<f64>,
    /// `1 / slack`.
    inverse: Vec<f64>,
    /// `1 / multiplier`; 0 without a limit.
    inverse_multiplier: Vec<f64>,
    /// `d slack * d multiplier` of the predictor.
    second_order: Vec<f64>,
    slack_step: Vec<f64>,
    multiplier_step: Vec<f64>,
}

impl Side {
    fn new(sign: f64, n_rows: usize) -> Self {
        let vector = || vec![0.0; n_rows];
        Self {
            sign,
            is_on: vector(),
            limit: vector(),
            kept: vector(),
            is_held: vec![false; n_rows],
            slack: vec![1.0; n_rows],
            multiplier: vector(),
            inverse: vec![1.0; n_rows],
            inverse_multiplier: vector(),
            second_order: vector(),
            slack_step: vector(),
            multiplier_step: vector(),
        }
    }

    /// Sets the limit of a row; an infinite one means no limit.
    pub(super) fn set(&mut self, row: usize, limit: f64) {
        let is_on = limit.is_finite();
        self.is_on[row] = if is_on { 1.0 } else { 0.0 };
        self.limit[row] = if is_on { limit } else { 0.0 };
    }

    pub(super) fn room(&self, row: usize, value: f64) -> f64 {
        self.sign * (self.limit[row] - value)
    }

    fn count(&self) -> f64 {
        self.is_on.iter().sum()
    }

    /// `sum slack * multiplier`.
    fn complementarity(&self) -> f64 {
        sum_of(self.slack.len(), |row| self.slack[row] * self.multiplier[row])
    }

    /// Adds this side's share to the weight and the gradient of each row; `centre` is the target of
    /// the product of slack and multiplier.
    fn weigh(
        &self,
        at: &[f64],
        sigma: &mut [f64],
        pull: &mut [f64],
        centre: f64,
        is_corrector: bool,
    ) {
        let order = if is_corrector { 1.0 } else { 0.0 };
        let n = sigma.len();
        let (limit, slack) = (&self.limit[..n], &self.slack[..n]);
        let (multiplier, inverse) = (&self.multiplier[..n], &self.inverse[..n]);
        let (is_on, second) = (&self.is_on[..n], &self.second_order[..n]);
        let (at, pull) = (&at[..n], &mut pull[..n]);
        for row in 0..n {
            let ratio = multiplier[row] * inverse[row];
            let aim = is_on[row] * (centre - order * second[row]);
            let residual = self.sign * (limit[row] - at[row]) - slack[row];
            sigma[row] += ratio;
            pull[row] -= self.sign * (aim * inverse[row] - ratio * residual);
        }
    }

    /// Computes the steps of slack and multiplier for the `steps` of the rows; returns the largest
    /// relative decrease of one of them.
    fn step(&mut self, at: &[f64], steps: &[f64], centre: f64, is_corrector: bool) -> f64 {
        let order = if is_corrector { 1.0 } else { 0.0 };
        let sign = self.sign;
        let (at, steps) = (lanes(at), lanes(steps));
        let (is_on, limit) = (lanes(&self.is_on), lanes(&self.limit));
        let (slack, multiplier) = (lanes(&self.slack), lanes(&self.multiplier));
        let (inverse, inverse_multiplier) = (lanes(&self.inverse), lanes(&self.inverse_multiplier));
        let second_order = self.second_order.as_chunks_mut::<LANES>().0;
        let slack_step = self.slack_step.as_chunks_mut::<LANES>().0;
        let multiplier_step = self.multiplier_step.as_chunks_mut::<LANES>().0;
        // One maximum for each lane: they need not wait for each other.
        let mut shrinks = [0.0_f64; LANES];
        for (c, second) in second_order.iter_mut().enumerate() {
            let (at, steps, is_on, limit) = (&at[c], &steps[c], &is_on[c], &limit[c]);
            let (slack, multiplier, inverse) = (&slack[c], &multiplier[c], &inverse[c]);
            let inverse_multiplier = &inverse_multiplier[c];
            let (mut slack_steps, mut multiplier_steps) = ([0.0; LANES], [0.0; LANES]);
            for i in 0..LANES {
                let residual = sign * (limit[i] - at[i]) - slack[i];
                let ds = is_on[i] * (residual - sign * steps[i]);
                let aim = is_on[i] * (centre - order * second[i]);
                let dl = (aim - multiplier[i] * ds) * inverse[i] - multiplier[i];
                slack_steps[i] = ds;
                multiplier_steps[i] = dl;
                let (of_slack, of_multiplier) = (-ds * inverse[i], -dl * inverse_multiplier[i]);
                let larger = if of_slack > of_multiplier { of_slack } else { of_multiplier };
                shrinks[i] = if larger > shrinks[i] { larger } else { shrinks[i] };
            }
            if !is_corrector {
                *second = std::array::from_fn(|i| slack_steps[i] * multiplier_steps[i]);
            }
            slack_step[c] = slack_steps;
            multiplier_step[c] = multiplier_steps;
        }
        shrinks.into_iter().fold(0.0, f64::max)
    }

    /// `sum (slack + a d slack) (multiplier + a d multiplier)`.
    fn complementarity_at(&self, length: f64) -> f64 {
        sum_of(self.slack.len(), |row| {
            (self.slack[row] + length * self.slack_step[row])
                * (self.multiplier[row] + length * self.multiplier_step[row])
        })
    }

    fn advance(&mut self, length: f64) {
        for row in 0..self.slack.len() {
            self.slack[row] += length * self.slack_step[row];
            self.multiplier[row] += length * self.multiplier_step[row];
            self.inverse[row] = 1.0 / self.slack[row];
            let is_on = self.is_on[row];
            self.inverse_multiplier[row] = is_on / (self.multiplier[row] + (1.0 - is_on));
        }
    }

    /// Initialises slacks and multipliers with the product `centre`: a slack is the distance to the
    /// limit, at least `least`; if `keep`, it follows from the multiplier of the last search (warm
    /// start).
    fn start(&mut self, values: &[f64], least: &[f64], centre: f64, keep: bool) {
        for (row, value) in values.iter().enumerate() {
            if self.is_on[row] <= 0.0 {
                (self.slack[row], self.multiplier[row], self.inverse[row]) = (1.0, 0.0, 1.0);
                self.inverse_multiplier[row] = 0.0;
                continue;
            }
            let least = if keep { (centre / self.kept[row]).min(least[row]) } else { least[row] };
            let slack = self.room(row, *value).max(least);
            self.slack[row] = slack;
            self.inverse[row] = 1.0 / slack;
            self.multiplier[row] = centre / slack;
            self.inverse_multiplier[row] = slack / centre;
        }
    }
}

/// Returns rows, so many at a time.
fn lanes(values: &[f64]) -> &[[f64; LANES]] {
    values.as_chunks().0
}

/// Sums over all rows, one sum for each lane.
fn sum_of(n_rows: usize, term: impl Fn(usize) -> f64) -> f64 {
    let mut sums = [0.0; LANES];
    for first in (0..n_rows).step_by(LANES) {
        for (lane, sum) in sums.iter_mut().enumerate() {
            *sum += term(first + lane);
        }
    }
    sums.iter().sum()
}

/// All rows of one group of axes.
#[derive(Debug)]
pub(super) struct Rows {
    /// First row of each kind, if it has any.
    pub(super) begin: [Option<usize>; 4],
    /// The bounded kinds and their rows.
    pub(super) ranges: Vec<(usize, std::ops::Range<usize>)>,
    pub(super) upper: Side,
    pub(super) lower: Side,
    /// Weight of each row as a virtual output.
    pub(super) sigma: Vec<f64>,
    /// That weight times the row's target.
    pub(super) pull: Vec<f64>,
    /// `T v` at the iterate.
    pub(super) values: Vec<f64>,
    /// `T dv` of the last computed step.
    pub(super) steps: Vec<f64>,
    /// The smallest initial slack; later the reference size of a violation.
    least: Vec<f64>,
}

impl Rows {
    /// Creates the rows: `counts[kind]` numbers for each bounded kind.
    pub(super) fn new(counts: [usize; 4]) -> Self {
        let mut begin = [None; 4];
        let mut ranges = Vec::new();
        let mut n_rows = 0;
        for (kind, count) in counts.into_iter().enumerate() {
            if count > 0 {
                begin[kind] = Some(n_rows);
                ranges.push((kind, n_rows..n_rows + count));
                n_rows += count;
            }
        }
        let n_rows = n_rows.next_multiple_of(LANES);
        Self {
            begin,
            ranges,
            upper: Side::new(1.0, n_rows),
            lower: Side::new(-1.0, n_rows),
            sigma: vec![0.0; n_rows],
            pull: vec![0.0; n_rows],
            values: vec![0.0; n_rows],
            steps: vec![0.0; n_rows],
            least: vec![0.0; n_rows],
        }
    }

    /// Returns the number of limits.
    pub(super) fn count(&self) -> f64 {
        self.upper.count() + self.lower.count()
    }

    /// Returns true if no row violates its limits.
    pub(super) fn fit(&self) -> bool {
        let fits = |side: &Side| {
            let room =
                |(row, value): (usize, &f64)| side.is_on[row] * side.room(row, *value) >= 0.0;
            self.values.iter().enumerate().all(room)
        };
        fits(&self.upper) && fits(&self.lower)
    }

    /// Returns the largest violation of any row, relative to the size of its kind's limits.
    pub(super) fn overshoot(&self, sizes: &[f64; 4]) -> f64 {
        let mut worst = 0.0_f64;
        for (kind, range) in &self.ranges {
            let size = sizes[*kind].max(f64::MIN_POSITIVE);
            for row in range.clone() {
                for side in [&self.upper, &self.lower] {
                    worst = worst.max(-side.is_on[row] * side.room(row, self.values[row]) / size);
                }
            }
        }
        worst
    }

    /// Initialises the slacks and multipliers around the computed values.
    pub(super) fn start(&mut self, centre: f64, is_warm: bool) {
        for (_, range) in &self.ranges {
            let overshoot = range.clone().fold(0.0_f64, |worst, row| {
                let room = |side: &Side| -side.is_on[row] * side.room(row, self.values[row]);
                worst.max(room(&self.upper)).max(room(&self.lower))
            });
            for row in range.clone() {
                let both = self.upper.is_on[row] * self.lower.is_on[row];
                let width = both * (self.upper.limit[row] - self.lower.limit[row]);
                let least = (START_WIDTH * width).max(START_OVERSHOOT * overshoot);
                self.least[row] = least.max(f64::MIN_POSITIVE.sqrt());
            }
        }
        self.upper.start(&self.values, &self.least, centre, is_warm);
        self.lower.start(&self.values, &self.least, centre, is_warm);
    }

    /// `sum slack * multiplier`, the gap once the point is feasible.
    pub(super) fn gap(&self) -> f64 {
        self.upper.complementarity() + self.lower.complementarity()
    }

    /// Writes weights and gradients for the next solution.
    pub(super) fn weigh(&mut self, centre: f64, is_corrector: bool) {
        self.sigma.fill(0.0);
        self.pull.fill(0.0);
        for side in [&self.upper, &self.lower] {
            side.weigh(&self.values, &mut self.sigma, &mut self.pull, centre, is_corrector);
        }
    }

    /// Computes the steps to the solution; returns the step length that keeps every slack and
    /// multiplier positive, at most 1 with `margin` applied.
    pub(super) fn step(&mut self, centre: f64, is_corrector: bool, margin: f64) -> f64 {
        let upper = self.upper.step(&self.values, &self.steps, centre, is_corrector);
        let lower = self.lower.step(&self.values, &self.steps, centre, is_corrector);
        (margin / upper.max(lower)).min(1.0)
    }

    /// Returns the gap after a step of the given length.
    pub(super) fn gap_at(&self, length: f64) -> f64 {
        self.upper.complementarity_at(length) + self.lower.complementarity_at(length)
    }

    /// Takes a step of the given length with slacks and multipliers.
    pub(super) fn advance(&mut self, length: f64) {
        self.upper.advance(length);
        self.lower.advance(length);
    }
}
