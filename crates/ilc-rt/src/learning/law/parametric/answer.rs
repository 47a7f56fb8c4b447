//! Answer of a model to an input, and its adjoint, for time-invariant and time-varying models.

use nalgebra::{DVector, DVectorView, DVectorViewMut};

use crate::learning::law::norm_optimal::plant::OwnPlant;

/// `y = P u` and `v = P' e`, in linear time.
#[derive(Debug, Clone)]
pub(super) struct Answer {
    plant: OwnPlant,
    state: DVector<f64>,
    other: DVector<f64>,
}

impl Answer {
    pub(super) fn new(plant: OwnPlant) -> Self {
        let n = plant.borrow().at(0).n_states();
        Self { plant, state: DVector::zeros(n), other: DVector::zeros(n) }
    }

    /// Simulates from rest.
    pub(super) fn forward(&mut self, u: &[f64], y: &mut [f64]) {
        let Self { plant, state, other } = self;
        let plant = plant.borrow();
        let (m, p) = (plant.at(0).n_inputs(), plant.at(0).n_outputs());
        state.fill(0.0);
        for (k, (u, y)) in u.chunks_exact(m).zip(y.chunks_exact_mut(p)).enumerate() {
            let model = plant.at(k);
            let u = DVectorView::from_slice(u, m);
            let mut y = DVectorViewMut::from_slice(y, p);
            y.gemv(1.0, model.c(), state, 0.0);
            y.gemv(1.0, model.d(), &u, 1.0);
            other.gemv(1.0, model.a(), state, 0.0);
            other.gemv(1.0, model.b(), &u, 1.0);
            std::mem::swap(state, other);
        }
    }

    /// Simulates the adjoint model backward.
    pub(super) fn transposed(&mut self, e: &[f64], v: &mut [f64]) {
        let Self { plant, state, other } = self;
        let plant = plant.borrow();
        let (m, p) = (plant.at(0).n_inputs(), plant.at(0).n_outputs());
        state.fill(0.0);
        for (k, (e, v)) in e.chunks_exact(p).zip(v.chunks_exact_mut(m)).enumerate().rev() {
            let model = plant.at(k);
            let e = DVectorView::from_slice(e, p);
            let mut v = DVectorViewMut::from_slice(v, m);
            v.gemv_tr(1.0, model.b(), state, 0.0);
            v.gemv_tr(1.0, model.d(), &e, 1.0);
            other.gemv_tr(1.0, model.a(), state, 0.0);
            other.gemv_tr(1.0, model.c(), &e, 1.0);
            std::mem::swap(state, other);
        }
    }
}
