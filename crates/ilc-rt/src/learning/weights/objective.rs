//! Objectives of several agents: own tracking, centre tracking, leader following, formation
//! keeping.

use nalgebra::DMatrix;

use super::{Formation, Gain, Weight};
use crate::learning::{LearningError, Result};

/// The objective of several agents; each term may vary along the run.
///
/// `Q = Sigma (X1 (B1 diag(Q_1, .., Q_p) + B2 K' Q_c K) + X2 F' F)`, `X2 = I - X1`
///
/// `Sigma`, `B1`, `B2` and `X1` hold one number per agent. The products as printed are symmetric,
/// and thus a weight, only if that number is the same for all agents coupled by a term. Otherwise a
/// symmetric form that contains the printed one as a special case is used: `G^1/2 K' Q_c K G^1/2`
/// for the centre, and for each row of `F` the geometric mean of the gains of its agents, so that a
/// formation error weighs equally on both, and an error common to all agents still costs nothing.
///
/// Each list holds one entry for all agents, or one per agent.
///
/// # Shapes
/// - `own`, `centre`: weights of the axes of one agent, (`n_axes`, `n_axes`)
/// # Source
/// - \[barton2010\], Eq. (6.1) to (6.9), (6.13).
#[derive(Debug, Clone, PartialEq)]
pub struct Objective {
    /// `Q_i`: weight of an agent's own error.
    pub own: Vec<Weight>,
    /// `Q_c`: weight of the error of the formation's centre.
    pub centre: Weight,
    /// `B1`: share of its own error in an agent's tracking, 0 to 1.
    pub own_share: Vec<Gain>,
    /// `B2`: share of the centre's error in an agent's tracking, 0 to 1.
    pub centre_share: Vec<Gain>,
    /// `X1`: share of tracking, 0 to 1; the remainder goes to the formation.
    pub tracking_share: Vec<Gain>,
    /// `Sigma`: overall weight, not negative.
    pub sigma: Vec<Gain>,
}

impl Objective {
    /// Returns the objective in which every agent tracks its own reference.
    pub fn individual() -> Self {
        Self {
            own: vec![Weight::Scalar(1.0)],
            centre: Weight::Scalar(1.0),
            own_share: vec![1.0.into()],
            centre_share: vec![0.0.into()],
            tracking_share: vec![1.0.into()],
            sigma: vec![1.0.into()],
        }
    }

    /// Returns the objective in which the formation's centre tracks its reference; the agents are
    /// free around it.
    pub fn centred() -> Self {
        Self { own_share: vec![0.0.into()], centre_share: vec![1.0.into()], ..Self::individual() }
    }

    /// Returns the objective in which only the leaders track their references. Several leaders are
    /// the neighbours of the others.
    ///
    /// # Errors
    /// - [`LearningError::Weight`] for a leader that is not one of the agents.
    pub fn led_by(n_agents: usize, leaders: &[usize]) -> Result<Self> {
        if let Some(leader) = leaders.iter().find(|leader| **leader >= n_agents) {
            let reason = format!("agent {leader}; there are {n_agents} from 0");
            return Err(LearningError::Weight { what: "leaders", sample: 0, reason });
        }
        let share = |agent: usize| Gain::from(f64::from(u8::from(leaders.contains(&agent))));
        Ok(Self { own_share: (0..n_agents).map(share).collect(), ..Self::individual() })
    }

    /// Returns the objective in which only the formation counts. Agents with equal references then
    /// learn nothing from tracking: an error common to all costs nothing.
    pub fn shape() -> Self {
        Self::individual().with_tracking_share(0.0)
    }

    /// Divides the weight between tracking (`share`) and formation (`1 - share`).
    #[must_use]
    pub fn with_tracking_share(self, share: impl Into<Gain>) -> Self {
        Self { tracking_share: vec![share.into()], ..self }
    }

    /// Returns true if the weight is the same at every sample.
    pub(super) fn is_constant(&self) -> bool {
        let weights = self.own.iter().chain([&self.centre]);
        let gains = [&self.own_share, &self.centre_share, &self.tracking_share, &self.sigma];
        weights.into_iter().all(Weight::is_constant)
            && gains.into_iter().flatten().all(Gain::is_constant)
    }

    /// Refuses terms out of range or of the wrong number.
    pub(super) fn check(&self, n_samples: usize, n_agents: usize, n_axes: usize) -> Result {
        let count = |what: &'static str, found: usize| {
            if found == 1 || found == n_agents {
                return Ok(());
            }
            let reason = format!("{found} given; 1 or {n_agents}, one for each agent, are needed");
            Err(LearningError::Weight { what, sample: 0, reason })
        };
        count("own", self.own.len())?;
        self.own.iter().try_for_each(|weight| weight.check("own", n_samples, n_axes))?;
        self.centre.check("centre", n_samples, n_axes)?;
        for (what, gains, highest) in [
            ("own_share", &self.own_share, 1.0),
            ("centre_share", &self.centre_share, 1.0),
            ("tracking_share", &self.tracking_share, 1.0),
            ("sigma", &self.sigma, f64::INFINITY),
        ] {
            count(what, gains.len())?;
            gains.iter().try_for_each(|gain| gain.check(what, n_samples, highest))?;
        }
        Ok(())
    }

    /// Returns the weight at sample `k`.
    pub(super) fn at(&self, k: usize, formation: &Formation) -> DMatrix<f64> {
        let (n_agents, n_axes) = (formation.n_agents(), formation.n_axes());
        let of = |gains: &[Gain], agent: usize| gains[agent.min(gains.len() - 1)].at(k);
        let per_agent = |gain: &dyn Fn(usize) -> f64| (0..n_agents).map(gain).collect::<Vec<_>>();
        let tracking = per_agent(&|i| of(&self.sigma, i) * of(&self.tracking_share, i));
        let shape = per_agent(&|i| of(&self.sigma, i) * (1.0 - of(&self.tracking_share, i)));

        let mut q = DMatrix::zeros(formation.n_channels(), formation.n_channels());
        for (agent, tracking) in tracking.iter().enumerate() {
            let own = self.own[agent.min(self.own.len() - 1)].at(k, n_axes);
            let scale = tracking * of(&self.own_share, agent);
            let corner = agent * n_axes;
            q.view_mut((corner, corner), (n_axes, n_axes)).copy_from(&(own * scale));
        }
        let mut centre = formation.centre().clone();
        for (col, mut column) in centre.column_iter_mut().enumerate() {
            let agent = col / n_axes;
            column *= (tracking[agent] * of(&self.centre_share, agent)).sqrt();
        }
        q += centre.transpose() * self.centre.at(k, n_axes) * &centre;
        for row in formation.shape().row_iter() {
            q += row.transpose() * row * shared(&row.iter().copied().collect::<Vec<_>>(), &shape);
        }
        q
    }
}

/// Geometric mean of the gains of the agents in one row of the formation errors.
fn shared(row: &[f64], gains: &[f64]) -> f64 {
    let n_axes = row.len() / gains.len();
    let taking_part: Vec<f64> = row
        .chunks(n_axes)
        .zip(gains)
        .filter(|(entries, _)| entries.iter().any(|entry| *entry != 0.0))
        .map(|(_, gain)| *gain)
        .collect();
    match &taking_part[..] {
        [] => 0.0,
        // Exact if all are equal, the usual case.
        [first, others @ ..] if others.iter().all(|gain| gain.total_cmp(first).is_eq()) => *first,
        all => all.iter().map(|gain| gain.powf(1.0 / all.len() as f64)).product(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;
    use proptest::prelude::*;

    fn cost(weight: &DMatrix<f64>, error: &[f64]) -> f64 {
        let e = DVector::from_row_slice(error);
        (e.transpose() * weight * &e)[0]
    }

    #[test]
    fn two_agents_on_a_line_by_hand() {
        let two = Formation::new(2, 1).unwrap();
        let weight = |objective: &Objective| two.weight(4, objective).unwrap().at(3, 2);
        let of = |entries: [f64; 4]| DMatrix::from_row_slice(2, 2, &entries);
        let near = |found: DMatrix<f64>, entries: [f64; 4]| {
            assert!((&found - of(entries)).amax() < 1e-15, "{found}");
        };
        near(weight(&Objective::individual()), [1.0, 0.0, 0.0, 1.0]);
        near(weight(&Objective::centred()), [0.25, 0.25, 0.25, 0.25]);
        near(weight(&Objective::led_by(2, &[1]).unwrap()), [0.0, 0.0, 0.0, 1.0]);
        near(weight(&Objective::shape()), [1.0, -1.0, -1.0, 1.0]);
        near(weight(&Objective::individual().with_tracking_share(0.75)), [1.0, -0.25, -0.25, 1.0]);
        // The leader tracks, the other keeps its distance.
        let led = Objective::led_by(2, &[0]).unwrap().with_tracking_share(0.5);
        near(weight(&led), [1.0, -0.5, -0.5, 0.5]);
        // An agent of weight 0 takes no part in the formation either.
        let alone = Objective { sigma: vec![4.0.into(), 0.0.into()], ..Objective::shape() };
        near(weight(&alone), [0.0; 4]);
        let uneven = Objective { sigma: vec![4.0.into(), 1.0.into()], ..Objective::shape() };
        near(weight(&uneven), [2.0, -2.0, -2.0, 2.0]);
    }

    #[test]
    fn the_objective_may_change_along_the_run() {
        let two = Formation::new(2, 1).unwrap();
        let objective = Objective::shape().with_tracking_share(vec![1.0, 0.5, 0.0]);
        let weight = two.weight(3, &objective).unwrap();
        assert!(!weight.is_constant());
        assert_eq!(weight.at(0, 2), DMatrix::identity(2, 2));
        assert_eq!(weight.at(2, 2), DMatrix::from_row_slice(2, 2, &[1.0, -1.0, -1.0, 1.0]));
    }

    #[test]
    fn one_wrong_thing_at_a_time_is_refused() {
        let three = Formation::new(3, 2).unwrap();
        let told = |objective: Objective| three.weight(4, &objective).unwrap_err().to_string();
        let good = Objective::individual;
        assert!(told(Objective { own: vec![Weight::Scalar(1.0); 2], ..good() }).contains("own"));
        let wide = Weight::Block(DMatrix::identity(3, 3));
        assert!(told(Objective { own: vec![wide.clone()], ..good() }).contains("3 x 3"));
        assert!(told(Objective { centre: wide, ..good() }).contains("centre"));
        let share = || vec![Gain::from(1.5)];
        assert!(told(Objective { own_share: share(), ..good() }).contains("own_share"));
        assert!(told(Objective { centre_share: share(), ..good() }).contains("centre_share"));
        assert!(told(good().with_tracking_share(-0.5)).contains("tracking_share"));
        assert!(told(Objective { sigma: vec![], ..good() }).contains("sigma"));
        assert!(told(good().with_tracking_share(vec![0.5; 5])).contains("5 samples"));
        let led = Objective::led_by(3, &[0, 3]).unwrap_err().to_string();
        assert!(led.contains("agent 3"), "{led}");
    }

    /// The equations as printed, in lifted order, entry by entry.
    fn printed(
        (n, p, d): (usize, usize, usize),
        formation: &Formation,
        own: &[DMatrix<f64>],
        centre: &DMatrix<f64>,
        gains: &[[f64; 4]],
    ) -> DMatrix<f64> {
        let all = n * p * d;
        let diagonal = |of: &dyn Fn(&[f64; 4]) -> f64| {
            DMatrix::from_fn(all, all, |i, j| if i == j { of(&gains[i / (p * d)]) } else { 0.0 })
        };
        let q = DMatrix::from_fn(all, all, |i, j| {
            let (agent, other) = ((i / d) % p, (j / d) % p);
            if i / (p * d) == j / (p * d) && agent == other {
                own[agent][(i % d, j % d)]
            } else {
                0.0
            }
        });
        let q_centre = DMatrix::from_fn(n * d, n * d, |i, j| {
            if i / d == j / d { centre[(i % d, j % d)] } else { 0.0 }
        });
        let kappa = DMatrix::from_fn(n * d, all, |i, j| {
            if i / d == j / (p * d) && i % d == j % d { 1.0 / p as f64 } else { 0.0 }
        });
        let rows = formation.shape().nrows();
        let f = DMatrix::from_fn(n * rows, all, |i, j| {
            if i / rows == j / (p * d) { formation.shape()[(i % rows, j % (p * d))] } else { 0.0 }
        });
        let tracked =
            diagonal(&|g| g[0]) * q + diagonal(&|g| g[1]) * kappa.transpose() * q_centre * kappa;
        diagonal(&|g| g[3])
            * (diagonal(&|g| g[2]) * tracked + diagonal(&|g| 1.0 - g[2]) * f.transpose() * f)
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        #[test]
        fn equal_gains_give_the_printed_product(
            (p, d, n) in (1..5_usize, 1..4_usize, 1..4_usize),
            entries in prop::collection::vec(-1.0..1.0_f64, 5 * 9),
            numbers in prop::collection::vec((0.0..1.0_f64, 0.0..1.0_f64, 0.0..1.0_f64, 0.0..5.0_f64), 3),
        ) {
            let square = |i: usize| {
                let half = DMatrix::from_row_slice(3, 3, &entries[9 * i..9 * i + 9]);
                let half = half.view((0, 0), (3, d)).into_owned();
                half.transpose() * half
            };
            let own: Vec<DMatrix<f64>> = (0..p).map(square).collect();
            let centre = square(4);
            let gains: Vec<[f64; 4]> =
                numbers[..n].iter().map(|(b1, b2, x1, s)| [*b1, *b2, *x1, *s]).collect();
            let column = |i: usize| vec![Gain::from(gains.iter().map(|g| g[i]).collect::<Vec<_>>())];
            let objective = Objective {
                own: own.iter().cloned().map(Weight::Block).collect(),
                centre: Weight::Block(centre.clone()),
                own_share: column(0),
                centre_share: column(1),
                tracking_share: column(2),
                sigma: column(3),
            };
            let formation = Formation::new(p, d).unwrap();
            let weight = formation.weight(n, &objective).unwrap();
            prop_assert!(weight.check("q", n, p * d).is_ok());
            let dense = printed((n, p, d), &formation, &own, &centre, &gains);
            let width = p * d;
            let found = DMatrix::from_fn(n * width, n * width, |i, j| {
                let block = weight.at(i / width, width);
                if i / width == j / width { block[(i % width, j % width)] } else { 0.0 }
            });
            prop_assert!((found - dense).amax() < 1e-10);
        }

        #[test]
        fn unequal_gains_give_a_weight_and_keep_the_formation_free(
            (p, d) in (2..5_usize, 1..4_usize),
            shares in prop::collection::vec(prop::array::uniform4(0.0..1.0_f64), 4),
            drift in prop::array::uniform3(-2.0..2.0_f64),
        ) {
            let of = |i: usize| -> Vec<Gain> {
                shares[..p].iter().map(|share| Gain::from(share[i])).collect()
            };
            let objective = Objective {
                own_share: of(0),
                centre_share: of(1),
                tracking_share: of(2),
                sigma: of(3),
                ..Objective::individual()
            };
            let formation = Formation::new(p, d).unwrap();
            let weight = formation.weight(2, &objective).unwrap();
            prop_assert!(weight.check("q", 2, p * d).is_ok());
            // An error common to all agents costs nothing if only the formation counts.
            let free = Objective { sigma: of(3), ..Objective::shape() };
            let weight = formation.weight(2, &free).unwrap().at(0, p * d);
            let error: Vec<f64> = (0..p * d).map(|i| drift[i % d]).collect();
            prop_assert!(cost(&weight, &error).abs() < 1e-10);
        }
    }
}
