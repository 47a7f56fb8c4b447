//! White noise, the same numbers bit by bit as NumPy draws for the same seed.
//!
//! Each plant of a batch can therefore be repeated in Python. Every cold module may import it.

mod ziggurat;

use rand_pcg::Pcg64;
use rand_pcg::rand_core::Rng;

use ziggurat::{PER_TAIL, STRIPS, TAIL};

/// Normally distributed white noise of standard deviation 1.
///
/// `numpy.random.default_rng(numpy.random.SeedSequence(seed, spawn_key=key)).standard_normal(n)`
///
/// # Source
/// - \[oneill2014\]: the generator, PCG XSL RR 128/64; \[marsaglia2000\]: the ziggurat; NumPy's
///   `SeedSequence`: the hashing of seed and key.
/// # Examples
/// ```
/// use ilc_rt::signal::WhiteNoise;
///
/// let mut noise = WhiteNoise::new(7, &[3, 0]);
/// assert_eq!([noise.draw(), noise.draw()], [1.392088440505208, -0.09055921892679361]);
/// ```
#[derive(Debug)]
pub struct WhiteNoise(Pcg64);

impl WhiteNoise {
    /// Creates the stream of a seed that belongs to a key, e.g. the number of a run.
    pub fn new(seed: u64, key: &[u32]) -> Self {
        let [state_high, state_low, stream_high, stream_low] = words(seed, key);
        let wide = |high: u64, low: u64| u128::from(high) << 64 | u128::from(low);
        Self(Pcg64::new(wide(state_high, state_low), wide(stream_high, stream_low)))
    }

    /// Returns the next number.
    pub fn draw(&mut self) -> f64 {
        loop {
            let bits = self.0.next_u64();
            let strip = usize::from(bits.to_le_bytes()[0]);
            let (within, width, density) = STRIPS[strip];
            let count = bits >> 9 & 0x000f_ffff_ffff_ffff;
            // At most 52 bits, which a number holds exactly.
            let size = count as f64 * width;
            let x = if bits & 0x100 == 0 { size } else { -size };
            if count < within {
                return x;
            }
            if strip == 0 {
                let size = self.tail();
                return if count & 0x100 == 0 { size } else { -size };
            }
            let below = STRIPS[strip - 1].2;
            if (below - density) * self.uniform() + density < (-0.5 * x * x).exp() {
                return x;
            }
        }
    }

    /// Returns a number beyond the last strip.
    fn tail(&mut self) -> f64 {
        loop {
            let beyond = -PER_TAIL * (-self.uniform()).ln_1p();
            let height = -(-self.uniform()).ln_1p();
            if height + height > beyond * beyond {
                return TAIL + beyond;
            }
        }
    }

    /// Returns a number from 0 to 1.
    fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }
}

/// Words that NumPy's `SeedSequence` keeps.
const POOL: usize = 4;

/// A multiplicative hash that changes from word to word.
struct Hash {
    constant: u32,
    factor: u32,
}

impl Hash {
    fn of(&mut self, value: u32) -> u32 {
        let value = value ^ self.constant;
        self.constant = self.constant.wrapping_mul(self.factor);
        let value = value.wrapping_mul(self.constant);
        value ^ value >> 16
    }
}

fn mix(x: u32, y: u32) -> u32 {
    let mixed = x.wrapping_mul(0xca01_f9dd).wrapping_sub(y.wrapping_mul(0x4973_f715));
    mixed ^ mixed >> 16
}

/// Returns the first four words of 64 bits of NumPy's `SeedSequence`.
#[expect(clippy::cast_possible_truncation, reason = "the halves of a seed")]
fn words(seed: u64, key: &[u32]) -> [u64; 4] {
    let mut hash = Hash { constant: 0x43b0_d7e5, factor: 0x931e_8875 };
    let mut pool: [u32; POOL] = [seed as u32, (seed >> 32) as u32, 0, 0].map(|word| hash.of(word));
    for from in 0..POOL {
        for to in (0..POOL).filter(|to| *to != from) {
            pool[to] = mix(pool[to], hash.of(pool[from]));
        }
    }
    for word in key {
        for kept in &mut pool {
            *kept = mix(*kept, hash.of(*word));
        }
    }
    let mut hash = Hash { constant: 0x8b51_f9dd, factor: 0x58f3_8ded };
    let mut halves = pool.into_iter().cycle().map(|word| u64::from(hash.of(word)));
    std::array::from_fn(|_| {
        let low = halves.next().unwrap_or_default();
        low | halves.next().unwrap_or_default() << 32
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_are_those_of_numpy() {
        // default_rng(SeedSequence(2**40 + 5, spawn_key=(19, 0))), and without a key.
        let drawn = |seed, key: &[u32]| {
            let mut noise = WhiteNoise::new(seed, key);
            [noise.draw(), noise.draw(), noise.draw()]
        };
        assert_eq!(
            drawn((1 << 40) + 5, &[19, 0]).map(f64::to_bits),
            [1.304_528_016_556_854_5, -1.955_902_706_134_295, 0.293_964_698_370_809_96]
                .map(f64::to_bits)
        );
        assert_eq!(
            drawn(0, &[0, 0]).map(f64::to_bits),
            [0.785_906_767_719_803_6, -0.919_952_956_023_596_4, 1.471_578_938_498_137_5]
                .map(f64::to_bits)
        );
    }

    #[test]
    fn the_strips_are_those_of_the_density() {
        let edge = |strip: usize| STRIPS[strip].1 * 2.0_f64.powi(52);
        for strip in 1..STRIPS.len() {
            let x = edge(strip);
            assert!((STRIPS[strip].2 - (-0.5 * x * x).exp()).abs() < 1e-15, "{strip}");
            let inner = if strip == 1 { 0.0 } else { edge(strip - 1) };
            let within = inner / x * 2.0_f64.powi(52);
            assert!((STRIPS[strip].0 as f64 - within).abs() <= 4.0, "{strip}");
            // Every strip has the area of the first, tail included.
            let top = if strip == 1 { 1.0 } else { STRIPS[strip - 1].2 };
            let area = x * (top - STRIPS[strip].2);
            assert!((area - edge(0) * STRIPS[255].2).abs() < 1e-13, "{strip}");
        }
        assert!((edge(255) - TAIL).abs() < 1e-15 && (TAIL * PER_TAIL - 1.0).abs() < 1e-15);
    }

    #[test]
    fn moments_and_tails_are_those_of_the_normal_distribution() {
        let n = 2_000_000;
        let mut noise = WhiteNoise::new(1, &[0]);
        let (mut sums, mut beyond) = ([0.0; 4], 0);
        let mut product = 0.0;
        let mut last = 0.0;
        for _ in 0..n {
            let x = noise.draw();
            sums.iter_mut().zip(1..).for_each(|(sum, power)| *sum += x.powi(power));
            beyond += usize::from(x.abs() > TAIL);
            product += last * x;
            last = x;
        }
        let mean = sums.map(|sum| sum / f64::from(n));
        // Five standard deviations of each figure.
        let off = 5.0 / f64::from(n).sqrt();
        assert!(mean[0].abs() < off && (mean[1] - 1.0).abs() < off * 2.0_f64.sqrt(), "{mean:?}");
        assert!(mean[2].abs() < off * 15.0_f64.sqrt(), "{mean:?}");
        assert!((mean[3] - 3.0).abs() < off * 96.0_f64.sqrt(), "{mean:?}");
        assert!((product / f64::from(n)).abs() < off);
        // 2.5805e-4 of the numbers.
        assert!((400..640).contains(&beyond), "{beyond}");
    }
}
