//! Every operation gives the same bits on every path.

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

/// Random lanes; Miri is some thousand times slower.
const CASES: u32 = if cfg!(miri) { 100 } else { 20_000 };

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
fn all_paths_give_the_same_bits() {
    let mut state = 1_usize;
    for _ in 0..CASES {
        let mut value = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(99);
            VALUES[(state >> 33) % VALUES.len()]
        };
        let lanes: [[f32; 8]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| value()));
        let expected = Isa::Scalar.run(All(lanes));
        for isa in Isa::all().into_iter().flatten() {
            assert_eq!(isa.run(All(lanes)), expected, "{isa:?} {lanes:?}");
        }
    }
}

struct Meet([[[[f32; 8]; 3]; 2]; 2]);

impl Kernel for Meet {
    type Output = u64;

    #[inline(always)]
    fn run<L: Lanes>(self) -> u64 {
        let [[min_a, max_a], [min_b, max_b]] = &self.0;
        L::meet([min_a, max_a], [min_b, max_b])
    }
}

#[test]
fn boxes_meet_alike_on_all_paths() {
    let ends =
        [0.0, 1.0, -1.5, f32::MAX, -f32::MAX, f32::MIN_POSITIVE, 1e-45, -1e-45, 1.0 + f32::EPSILON];
    let mut state = 2_usize;
    let mut below = |end: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(99);
        (state >> 33) % end
    };
    let mut meeting = 0;
    for _ in 0..CASES {
        let mut blocks = [[[[0.0; 8]; 3]; 2]; 2];
        for [min, max] in &mut blocks {
            for lane in 0..8 {
                let empty = below(9) == 0;
                for axis in 0..3 {
                    let [a, b] = [ends[below(ends.len())], ends[below(ends.len())]];
                    let within = [a.min(b), a.max(b)];
                    let anything = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, a];
                    [min[axis][lane], max[axis][lane]] = match (empty, axis) {
                        (false, _) => within,
                        (true, 0) => [f32::INFINITY, f32::NEG_INFINITY],
                        (true, _) => [anything[below(4)], anything[below(4)]],
                    };
                }
            }
        }
        let [[min_a, max_a], [min_b, max_b]] = &blocks;
        let mut expected = 0;
        for bit in 0..64 {
            let (i, j) = (bit / 8, bit % 8);
            let along =
                |axis: usize| min_a[axis][i] <= max_b[axis][j] && min_b[axis][j] <= max_a[axis][i];
            expected |= u64::from((0..3).all(along)) << bit;
        }
        meeting += expected.count_ones();
        for isa in Isa::all().into_iter().flatten() {
            assert_eq!(isa.run(Meet(blocks)), expected, "{isa:?} {blocks:?}");
        }
    }
    assert!(meeting > CASES / 20);
}

#[test]
fn this_machine_says_what_it_has() {
    #[cfg(target_arch = "x86_64")]
    assert_eq!(Isa::detect() != Isa::Scalar, std::arch::is_x86_feature_detected!("avx2"));
    #[cfg(not(target_arch = "x86_64"))]
    assert_eq!(Isa::detect(), Isa::Scalar);
}
