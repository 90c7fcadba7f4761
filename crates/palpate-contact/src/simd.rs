//! Eight numbers at a time: one source for AVX2 and for plain Rust, with the same bits.
//!
//! An algorithm is a [`Kernel`], written once over [`Lanes`]; [`Isa::run`] compiles it twice and picks
//! at run time. No operation is fused, reordered or approximate, so both give the same results.

#![allow(unsafe_code)]
#![allow(clippy::inline_always, reason = "what is not inlined is not compiled for the processor")]
#![allow(clippy::wildcard_imports, reason = "every name says that it is an intrinsic")]

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

/// What the processor can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Isa {
    /// Plain Rust.
    Scalar,
    /// Only made by [`Isa::detect`], which has asked the processor.
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2Token),
}

/// Proof that the processor has AVX2.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Avx2Token(());

impl Isa {
    /// The fastest that this processor has.
    pub(crate) fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Self::Avx2(Avx2Token(()));
        }
        Self::Scalar
    }

    /// Runs a kernel.
    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            Self::Scalar => kernel.run::<Scalar>(),
            // SAFETY: the token was made where AVX2 was detected.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => unsafe { run_avx2(kernel) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx2>()
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
}

/// Eight lanes of AVX2. Values exist only within `run_avx2`.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx2(__m256);

/// An expression of intrinsics.
#[cfg(target_arch = "x86_64")]
macro_rules! avx2 {
    ($value:expr) => {
        // SAFETY: methods of `Avx2` are only reached through `run_avx2`, where the processor has AVX2;
        // loads and stores are unaligned ones, within the arrays that are borrowed for them.
        unsafe { $value }
    };
}

#[cfg(target_arch = "x86_64")]
impl Avx2 {
    /// The lanes 0, 2 and 1, 3 of each half of a and b.
    #[inline(always)]
    fn even_and_odd(a: Self, b: Self) -> [Self; 2] {
        avx2!([
            Self(_mm256_shuffle_ps::<0b10_00_10_00>(a.0, b.0)),
            Self(_mm256_shuffle_ps::<0b11_01_11_01>(a.0, b.0)),
        ])
    }

    /// The lower and the upper halves of a and b.
    #[inline(always)]
    fn halves(a: Self, b: Self) -> [Self; 2] {
        avx2!([
            Self(_mm256_permute2f128_ps::<0x20>(a.0, b.0)),
            Self(_mm256_permute2f128_ps::<0x31>(a.0, b.0)),
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
impl Lanes for Avx2 {
    #[inline(always)]
    fn load(from: &[f32; 8]) -> Self {
        Self(avx2!(_mm256_loadu_ps(from.as_ptr())))
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        avx2!(_mm256_storeu_ps(to.as_mut_ptr(), self.0));
    }

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(avx2!(_mm256_set1_ps(value)))
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
                Self(_mm256_shuffle_ps::<0b01_00_01_00>(xy01, xy23)),
                Self(_mm256_shuffle_ps::<0b11_10_11_10>(xy01, xy23)),
                Self(_mm256_shuffle_ps::<0b01_00_01_00>(z01, z23)),
            ]
        })
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(avx2!(_mm256_add_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(avx2!(_mm256_sub_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(avx2!(_mm256_mul_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(avx2!(_mm256_div_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(avx2!(_mm256_sqrt_ps(self.0)))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(avx2!(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(avx2!(_mm256_min_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(avx2!(_mm256_max_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn le(self, other: Self) -> Self {
        Self(avx2!(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn gt(self, other: Self) -> Self {
        Self(avx2!(_mm256_cmp_ps::<_CMP_GT_OQ>(self.0, other.0)))
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(avx2!(_mm256_and_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(avx2!(_mm256_or_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn blend(self, other: Self, mask: Self) -> Self {
        Self(avx2!(_mm256_blendv_ps(self.0, other.0, mask.0)))
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
}

#[cfg(test)]
mod tests {
    use super::*;

    const VALUES: [f32; 12] = [
        0.0,
        -0.0,
        1.0,
        -1.5,
        f32::MAX,
        f32::MIN_POSITIVE,
        1e-45,
        -3e-39,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
        0.1,
    ];

    /// All results on some lanes; NaN of any kind counts as one.
    struct All([[f32; 8]; 3]);

    impl Kernel for All {
        type Output = Vec<u32>;

        #[inline(always)]
        fn run<L: Lanes>(self) -> Vec<u32> {
            let [a, b, c] = [L::load(&self.0[0]), L::load(&self.0[1]), L::load(&self.0[2])];
            let numbers = [a.add(b), a.sub(b), a.mul(b), a.div(b), a.sqrt(), a.min(b), a.max(b)];
            let more = [
                a.abs(),
                a.blend(b, b.le(c)),
                L::splat(self.0[0][3]),
                L::min_of_each([a, b, c, a.add(b), b.min(a), c.sub(a), b, b.abs()]),
                L::max_of_each([a, b, c, a.add(b), b.min(a), c.sub(a), b, b.abs()]),
            ];
            let mut bits = vec![a.le(b).bits(), a.gt(b).bits(), a.bits()];
            bits.push(a.le(b).and(b.le(c)).bits());
            bits.push(a.le(b).or(b.le(c)).bits());
            let mut stored = [0.0; 8];
            for lanes in numbers.into_iter().chain(more) {
                lanes.store(&mut stored);
                bits.extend(stored.map(|v| if v.is_nan() { u32::MAX } else { v.to_bits() }));
            }
            let nodes = self.0.map(|[x, y, z, w, ..]| [x, y, z, w]);
            let [p, q, r] = [&nodes[0], &nodes[1], &nodes[2]];
            for lanes in L::gather([p, q, r, q, p, r, r, q]) {
                lanes.store(&mut stored);
                bits.extend(stored.map(f32::to_bits));
            }
            bits
        }
    }

    #[test]
    fn both_paths_give_the_same_bits() {
        let fast = Isa::detect();
        let mut state = 1_usize;
        for _ in 0..20_000 {
            let mut value = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(99);
                VALUES[(state >> 33) % VALUES.len()]
            };
            let lanes: [[f32; 8]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| value()));
            assert_eq!(fast.run(All(lanes)), Isa::Scalar.run(All(lanes)), "{lanes:?}");
        }
    }

    #[test]
    fn this_machine_says_what_it_has() {
        #[cfg(target_arch = "x86_64")]
        assert_eq!(Isa::detect() != Isa::Scalar, std::arch::is_x86_feature_detected!("avx2"));
        #[cfg(not(target_arch = "x86_64"))]
        assert_eq!(Isa::detect(), Isa::Scalar);
    }
}
