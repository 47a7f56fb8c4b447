//! `TimeVarying`.

use ilc_rt::model::{StateSpace, TimeVarying};
use pyo3::prelude::*;

use crate::answer::{Array, give_matrices, give_signal};
use crate::argument::{Matrix, Signal, misfit, read_array, read_vector};
use crate::detached::computed;
use crate::error::OrRaise;
use crate::whole::Real;

/// Linear model whose matrices vary along the run.
///
/// ``x[k+1] = A[k] x[k] + B[k] u[k]``, ``y[k] = C[k] x[k] + D[k] u[k]``.
///
/// - a, b, c, d: a matrix for each sample, e.g. `a` of shape (n_samples, n_states, n_states).
/// - dt_s: sample time in seconds.
///
/// Raises ModelError if there are no samples or the sample time is not positive.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import TimeVarying
/// >>> one = np.ones((3, 1, 1))
/// >>> c = np.array([1.0, 2.0, 10.0]).reshape(3, 1, 1)
/// >>> TimeVarying(0.5 * one, one, c, 0 * one, 0.001).simulate(np.array([1.0, 0.0, 0.0]))
/// array([0., 2., 5.])
#[pyclass(name = "TimeVarying", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(crate) struct PyTimeVarying {
    pub(crate) model: TimeVarying,
    /// Sample time in seconds.
    #[pyo3(get)]
    dt_s: Option<f64>,
    /// Number of samples of the run.
    #[pyo3(get)]
    n_samples: usize,
    /// Number of states.
    #[pyo3(get)]
    n_states: usize,
    /// Number of inputs.
    #[pyo3(get)]
    n_inputs: usize,
    /// Number of outputs.
    #[pyo3(get)]
    n_outputs: usize,
}

impl From<TimeVarying> for PyTimeVarying {
    fn from(model: TimeVarying) -> Self {
        Self {
            dt_s: model.dt_s(),
            n_samples: model.n_samples(),
            n_states: model.n_states(),
            n_inputs: model.n_inputs(),
            n_outputs: model.n_outputs(),
            model,
        }
    }
}

impl PyTimeVarying {
    fn give<'py>(
        &self,
        py: Python<'py>,
        part: impl Fn(&StateSpace) -> &Matrix,
    ) -> Bound<'py, PyAny> {
        let (rows, cols) = part(self.model.at(0)).shape();
        let at = |k, row, col| part(self.model.at(k))[(row, col)];
        give_matrices(py, (self.n_samples, rows, cols), at)
    }
}

/// One matrix per sample.
fn read_matrices(name: &str, object: &Bound<'_, PyAny>) -> PyResult<(Vec<f64>, [usize; 3])> {
    let (values, shape) = read_array(name, object)?;
    match shape[..] {
        [n_samples, rows, cols] => Ok((values, [n_samples, rows, cols])),
        _ => Err(misfit(name, &shape, "three axes, (n_samples, rows, columns)")),
    }
}

#[pymethods]
impl PyTimeVarying {
    #[new]
    fn new(
        a: &Bound<'_, PyAny>,
        b: &Bound<'_, PyAny>,
        c: &Bound<'_, PyAny>,
        d: &Bound<'_, PyAny>,
        dt_s: Real,
    ) -> PyResult<Self> {
        let (a, b) = (read_matrices("a", a)?, read_matrices("b", b)?);
        let (c, d) = (read_matrices("c", c)?, read_matrices("d", d)?);
        let ([n_samples, n, _], [_, _, m], [_, p, _]) = (a.1, b.1, c.1);
        for (name, (_, shape), needed) in [
            ("a", &a, [n_samples, n, n]),
            ("b", &b, [n_samples, n, m]),
            ("c", &c, [n_samples, p, n]),
            ("d", &d, [n_samples, p, m]),
        ] {
            if *shape != needed {
                let [n_samples, rows, cols] = needed;
                return Err(misfit(name, shape, &format!("({n_samples}, {rows}, {cols})")));
            }
        }
        let at = |(values, [_, rows, cols]): &(Vec<f64>, [usize; 3]), k: usize| {
            let size = rows * cols;
            Matrix::from_row_slice(*rows, *cols, &values[k * size..(k + 1) * size])
        };
        let samples: Result<Vec<_>, _> = (0..n_samples)
            .map(|k| StateSpace::discrete(at(&a, k), at(&b, k), at(&c, k), at(&d, k), dt_s.0))
            .collect();
        TimeVarying::new(samples.or_raise()?).or_raise().map(Self::from)
    }

    /// Return the model of deviations from a trajectory of ``x[k+1] = f(x[k], u[k])``, ``y[k] = h(x[k], u[k])``.
    ///
    /// - f: function of a state (n_states,) and an input (n_inputs,) that returns the next state; with `h` None
    ///   the states are the outputs.
    /// - x, u: the trajectory, shapes (n_samples, n_states) and (n_samples, n_inputs) or (n_samples,).
    /// - jacobian: function of the same that returns A, B, C and D, in place of central differences.
    /// - step: step of the differences relative to the size of the value.
    ///
    /// Raises ValueError or TypeError, naming the sample, if a function returns another shape or a number that is not
    /// finite.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from ilc_rt import TimeVarying
    /// >>> def pendulum(x, u):
    /// ...     return np.array([x[0] + 0.01 * x[1], x[1] + 0.01 * (u[0] - 9.81 * np.sin(x[0]))])
    /// >>> rest = TimeVarying.linearize(pendulum, np.zeros((3, 2)), np.zeros(3), 0.01)
    /// >>> rest.a[0].round(6).tolist()
    /// [[1.0, 0.01], [-0.0981, 1.0]]
    #[staticmethod]
    #[pyo3(signature = (f, x, u, dt_s, h=None, jacobian=None, step=1e-6))]
    fn linearize<'py>(
        f: &Bound<'py, PyAny>,
        x: &Bound<'py, PyAny>,
        u: &Bound<'py, PyAny>,
        dt_s: &Bound<'py, PyAny>,
        h: Option<&Bound<'py, PyAny>>,
        jacobian: Option<&Bound<'py, PyAny>>,
        step: f64,
    ) -> Array<'py> {
        let linearization = f.py().import("ilc_rt.linearization")?;
        linearization.call_method1("linearize", (f, x, u, dt_s, h, jacobian, step))
    }

    /// Pickled and copied as its matrices.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, this) = (slf.py(), slf.get());
        let parts = (this.a(py), this.b(py), this.c(py), this.d(py), this.dt_s);
        Ok((slf.get_type().into_any(), parts.into_pyobject(py)?.into_any()))
    }

    /// State matrices, shape (n_samples, n_states, n_states).
    #[getter]
    fn a<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.give(py, StateSpace::a)
    }

    /// Input matrices, shape (n_samples, n_states, n_inputs).
    #[getter]
    fn b<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.give(py, StateSpace::b)
    }

    /// Output matrices, shape (n_samples, n_outputs, n_states).
    #[getter]
    fn c<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.give(py, StateSpace::c)
    }

    /// Feedthrough matrices, shape (n_samples, n_outputs, n_inputs).
    #[getter]
    fn d<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.give(py, StateSpace::d)
    }

    /// Return the output for an input of shape (n_samples,) or (n_samples, n_inputs).
    ///
    /// `x0` is the state at the first sample, shape (n_states,), zero if None. The output has the shape
    /// (n_samples, n_outputs), or (n_samples,) if `u` has no channel axis and there is one output.
    #[pyo3(signature = (u, x0=None))]
    fn simulate<'py>(&self, u: &Bound<'py, PyAny>, x0: Option<&Bound<'py, PyAny>>) -> Array<'py> {
        let py = u.py();
        let u = Signal::read("u", u)?
            .with_samples("u", self.n_samples)?
            .with_channels("u", self.n_inputs)?;
        let x0 = x0.map(|x0| read_vector("x0", x0)).transpose()?;
        let y = computed(py, || self.model.simulate(&u.values, x0.as_deref()))?;
        give_signal(py, y, self.n_outputs, u.is_flat && self.n_outputs == 1)
    }

    fn __repr__(&self) -> String {
        let Self { n_samples, n_states: n, n_inputs: m, n_outputs: p, .. } = self;
        let dt_s = self.dt_s.unwrap_or_default();
        format!(
            "TimeVarying(n_samples={n_samples}, n_states={n}, n_inputs={m}, n_outputs={p}, dt_s={dt_s})"
        )
    }
}
