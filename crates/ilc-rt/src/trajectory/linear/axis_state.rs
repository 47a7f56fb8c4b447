//! State of one axis, and its motion under constant jerk.

/// State of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct AxisState {
    pub(super) p: f64,
    pub(super) v: f64,
    pub(super) a: f64,
    pub(super) j: f64,
}

impl AxisState {
    /// Returns the state after `t` under constant jerk.
    pub(super) fn after(self, t: f64, j: f64) -> Self {
        let Self { p, v, a, .. } = self;
        Self {
            p: p + t * (v + t * (0.5 * a + t * j / 6.0)),
            v: v + t * (a + 0.5 * t * j),
            a: a + t * j,
            j,
        }
    }
}
