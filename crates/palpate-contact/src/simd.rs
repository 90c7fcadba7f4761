//! Eight numbers at a time: one source for AVX2, AVX-512 and plain Rust, with the same bits.
//!
//! An algorithm is a [`Kernel`], written once over [`Lanes`]; [`Isa::run`] compiles it for each and picks
//! at run time. AVX-512 differs from AVX2 in the comparison of boxes alone, sixteen at a time. No operation is fused, reordered or approximate, so both give the same results.

#![allow(unsafe_code)]
#![allow(clippy::inline_always, reason = "what is not inlined is not compiled for the processor")]
#![allow(clippy::wildcard_imports, reason = "every name says that it is an intrinsic")]

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;
#[cfg(target_arch = "x86_64")]
use std::marker::PhantomData;

/// What the processor can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Isa {
    /// Plain Rust.
    Scalar,
    /// Only made by [`Isa::detect`], which has asked the processor.
    #[cfg(target_arch = "x86_64")]
    Avx2(Detected),
    /// Likewise.
    #[cfg(target_arch = "x86_64")]
    Avx512(Detected),
}

/// Proof that the processor was asked.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Detected(());

impl Isa {
    /// The fastest that this processor has, but none beyond what the environment variable
    /// `PALPATE_SIMD` names: `scalar`, `avx2` or `avx512`.
    pub(crate) fn detect() -> Self {
        let named = std::env::var("PALPATE_SIMD");
        let most = match named.as_deref() {
            Ok("scalar") => 1,
            Ok("avx2") => 2,
            _ => 3,
        };
        Self::all().into_iter().take(most).flatten().last().unwrap_or(Self::Scalar)
    }

    /// What this processor has, the fastest last.
    pub(crate) fn all() -> [Option<Self>; 3] {
        #[cfg(target_arch = "x86_64")]
        {
            let avx2 = std::arch::is_x86_feature_detected!("avx2");
            let avx512 = avx2
                && std::arch::is_x86_feature_detected!("avx512f")
                && std::arch::is_x86_feature_detected!("avx512vl")
                && std::arch::is_x86_feature_detected!("avx512dq");
            [
                Some(Self::Scalar),
                avx2.then_some(Self::Avx2(Detected(()))),
                avx512.then_some(Self::Avx512(Detected(()))),
            ]
        }
        #[cfg(not(target_arch = "x86_64"))]
        [Some(Self::Scalar), None, None]
    }

    /// Runs a kernel.
    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            Self::Scalar => kernel.run::<Scalar>(),
            // SAFETY: the token was made where AVX2 was detected.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => unsafe { run_avx2(kernel) },
            // SAFETY: likewise.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => unsafe { run_avx512(kernel) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Ymm<Avx2>>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,avx512f,avx512vl,avx512dq")]
fn run_avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Ymm<Avx512>>()
}

/// An algorithm over lanes. `run` is to be `#[inline(always)]`, with all that it calls, and to hold no
/// lanes in closures or iterators: what is not inlined is not compiled for the processor.
pub(crate) trait Kernel {
    type Output;

    fn run<L: Lanes>(self) -> Self::Output;
}

/// Eight `f32`. Comparisons give lanes of all or no bits; they are false for NaN.
pub(crate) trait Lanes: Copy {
    fn load(from: &[f32; 8]) -> Self;
    fn store(self, to: &mut [f32; 8]);
    fn splat(value: f32) -> Self;
    /// x, y and z of eight nodes.
    fn gather(nodes: [&[f32; 4]; 8]) -> [Self; 3];
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    /// `other` unless `self < other`.
    fn min(self, other: Self) -> Self;
    /// `other` unless `self > other`.
    fn max(self, other: Self) -> Self;
    fn le(self, other: Self) -> Self;
    fn gt(self, other: Self) -> Self;
    fn and(self, other: Self) -> Self;
    fn or(self, other: Self) -> Self;
    /// `other` where `mask` has bits, `self` elsewhere.
    fn blend(self, other: Self, mask: Self) -> Self;
    /// Bit i is the sign of lane i.
    fn bits(self) -> u32;
    /// Lane i of the result is the smallest lane of `rows[i]`.
    fn min_of_each(rows: [Self; 8]) -> Self;
    /// Lane i of the result is the largest lane of `rows[i]`.
    fn max_of_each(rows: [Self; 8]) -> Self;
    /// Which boxes meet: bit 8 i + j for box i of a and box j of b. Empty boxes, from infinity to minus
    /// infinity along x, meet none and may be anything along y and z; elsewhere boxes are finite and
    /// have no negative zero.
    fn meet(a: EightBoxes, b: EightBoxes) -> u64;
}

/// The least and the largest x, y and z of eight boxes.
pub(crate) type EightBoxes<'a> = [&'a [[f32; 8]; 3]; 2];

/// [`Lanes::meet`], one box of a at a time.
#[inline(always)]
fn meet_by_box<L: Lanes>([min, max]: EightBoxes, b: EightBoxes) -> u64 {
    let min_b = [L::load(&b[0][0]), L::load(&b[0][1]), L::load(&b[0][2])];
    let max_b = [L::load(&b[1][0]), L::load(&b[1][1]), L::load(&b[1][2])];
    let mut mask = 0;
    for i in 0..8 {
        let mut meet = L::splat(min[0][i]).le(max_b[0]);
        meet = meet.and(min_b[0].le(L::splat(max[0][i])));
        for axis in 1..3 {
            meet = meet.and(L::splat(min[axis][i]).le(max_b[axis]));
            meet = meet.and(min_b[axis].le(L::splat(max[axis][i])));
        }
        mask |= u64::from(meet.bits()) << (8 * i);
    }
    mask
}

/// The twin of plain Rust.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scalar([f32; 8]);

impl Scalar {
    #[inline(always)]
    fn zip(self, other: Self, op: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| op(self.0[i], other.0[i])))
    }

    #[inline(always)]
    fn zip_bits(self, other: Self, op: impl Fn(u32, u32) -> u32) -> Self {
        self.zip(other, |a, b| f32::from_bits(op(a.to_bits(), b.to_bits())))
    }

    #[inline(always)]
    fn test(self, other: Self, op: impl Fn(f32, f32) -> bool) -> Self {
        self.zip(other, |a, b| f32::from_bits(if op(a, b) { u32::MAX } else { 0 }))
    }

    /// Combines the lanes of each row in the order of the shuffles of AVX2, which matters for zeros.
    #[inline(always)]
    fn fold_each(rows: [Self; 8], op: impl Fn(f32, f32) -> f32) -> Self {
        Self(rows.map(|Self(r)| {
            op(op(op(r[0], r[1]), op(r[2], r[3])), op(op(r[4], r[5]), op(r[6], r[7])))
        }))
    }
}

#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

impl Lanes for Scalar {
    #[inline(always)]
    fn load(from: &[f32; 8]) -> Self {
        Self(*from)
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        *to = self.0;
    }

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; 8])
    }

    #[inline(always)]
    fn gather(nodes: [&[f32; 4]; 8]) -> [Self; 3] {
        std::array::from_fn(|axis| Self(nodes.map(|node| node[axis])))
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, lesser)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, greater)
    }

    #[inline(always)]
    fn le(self, other: Self) -> Self {
        self.test(other, |a, b| a <= b)
    }

    #[inline(always)]
    fn gt(self, other: Self) -> Self {
        self.test(other, |a, b| a > b)
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self.zip_bits(other, |a, b| a & b)
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self.zip_bits(other, |a, b| a | b)
    }

    #[inline(always)]
    fn blend(self, other: Self, mask: Self) -> Self {
        let Self(mask) = mask;
        Self(std::array::from_fn(|i| if mask[i].to_bits() != 0 { other.0[i] } else { self.0[i] }))
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        self.0.iter().rev().fold(0, |bits, value| bits << 1 | value.to_bits() >> 31)
    }

    #[inline(always)]
    fn min_of_each(rows: [Self; 8]) -> Self {
        Self::fold_each(rows, lesser)
    }

    #[inline(always)]
    fn max_of_each(rows: [Self; 8]) -> Self {
        Self::fold_each(rows, greater)
    }

    #[inline(always)]
    fn meet(a: EightBoxes, b: EightBoxes) -> u64 {
        meet_by_box::<Self>(a, b)
    }
}

/// Eight lanes of AVX2. Values exist only within `run_avx2` and `run_avx512`.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ymm<B>(__m256, PhantomData<B>);

#[cfg(target_arch = "x86_64")]
impl<B> Ymm<B> {
    #[inline(always)]
    fn of(lanes: __m256) -> Self {
        Self(lanes, PhantomData)
    }
}

/// An expression of intrinsics.
#[cfg(target_arch = "x86_64")]
macro_rules! avx2 {
    ($value:expr) => {
        // SAFETY: methods of `Ymm` are only reached through `run_avx2` or `run_avx512`, where the
        // processor has what they use;
        // loads and stores are unaligned ones, within the arrays that are borrowed for them.
        unsafe { $value }
    };
}

#[cfg(target_arch = "x86_64")]
impl<B: BoxTest> Ymm<B> {
    /// The lanes 0, 2 and 1, 3 of each half of a and b.
    #[inline(always)]
    fn even_and_odd(a: Self, b: Self) -> [Self; 2] {
        avx2!([
            Self::of(_mm256_shuffle_ps::<0b10_00_10_00>(a.0, b.0)),
            Self::of(_mm256_shuffle_ps::<0b11_01_11_01>(a.0, b.0)),
        ])
    }

    /// The lower and the upper halves of a and b.
    #[inline(always)]
    fn halves(a: Self, b: Self) -> [Self; 2] {
        avx2!([
            Self::of(_mm256_permute2f128_ps::<0x20>(a.0, b.0)),
            Self::of(_mm256_permute2f128_ps::<0x31>(a.0, b.0)),
        ])
    }
}

/// Folds each row, neighbouring lanes first: two rows at a time, then four, then all.
#[cfg(target_arch = "x86_64")]
macro_rules! fold_each {
    ($rows:ident, $op:ident) => {{
        let mut sums = $rows;
        for step in [4, 2] {
            for i in 0..step {
                let [even, odd] = Self::even_and_odd(sums[2 * i], sums[2 * i + 1]);
                sums[i] = even.$op(odd);
            }
        }
        let [low, high] = Self::halves(sums[0], sums[1]);
        low.$op(high)
    }};
}

#[cfg(target_arch = "x86_64")]
impl<B: BoxTest> Lanes for Ymm<B> {
    #[inline(always)]
    fn load(from: &[f32; 8]) -> Self {
        Self::of(avx2!(_mm256_loadu_ps(from.as_ptr())))
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        avx2!(_mm256_storeu_ps(to.as_mut_ptr(), self.0));
    }

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self::of(avx2!(_mm256_set1_ps(value)))
    }

    #[inline(always)]
    fn gather(nodes: [&[f32; 4]; 8]) -> [Self; 3] {
        avx2!({
            let [n0, n1, n2, n3, n4, n5, n6, n7] = nodes;
            let n04 = _mm256_castps128_ps256(_mm_loadu_ps(n0.as_ptr()));
            let n15 = _mm256_castps128_ps256(_mm_loadu_ps(n1.as_ptr()));
            let n26 = _mm256_castps128_ps256(_mm_loadu_ps(n2.as_ptr()));
            let n37 = _mm256_castps128_ps256(_mm_loadu_ps(n3.as_ptr()));
            let n04 = _mm256_insertf128_ps::<1>(n04, _mm_loadu_ps(n4.as_ptr()));
            let n15 = _mm256_insertf128_ps::<1>(n15, _mm_loadu_ps(n5.as_ptr()));
            let n26 = _mm256_insertf128_ps::<1>(n26, _mm_loadu_ps(n6.as_ptr()));
            let n37 = _mm256_insertf128_ps::<1>(n37, _mm_loadu_ps(n7.as_ptr()));
            let (xy01, xy23) = (_mm256_unpacklo_ps(n04, n15), _mm256_unpacklo_ps(n26, n37));
            let (z01, z23) = (_mm256_unpackhi_ps(n04, n15), _mm256_unpackhi_ps(n26, n37));
            [
                Self::of(_mm256_shuffle_ps::<0b01_00_01_00>(xy01, xy23)),
                Self::of(_mm256_shuffle_ps::<0b11_10_11_10>(xy01, xy23)),
                Self::of(_mm256_shuffle_ps::<0b01_00_01_00>(z01, z23)),
            ]
        })
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::of(avx2!(_mm256_add_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::of(avx2!(_mm256_sub_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self::of(avx2!(_mm256_mul_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self::of(avx2!(_mm256_div_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::of(avx2!(_mm256_sqrt_ps(self.0)))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self::of(avx2!(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::of(avx2!(_mm256_min_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::of(avx2!(_mm256_max_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn le(self, other: Self) -> Self {
        Self::of(avx2!(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn gt(self, other: Self) -> Self {
        Self::of(avx2!(_mm256_cmp_ps::<_CMP_GT_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self::of(avx2!(_mm256_and_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self::of(avx2!(_mm256_or_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn blend(self, other: Self, mask: Self) -> Self {
        Self::of(avx2!(_mm256_blendv_ps(self.0, other.0, mask.0)))
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        avx2!(_mm256_movemask_ps(self.0)) as u32
    }

    #[inline(always)]
    fn min_of_each(rows: [Self; 8]) -> Self {
        fold_each!(rows, min)
    }

    #[inline(always)]
    fn max_of_each(rows: [Self; 8]) -> Self {
        fold_each!(rows, max)
    }

    #[inline(always)]
    fn meet(a: EightBoxes, b: EightBoxes) -> u64 {
        B::meet(a, b)
    }
}

/// How [`Ymm`] compares boxes.
#[cfg(target_arch = "x86_64")]
pub(crate) trait BoxTest: Copy {
    fn meet(a: EightBoxes, b: EightBoxes) -> u64;
}

/// One box against eight.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx2;

#[cfg(target_arch = "x86_64")]
impl BoxTest for Avx2 {
    #[inline(always)]
    fn meet(a: EightBoxes, b: EightBoxes) -> u64 {
        meet_by_box::<Ymm<Self>>(a, b)
    }
}

/// Two boxes against eight.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx512;

#[cfg(target_arch = "x86_64")]
impl BoxTest for Avx512 {
    /// By the signs of differences: comparisons and permutations would wait for one unit.
    #[inline(always)]
    fn meet([min_a, max_a]: EightBoxes, [min_b, max_b]: EightBoxes) -> u64 {
        avx2!({
            let first = _mm512_setr_epi32(0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1);
            let mut apart = [_mm512_setzero_si512(); 4];
            for axis in 0..3 {
                let (min_a, max_a) = (twice(&min_a[axis]), twice(&max_a[axis]));
                let (min_b, max_b) = (twice(&min_b[axis]), twice(&max_b[axis]));
                for (i, apart) in (0..).step_by(2).zip(&mut apart) {
                    // Boxes i and i + 1 of a.
                    let two = _mm512_add_epi32(first, _mm512_set1_epi32(i));
                    let below = _mm512_sub_ps(max_b, _mm512_permutexvar_ps(two, min_a));
                    let above = _mm512_sub_ps(_mm512_permutexvar_ps(two, max_a), min_b);
                    let (below, above) = (_mm512_castps_si512(below), _mm512_castps_si512(above));
                    *apart = _mm512_ternarylogic_epi32::<OR>(*apart, below, above);
                }
            }
            let mut mask = 0;
            for (i, apart) in apart.into_iter().enumerate() {
                mask |= u64::from(_mm512_movepi32_mask(apart)) << (16 * i);
            }
            !mask
        })
    }
}

/// Any of three bits, for `_mm512_ternarylogic_epi32`.
#[cfg(target_arch = "x86_64")]
const OR: i32 = 0xfe;

/// The same eight numbers in both halves.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn twice(values: &[f32; 8]) -> __m512 {
    avx2!({
        let half = _mm512_castps256_ps512(_mm256_loadu_ps(values.as_ptr()));
        _mm512_shuffle_f32x4::<0b01_00_01_00>(half, half)
    })
}

#[cfg(test)]
mod tests;
