//! One sample of the Riccati recursion, with sizes known at compile time.
//!
//! The delayed changes of the input in the state are selectors, so their rows and columns are never
//! multiplied; only `interior` imports this.

#![expect(clippy::needless_range_loop, reason = "matrices are written with their indices")]
#![expect(clippy::inline_always, reason = "one copy in each sweep, its matrices in registers")]

use super::gain::Gain;

/// `x+ = A x + B v`, `y = C x + D v`.
#[derive(Debug, Clone)]
pub(super) struct Plant<const N: usize, const M: usize, const P: usize> {
    pub(super) a: [[f64; N]; N],
    pub(super) b: [[f64; M]; N],
    pub(super) c: [[f64; N]; P],
    pub(super) d: [[f64; M]; P],
}

/// The weights of one sample: of `C x + D v`, of `v`, of `v - v_-` and of `v - 2 v_- + v_--`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Weighing<const M: usize, const P: usize> {
    pub(super) output: [[f64; P]; P],
    pub(super) change: [[f64; M]; M],
    pub(super) step: [f64; M],
    pub(super) bend: [f64; M],
}

/// The linear terms of one sample: of the output, of `v`, of `v - v_-` and of `v - 2 v_- + v_--`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pull<const M: usize, const P: usize> {
    pub(super) output: [f64; P],
    pub(super) change: [f64; M],
    pub(super) step: [f64; M],
    pub(super) bend: [f64; M],
}

impl<const M: usize, const P: usize> Pull<M, P> {
    pub(super) const NONE: Self =
        Self { output: [0.0; P], change: [0.0; M], step: [0.0; M], bend: [0.0; M] };
}

impl<const N: usize, const M: usize, const P: usize> Plant<N, M, P> {
    /// Delayed changes that a state of `ns` numbers holds: 0, 1 or 2.
    const fn delays(ns: usize) -> usize {
        (ns - N) / M
    }

    /// Replaces the cost-to-go by that of one sample earlier and writes the gain between.
    ///
    /// Joseph form, a sum of squares: weights of rows near their bound grow beyond 1e10, and a
    /// difference of such numbers would cancel all digits.
    #[inline(always)]
    pub(super) fn earlier<const NS: usize>(
        &self,
        weighing: &Weighing<M, P>,
        cost: &mut [[f64; NS]; NS],
        gain: &mut Gain<M, NS>,
    ) {
        self.answer(weighing, cost, gain);
        self.follow(weighing, cost, gain);
    }

    /// Writes the gain, given the cost-to-go of the next state.
    #[inline(always)]
    fn answer<const NS: usize>(
        &self,
        weighing: &Weighing<M, P>,
        cost: &[[f64; NS]; NS],
        gain: &mut Gain<M, NS>,
    ) {
        let Self { a, b, c, d } = self;
        let Weighing { output, change, step, bend } = weighing;
        let delays = Self::delays(NS);
        let (one, two) = (N, N + M);

        // `reach = B' Pi_xx + Pi_1x`, the cost of v on the next x.
        let mut reach = [[0.0; N]; M];
        for i in 0..M {
            if delays > 0 {
                for col in 0..N {
                    reach[i][col] = cost[one + i][col];
                }
            }
            for k in 0..N {
                for col in 0..N {
                    reach[i][col] += b[k][i] * cost[k][col];
                }
            }
        }
        // Weighted output rows.
        let (mut qc, mut qd) = ([[0.0; N]; P], [[0.0; M]; P]);
        for i in 0..P {
            for k in 0..P {
                for col in 0..N {
                    qc[i][col] += output[i][k] * c[k][col];
                }
                for col in 0..M {
                    qd[i][col] += output[i][k] * d[k][col];
                }
            }
        }
        let mut h = *change;
        let mut feedback = [[0.0; NS]; M];
        for i in 0..M {
            for k in 0..P {
                for col in 0..M {
                    h[i][col] += d[k][i] * qd[k][col];
                }
                for col in 0..N {
                    feedback[i][col] += d[k][i] * qc[k][col];
                }
            }
            for k in 0..N {
                for col in 0..M {
                    h[i][col] += reach[i][k] * b[k][col];
                }
                for col in 0..N {
                    feedback[i][col] += reach[i][k] * a[k][col];
                }
            }
            h[i][i] += step[i] + bend[i];
            if delays > 0 {
                for col in 0..M {
                    h[i][col] += cost[one + i][one + col];
                    for k in 0..N {
                        h[i][col] += b[k][i] * cost[k][one + col];
                    }
                }
                feedback[i][one + i] -= step[i] + 2.0 * bend[i];
            }
            if delays > 1 {
                for col in 0..M {
                    feedback[i][one + col] += cost[one + i][two + col];
                    for k in 0..N {
                        feedback[i][one + col] += b[k][i] * cost[k][two + col];
                    }
                }
                feedback[i][two + i] += bend[i];
            }
        }
        gain.factorise(&h);
        gain.solve(&mut feedback);
        gain.feedback = feedback;
    }

    /// Replaces the cost-to-go of the next state by that of this one, given the gain between.
    #[inline(always)]
    fn follow<const NS: usize>(
        &self,
        weighing: &Weighing<M, P>,
        cost: &mut [[f64; NS]; NS],
        gain: &Gain<M, NS>,
    ) {
        let Self { a, b, c, d } = self;
        let Weighing { output, change, step, bend } = weighing;
        let delays = Self::delays(NS);
        let (one, two) = (N, N + M);
        let feedback = &gain.feedback;

        // The next state as a function of this one: x+ by `moved`, v by `answer`, v_- directly.
        let mut moved = [[0.0; NS]; N];
        let mut answer = [[0.0; NS]; M];
        for i in 0..M {
            for col in 0..NS {
                answer[i][col] = -feedback[i][col];
            }
        }
        for i in 0..N {
            for col in 0..N {
                moved[i][col] = a[i][col];
            }
            for k in 0..M {
                for col in 0..NS {
                    moved[i][col] += b[i][k] * answer[k][col];
                }
            }
        }
        let mut sum = [[0.0; NS]; NS];
        // F' Pi F, one row of Pi F at a time.
        for i in 0..NS {
            let mut row = [0.0; NS];
            for k in 0..N {
                for col in 0..NS {
                    row[col] += cost[i][k] * moved[k][col];
                }
            }
            if delays > 0 {
                for k in 0..M {
                    for col in 0..NS {
                        row[col] += cost[i][one + k] * answer[k][col];
                    }
                }
            }
            if delays > 1 {
                for k in 0..M {
                    row[one + k] += cost[i][two + k];
                }
            }
            if i < N {
                add_upper(&mut sum, &moved[i], &row, 1.0);
            } else if i < N + M {
                add_upper(&mut sum, &answer[i - one], &row, 1.0);
            } else {
                for col in 0..NS {
                    sum[i - M][col] += row[col];
                }
            }
        }
        // The output rows: L' Q L with L = C - D K.
        let mut left = [[0.0; NS]; P];
        for i in 0..P {
            for col in 0..N {
                left[i][col] = c[i][col];
            }
            for k in 0..M {
                for col in 0..NS {
                    left[i][col] += d[i][k] * answer[k][col];
                }
            }
        }
        for i in 0..P {
            let mut row = [0.0; NS];
            for k in 0..P {
                for col in 0..NS {
                    row[col] += output[i][k] * left[k][col];
                }
            }
            add_upper(&mut sum, &left[i], &row, 1.0);
        }
        for i in 0..M {
            let mut row = [0.0; NS];
            for k in 0..M {
                for col in 0..NS {
                    row[col] += change[i][k] * answer[k][col];
                }
            }
            add_upper(&mut sum, &answer[i], &row, 1.0);
            if delays > 0 {
                let mut stepped = answer[i];
                stepped[one + i] -= 1.0;
                add_upper(&mut sum, &stepped, &stepped, step[i]);
            }
            if delays > 1 {
                let mut bent = answer[i];
                bent[one + i] -= 2.0;
                bent[two + i] += 1.0;
                add_upper(&mut sum, &bent, &bent, bend[i]);
            }
        }
        for row in 0..NS {
            for col in row..NS {
                cost[row][col] = sum[row][col];
                cost[col][row] = sum[row][col];
            }
        }
    }

    /// Replaces the gradient of the cost by that of one sample earlier; returns `kappa = H^-1 g`.
    #[inline(always)]
    pub(super) fn backward<const NS: usize>(
        &self,
        gain: &Gain<M, NS>,
        pull: &Pull<M, P>,
        slope: &mut [f64; NS],
    ) -> [f64; M] {
        let Self { a, b, c, d } = self;
        let delays = Self::delays(NS);
        let (one, two) = (N, N + M);
        let mut g = [[0.0; 1]; M];
        let mut earlier = [0.0; NS];
        for i in 0..M {
            let mut sum = pull.change[i] + pull.step[i] + pull.bend[i];
            for k in 0..P {
                sum += d[k][i] * pull.output[k];
            }
            for k in 0..N {
                sum += b[k][i] * slope[k];
            }
            if delays > 0 {
                sum += slope[one + i];
                earlier[one + i] = -pull.step[i] - 2.0 * pull.bend[i];
            }
            if delays > 1 {
                earlier[one + i] += slope[two + i];
                earlier[two + i] = pull.bend[i];
            }
            g[i][0] = sum;
        }
        for col in 0..N {
            let mut sum = 0.0;
            for k in 0..P {
                sum += c[k][col] * pull.output[k];
            }
            for k in 0..N {
                sum += a[k][col] * slope[k];
            }
            earlier[col] = sum;
        }
        for i in 0..M {
            for col in 0..NS {
                earlier[col] -= gain.feedback[i][col] * g[i][0];
            }
        }
        *slope = earlier;
        gain.solve(&mut g);
        std::array::from_fn(|i| g[i][0])
    }

    /// Returns the change at this sample, `v = kappa - K state`.
    #[inline(always)]
    pub(super) fn change<const NS: usize>(
        gain: &Gain<M, NS>,
        kappa: &[f64],
        state: &[f64; NS],
    ) -> [f64; M] {
        std::array::from_fn(|i| {
            let mut sum = kappa[i];
            for k in 0..NS {
                sum -= gain.feedback[i][k] * state[k];
            }
            sum
        })
    }

    /// Returns `C x + D v`.
    #[inline(always)]
    pub(super) fn output<const NS: usize>(&self, state: &[f64; NS], v: &[f64; M]) -> [f64; P] {
        std::array::from_fn(|i| {
            let mut sum = 0.0;
            for k in 0..N {
                sum += self.c[i][k] * state[k];
            }
            for k in 0..M {
                sum += self.d[i][k] * v[k];
            }
            sum
        })
    }

    /// Advances the state by one sample.
    #[inline(always)]
    pub(super) fn forward<const NS: usize>(&self, state: &mut [f64; NS], v: &[f64; M]) {
        let delays = Self::delays(NS);
        let mut next = [0.0; NS];
        for i in 0..N {
            for k in 0..N {
                next[i] += self.a[i][k] * state[k];
            }
            for k in 0..M {
                next[i] += self.b[i][k] * v[k];
            }
        }
        for i in 0..M {
            if delays > 0 {
                next[N + i] = v[i];
            }
            if delays > 1 {
                next[N + M + i] = state[N + i];
            }
        }
        *state = next;
    }
}

/// Adds `weight left' right` to the upper triangle.
#[inline(always)]
fn add_upper<const NS: usize>(
    sum: &mut [[f64; NS]; NS],
    left: &[f64; NS],
    right: &[f64; NS],
    weight: f64,
) {
    for row in 0..NS {
        let factor = weight * left[row];
        for col in row..NS {
            sum[row][col] += factor * right[col];
        }
    }
}
