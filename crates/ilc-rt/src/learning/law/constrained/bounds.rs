//! Bounds as given by the user, and their errors.

use thiserror::Error;

use super::solver::{Band, Bands, Places};
use crate::learning::{LearningError, Result};

/// One side of a bound: the same for every channel and sample, or for each; infinite where there is
/// none.
#[derive(Debug, Clone, PartialEq)]
pub enum Limit {
    /// The same number everywhere.
    Scalar(f64),
    /// One number per sample, the same for every channel.
    PerSample(Vec<f64>),
    /// One number per channel, the same at every sample.
    PerChannel(Vec<f64>),
    /// One number for each sample and channel, time first.
    Full(Vec<f64>),
}

/// Lower and upper limit of a quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct Bound {
    /// Lower limit.
    pub lower: Limit,
    /// Upper limit.
    pub upper: Limit,
}

/// The bounds of the next run.
///
/// Before the run the input is 0 and the set point is the reference's first value: so the first
/// sample's step is the input itself, and the first two accelerations start from rest. If a run
/// begins otherwise, make the bounds of those samples infinite.
///
/// # Units
/// - those of the input (for the set-point: of the reference, which must be the same), per second
///   and per second squared for velocity and acceleration; `output` in those of the output
/// # Source
/// - \[haas2016\], section 4: constraints on set points, proposed as future work.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Bounds {
    /// Of the next input `u'`.
    pub input: Option<Bound>,
    /// Of the change of the input from run to run, `u' - u`.
    pub change: Option<Bound>,
    /// Of the change of the input from sample to sample, `u'[k] - u'[k-1]`.
    pub step: Option<Bound>,
    /// Of the set point `r + u'`.
    pub position: Option<Bound>,
    /// Of its first difference over the sample time.
    pub velocity: Option<Bound>,
    /// Of its second difference over the square of the sample time.
    pub acceleration: Option<Bound>,
    /// Of the predicted output `r - z`. Samples before the input's first effect cannot be changed.
    pub output: Option<Bound>,
    /// The reference `r` of each input, `n_samples` x `n_inputs`: required for bounds of the set
    /// point.
    pub reference: Option<Vec<f64>>,
    /// The reference of each output, `n_samples` x `n_outputs`, if it differs from `reference`: one
    /// of them is required for bounds of the output.
    pub output_reference: Option<Vec<f64>>,
}

/// Refused bounds, or bounds that cannot be honoured in a run.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum BoundsError {
    /// An invalid limit.
    #[error(
        "the {side} {what} bound is {value} at sample {sample}, channel {channel}; a finite number, \
         or infinity away from the other side, is needed"
    )]
    NoLimit {
        /// Name of the bound.
        what: &'static str,
        /// Its side.
        side: &'static str,
        /// Index.
        sample: usize,
        /// Index.
        channel: usize,
        /// Value found.
        value: f64,
    },
    /// A lower limit above the upper one.
    #[error(
        "the lower {what} bound {lower} lies above the upper one {upper} at sample {sample}, channel \
         {channel}"
    )]
    Crossed {
        /// Name of the bound.
        what: &'static str,
        /// Index.
        sample: usize,
        /// Index.
        channel: usize,
        /// The lower limit.
        lower: f64,
        /// The upper limit.
        upper: f64,
    },
    /// Two contradictory bounds.
    #[error(
        "{first} and {second} bounds leave no value for the input at sample {sample}, channel \
         {channel}: at least {lower} and at most {upper}"
    )]
    Disjoint {
        /// First bound.
        first: &'static str,
        /// Second bound.
        second: &'static str,
        /// Index.
        sample: usize,
        /// Index.
        channel: usize,
        /// Least that they require of the input (for the rates: of its step).
        lower: f64,
        /// Largest value that they allow.
        upper: f64,
    },
    /// Bounds of the value that the bounds of the steps make unreachable.
    #[error(
        "the input must lie in [{least}, {most}] at sample {sample}, channel {channel}, but from 0 \
         before the run its steps reach only [{lowest}, {highest}]"
    )]
    OutOfReach {
        /// Index.
        sample: usize,
        /// Index.
        channel: usize,
        /// Smallest reachable value.
        lowest: f64,
        /// Largest reachable value.
        highest: f64,
        /// Smallest allowed value.
        least: f64,
        /// Largest allowed value.
        most: f64,
    },
    /// A missing reference for a bound that needs one.
    #[error("a {what} bound needs the reference")]
    NoReference {
        /// Name of the bound.
        what: &'static str,
    },
}

/// Samples, channels and sample time that bounds refer to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extent {
    pub(super) n_samples: usize,
    pub(super) n_inputs: usize,
    pub(super) n_outputs: usize,
    pub(super) dt_s: f64,
}

impl Limit {
    fn at(&self, sample: usize, channel: usize, n_channels: usize) -> f64 {
        match self {
            Self::Scalar(value) => *value,
            Self::PerSample(values) => values[sample],
            Self::PerChannel(values) => values[channel],
            Self::Full(values) => values[sample * n_channels + channel],
        }
    }

    fn fits(&self, what: &'static str, n_samples: usize, n_channels: usize) -> Result {
        let (found, needed) = match self {
            Self::Scalar(_) => return Ok(()),
            Self::PerSample(values) => (values.len(), (n_samples, 1)),
            Self::PerChannel(values) => (values.len(), (1, n_channels)),
            Self::Full(values) => (values.len(), (n_samples, n_channels)),
        };
        let (n_samples, n_channels) = needed;
        if found == n_samples * n_channels {
            return Ok(());
        }
        Err(LearningError::Length { what, found, n_samples, n_channels })
    }

    /// JSON has no infinity: a missing limit is `null`, and varying limits are only counted.
    fn describe(&self) -> String {
        match self {
            Self::Scalar(value) if value.is_finite() => format!("{value}"),
            Self::Scalar(_) => "null".to_owned(),
            Self::PerChannel(values) => {
                let parts: Vec<String> =
                    values.iter().map(|value| Self::Scalar(*value).describe()).collect();
                format!("[{}]", parts.join(","))
            }
            Self::PerSample(_) => r#""per sample""#.to_owned(),
            Self::Full(_) => r#""per sample and channel""#.to_owned(),
        }
    }
}

impl Bound {
    /// Creates the same limits for every channel and sample.
    pub fn within(lower: f64, upper: f64) -> Self {
        Self { lower: Limit::Scalar(lower), upper: Limit::Scalar(upper) }
    }

    fn at(&self, sample: usize, channel: usize, n_channels: usize) -> (f64, f64) {
        (self.lower.at(sample, channel, n_channels), self.upper.at(sample, channel, n_channels))
    }

    fn check(&self, what: &'static str, n_samples: usize, n_channels: usize) -> Result {
        self.lower.fits(what, n_samples, n_channels)?;
        self.upper.fits(what, n_samples, n_channels)?;
        for sample in 0..n_samples {
            for channel in 0..n_channels {
                let (lower, upper) = self.at(sample, channel, n_channels);
                let no_limit = |side: &'static str, value: f64| {
                    Err(BoundsError::NoLimit { what, side, sample, channel, value }.into())
                };
                if lower.is_nan() || lower == f64::INFINITY {
                    return no_limit("lower", lower);
                }
                if upper.is_nan() || upper == f64::NEG_INFINITY {
                    return no_limit("upper", upper);
                }
                if lower > upper {
                    return Err(BoundsError::Crossed { what, sample, channel, lower, upper }.into());
                }
            }
        }
        Ok(())
    }
}

/// Returns the larger magnitude of two limits, considering finite ones only.
fn magnitude(lower: f64, upper: f64) -> f64 {
    let finite = |value: f64| if value.is_finite() { value.abs() } else { 0.0 };
    finite(lower).max(finite(upper))
}

impl Bounds {
    /// Refuses bounds of the wrong shape, or with crossed sides.
    pub(super) fn check(&self, extent: Extent) -> Result {
        let Extent { n_samples, n_inputs, n_outputs, .. } = extent;
        for (what, bound, n_channels) in self.named(extent) {
            if let Some(bound) = bound {
                bound.check(what, n_samples, n_channels)?;
            }
        }
        for (what, signal, n_channels) in [
            ("reference", &self.reference, n_inputs),
            ("output_reference", &self.output_reference, n_outputs),
        ] {
            if let Some(signal) = signal {
                crate::learning::error::check(what, signal, n_samples, n_channels)?;
            }
        }
        for (what, bound) in [
            ("position", &self.position),
            ("velocity", &self.velocity),
            ("acceleration", &self.acceleration),
        ] {
            if bound.is_some() && self.reference.is_none() {
                return Err(BoundsError::NoReference { what }.into());
            }
        }
        if self.output.is_some() && self.target(extent).is_none() {
            return Err(BoundsError::NoReference { what: "output" }.into());
        }
        Ok(())
    }

    fn named(&self, extent: Extent) -> [(&'static str, Option<&Bound>, usize); 7] {
        let Extent { n_inputs, n_outputs, .. } = extent;
        [
            ("input", self.input.as_ref(), n_inputs),
            ("change", self.change.as_ref(), n_inputs),
            ("step", self.step.as_ref(), n_inputs),
            ("position", self.position.as_ref(), n_inputs),
            ("velocity", self.velocity.as_ref(), n_inputs),
            ("acceleration", self.acceleration.as_ref(), n_inputs),
            ("output", self.output.as_ref(), n_outputs),
        ]
    }

    fn target(&self, extent: Extent) -> Option<&Vec<f64>> {
        let same = self.reference.as_ref().filter(|_| extent.n_inputs == extent.n_outputs);
        self.output_reference.as_ref().or(same)
    }

    /// Returns the bounds of one group of axes, `m` and `p` numbers wide.
    pub(super) fn bands(
        &self,
        extent: Extent,
        places: &Places,
        (m, p): (usize, usize),
    ) -> Result<Bands, BoundsError> {
        let Extent { n_samples, n_inputs, n_outputs, dt_s } = extent;
        let rest = |sample: usize, back: usize, channel: usize| {
            let held = self.reference.as_ref();
            held.map_or(0.0, |r| r[sample.saturating_sub(back) * n_inputs + channel])
        };
        let values = |k: usize, channel: usize| rest(k, 0, channel);
        let steps = |k: usize, channel: usize| rest(k, 0, channel) - rest(k, 1, channel);
        let bends = |k: usize, channel: usize| {
            steps(k, channel) - (rest(k, 1, channel) - rest(k, 2, channel))
        };
        let band = |first: (&'static str, Option<&Bound>),
                    second: (&'static str, Option<&Bound>),
                    scale: f64,
                    offset: &dyn Fn(usize, usize) -> f64|
         -> Result<Option<Band>, BoundsError> {
            if first.1.is_none() && second.1.is_none() {
                return Ok(None);
            }
            let mut band = Band::open(n_samples * m);
            for sample in 0..n_samples {
                for (i, channel) in places.inputs.iter().copied().enumerate() {
                    let place = sample * m + i;
                    if let Some(bound) = first.1 {
                        let (lower, upper) = bound.at(sample, channel, n_inputs);
                        band.narrow(place, lower, upper, magnitude(lower, upper));
                    }
                    if let Some(bound) = second.1 {
                        let (lower, upper) = bound.at(sample, channel, n_inputs);
                        let (lower, upper) = (lower * scale, upper * scale);
                        let size = magnitude(lower, upper);
                        let offset = offset(sample, channel);
                        band.narrow(place, lower - offset, upper - offset, size);
                    }
                    let (lower, upper) = band.at(place);
                    if lower > upper {
                        let (first, second) = (first.0, second.0);
                        return Err(BoundsError::Disjoint {
                            first,
                            second,
                            sample,
                            channel,
                            lower,
                            upper,
                        });
                    }
                }
            }
            Ok(Some(band))
        };
        let none = ("", None);
        let zero = |_: usize, _: usize| 0.0;
        let input = band(
            ("input", self.input.as_ref()),
            ("position", self.position.as_ref()),
            1.0,
            &values,
        )?;
        let change = band(("change", self.change.as_ref()), none, 1.0, &zero)?;
        let step =
            band(("step", self.step.as_ref()), ("velocity", self.velocity.as_ref()), dt_s, &steps)?;
        let bend = band(none, ("acceleration", self.acceleration.as_ref()), dt_s * dt_s, &bends)?;
        let output = match (&self.output, self.target(extent)) {
            (Some(bound), Some(target)) => {
                let mut band = Band::open(n_samples * p);
                for (i, channel) in places.outputs.iter().copied().enumerate() {
                    for sample in places.shifts[i]..n_samples {
                        let (lower, upper) = bound.at(sample, channel, n_outputs);
                        let offset = target[sample * n_outputs + channel];
                        let place = (sample - places.shifts[i]) * p + i;
                        let size = magnitude(lower, upper);
                        band.narrow(place, lower - offset, upper - offset, size);
                    }
                }
                Some(band)
            }
            _ => None,
        };
        Ok(Bands { n_samples, input, change, step, bend, output })
    }

    /// Returns the bounds as members of a JSON object.
    pub(super) fn describe(&self, extent: Extent) -> String {
        let parts: Vec<String> = self
            .named(extent)
            .into_iter()
            .filter_map(|(what, bound, _)| bound.map(|bound| (what, bound)))
            .map(|(what, bound)| {
                format!(r#""{what}":[{},{}]"#, bound.lower.describe(), bound.upper.describe())
            })
            .collect();
        format!("{{{}}}", parts.join(","))
    }
}
