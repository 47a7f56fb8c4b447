//! Models: `StateSpace`, `from_transfer_function`, `second_order`, `discretize`.

use ilc_rt::model::{self, Method, ModelError, StateSpace};
use pyo3::prelude::*;

use crate::answer::{Array, give_matrices, give_matrix, give_signal, give_vector};
use crate::argument::{Signal, read_matrix, read_vector};
use crate::arguments::Arguments;
use crate::detached::computed;
use crate::error::OrRaise;
use crate::model_argument::{read_model, read_sample_time};
use crate::whole::{number, whole};

/// Linear time-invariant model, in discrete or continuous time.
///
/// ``x[k+1] = A x[k] + B u[k]``, ``y[k] = C x[k] + D u[k]``.
///
/// - a, b, c, d: matrices of shape (n_states, n_states), (n_states, n_inputs), (n_outputs, n_states) and
///   (n_outputs, n_inputs).
/// - dt_s: sample time in seconds; None or 0 for a continuous-time model.
///
/// Every argument that is a model may also be one of scipy.signal or python-control. The methods raise
/// ModelError if models, sample times or signals are incompatible, a loop is not well posed, a continuous-time
/// model is to be simulated, or numbers overflow; ValueError or TypeError if an array has the wrong shape,
/// dtype or a number that is not finite.
///
/// ``G * H`` is G after H, ``G + H`` and ``G - H`` their sum and difference for the same input, ``-G``, ``2 * G`` and
/// ``G / 2`` scale, a matrix is a gain; ``G ** -1`` is the inverse, if D has one; ``G[i, j]`` leads from input j to
/// output i, also with slices and lists. ``print(G)`` shows matrices, poles in Hz and delays, as a notebook does.
///
/// Examples
/// --------
/// >>> from ilc_rt import StateSpace
/// >>> StateSpace([[0.5]], [[1.0]], [[2.0]], [[0.0]], 0.001).simulate([1.0, 0.0, 0.0])
/// array([0., 2., 1.])
#[pyclass(name = "StateSpace", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(crate) struct PyStateSpace {
    pub(crate) model: StateSpace,
    /// Sample time in seconds; None for a continuous-time model.
    #[pyo3(get)]
    dt_s: Option<f64>,
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

impl From<StateSpace> for PyStateSpace {
    fn from(model: StateSpace) -> Self {
        Self {
            dt_s: model.dt_s(),
            n_states: model.n_states(),
            n_inputs: model.n_inputs(),
            n_outputs: model.n_outputs(),
            model,
        }
    }
}

/// Returns a new model to Python.
fn give(model: Result<StateSpace, ModelError>) -> PyResult<PyStateSpace> {
    model.or_raise().map(PyStateSpace::from)
}

/// Calls a view of models, which are written in Python.
fn shown<'py>(model: &Bound<'py, PyStateSpace>, view: &str) -> Array<'py> {
    model.py().import("ilc_rt.model_views")?.call_method1(view, (model,))
}

/// Calls an operator of models, which are written in Python, over `_gain`, `_scaled`, `_sum` and `_select`.
fn operated<'py>(
    model: &Bound<'py, PyStateSpace>,
    operator: &str,
    other: &Bound<'py, PyAny>,
) -> Array<'py> {
    model.py().import("ilc_rt.model_algebra")?.call_method1(operator, (model, other))
}

#[pymethods]
impl PyStateSpace {
    #[new]
    #[pyo3(signature = (a, b, c, d, dt_s=None))]
    fn new(
        a: &Bound<'_, PyAny>,
        b: &Bound<'_, PyAny>,
        c: &Bound<'_, PyAny>,
        d: &Bound<'_, PyAny>,
        dt_s: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let dt_s = dt_s.map_or(Ok(None), |dt_s| read_sample_time("dt_s", dt_s))?;
        let (a, b) = (read_matrix("a", a)?, read_matrix("b", b)?);
        let (c, d) = (read_matrix("c", c)?, read_matrix("d", d)?);
        give(StateSpace::new(a, b, c, d, dt_s))
    }

    /// Pickled and copied as its matrices.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, this) = (slf.py(), slf.get());
        let parts = (this.a(py), this.b(py), this.c(py), this.d(py), this.dt_s);
        Ok((slf.get_type().into_any(), parts.into_pyobject(py)?.into_any()))
    }

    /// State matrix, shape (n_states, n_states).
    #[getter]
    fn a<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        give_matrix(py, self.model.a())
    }

    /// Input matrix, shape (n_states, n_inputs).
    #[getter]
    fn b<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        give_matrix(py, self.model.b())
    }

    /// Output matrix, shape (n_outputs, n_states).
    #[getter]
    fn c<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        give_matrix(py, self.model.c())
    }

    /// Feedthrough matrix, shape (n_outputs, n_inputs).
    #[getter]
    fn d<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        give_matrix(py, self.model.d())
    }

    /// Return the output for an input of shape (n_samples,) or (n_samples, n_inputs).
    ///
    /// `x0` is the state at the first sample, shape (n_states,), zero if None. The output has the shape
    /// (n_samples, n_outputs), or (n_samples,) if `u` has no channel axis and there is one output.
    #[pyo3(signature = (u, x0=None))]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        x0: Option<&Bound<'py, PyAny>>,
    ) -> Array<'py> {
        let u = Signal::read("u", u)?.with_channels("u", self.n_inputs)?;
        let x0 = x0.map(|x0| read_vector("x0", x0)).transpose()?;
        let y = computed(py, || self.model.simulate(&u.values, x0.as_deref()))?;
        give_signal(py, y, self.n_outputs, u.is_flat && self.n_outputs == 1)
    }

    /// Return the first `n` Markov parameters D, CB, CAB, ..., shape (n, n_outputs, n_inputs).
    fn markov<'py>(&self, py: Python<'py>, n: &Bound<'py, PyAny>) -> Array<'py> {
        let n = whole("n", n)?;
        let parameters = computed(py, || self.model.markov(n))?;
        let shape = (n, self.n_outputs, self.n_inputs);
        Ok(give_matrices(py, shape, |k, row, col| parameters[k][(row, col)]))
    }

    /// Return the lifted-system matrix of runs of `n` samples, shape (n * n_outputs, n * n_inputs).
    ///
    /// The block lower-triangular Toeplitz matrix of the Markov parameters, sample by sample.
    fn lifted<'py>(&self, py: Python<'py>, n: &Bound<'py, PyAny>) -> Array<'py> {
        let n = whole("n", n)?;
        let lifted = computed(py, || self.model.lifted(n))?;
        Ok(give_matrix(py, &lifted))
    }

    /// Return the poles, the eigenvalues of A, in no particular order.
    fn poles<'py>(&self, py: Python<'py>) -> Array<'py> {
        Ok(give_vector(py, self.model.poles().or_raise()?))
    }

    /// Return the closed loop with a controller K, P / (1 + P K), from set point to output.
    fn feedback(&self, controller: &Bound<'_, PyAny>) -> PyResult<Self> {
        give(self.model.feedback(&read_model("controller", controller)?))
    }

    /// Return the series connection with another model, y = next(self(u)).
    fn series(&self, next: &Bound<'_, PyAny>) -> PyResult<Self> {
        give(self.model.series(&read_model("next", next)?))
    }

    /// Return the parallel arrangement with another model: a block-diagonal model.
    fn append(&self, other: &Bound<'_, PyAny>) -> PyResult<Self> {
        give(self.model.append(&read_model("other", other)?))
    }

    /// Return the model with a dead time of `n_samples` at every input, e.g. of a bus.
    fn delayed(&self, n_samples: &Bound<'_, PyAny>) -> PyResult<Self> {
        give(self.model.delayed(whole("n_samples", n_samples)?))
    }

    /// Return the finite invariant zeros, in no particular order [emami1982].
    fn zeros<'py>(&self, py: Python<'py>) -> Array<'py> {
        let zeros = computed(py, || self.model.zeros())?;
        Ok(give_vector(py, zeros))
    }

    /// Return the static gain G(0) or G(z = 1), shape (n_outputs, n_inputs).
    fn dc_gain<'py>(&self, py: Python<'py>) -> Array<'py> {
        Ok(give_matrix(py, &self.model.dc_gain().or_raise()?))
    }

    /// Return C (q I - A)^-1 B + D at frequencies in rad/s, shape (n_frequencies, n_outputs, n_inputs).
    fn frequency_response<'py>(&self, py: Python<'py>, w_rad_s: &Bound<'py, PyAny>) -> Array<'py> {
        let w = read_vector("w_rad_s", w_rad_s)?;
        let response = computed(py, || self.model.frequency_response(&w))?;
        let shape = (w.len(), self.n_outputs, self.n_inputs);
        Ok(give_matrices(py, shape, |k, row, col| response[k][(row, col)]))
    }

    /// Return magnitude and unwrapped phase in rad of one channel at frequencies in rad/s.
    #[pyo3(signature = (w_rad_s, output=None, input=None), text_signature = "($self, w_rad_s, output=0, input=0)")]
    fn bode<'py>(
        &self,
        py: Python<'py>,
        w_rad_s: &Bound<'py, PyAny>,
        output: Option<&Bound<'py, PyAny>>,
        input: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let w = read_vector("w_rad_s", w_rad_s)?;
        let output = output.map_or(Ok(0), |output| whole("output", output))?;
        let input = input.map_or(Ok(0), |input| whole("input", input))?;
        let bode = computed(py, || self.model.bode(&w, output, input))?;
        Ok((give_vector(py, bode.magnitude), give_vector(py, bode.phase_rad)))
    }

    /// Return the sensitivity S = (I + P K)^-1, from set point to control error.
    fn sensitivity(&self, controller: &Bound<'_, PyAny>) -> PyResult<Self> {
        give(self.model.sensitivity(&read_model("controller", controller)?))
    }

    /// Return the complementary sensitivity T = P K (I + P K)^-1, from set point to output.
    fn complementary_sensitivity(&self, controller: &Bound<'_, PyAny>) -> PyResult<Self> {
        give(self.model.complementary_sensitivity(&read_model("controller", controller)?))
    }

    /// Return the process sensitivity P (I + K P)^-1, from an input added to the controller's
    /// output to the output.
    ///
    /// The plant of learning in the parallel structure.
    fn process_sensitivity(&self, controller: &Bound<'_, PyAny>) -> PyResult<Self> {
        give(self.model.process_sensitivity(&read_model("controller", controller)?))
    }

    /// Return the relative degree of each output: its first Markov parameter that is not zero, or None.
    fn relative_degrees(&self) -> PyResult<Vec<Option<usize>>> {
        model::relative_degrees(&self.model).or_raise()
    }

    /// Return the dead time in samples of each output (rows) from each input (columns), or None.
    fn delays(&self) -> PyResult<Vec<Vec<Option<usize>>>> {
        model::delays(&self.model).or_raise()
    }

    /// Return a minimal realisation: the controllable and observable states.
    fn minimal(&self) -> PyResult<Self> {
        give(self.model.minimal())
    }

    /// Return the model as an object of scipy.signal.
    ///
    /// Returns scipy.signal.StateSpace: Discrete if this model is.
    /// Raises ImportError if SciPy is not installed.
    fn to_scipy<'py>(slf: &Bound<'py, Self>) -> Array<'py> {
        shown(slf, "to_scipy")
    }

    /// Return the model as an object of python-control.
    ///
    /// Returns control.StateSpace: Discrete if this model is.
    /// Raises ImportError if python-control is not installed.
    fn to_control<'py>(slf: &Bound<'py, Self>) -> Array<'py> {
        shown(slf, "to_control")
    }

    /// Return natural frequencies in Hz and dampings of the poles, each of shape (n_states,), in the order of
    /// the frequencies.
    ///
    /// Of a discrete-time model, those of the continuous-time poles that it samples.
    fn natural_frequencies<'py>(slf: &Bound<'py, Self>) -> Array<'py> {
        shown(slf, "natural_frequencies")
    }

    /// Leaves products and sums with arrays to this class.
    #[classattr]
    fn __array_ufunc__() -> Option<bool> {
        None
    }

    /// Return a model of another library, or this class itself, as this class.
    #[staticmethod]
    fn _of(operand: &Bound<'_, PyAny>) -> PyResult<Self> {
        read_model("operand", operand).map(Self::from)
    }

    fn _gain(&self, gain: &Bound<'_, PyAny>) -> PyResult<Self> {
        give(StateSpace::static_gain(read_matrix("gain", gain)?, self.dt_s))
    }

    fn _scaled(&self, factor: &Bound<'_, PyAny>) -> PyResult<Self> {
        give(self.model.scaled(number("factor", factor)?))
    }

    fn _sum(&self, other: &Bound<'_, Self>) -> PyResult<Self> {
        give(self.model.sum(&other.get().model))
    }

    fn _inverse(&self) -> PyResult<Self> {
        give(self.model.inverse())
    }

    fn _select(&self, outputs: Vec<usize>, inputs: Vec<usize>) -> PyResult<Self> {
        give(self.model.select(&outputs, &inputs))
    }

    fn __neg__(&self) -> PyResult<Self> {
        give(self.model.scaled(-1.0))
    }

    fn __mul__<'py>(slf: &Bound<'py, Self>, other: &Bound<'py, PyAny>) -> Array<'py> {
        operated(slf, "product", other)
    }

    fn __rmul__<'py>(slf: &Bound<'py, Self>, other: &Bound<'py, PyAny>) -> Array<'py> {
        operated(slf, "product_after", other)
    }

    fn __truediv__<'py>(slf: &Bound<'py, Self>, other: &Bound<'py, PyAny>) -> Array<'py> {
        operated(slf, "quotient", other)
    }

    fn __add__<'py>(slf: &Bound<'py, Self>, other: &Bound<'py, PyAny>) -> Array<'py> {
        operated(slf, "sum_of", other)
    }

    fn __radd__<'py>(slf: &Bound<'py, Self>, other: &Bound<'py, PyAny>) -> Array<'py> {
        operated(slf, "sum_of", other)
    }

    fn __sub__<'py>(slf: &Bound<'py, Self>, other: &Bound<'py, PyAny>) -> Array<'py> {
        operated(slf, "difference", other)
    }

    fn __rsub__<'py>(slf: &Bound<'py, Self>, other: &Bound<'py, PyAny>) -> Array<'py> {
        operated(slf, "difference_from", other)
    }

    fn __getitem__<'py>(slf: &Bound<'py, Self>, other: &Bound<'py, PyAny>) -> Array<'py> {
        operated(slf, "channels", other)
    }

    fn __pow__<'py>(
        slf: &Bound<'py, Self>,
        exponent: &Bound<'py, PyAny>,
        _modulo: Option<&Bound<'py, PyAny>>,
    ) -> Array<'py> {
        operated(slf, "power", exponent)
    }

    fn __str__<'py>(slf: &Bound<'py, Self>) -> Array<'py> {
        shown(slf, "text")
    }

    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> Array<'py> {
        shown(slf, "page")
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| self.model == other.get().model)
    }

    fn __hash__(&self) -> u64 {
        let numbers = [self.model.a(), self.model.b(), self.model.c(), self.model.d()];
        let bits =
            numbers.into_iter().flat_map(|matrix| matrix.iter()).map(|x| (x + 0.0).to_bits());
        bits.fold(0, |hash: u64, bits| hash.rotate_left(5).wrapping_add(bits))
    }

    fn __repr__(&self) -> String {
        let Self { n_states: n, n_inputs: m, n_outputs: p, .. } = self;
        let dt_s = self.dt_s.map_or_else(|| "None".to_owned(), |dt_s| dt_s.to_string());
        format!("StateSpace(n_states={n}, n_inputs={m}, n_outputs={p}, dt_s={dt_s})")
    }
}

#[pyfunction]
pub(crate) fn from_transfer_function(a: Arguments<'_, '_>) -> PyResult<PyStateSpace> {
    let dt_s = a.maybe("dt_s", read_sample_time)?.flatten();
    let (num, den) = (a.vector("num")?, a.vector("den")?);
    give(model::from_transfer_function(&num, &den, dt_s))
}

#[pyfunction]
pub(crate) fn second_order(a: Arguments<'_, '_>) -> PyResult<PyStateSpace> {
    let (w0, damping) = (a.number("natural_frequency_rad_s")?, a.number("damping")?);
    give(model::second_order(w0, damping))
}

#[pyfunction]
pub(crate) fn discretize(a: Arguments<'_, '_>) -> PyResult<PyStateSpace> {
    let methods = [("zoh", Method::ZeroOrderHold), ("tustin", Method::Tustin)];
    let (model, dt_s) = (a.model("model")?, a.number("dt_s")?);
    let method = a.choice("method", &methods)?;
    give(model::discretize(&model, dt_s, method))
}
