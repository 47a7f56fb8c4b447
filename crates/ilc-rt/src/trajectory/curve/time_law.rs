//! Time law along a curve: as fast as a speed limit over the distance allows, with limited
//! acceleration and jerk along the path, from rest to rest.
//!
//! One forward and one backward sweep turn the speed limit into a speed; traversed in ticks and
//! averaged twice over a window, its jerk is limited. Averages of the distance stay on the curve.

/// One tick: distance, speed, acceleration, and the jerk until the next tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Tick {
    pub(super) s: f64,
    pub(super) v: f64,
    pub(super) a: f64,
    pub(super) j: f64,
}

/// Speed limits at equal distances from 0 to the length.
pub(super) struct TimeLaw<'a> {
    pub(super) length_m: f64,
    pub(super) speed_m_s: &'a [f64],
    /// Acceleration limits at the same points.
    pub(super) acceleration_m_s2: &'a [f64],
    /// Length of each of the two averages in ticks.
    pub(super) window: usize,
    pub(super) dt_s: f64,
}

impl TimeLaw<'_> {
    fn step_m(&self) -> f64 {
        self.length_m / (self.speed_m_s.len() - 1) as f64
    }

    /// Returns the speed at each distance: never above the limit within the reach of the averages,
    /// with `v²` changing by at most `2 a ds`.
    fn swept(&self) -> Vec<f64> {
        let n = self.speed_m_s.len();
        let fastest = self.speed_m_s.iter().fold(0.0_f64, |most, v| most.max(*v));
        let reach_m = self.window as f64 * self.dt_s * fastest;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most the number of distances"
        )]
        let reach = ((reach_m / self.step_m()).ceil().min(n as f64)) as usize;
        let mut speed = sliding_minimum(self.speed_m_s, reach);
        let step_m = self.step_m();
        let gain = |i: usize| {
            let [a, b] = [i, i + 1].map(|at| self.acceleration_m_s2[at]);
            2.0 * a.min(b) * step_m
        };
        (speed[0], speed[n - 1]) = (0.0, 0.0);
        for i in 1..n {
            speed[i] = speed[i].min((speed[i - 1].powi(2) + gain(i - 1)).sqrt());
        }
        for i in (0..n - 1).rev() {
            speed[i] = speed[i].min((speed[i + 1].powi(2) + gain(i)).sqrt());
        }
        speed
    }

    /// Duration of the motion before it is averaged.
    pub(super) fn swept_s(&self) -> f64 {
        let step_m = self.step_m();
        self.swept().windows(2).map(|pair| 2.0 * step_m / (pair[0] + pair[1])).sum()
    }

    /// Returns the motion tick by tick; the last tick is at rest at the end.
    pub(super) fn ticks(&self) -> Vec<Tick> {
        let speed = self.walked();
        let m = self.window as f64;
        let h = self.dt_s;
        let n = speed.len() + 2 * self.window + 1;
        let at = |values: &[f64], k: usize, back: usize| {
            k.checked_sub(back).and_then(|i| values.get(i)).copied().unwrap_or(0.0)
        };
        // The first average of the stepwise speed is piecewise linear: exact at its corners.
        let mut once = vec![0.0; n + 1];
        for k in 1..=n {
            once[k] = once[k - 1] + (at(&speed, k, 1) - at(&speed, k, 1 + self.window)) / m;
        }
        let mut ticks = vec![Tick::default(); n + 1];
        for k in 1..=n {
            let edge = |k: usize| 0.5 * (at(&once, k, 0) + at(&once, k, 1));
            let gone = if k > self.window { edge(k - self.window) } else { 0.0 };
            ticks[k].v = ticks[k - 1].v + (edge(k) - gone) / m;
            ticks[k].a = (once[k] - at(&once, k, self.window)) / (m * h);
        }
        for k in 0..n {
            ticks[k].j = (ticks[k + 1].a - ticks[k].a) / h;
            let (now, next) = (ticks[k], ticks[k + 1]);
            let gained = 0.5 * h * (now.v + next.v) - h * h * (next.a - now.a) / 12.0;
            ticks[k + 1].s = now.s + gained;
        }
        // Accumulated rounding, as a factor of all.
        let factor = self.length_m / ticks[n].s;
        for tick in &mut ticks {
            tick.s = (tick.s * factor).clamp(0.0, self.length_m);
        }
        ticks[n] = Tick { s: self.length_m, ..Tick::default() };
        ticks
    }

    /// Returns the mean speed of each tick.
    fn walked(&self) -> Vec<f64> {
        let swept = self.swept();
        let step_m = self.step_m();
        let (mut k, mut t, mut last_m) = (1_usize, 0.0, 0.0);
        let mut speed = Vec::new();
        for (i, pair) in swept.windows(2).enumerate() {
            let lasts_s = 2.0 * step_m / (pair[0] + pair[1]);
            let acceleration = (pair[1] - pair[0]) / lasts_s;
            while k as f64 * self.dt_s <= t + lasts_s {
                let tau = k as f64 * self.dt_s - t;
                let now_m = i as f64 * step_m + tau * (pair[0] + 0.5 * acceleration * tau);
                speed.push(((now_m - last_m) / self.dt_s).max(0.0));
                last_m = now_m;
                k += 1;
            }
            t += lasts_s;
        }
        if self.length_m > last_m {
            speed.push((self.length_m - last_m) / self.dt_s);
        }
        speed
    }
}

/// Returns the smallest value within `reach` of each point.
fn sliding_minimum(values: &[f64], reach: usize) -> Vec<f64> {
    let mut best: std::collections::VecDeque<usize> = std::collections::VecDeque::new();
    let mut next = 0;
    (0..values.len())
        .map(|i| {
            while next < values.len() && next <= i + reach {
                while best.back().is_some_and(|&last| values[last] >= values[next]) {
                    best.pop_back();
                }
                best.push_back(next);
                next += 1;
            }
            while best.front().is_some_and(|&first| first + reach < i) {
                best.pop_front();
            }
            best.front().map_or(f64::INFINITY, |&first| values[first])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sliding_minimum_is_that_of_the_definition() {
        let values = [5.0, 3.0, 4.0, 8.0, 9.0, 1.0, 7.0, 6.0];
        for reach in 0..10 {
            for (i, found) in sliding_minimum(&values, reach).iter().enumerate() {
                let window = &values[i.saturating_sub(reach)..(i + reach + 1).min(values.len())];
                let wanted = window.iter().copied().fold(f64::INFINITY, f64::min);
                assert!((found - wanted).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn ticks_are_the_integral_of_each_other_and_end_at_rest() {
        let speed: Vec<f64> =
            (0..500).map(|i| if (200..240).contains(&i) { 0.02 } else { 0.1 }).collect();
        let law = TimeLaw {
            length_m: 0.2,
            speed_m_s: &speed,
            acceleration_m_s2: &[0.5; 500],
            window: 12,
            dt_s: 0.002,
        };
        let ticks = law.ticks();
        let (first, last) = (ticks[0], ticks[ticks.len() - 1]);
        assert!(first.v.abs() + first.a.abs() + first.s.abs() < 1e-15);
        assert!((last.s - 0.2).abs() < 1e-15 && last.v.abs() < 1e-15);
        for pair in ticks.windows(2) {
            let h = 0.002;
            let v = pair[0].v + h * pair[0].a + 0.5 * h * h * pair[0].j;
            let s =
                pair[0].s + h * pair[0].v + 0.5 * h * h * pair[0].a + h * h * h * pair[0].j / 6.0;
            assert!((v - pair[1].v).abs() < 1e-12 && (s - pair[1].s).abs() < 1e-11, "{pair:?}");
            assert!(pair[0].a.abs() <= 0.5 * (1.0 + 1e-9), "{pair:?}");
            assert!(pair[0].j.abs() <= 2.0 * 0.5 / (12.0 * h) * (1.0 + 1e-9), "{pair:?}");
            let place = pair[0].s / 0.2 * 499.0;
            let slow = (201.0..238.0).contains(&place);
            assert!(pair[0].v <= if slow { 0.02 } else { 0.1 } * (1.0 + 1e-9), "{pair:?}");
        }
    }
}
