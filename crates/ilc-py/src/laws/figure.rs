//! Figures of a law that Python can read.

use ilc_rt::learning::Law;
use ilc_rt::learning::law::relevance::Relevance;
use pyo3::prelude::*;

use crate::answer::{Array, give_signal};

/// A figure of a law: the value of a property of its Python class.
pub(crate) enum Figure {
    Number(Option<f64>),
    Count(usize),
    Text(String),
    /// An input of the law, time first.
    Input(Option<Vec<f64>>),
}

impl Figure {
    /// Returns the figure to Python.
    pub(super) fn give(self, py: Python<'_>, n_inputs: usize, is_flat: bool) -> Array<'_> {
        Ok(match self {
            Self::Number(value) => value.into_pyobject(py)?,
            Self::Count(value) => value.into_pyobject(py)?.into_any(),
            Self::Text(value) => value.into_pyobject(py)?.into_any(),
            Self::Input(values) => {
                let give = |values| give_signal(py, values, n_inputs, is_flat && n_inputs == 1);
                values.map(give).transpose()?.into_pyobject(py)?
            }
        })
    }
}

/// A law as stored in Python's `Law`; most have only their update.
pub(crate) trait Readable: Law {
    /// Returns the figure of this name, if the law has it.
    fn figure(&self, name: &str) -> Option<Figure> {
        let _ = name;
        None
    }

    /// Returns true if the law calls an inner law, which may be written in Python.
    fn has_inner(&self) -> bool {
        self.inner().is_some()
    }

    /// Returns the number of values of input and error up to which an update takes so little time
    /// that other Python threads may wait for it: it then reads the arrays in place.
    fn in_place_max(&self) -> usize {
        8192
    }

    /// Returns the law with a memory of runs by their relevance, if it is one.
    fn relevance(&mut self) -> Option<&mut Relevance> {
        None
    }
}

/// Makes a law readable: its figures by name, each with its kind, and then other methods.
///
/// `readable! { Adjoint as law => gain: Number(law.gain()) }`
macro_rules! readable {
    ($($law:ty),+) => { $(impl $crate::laws::Readable for $law {})+ };
    ($law:ty as $it:ident => $($name:ident: $kind:ident($value:expr)),+; $($others:tt)*) => {
        impl $crate::laws::Readable for $law {
            fn figure(&self, name: &str) -> Option<$crate::laws::figure::Figure> {
                let $it = self;
                match name {
                    $(stringify!($name) => {
                        Some($crate::laws::figure::Figure::$kind($value.into()))
                    })+
                    _ => None,
                }
            }

            $($others)*
        }
    };
}
pub(super) use readable;
