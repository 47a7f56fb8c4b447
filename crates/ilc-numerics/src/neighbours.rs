//! Nearest points among many (k-d tree).

use std::fmt;
use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// Largest number of coordinates of a point.
pub const COORDINATES_MAX: usize = 8;

/// A tree over points; their numbers are those of their order.
pub trait Neighbours: Send + Sync + fmt::Debug {
    /// Returns the squared distance of the `n`-th nearest point, up to rounding.
    fn squared_distance(&self, at: &[f64], n: NonZero<usize>) -> f64;
    /// Visits all points within a squared distance, in any order.
    fn within(&self, at: &[f64], squared_distance: f64, visit: &mut dyn FnMut(usize));
}

/// Creates a tree over points of `n_coordinates` each, one after the other; `None` for none or more
/// than [`COORDINATES_MAX`] of them, or points that cannot be divided.
pub fn neighbours(points: &[f64], n_coordinates: usize) -> Option<Box<dyn Neighbours>> {
    match n_coordinates {
        1 => tree::<1>(points),
        2 => tree::<2>(points),
        3 => tree::<3>(points),
        4 => tree::<4>(points),
        5 => tree::<5>(points),
        6 => tree::<6>(points),
        7 => tree::<7>(points),
        COORDINATES_MAX => tree::<COORDINATES_MAX>(points),
        _ => None,
    }
}

fn tree<const K: usize>(points: &[f64]) -> Option<Box<dyn Neighbours>> {
    let tree = ImmutableKdTree::new_from_slice(points.as_chunks().0).ok()?;
    Some(Box::new(Tree::<K>(tree)))
}

struct Tree<const K: usize>(ImmutableKdTree<f64, K>);

impl<const K: usize> Neighbours for Tree<K> {
    fn squared_distance(&self, at: &[f64], n: NonZero<usize>) -> f64 {
        let Some(at) = at.first_chunk() else { return f64::NAN };
        self.0
            .query(at)
            .nearest_n::<SquaredEuclidean<f64>>(n)
            .execute()
            .iter()
            .fold(0.0, |most, near| f64::max(most, near.distance))
    }

    fn within(&self, at: &[f64], squared_distance: f64, visit: &mut dyn FnMut(usize)) {
        let Some(at) = at.first_chunk() else { return };
        self.0
            .query(at)
            .within::<SquaredEuclidean<f64>>(squared_distance)
            .unsorted()
            .visit(|near| visit(near.item as usize));
    }
}

impl<const K: usize> fmt::Debug for Tree<K> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "tree of points of {K} coordinates")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_found_by_their_numbers_for_every_number_of_coordinates() {
        for n_coordinates in 1..=8 {
            let points: Vec<f64> =
                (0..100).flat_map(|point| vec![f64::from(point); n_coordinates]).collect();
            let tree = neighbours(&points, n_coordinates).unwrap();
            let at = vec![40.25; n_coordinates];
            let (third, n) = (tree.squared_distance(&at, NonZero::new(3).unwrap()), n_coordinates);
            assert!((third - 1.25 * 1.25 * n as f64).abs() < 1e-12);
            let mut found = Vec::new();
            tree.within(&at, third + 1e-9, &mut |point| found.push(point));
            found.sort_unstable();
            assert_eq!(found, [39, 40, 41]);
        }
        assert!(neighbours(&[0.0; 9], 9).is_none() && neighbours(&[0.0; 9], 0).is_none());
    }
}
