//! Units of the axes of a record, and the comparison of like with like: lengths with lengths, angles with
//! angles.

/// Smallest range of a coordinate that counts as motion: below it is rounding.
const MOVES_M: f64 = 1e-9;

/// The kind of each axis: linear, in metres, or rotary, in radians.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AxisKinds {
    rotary: Vec<bool>,
}

impl AxisKinds {
    /// Derives the kinds from the units of the learned inputs; an axis without one is linear.
    pub fn new(input_units: &[String], n_axes: usize) -> Self {
        let unit = |axis: usize| input_units.get(axis).map_or("m", String::as_str);
        Self {
            rotary: (0..n_axes).map(|axis| matches!(unit(axis), "rad" | "rad/s" | "N m")).collect(),
        }
    }

    /// Returns the number of axes.
    pub fn n_axes(&self) -> usize {
        self.rotary.len()
    }

    /// Returns whether every axis is rotary.
    pub fn all_rotary(&self) -> bool {
        !self.rotary.is_empty() && self.rotary.iter().all(|rotary| *rotary)
    }

    /// Returns whether there are linear and rotary axes side by side.
    pub fn is_mixed(&self) -> bool {
        self.rotary.contains(&true) && self.rotary.contains(&false)
    }

    /// Returns the axes of this kind, in order.
    pub fn of_kind(&self, rotary: bool) -> Vec<usize> {
        (0..self.n_axes()).filter(|&axis| self.rotary[axis] == rotary).collect()
    }

    /// Returns the axes of a figure over several axes: the linear ones, or all of a cell with
    /// rotary ones only.
    pub fn comparable(&self) -> Vec<usize> {
        self.of_kind(self.all_rotary())
    }

    /// Returns true if a path has a contour: at least two linear axes move along it.
    ///
    /// If only one axis moves, the distance across the path is the position of the axes at rest,
    /// and the remaining distance is rounding, or over-travel at an end.
    ///
    /// # Shapes
    /// - `reference_m`: `n_samples * n_axes`, time first
    pub fn has_contour(&self, reference_m: &[f64]) -> bool {
        let moves = |axis: &usize| {
            let column = || reference_m.iter().skip(*axis).step_by(self.n_axes().max(1));
            let low = column().copied().fold(f64::INFINITY, f64::min);
            let high = column().copied().fold(f64::NEG_INFINITY, f64::max);
            high - low > MOVES_M
        };
        self.of_kind(false).iter().filter(|axis| moves(axis)).count() >= 2
    }

    /// Returns some axes of a signal, time first.
    pub fn columns(&self, signal: &[f64], axes: &[usize]) -> Vec<f64> {
        let rows = signal.chunks_exact(self.n_axes().max(1));
        rows.flat_map(|row| axes.iter().map(|&axis| row[axis])).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds(units: &[&str]) -> AxisKinds {
        let units: Vec<_> = units.iter().map(|unit| (*unit).to_owned()).collect();
        AxisKinds::new(&units, units.len())
    }

    #[test]
    fn lengths_are_put_with_lengths() {
        let mixed = kinds(&["m", "rad/s", "m/s"]);
        assert!(mixed.is_mixed() && !mixed.all_rotary());
        assert_eq!(mixed.comparable(), [0, 2]);
        assert_eq!(mixed.columns(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], &[0, 2]), [1.0, 3.0, 4.0, 6.0]);
        let turning = kinds(&["rad", "rad/s", "N m"]);
        assert_eq!(turning.comparable(), [0, 1, 2]);
        assert!(kinds(&["N", "N m"]).is_mixed());
        assert!(!kinds(&["m", "m"]).is_mixed());
    }

    #[test]
    fn a_contour_takes_two_linear_axes_that_move() {
        let diagonal = [0.0, 0.0, 0.01, 0.02];
        assert!(kinds(&["m", "m"]).has_contour(&diagonal));
        assert!(!kinds(&["rad", "rad"]).has_contour(&diagonal));
        assert!(!kinds(&["m", "rad"]).has_contour(&diagonal));
        assert!(!kinds(&["m"]).has_contour(&[0.0, 0.01]));
        // Rounding of a program in inches is not motion.
        assert!(!kinds(&["m", "m"]).has_contour(&[0.0, 0.0, 0.01, 3e-17]));
        let plane_and_turn = [0.0, 0.0, 0.0, 0.01, 0.02, 1.0];
        assert!(kinds(&["m", "m", "rad"]).has_contour(&plane_and_turn));
    }
}
