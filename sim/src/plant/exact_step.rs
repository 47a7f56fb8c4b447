//! Exact steps of a carriage with a flexible mode: the solution of the linear motion under a
//! constant force.
//!
//! The carriage of mass `m_c` carries a mass `m_f` on a spring, with the stated frequency and
//! damping while the carriage is fixed: with deflection `q`, `m_c ẍ = F + k q + c q̇`,
//! `m_f (ẍ + q̈) = −k q − c q̇`, `k = m_f ω²`, `c = 2 ζ m_f ω`.

/// Position and velocity of the carriage, deflection of the mode and its rate.
pub(super) type State = [f64; 4];
/// Side of the augmented matrix: four states and the constant force.
const SIDE: usize = 5;
type Matrix = [[f64; SIDE]; SIDE];

/// Masses and mode of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mechanics {
    /// Moving mass without the mode's.
    pub carriage_kg: f64,
    /// Mass of the mode; 0 for none.
    pub mode_kg: f64,
    /// Natural angular frequency of the mode with the carriage locked.
    pub mode_rad_s: f64,
    /// Damping ratio of the mode with the carriage locked.
    pub mode_damping: f64,
}

/// `z⁺ = A z + B F` for a free carriage, and the deflection's part of it for a locked one.
#[derive(Clone, Copy, Debug)]
pub(super) struct ExactStep {
    pub(super) dt_s: f64,
    free: [[f64; 4]; 4],
    force: [f64; 4],
    locked: [[f64; 2]; 2],
    stiffness_n_m: f64,
    damping_n_s_m: f64,
}

impl ExactStep {
    pub(super) fn new(mechanics: &Mechanics, dt_s: f64) -> Self {
        let Mechanics { carriage_kg, mode_kg, mode_rad_s, mode_damping } = *mechanics;
        let stiffness = mode_kg * mode_rad_s * mode_rad_s;
        let damping = 2.0 * mode_damping * mode_kg * mode_rad_s;
        let (own_stiffness, own_damping) =
            (mode_rad_s * mode_rad_s, 2.0 * mode_damping * mode_rad_s);
        let mut rates: Matrix = [[0.0; SIDE]; SIDE];
        rates[0][1] = 1.0;
        rates[1] = [0.0, 0.0, stiffness / carriage_kg, damping / carriage_kg, 1.0 / carriage_kg];
        rates[2][3] = 1.0;
        rates[3] = rates[1].map(|acceleration| -acceleration);
        rates[3][2] -= own_stiffness;
        rates[3][3] -= own_damping;
        let free = exponential(&rates, dt_s);
        let mut fixed: Matrix = [[0.0; SIDE]; SIDE];
        fixed[2][3] = 1.0;
        (fixed[3][2], fixed[3][3]) = (-own_stiffness, -own_damping);
        let locked = exponential(&fixed, dt_s);
        Self {
            dt_s,
            free: std::array::from_fn(|row| std::array::from_fn(|column| free[row][column])),
            force: std::array::from_fn(|row| free[row][4]),
            locked: [[locked[2][2], locked[2][3]], [locked[3][2], locked[3][3]]],
            stiffness_n_m: stiffness,
            damping_n_s_m: damping,
        }
    }

    /// Returns the state after a step under a constant net force on the carriage.
    #[inline]
    pub(super) fn free(&self, z: &State, force_n: f64) -> State {
        let mut next = [0.0; 4];
        for (row, next) in next.iter_mut().enumerate() {
            let a = &self.free[row];
            *next =
                a[0] * z[0] + a[1] * z[1] + a[2] * z[2] + a[3] * z[3] + self.force[row] * force_n;
        }
        next
    }

    /// The state after a step with the carriage locked where it is.
    #[inline]
    pub(super) fn locked(&self, z: &State) -> State {
        let [[a, b], [c, d]] = self.locked;
        [z[0], 0.0, a * z[2] + b * z[3], c * z[2] + d * z[3]]
    }

    /// Returns the net force that brings the carriage to rest at the end of the step.
    #[inline]
    pub(super) fn stopping_force_n(&self, z: &State) -> f64 {
        -self.free(z, 0.0)[1] / self.force[1]
    }

    /// Returns the force of the mode on the carriage.
    #[inline]
    pub(super) fn mode_force_n(&self, z: &State) -> f64 {
        self.stiffness_n_m * z[2] + self.damping_n_s_m * z[3]
    }
}

/// Returns `e^{M t}` by scaling, a Taylor series and squaring.
fn exponential(rates: &Matrix, t_s: f64) -> Matrix {
    let largest = rates.iter().flatten().fold(0.0_f64, |max, value| max.max(value.abs()));
    let mut squarings = 0;
    let mut step_s = t_s;
    while largest * step_s.abs() > 0.05 && squarings < 60 {
        step_s *= 0.5;
        squarings += 1;
    }
    let mut sum = identity();
    let mut term = identity();
    for order in 1..=12 {
        term = product(&term, rates, step_s / f64::from(order));
        for (row, terms) in sum.iter_mut().zip(&term) {
            for (value, term) in row.iter_mut().zip(terms) {
                *value += term;
            }
        }
    }
    for _ in 0..squarings {
        sum = product(&sum, &sum, 1.0);
    }
    sum
}

fn identity() -> Matrix {
    let mut one = [[0.0; SIDE]; SIDE];
    for (place, row) in one.iter_mut().enumerate() {
        row[place] = 1.0;
    }
    one
}

fn product(left: &Matrix, right: &Matrix, scale: f64) -> Matrix {
    std::array::from_fn(|row| {
        std::array::from_fn(|column| {
            scale * (0..SIDE).map(|inner| left[row][inner] * right[inner][column]).sum::<f64>()
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const GANTRY: Mechanics =
        Mechanics { carriage_kg: 120.0, mode_kg: 30.0, mode_rad_s: 125.66, mode_damping: 0.1 };

    #[test]
    fn a_mass_alone_follows_newton_exactly() {
        let step = ExactStep::new(&Mechanics { mode_kg: 0.0, ..GANTRY }, 0.01);
        let next = step.free(&[1.0, 2.0, 0.0, 0.0], 60.0);
        assert!((next[0] - (1.0 + 0.02 + 0.5 * 0.5 * 1e-4)).abs() < 1e-15);
        assert!((next[1] - 2.005).abs() < 1e-15);
    }

    #[test]
    fn two_half_steps_are_one_step() {
        let (whole, half) = (ExactStep::new(&GANTRY, 0.01), ExactStep::new(&GANTRY, 0.005));
        let z = [0.1, 0.3, 1e-3, -0.2];
        let twice = half.free(&half.free(&z, 500.0), 500.0);
        for (a, b) in whole.free(&z, 500.0).iter().zip(twice) {
            assert!((a - b).abs() < 1e-13, "{a} {b}");
        }
    }

    #[test]
    fn momentum_is_kept_without_a_force() {
        let step = ExactStep::new(&GANTRY, 125e-6);
        let momentum = |z: &State| 150.0 * z[1] + 30.0 * z[3];
        let mut z = [0.0, 0.4, 2e-3, 0.1];
        let before = momentum(&z);
        for _ in 0..100_000 {
            z = step.free(&z, 0.0);
        }
        assert!((momentum(&z) / before - 1.0).abs() < 1e-9, "{}", momentum(&z) / before);
    }

    #[test]
    fn the_held_mode_decays_with_the_stated_frequency_and_damping() {
        let step = ExactStep::new(&GANTRY, 125e-6);
        let damped_rad_s = 125.66 * (1.0_f64 - 0.01).sqrt();
        let period = std::f64::consts::TAU / damped_rad_s;
        let mut z = [0.0, 0.0, 1e-3, -0.1 * 125.66 * 1e-3];
        for n in 1..=8000_u32 {
            z = step.locked(&z);
            let t = f64::from(n) * 125e-6;
            let expected = 1e-3 * (-0.1 * 125.66 * t).exp() * (damped_rad_s * t).cos();
            assert!((z[2] - expected).abs() < 1e-12, "at {t} s of period {period}");
        }
    }
}
