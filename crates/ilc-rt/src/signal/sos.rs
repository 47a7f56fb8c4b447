//! Cascade of second-order sections (biquads), run sample by sample.
#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

/// One second-order section (biquad).
///
/// `H(z) = (b0 + b1 z^-1 + b2 z^-2) / (1 + a1 z^-1 + a2 z^-2)`
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// Numerator: `b0`, `b1`, `b2`.
    pub b: [f64; 3],
    /// Denominator after its leading 1: `a1`, `a2`.
    pub a: [f64; 2],
}

impl Section {
    /// Returns the gain at frequency zero.
    pub fn static_gain(&self) -> f64 {
        (self.b[0] + self.b[1] + self.b[2]) / (1.0 + self.a[0] + self.a[1])
    }

    /// Returns the state after a constant input of 1, in steady state.
    ///
    /// Transposed direct form II at rest: `s2 = b2 - a2 g`, `s1 = b1 - a1 g + s2`, `g` the static
    /// gain.
    pub fn settled(&self) -> [f64; 2] {
        let gain = self.static_gain();
        let second = self.b[2] - self.a[1] * gain;
        [self.b[1] - self.a[0] * gain + second, second]
    }

    /// Filters one sample, in transposed direct form II.
    #[inline]
    pub fn step(&self, memory: &mut [f64; 2], input: f64) -> f64 {
        let output = self.b[0] * input + memory[0];
        memory[0] = self.b[1] * input - self.a[0] * output + memory[1];
        memory[1] = self.b[2] * input - self.a[1] * output;
        output
    }
}

/// A causal filter: second-order sections with their state.
///
/// # Shapes
/// - one channel; each channel needs its own filter
/// # Real Time
/// Hot once created: [`SosFilter::step`] costs a few nanoseconds per section.
#[derive(Debug, Clone, PartialEq)]
pub struct SosFilter {
    sections: Vec<Section>,
    memory: Vec<[f64; 2]>,
}

impl SosFilter {
    /// Creates a filter at rest.
    #[expect(clippy::disallowed_macros, reason = "cold: set-up")]
    pub fn new(sections: Vec<Section>) -> Self {
        let memory = vec![[0.0; 2]; sections.len()];
        Self { sections, memory }
    }

    /// Filters one sample.
    #[inline]
    pub fn step(&mut self, input: f64) -> f64 {
        let mut value = input;
        for (section, memory) in self.sections.iter().zip(&mut self.memory) {
            value = section.step(memory, value);
        }
        value
    }

    /// Resets the filter to rest.
    pub fn reset(&mut self) {
        for memory in &mut self.memory {
            *memory = [0.0; 2];
        }
    }

    /// Sets the state to the steady state of a constant input `level`.
    pub fn settle(&mut self, level: f64) {
        let mut level = level;
        for (section, memory) in self.sections.iter().zip(&mut self.memory) {
            let [first, second] = section.settled();
            *memory = [first * level, second * level];
            level *= section.static_gain();
        }
    }

    /// Returns the sections in order of execution.
    pub fn sections(&self) -> &[Section] {
        &self.sections
    }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    clippy::disallowed_types,
    reason = "tests are cold"
)]
mod tests {
    use super::*;

    /// y[k] = x[k] + 2 x[k-1] + 0.5 y[k-1]
    const SECTION: Section = Section { b: [1.0, 2.0, 0.0], a: [-0.5, 0.0] };

    #[test]
    fn the_impulse_response_follows_the_difference_equation() {
        let mut filter = SosFilter::new(vec![SECTION]);
        let found: Vec<f64> = [1.0, 0.0, 0.0, 0.0].iter().map(|x| filter.step(*x)).collect();
        assert_eq!(found, [1.0, 2.5, 1.25, 0.625]);
        filter.reset();
        assert_eq!(filter.step(0.0).to_bits(), 0);
    }

    #[test]
    fn a_settled_filter_answers_a_constant_with_a_constant() {
        let mut filter =
            SosFilter::new(vec![SECTION, Section { b: [0.3, 0.1, 0.2], a: [0.1, -0.2] }]);
        filter.settle(2.0);
        let expected = 2.0 * 6.0 * (0.6 / 0.9);
        for _ in 0..5 {
            assert!((filter.step(2.0) - expected).abs() < 1e-13);
        }
    }
}
