//! SIMD rows of eight numbers, with the widest instructions of the processor.
//!
//! For the sweeps of this folder, and for many plants side by side
//! ([`crate::learning::batch`]). Products and sums are rounded
//! separately, never fused, so results are bit-identical on every processor.

#![expect(
    clippy::inline_always,
    reason = "single instructions, and what takes over the instructions of its caller"
)]

/// Numbers per row.
pub(in crate::learning) const LANES: usize = 8;
/// Numbers per half of one.
pub(in crate::learning) const HALF: usize = LANES / 2;

/// Eight numbers in memory.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
pub(in crate::learning) struct Lanes(pub(in crate::learning) [f64; LANES]);

/// Instructions for rows of eight numbers.
pub(in crate::learning) trait Wide: Copy {
    /// Eight numbers in registers.
    type Row: Copy;

    /// Half of them.
    type Half: Copy;

    /// Loads a half.
    fn half(self, values: &[f64; HALF]) -> Self::Half;

    /// Returns the numbers of a half.
    fn half_values(self, half: Self::Half) -> [f64; HALF];

    /// Returns `sum + factor half`.
    fn add_half(self, sum: Self::Half, factor: f64, half: Self::Half) -> Self::Half;

    /// Returns `sum` plus the products of the numbers, one by one.
    fn add_product(self, sum: Self::Half, left: Self::Half, right: Self::Half) -> Self::Half;

    /// Loads a row.
    fn row(self, values: &[f64; LANES]) -> Self::Row;

    /// Returns the numbers of a row.
    fn values(self, row: Self::Row) -> [f64; LANES];

    /// Returns `left + right`.
    fn add(self, left: Self::Row, right: Self::Row) -> Self::Row;

    /// Returns the products of the numbers, one by one.
    fn multiply(self, left: Self::Row, right: Self::Row) -> Self::Row;

    /// Returns `factor row`.
    fn scale(self, factor: f64, row: Self::Row) -> Self::Row;

    /// Returns the columns of eight rows.
    fn transpose(self, rows: [Self::Row; LANES]) -> [Self::Row; LANES];
}

/// Work to be compiled for each instruction set.
pub(in crate::learning) trait Work {
    /// Its result.
    type Output;

    /// Runs the work. Marked `#[inline(always)]`, like everything it calls, so that it is compiled
    /// for the selected instructions.
    fn with(self, wide: impl Wide) -> Self::Output;
}

/// Instruction set of the processor.
#[derive(Debug, Clone, Copy)]
pub(in crate::learning) enum Instructions {
    /// The baseline that every supported processor has.
    Portable,
    /// AVX2 in addition.
    #[cfg(target_arch = "x86_64")]
    Avx(pulp::x86::V3),
}

impl Instructions {
    /// Returns the best instruction set of this processor.
    pub(in crate::learning) fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            return Self::Avx(simd);
        }
        Self::Portable
    }

    /// Runs the work with these instructions if they are those of most processors of this kind: work for which there
    /// is a slower way, and that would be compiled twice otherwise.
    pub(in crate::learning) fn run_if_usual<T: Work>(self, work: T) -> Option<T::Output> {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Portable => None,
            #[cfg(not(target_arch = "x86_64"))]
            Self::Portable => Some(work.with(Portable)),
            #[cfg(target_arch = "x86_64")]
            Self::Avx(simd) => Some(simd.vectorize(avx::Call(simd, work))),
        }
    }

    /// Runs the work with these instructions.
    pub(in crate::learning) fn run<T: Work>(self, work: T) -> T::Output {
        match self {
            Self::Portable => work.with(Portable),
            #[cfg(target_arch = "x86_64")]
            Self::Avx(simd) => simd.vectorize(avx::Call(simd, work)),
        }
    }
}

/// The baseline instructions.
#[derive(Debug, Clone, Copy)]
pub(in crate::learning) struct Portable;

impl Wide for Portable {
    type Row = [f64; LANES];
    type Half = [f64; HALF];

    #[inline(always)]
    fn half(self, values: &[f64; HALF]) -> Self::Half {
        *values
    }

    #[inline(always)]
    fn half_values(self, half: Self::Half) -> [f64; HALF] {
        half
    }

    #[inline(always)]
    fn add_half(self, sum: Self::Half, factor: f64, half: Self::Half) -> Self::Half {
        std::array::from_fn(|lane| sum[lane] + factor * half[lane])
    }

    #[inline(always)]
    fn add_product(self, sum: Self::Half, left: Self::Half, right: Self::Half) -> Self::Half {
        std::array::from_fn(|lane| sum[lane] + left[lane] * right[lane])
    }

    #[inline(always)]
    fn row(self, values: &[f64; LANES]) -> Self::Row {
        *values
    }

    #[inline(always)]
    fn values(self, row: Self::Row) -> [f64; LANES] {
        row
    }

    #[inline(always)]
    fn add(self, left: Self::Row, right: Self::Row) -> Self::Row {
        std::array::from_fn(|lane| left[lane] + right[lane])
    }

    #[inline(always)]
    fn multiply(self, left: Self::Row, right: Self::Row) -> Self::Row {
        std::array::from_fn(|lane| left[lane] * right[lane])
    }

    #[inline(always)]
    fn scale(self, factor: f64, row: Self::Row) -> Self::Row {
        row.map(|value| factor * value)
    }

    #[inline(always)]
    fn transpose(self, rows: [Self::Row; LANES]) -> [Self::Row; LANES] {
        std::array::from_fn(|col| std::array::from_fn(|row| rows[row][col]))
    }
}

/// AVX, as two vectors of four numbers.
#[cfg(target_arch = "x86_64")]
mod avx {
    use std::arch::x86_64::__m256d;

    use pulp::x86::V3;
    use pulp::{NullaryFnOnce, cast};

    use super::{HALF, LANES, Wide, Work};

    /// Work with the proof that the processor has the instructions.
    pub(super) struct Call<T>(pub(super) V3, pub(super) T);

    impl<T: Work> NullaryFnOnce for Call<T> {
        type Output = T::Output;

        #[inline(always)]
        fn call(self) -> Self::Output {
            self.1.with(self.0)
        }
    }

    /// The low halves of two rows, then the high ones.
    const LOW: i32 = 0x20;
    const HIGH: i32 = 0x31;

    impl Wide for V3 {
        type Row = [__m256d; 2];
        type Half = __m256d;

        #[inline(always)]
        fn half(self, values: &[f64; HALF]) -> Self::Half {
            cast(*values)
        }

        #[inline(always)]
        fn half_values(self, half: Self::Half) -> [f64; HALF] {
            cast(half)
        }

        #[inline(always)]
        fn add_half(self, sum: Self::Half, factor: f64, half: Self::Half) -> Self::Half {
            let simd = self.avx;
            simd._mm256_add_pd(sum, simd._mm256_mul_pd(simd._mm256_set1_pd(factor), half))
        }

        #[inline(always)]
        fn add_product(self, sum: Self::Half, left: Self::Half, right: Self::Half) -> Self::Half {
            self.avx._mm256_add_pd(sum, self.avx._mm256_mul_pd(left, right))
        }

        #[inline(always)]
        fn row(self, values: &[f64; LANES]) -> Self::Row {
            cast(*values)
        }

        #[inline(always)]
        fn values(self, row: Self::Row) -> [f64; LANES] {
            cast(row)
        }

        #[inline(always)]
        fn add(self, left: Self::Row, right: Self::Row) -> Self::Row {
            let simd = self.avx;
            [simd._mm256_add_pd(left[0], right[0]), simd._mm256_add_pd(left[1], right[1])]
        }

        #[inline(always)]
        fn multiply(self, left: Self::Row, right: Self::Row) -> Self::Row {
            let simd = self.avx;
            [simd._mm256_mul_pd(left[0], right[0]), simd._mm256_mul_pd(left[1], right[1])]
        }

        #[inline(always)]
        fn scale(self, factor: f64, row: Self::Row) -> Self::Row {
            let simd = self.avx;
            let factor = simd._mm256_set1_pd(factor);
            [simd._mm256_mul_pd(factor, row[0]), simd._mm256_mul_pd(factor, row[1])]
        }

        #[inline(always)]
        fn transpose(self, rows: [Self::Row; LANES]) -> [Self::Row; LANES] {
            // Four by four; the two off-diagonal quarters are swapped.
            let mut columns = rows;
            for row in [0, 4] {
                for half in 0..2 {
                    let [a, b, c, d] = [
                        rows[row][half],
                        rows[row + 1][half],
                        rows[row + 2][half],
                        rows[row + 3][half],
                    ];
                    let four = quarter(self, [a, b, c, d]);
                    for i in 0..4 {
                        columns[half * 4 + i][row / 4] = four[i];
                    }
                }
            }
            columns
        }
    }

    /// Returns the columns of four rows of four.
    #[inline(always)]
    fn quarter(simd: V3, [a, b, c, d]: [__m256d; 4]) -> [__m256d; 4] {
        let simd = simd.avx;
        let (ab_even, ab_odd) = (simd._mm256_unpacklo_pd(a, b), simd._mm256_unpackhi_pd(a, b));
        let (cd_even, cd_odd) = (simd._mm256_unpacklo_pd(c, d), simd._mm256_unpackhi_pd(c, d));
        [
            simd._mm256_permute2f128_pd::<LOW>(ab_even, cd_even),
            simd._mm256_permute2f128_pd::<LOW>(ab_odd, cd_odd),
            simd._mm256_permute2f128_pd::<HIGH>(ab_even, cd_even),
            simd._mm256_permute2f128_pd::<HIGH>(ab_odd, cd_odd),
        ]
    }
}
