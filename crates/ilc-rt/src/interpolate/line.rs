//! Straight line elements.

use super::MAX_AXES;

/// A straight line between two points with its unit direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub(crate) from_m: [f64; MAX_AXES],
    pub(crate) to_m: [f64; MAX_AXES],
    pub(crate) direction: [f64; MAX_AXES],
    pub(crate) length_m: f64,
}

impl Line {
    /// Creates a line. Unused axes are 0 in both points; a line of length 0 has the direction 0.
    pub(crate) fn new(from_m: [f64; MAX_AXES], to_m: [f64; MAX_AXES]) -> Self {
        let mut direction = [0.0; MAX_AXES];
        for (axis, share) in direction.iter_mut().enumerate() {
            *share = to_m[axis] - from_m[axis];
        }
        // Scaled by the largest component, so that the squares of tiny moves do not underflow.
        let largest = direction.iter().fold(0.0_f64, |most, share| most.max(share.abs()));
        if largest == 0.0 {
            return Self { from_m, to_m, direction, length_m: 0.0 };
        }
        let squares: f64 = direction.iter().map(|share| (share / largest).powi(2)).sum();
        let length_m = largest * squares.sqrt();
        for share in &mut direction {
            *share /= length_m;
        }
        Self { from_m, to_m, direction, length_m }
    }

    /// Returns the point at `s_m` from the start; exact at the end.
    pub(crate) fn point_m(&self, s_m: f64) -> [f64; MAX_AXES] {
        if s_m >= self.length_m {
            return self.to_m;
        }
        let mut point_m = self.from_m;
        for (coordinate, share) in point_m.iter_mut().zip(&self.direction) {
            *coordinate += share * s_m;
        }
        point_m
    }

    /// Returns the direction times `scale`.
    pub(crate) fn along(&self, scale: f64) -> [f64; MAX_AXES] {
        self.direction.map(|share| share * scale)
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact where exactness is promised")]
mod tests {
    use super::*;

    #[test]
    fn a_line_ends_exactly_and_survives_tiny_lengths() {
        let mut to_m = [0.0; MAX_AXES];
        (to_m[0], to_m[1]) = (3e-200, 4e-200);
        let line = Line::new([0.0; MAX_AXES], to_m);
        assert!((line.length_m / 5e-200 - 1.0).abs() < 1e-15);
        assert_eq!(line.point_m(line.length_m), to_m);
    }
}
