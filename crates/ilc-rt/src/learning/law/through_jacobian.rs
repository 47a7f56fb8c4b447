//! Learning in joint space from errors at the tool.

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::LawName;
use super::context::{
    BuildError, Example, LawCell, LawContext, LawParameters, check_core, violation,
};
use crate::schema::{Violation, field_order};

use crate::learning::error::{check, check_adjoint, check_learns_from_every_run};
use crate::learning::{Law, LearningError, Result};

/// Largest condition number of a Jacobian that is inverted.
const CONDITION_MAX: f64 = 1e6;

/// `[learning.through_jacobian]`: a law of the axes, fed with errors measured at the tool.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct ThroughJacobianParameters {
    /// The law of the axes, with the parameters of its own table.
    pub core: LawName,
    /// Motion of each coordinate of the tool (rows) per motion of each axis (columns), e.g.
    /// `[[1.0, 0.01], [0.0, 1.0]]`.
    pub jacobian: Vec<Vec<f64>>,
}

impl Default for ThroughJacobianParameters {
    fn default() -> Self {
        Self { core: LawName::NormOptimal, jacobian: Vec::new() }
    }
}

impl LawParameters for ThroughJacobianParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        check_core("[learning.through_jacobian] core", self.core, cell)
    }

    fn requires(&self, cell: &LawCell) -> Result<(), Violation> {
        let n_axes = cell.axes.len();
        if self.jacobian.len() == n_axes && self.jacobian.iter().all(|row| row.len() == n_axes) {
            return Ok(());
        }
        let allowed = format!("{n_axes} rows of {n_axes} numbers, as the cell has {n_axes} axes");
        Err(violation(
            "[learning.through_jacobian] jacobian",
            format!("{:?}", self.jacobian),
            allowed,
        ))
    }

    fn core(&self) -> Option<LawName> {
        Some(self.core)
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        self.requires(context.cell)?;
        let core = context.core(self.core)?;
        let n_axes = context.n_axes();
        let jacobian = DMatrix::from_fn(n_axes, n_axes, |i, j| self.jacobian[i][j]);
        Ok(Box::new(ThroughJacobian::new(core, &[jacobian])?))
    }

    fn examples(&self) -> &'static [Example] {
        &[Example {
            is_parallel: false,
            learning: "law = \"through_jacobian\"\n[learning.through_jacobian]\n\
                       jacobian = [[1.0, 1e-3], [0.0, 1.0]]\n[learning.norm_optimal]\nrate = 6.0",
            error_left: 0.1,
        }]
    }
}

/// Any law of the joints, fed with errors measured at the tool.
///
/// `e_joint[k] = J_k^+ e_tool[k]` (pseudo-inverse): to first order the joint motion that causes the
/// error, the smallest one if there are more joints than coordinates. The inner law has joints as
/// inputs and outputs.
///
/// One Jacobian serves runs of any length; one per sample serves runs of exactly that length.
/// Several mechanisms are block-diagonal in one matrix.
///
/// # Shapes
/// - `input`, `next`: `n_samples` x `n_joints`; `error`: `n_samples` x `n_coordinates`
/// # Units
/// - `error` in metres; the inner law's error in radians (or the unit of the joints)
/// # Real Time
/// Cold path. Allocates at creation, and in the first [`Law::update`] of a run of another length.
/// # Source
/// - \[barton2010\], Sect. 8.2: one matrix for the whole workspace; here also one per sample.
pub struct ThroughJacobian<L = Box<dyn Law>> {
    law: L,
    n_joints: usize,
    n_coordinates: usize,
    /// One pseudo-inverse for all samples, or one per sample; row-major.
    inverses: Vec<f64>,
    joint_error: Vec<f64>,
}

impl<L: Law> std::fmt::Debug for ThroughJacobian<L> {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.debug_struct("ThroughJacobian")
            .field("law", &self.law.describe())
            .finish_non_exhaustive()
    }
}

impl<L: Law> ThroughJacobian<L> {
    /// Wraps a law of the joints; `jacobians` holds one matrix for all samples, or one per sample.
    ///
    /// # Errors
    /// - [`LearningError::Empty`] without a matrix.
    /// - [`LearningError::Weight`] for matrices of different or empty shape.
    /// - [`LearningError::Parameter`] for a matrix that is singular or not finite.
    /// - [`LearningError::Measures`] for a law that makes runs which only measure.
    pub fn new(law: L, jacobians: &[DMatrix<f64>]) -> Result<Self> {
        check_learns_from_every_run("through_jacobian", &law)?;
        let found = jacobians.len();
        let Some(first) = jacobians.first() else {
            return Err(LearningError::Empty { what: "jacobian" });
        };
        let (n_coordinates, n_joints) = first.shape();
        let mut inverses = Vec::with_capacity(found * n_joints * n_coordinates);
        for (sample, jacobian) in jacobians.iter().enumerate() {
            let shape = jacobian.shape();
            if shape != (n_coordinates, n_joints) || jacobian.is_empty() {
                let reason = format!(
                    "a Jacobian of {} x {}; {n_coordinates} x {n_joints} as the first one has, and at \
                     least 1 x 1, is needed",
                    shape.0, shape.1
                );
                return Err(LearningError::Weight { what: "jacobian", sample, reason });
            }
            let inverse = pseudo_inverse(jacobian)?;
            inverses.extend(inverse.transpose().iter());
        }
        Ok(Self { law, n_joints, n_coordinates, inverses, joint_error: Vec::new() })
    }

    /// Returns the law of the joints.
    pub fn law(&self) -> &L {
        &self.law
    }

    /// Returns the law of the joints, mutably.
    pub fn law_mut(&mut self) -> &mut L {
        &mut self.law
    }

    /// Returns the numbers of joints and of tool coordinates.
    pub fn shape(&self) -> (usize, usize) {
        (self.n_joints, self.n_coordinates)
    }

    /// Returns the samples of a run: the number of matrices, or that of `input` if one serves all.
    fn n_samples(&self, input: &[f64]) -> usize {
        match self.inverses.len() / (self.n_joints * self.n_coordinates) {
            1 => (input.len() / self.n_joints).max(1),
            matrices => matrices,
        }
    }
}

fn pseudo_inverse(jacobian: &DMatrix<f64>) -> Result<DMatrix<f64>> {
    let refused = |value| LearningError::Parameter {
        what: "condition of the jacobian",
        value,
        allowed: "entries must be finite, and the largest singular value at most 1e6 times the smallest",
    };
    if jacobian.iter().any(|entry| !entry.is_finite()) {
        return Err(refused(f64::NAN));
    }
    let svd = jacobian.clone().svd(true, true);
    let (largest, smallest) = (svd.singular_values.max(), svd.singular_values.min());
    let condition = largest / smallest;
    if condition.is_nan() || condition > CONDITION_MAX {
        return Err(refused(condition));
    }
    svd.pseudo_inverse(0.0).map_err(|_| refused(condition))
}

impl<L: Law> Law for ThroughJacobian<L> {
    fn inner(&self) -> Option<&dyn Law> {
        Some(&self.law)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn Law> {
        Some(&mut self.law)
    }

    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        let (p, m) = (self.n_coordinates, self.n_joints);
        let n_samples = self.n_samples(input);
        check("input", input, n_samples, m)?;
        check("error", error, n_samples, p)?;
        self.joint_error.resize(n_samples * m, 0.0);
        let one_for_all = self.inverses.len() == m * p;
        for k in 0..n_samples {
            let at = if one_for_all { 0 } else { k * m * p };
            let at_tool = &error[k * p..(k + 1) * p];
            for joint in 0..m {
                let row = &self.inverses[at + joint * p..at + (joint + 1) * p];
                self.joint_error[k * m + joint] = row.iter().zip(at_tool).map(|(a, e)| a * e).sum();
            }
        }
        self.law.update(input, &self.joint_error, next)
    }

    fn apply_adjoint(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
    ) -> Result<bool> {
        let (p, m) = (self.n_coordinates, self.n_joints);
        let n_samples = self.n_samples(dual);
        check_adjoint(dual, to_input, to_error, n_samples, [m, p])?;
        self.joint_error.resize(n_samples * m, 0.0);
        if !self.law.apply_adjoint(dual, to_input, &mut self.joint_error)? {
            return Ok(false);
        }
        let one_for_all = self.inverses.len() == m * p;
        to_error.fill(0.0);
        for k in 0..n_samples {
            let at = if one_for_all { 0 } else { k * m * p };
            for joint in 0..m {
                let row = &self.inverses[at + joint * p..at + (joint + 1) * p];
                for (value, entry) in to_error[k * p..(k + 1) * p].iter_mut().zip(row) {
                    *value += entry * self.joint_error[k * m + joint];
                }
            }
        }
        Ok(true)
    }

    fn reset(&mut self) {
        self.law.reset();
    }

    fn describe(&self) -> String {
        format!(
            r#"{{"law":"through_jacobian","n_joints":{},"n_coordinates":{},"inner":{}}}"#,
            self.n_joints,
            self.n_coordinates,
            self.law.describe()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::Delta;
    use crate::learning::law::pd::{Pd, PdGains};
    use crate::learning::law::q_filter::QFilter;

    fn proportional(kp: f64, n_samples: usize, n_channels: usize) -> Box<dyn Law> {
        let gains = PdGains { kp, kd: 0.0, lead_samples: 0 };
        Box::new(Pd::new(gains, n_samples, n_channels, QFilter::None).unwrap())
    }

    #[test]
    fn hand_computed_with_one_matrix_and_with_one_a_sample() {
        let jacobian = DMatrix::from_row_slice(2, 2, &[2.0, 0.0, 0.0, 4.0]);
        let mut law =
            ThroughJacobian::new(proportional(1.0, 2, 2), std::slice::from_ref(&jacobian)).unwrap();
        let mut next = [0.0; 4];
        law.update(&[1.0; 4], &[2.0, 2.0, 4.0, 8.0], &mut next).unwrap();
        assert!(next.iter().zip([2.0, 1.5, 3.0, 3.0]).all(|(a, b)| (a - b).abs() < 1e-15));

        let changing = [jacobian.clone(), jacobian * 2.0];
        let mut law = ThroughJacobian::new(proportional(1.0, 2, 2), &changing).unwrap();
        law.update(&[1.0; 4], &[2.0, 2.0, 4.0, 8.0], &mut next).unwrap();
        assert!(next.iter().zip([2.0, 1.5, 2.0, 2.0]).all(|(a, b)| (a - b).abs() < 1e-15));
    }

    #[test]
    fn one_wrong_thing_at_a_time_is_refused() {
        let good = DMatrix::identity(3, 3);
        let make = |jacobians: &[DMatrix<f64>]| {
            ThroughJacobian::new(proportional(1.0, 5, 3), jacobians).unwrap_err().to_string()
        };
        assert!(make(&[]).contains("jacobian"));
        assert!(make(&[DMatrix::zeros(3, 3)]).contains("condition"));
        assert!(make(&[good.clone() * f64::NAN]).contains("finite"));
        let mut mixed = vec![good.clone(); 5];
        mixed[3] = DMatrix::identity(2, 3);
        assert!(make(&mixed).contains("sample 3"));
        let mut law =
            ThroughJacobian::new(proportional(1.0, 5, 3), std::slice::from_ref(&good)).unwrap();
        assert!(law.update(&[0.0; 15], &[0.0; 14], &mut [0.0; 15]).is_err());
        let mut law = ThroughJacobian::new(proportional(1.0, 5, 3), &vec![good; 4]).unwrap();
        let told = law.update(&[0.0; 15], &[0.0; 15], &mut [0.0; 15]).unwrap_err().to_string();
        assert!(told.contains("holds 15"), "{told}");
    }

    #[test]
    fn a_mechanism_learns_a_path_of_its_tool() {
        let delta = Delta::default();
        let n_samples = 50;
        let wanted: Vec<[f64; 3]> = (0..n_samples)
            .map(|k| {
                let angle = 0.12 * k as f64;
                [0.01 * angle.cos(), 0.01 * angle.sin(), 0.15 + 0.004 * angle.sin()]
            })
            .collect();
        let reference: Vec<[f64; 3]> =
            wanted.iter().map(|pose| delta.inverse(*pose).unwrap()).collect();
        let jacobians: Vec<DMatrix<f64>> = reference
            .iter()
            .map(|joints| DMatrix::from_row_slice(3, 3, &delta.jacobian(*joints).unwrap().concat()))
            .collect();
        let mut law = ThroughJacobian::new(proportional(0.8, n_samples, 3), &jacobians).unwrap();
        let mut input = vec![0.0; 3 * n_samples];
        let mut worst = Vec::new();
        for _ in 0..12 {
            // Joints that move 10 percent too little and 5 mrad off.
            let error: Vec<f64> = (0..n_samples)
                .flat_map(|k| {
                    let joints = std::array::from_fn(|joint| {
                        let set = reference[k][joint] + input[3 * k + joint];
                        reference[0][joint] + 0.9 * (set - reference[0][joint]) + 5e-3
                    });
                    let tool = delta.forward(joints).unwrap();
                    std::array::from_fn::<f64, 3, _>(|axis| wanted[k][axis] - tool[axis])
                })
                .collect();
            worst.push(error.iter().fold(0.0, |most: f64, e| most.max(e.abs())));
            let mut next = vec![0.0; input.len()];
            law.update(&input, &error, &mut next).unwrap();
            input = next;
        }
        assert!(worst[0] > 2e-4 && worst[11] < 1e-4 * worst[0], "{worst:?}");
    }
}
