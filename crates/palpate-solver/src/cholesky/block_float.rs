//! Columns of panels in sixteen bits per entry, with a scale for each column of a panel (block floating
//! point): half the bytes of single precision, so that a solve bound by reading them takes half the time.
//!
//! An entry is `scale (m - 1.5)`, where m in [1, 2) is a number whose mantissa begins with the sixteen bits: it
//! takes a shift and a mask to have it as an f32. The 1.5 are put right once per panel and not per entry.

use bytemuck::{Pod, Zeroable};
use pulp::Simd;

use super::packed::{LANES, Panel, ROWS};
use super::real::Real;
use super::stored::Stored;

/// Two entries to a word: that of row i in the low half, that of row i + [`WORDS`] in the high one.
const WORDS: usize = ROWS / 2;
/// Numbers that sixteen bits hold.
const STEPS: f32 = 65_536.0;
/// Columns without an entry larger than this are zero: their scale would have no reciprocal.
const TINY: f32 = 1e-30;
/// Bits of 1.0, and those of a mantissa.
const ONE: u32 = 0x3f80_0000;
const MANTISSA: u32 = 0x007f_ffff;
/// Bits of a mantissa beyond sixteen.
const BEYOND: u32 = 7;
/// Half of the last of the sixteen bits.
const HALF_STEP: u32 = 1 << (BEYOND - 1);

/// A column of a panel.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct BlockFloat {
    words: [u32; WORDS],
    scale: f32,
}

impl BlockFloat {
    #[allow(clippy::inline_always)] // compiled for the vector unit of the caller
    #[inline(always)]
    fn encode(column: &Panel<f32>) -> Self {
        let (low, high) = column.0.split_at(WORDS);
        let mut largest = [0.0_f32; WORDS];
        for ((most, low), high) in largest.iter_mut().zip(low).zip(high) {
            let here = if low.abs() > high.abs() { low.abs() } else { high.abs() };
            *most = if here > *most { here } else { *most };
        }
        let largest = largest.iter().fold(0.0, |most: f32, &x| if x > most { x } else { most });
        // A step of room at either end.
        let scale = 2.0 * largest * (STEPS / (STEPS - 2.0));
        let (scale, inverse) = if largest > TINY { (scale, scale.recip()) } else { (0.0, 0.0) };
        let words = std::array::from_fn(|i| {
            let mantissa = |entry: f32| (entry * inverse + 1.5).to_bits() & MANTISSA;
            let low = (mantissa(low[i]) + HALF_STEP) >> BEYOND;
            // The high half is read with the first bits of the low one behind it.
            let high = (mantissa(high[i]) + HALF_STEP - (low >> (16 - BEYOND))) >> BEYOND;
            low | high << 16
        });
        Self { words, scale }
    }

    #[allow(clippy::inline_always)] // as above
    #[inline(always)]
    fn decode(&self) -> Panel<f32> {
        Panel(std::array::from_fn(|row| {
            let word = self.words[row % WORDS];
            let mantissa =
                if row < WORDS { word << BEYOND & MANTISSA } else { word >> (16 - BEYOND) };
            self.scale * (f32::from_bits(mantissa | ONE) - 1.5)
        }))
    }
}

impl BlockFloat {
    /// Adds its words from vector `first` on times `factors`, and the scaled factors themselves.
    #[allow(clippy::inline_always)] // as above
    #[inline(always)]
    fn add_product<S: Simd, const K: usize>(
        &self,
        simd: S,
        factors: &[f32; K],
        first: usize,
        sums: &mut [[S::f32s; 2]; K],
        scaled: &mut [f32; K],
    ) {
        let m = halves(simd, S::as_simd_u32s(&self.words).0[first]);
        for k in 0..K {
            let factor = self.scale * factors[k];
            scaled[k] += factor;
            let factor = simd.splat_f32s(factor);
            sums[k] = [0, 1].map(|half| simd.mul_add_f32s(m[half], factor, sums[k][half]));
        }
    }
}

/// The numbers m of the entries in a vector of words: those of the low halves and of the high ones.
#[allow(clippy::inline_always)] // as above
#[inline(always)]
fn halves<S: Simd>(simd: S, words: S::u32s) -> [S::f32s; 2] {
    let one = simd.splat_u32s(ONE);
    let low = simd.wrapping_dyn_shl_u32s(words, simd.splat_u32s(BEYOND));
    let low = simd.and_u32s(low, simd.splat_u32s(MANTISSA));
    let high = simd.wrapping_dyn_shr_u32s(words, simd.splat_u32s(16 - BEYOND));
    [low, high].map(|mantissa| simd.transmute_f32s_u32s(simd.or_u32s(mantissa, one)))
}

struct Encode<'a> {
    columns: &'a mut [BlockFloat],
    from: &'a [Panel<f32>],
}

impl pulp::WithSimd for Encode<'_> {
    type Output = ();

    #[allow(clippy::inline_always)] // as above
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (column, from) in self.columns.iter_mut().zip(self.from) {
            *column = BlockFloat::encode(from);
        }
    }
}

#[allow(clippy::inline_always)] // as above
impl Stored for BlockFloat {
    type Real = f32;

    const ZERO: Self = Self { words: [0; WORDS], scale: 0.0 };

    fn fill(
        columns: &mut [Self],
        memory: &mut Vec<Panel<f32>>,
        fill: impl FnOnce(&mut [Panel<f32>]),
    ) {
        memory.resize(columns.len().max(memory.len()), Panel::ZERO);
        let from = &mut memory[..columns.len()];
        fill(from);
        pulp::Arch::new().dispatch(Encode { columns, from });
    }

    #[inline(always)]
    fn panel<'a>(columns: &'a [Self], memory: &'a mut [Panel<f32>]) -> &'a [Panel<f32>] {
        let panel = &mut memory[..columns.len()];
        for (to, column) in panel.iter_mut().zip(columns) {
            *to = column.decode();
        }
        panel
    }

    fn memory_columns(widest: usize) -> usize {
        widest
    }

    #[inline(always)]
    fn product<S: Simd, const K: usize>(
        simd: S,
        panel: &[Self],
        top: &[[f32; K]],
    ) -> [[f32; ROWS]; K] {
        let mut result = [[0.0; ROWS]; K];
        for first in 0..WORDS / f32::lanes::<S>() {
            // Every second column has sums of its own: one would wait for every addition.
            let mut sums = [[[simd.splat_f32s(0.0); 2]; K]; 2];
            let mut middles = [[0.0; K]; 2];
            let (pairs, last) = panel.as_chunks::<2>();
            let (tops, last_top) = top[..panel.len()].as_chunks::<2>();
            for (pair, tops) in pairs.iter().zip(tops) {
                pair[0].add_product(simd, &tops[0], first, &mut sums[0], &mut middles[0]);
                pair[1].add_product(simd, &tops[1], first, &mut sums[1], &mut middles[1]);
            }
            if let ([column], [top]) = (last, last_top) {
                column.add_product(simd, top, first, &mut sums[0], &mut middles[0]);
            }
            for (k, result) in result.iter_mut().enumerate() {
                let middle = simd.splat_f32s(-1.5 * (middles[0][k] + middles[1][k]));
                let (low, high) = result.split_at_mut(WORDS);
                for (half, rows) in [low, high].into_iter().enumerate() {
                    let sum = simd.add_f32s(sums[0][k][half], sums[1][k][half]);
                    S::as_mut_simd_f32s(rows).0[first] = simd.add_f32s(sum, middle);
                }
            }
        }
        result
    }

    #[inline(always)]
    fn add_transposed_product<S: Simd, const K: usize>(
        simd: S,
        panel: &[Self],
        values: &[[f32; ROWS]; K],
        sums: &mut [[[f32; LANES]; K]],
    ) {
        for first in 0..WORDS / f32::lanes::<S>() {
            let values = values.each_ref().map(|values| {
                let (low, high) = values.split_at(WORDS);
                let [low, high] = [low, high].map(|rows| S::as_simd_f32s(rows).0[first]);
                let middle = simd.mul_f32s(simd.splat_f32s(-1.5), simd.add_f32s(low, high));
                [low, high, middle]
            });
            for (column, sums) in panel.iter().zip(&mut *sums) {
                let [m_low, m_high] = halves(simd, S::as_simd_u32s(&column.words).0[first]);
                let scale = simd.splat_f32s(column.scale);
                for (sums, &[low, high, middle]) in sums.iter_mut().zip(&values) {
                    let part = simd.mul_add_f32s(m_high, high, middle);
                    let part = simd.mul_add_f32s(m_low, low, part);
                    let sum = &mut S::as_mut_simd_f32s(sums).0[first];
                    *sum = simd.mul_add_f32s(scale, part, *sum);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const _: () = assert!(WORDS == LANES, "a running sum per word");

    struct Products<'a, P: Stored<Real = f32>, const K: usize> {
        panel: &'a [P],
        top: &'a [[f32; K]],
        values: &'a [[f32; ROWS]; K],
    }

    impl<P: Stored<Real = f32>, const K: usize> pulp::WithSimd for Products<'_, P, K> {
        type Output = ([[f32; ROWS]; K], Vec<[f32; K]>);

        fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
            let mut sums = vec![[[0.0; LANES]; K]; self.panel.len()];
            P::add_transposed_product::<S, K>(simd, self.panel, self.values, &mut sums);
            let sums = sums.iter().map(|sums| sums.map(|sums| sums.iter().sum())).collect();
            (P::product::<S, K>(simd, self.panel, self.top), sums)
        }
    }

    fn encoded(columns: &[Panel<f32>]) -> Vec<BlockFloat> {
        let mut result = vec![BlockFloat::ZERO; columns.len()];
        let mut memory = Vec::new();
        BlockFloat::fill(&mut result, &mut memory, |panels| panels.copy_from_slice(columns));
        result
    }

    fn assert_close(found: &[f32], expected: &[f32], size: f32) {
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() <= 3e-6 * size, "{a} instead of {b}, of {size}");
        }
    }

    /// Compares both products with those of the decoded panel, on the machine's vector unit and on none.
    fn assert_products<const K: usize>(columns: &[Panel<f32>], numbers: &[f32]) {
        let panel = encoded(columns);
        let mut memory = vec![Panel::ZERO; panel.len()];
        let decoded = BlockFloat::panel(&panel, &mut memory);
        let mut numbers = numbers.iter().copied().cycle();
        let mut draw = || numbers.next().expect("a cycle");
        let top: Vec<[f32; K]> = panel.iter().map(|_| std::array::from_fn(|_| draw())).collect();
        let values: [[f32; ROWS]; K] = std::array::from_fn(|_| std::array::from_fn(|_| draw()));
        let plain = Products { panel: decoded, top: &top, values: &values };
        let (rows, sums) = pulp::WithSimd::with_simd(plain, pulp::Scalar::new());
        let largest = decoded.iter().flat_map(|c| c.0).fold(0.0_f32, |most, x| most.max(x.abs()));
        let work = || Products { panel: &panel[..], top: &top, values: &values };
        let on_none = pulp::WithSimd::with_simd(work(), pulp::Scalar::new());
        for (found, found_sums) in [pulp::Arch::new().dispatch(work()), on_none] {
            for k in 0..K {
                let size = top.iter().map(|top| top[k].abs()).sum::<f32>();
                assert_close(&found[k], &rows[k], largest * size);
                let size = values[k].iter().map(|value| value.abs()).sum::<f32>();
                for (found, sums) in found_sums.iter().zip(&sums) {
                    assert_close(&found[k..=k], &sums[k..=k], largest * size);
                }
            }
        }
    }

    proptest! {
        #[test]
        fn entries_are_kept_to_sixteen_bits_of_the_largest(
            mut entries in prop::array::uniform32(-1.0_f32..1.0),
            zeros in any::<u32>(),
            exponent in -20..20,
        ) {
            let size = 10.0_f32.powi(exponent);
            for (row, entry) in entries.iter_mut().enumerate() {
                *entry *= if zeros >> row & 1 == 0 { size } else { 0.0 };
            }
            let largest = entries.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
            let found = BlockFloat::encode(&Panel(entries)).decode();
            for (found, entry) in found.0.iter().zip(entries) {
                prop_assert!((found - entry).abs() <= 1.03 * largest / STEPS, "{found} of {entry}");
            }
        }

        #[test]
        fn products_are_those_of_the_decoded_columns(
            columns in prop::collection::vec(prop::array::uniform32(-1.0_f32..1.0), 1..8),
            numbers in prop::collection::vec(-1.0_f32..1.0, 1..97),
        ) {
            let columns: Vec<Panel<f32>> = columns.into_iter().map(Panel).collect();
            assert_products::<1>(&columns, &numbers);
            assert_products::<2>(&columns, &numbers);
            assert_products::<3>(&columns, &numbers);
        }
    }

    #[test]
    fn columns_of_nothing_stay_so() {
        for entry in [0.0, -0.0, 1e-38, -1e-42] {
            let found = BlockFloat::encode(&Panel([entry; ROWS])).decode();
            assert_eq!(found.0, [0.0; ROWS]);
        }
    }
}
