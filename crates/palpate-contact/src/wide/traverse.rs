//! Simultaneous traversal, level by level, on lists of block pairs.

use super::WIDTH;
use super::adjacency::{Adjacency, Seconds, UPPER, bits};
use super::boxes::{Block, Levels, at_least_lowest, at_most_largest, rounding};
use super::separation::round_up;
use crate::leaf_pairs::Cost;
use crate::simd::{Isa, Kernel, Lanes};

/// Buffers of a traversal.
#[derive(Debug, Default)]
pub(crate) struct Traversal {
    /// Block pairs of the level that is next: as output, of the level where it stopped.
    pub(crate) pairs: Vec<[u32; 2]>,
    next: Vec<[u32; 2]>,
    masks: Vec<u64>,
}

/// What a traversal compares.
#[derive(Clone, Copy)]
pub(crate) struct Sides<'a> {
    a: &'a Levels,
    b: &'a Levels,
    /// Whether a and b are one and the same: each unordered pair is then met once.
    same: bool,
    /// For one body: what shares a node.
    own: Option<&'a Adjacency>,
    /// Boxes further apart than this [m] are not wanted.
    margin: f64,
    padding: Option<f32>,
}

impl<'a> Sides<'a> {
    pub(super) fn new(
        [a, b]: [&'a Levels; 2],
        own: Option<&'a Adjacency>,
        same: bool,
        margin: f64,
    ) -> Self {
        let largest = a.largest_coordinate().max(b.largest_coordinate());
        Self { a, b, same, own, margin, padding: padding(margin, largest) }
    }

    fn overlap<'b>(&self, level: usize, pairs: Pairs<'b>, masks: &'b mut Vec<u64>) -> Overlap<'b>
    where
        'a: 'b,
    {
        let (margin, padding) = (self.margin, self.padding);
        Overlap { a: self.a.level(level), b: self.b.level(level), pairs, margin, padding, masks }
    }

    /// The level of the first block pair (0, 0); `None` where there is nothing to traverse: no elements,
    /// or one block of each, of one body.
    pub(crate) fn top(&self) -> Option<usize> {
        let (a, b) = (self.a.depth(), self.b.depth());
        let nothing = a == 0 || b == 0 || (self.own.is_some() && a.max(b) == 1);
        (!nothing).then(|| a.max(b) - 1)
    }

    /// Number of block pairs that share a node, which the traversal leaves out.
    pub(crate) fn adjacent_count(&self) -> usize {
        self.own.map_or(0, Adjacency::len)
    }
}

impl Traversal {
    /// Memory of the buffers in bytes.
    pub(crate) fn bytes(&self) -> usize {
        let Self { pairs, next, masks } = self;
        bytes(pairs) + bytes(next) + bytes(masks)
    }

    /// Goes down one level, from `level`, which is not 0.
    pub(crate) fn descend(&mut self, isa: Isa, sides: &Sides, level: usize, cost: &mut Cost) {
        self.test(isa, sides, level, cost);
        self.next.clear();
        for (&[a, b], &mask) in self.pairs.iter().zip(&self.masks) {
            let mut mask = mask;
            if sides.same && a == b {
                mask &= UPPER;
                if level > 1 {
                    let count = sides.a.level(level - 1).len() as u32;
                    let first = a * WIDTH as u32;
                    let children = first..(first + WIDTH as u32).min(count);
                    self.next.extend(children.map(|child| [child, child]));
                }
            }
            if level == 1
                && let Some(own) = sides.own
            {
                mask &= !own.child_pairs([a, b]);
            }
            push_lanes([a, b], mask, &mut self.next);
        }
        std::mem::swap(&mut self.pairs, &mut self.next);
    }

    /// Collects the slot pairs whose boxes meet, of the block pairs of level 0.
    pub(crate) fn collect(
        &mut self,
        isa: Isa,
        sides: &Sides,
        candidates: &mut Vec<[u32; 2]>,
        cost: &mut Cost,
    ) {
        self.test(isa, sides, 0, cost);
        cost.leaf_pairs += self.pairs.len() as u64;
        for (&pair, &mask) in self.pairs.iter().zip(&self.masks) {
            push_lanes(pair, mask, candidates);
        }
    }

    /// Collects the slot pairs of neighbouring blocks of one body whose boxes meet, and that share no
    /// node, or do with `sharing`. `range`: of the pairs of its adjacency.
    pub(crate) fn collect_adjacent(
        &mut self,
        isa: Isa,
        sides: &Sides,
        sharing: bool,
        range: std::ops::Range<usize>,
        candidates: &mut Vec<[u32; 2]>,
        cost: &mut Cost,
    ) {
        let Some(adjacency) = sides.own else {
            return;
        };
        self.masks.clear();
        let seconds = adjacency.seconds(range.clone());
        isa.run(sides.overlap(0, Pairs::Neighbours(seconds), &mut self.masks));
        cost.count(range.len());
        cost.leaf_pairs += range.len() as u64;
        let apart = &adjacency.apart[range.clone()];
        for ((pair, &mask), &apart) in adjacency.pairs(range).zip(&self.masks).zip(apart) {
            let once = || if sides.same && pair[0] == pair[1] { UPPER } else { u64::MAX };
            let wanted = if sharing { !apart & once() } else { apart };
            push_lanes(pair, mask & wanted, candidates);
        }
    }

    fn test(&mut self, isa: Isa, sides: &Sides, level: usize, cost: &mut Cost) {
        self.masks.clear();
        isa.run(sides.overlap(level, Pairs::Listed(&self.pairs), &mut self.masks));
        cost.count(self.pairs.len());
    }
}

/// Memory of a buffer, whether it is in use or not.
pub(crate) fn bytes<T>(buffer: &Vec<T>) -> usize {
    buffer.capacity() * size_of::<T>()
}

impl Cost {
    fn count(&mut self, block_pairs: usize) {
        self.nodes_visited += block_pairs as u64;
        self.box_tests += (block_pairs * WIDTH * WIDTH) as u64;
    }
}

#[inline]
fn push_lanes([a, b]: [u32; 2], mask: u64, found: &mut Vec<[u32; 2]>) {
    let (a, b) = (a * WIDTH as u32, b * WIDTH as u32);
    for bit in bits(mask) {
        found.push([a + (bit / WIDTH) as u32, b + (bit % WIDTH) as u32]);
    }
}

/// Pairs of blocks.
#[derive(Clone, Copy)]
pub(super) enum Pairs<'a> {
    Listed(&'a [[u32; 2]]),
    Neighbours(Seconds<'a>),
}

/// Which boxes of two blocks meet: bit 8 i + j for lane i of a and lane j of b.
pub(super) struct Overlap<'a> {
    pub(super) a: &'a [Block],
    pub(super) b: &'a [Block],
    pub(super) pairs: Pairs<'a>,
    pub(super) margin: f64,
    /// By [`padding`] of the margin.
    pub(super) padding: Option<f32>,
    pub(super) masks: &'a mut Vec<u64>,
}

impl Kernel for Overlap<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { a, b, pairs, margin, padding, masks } = self;
        let grow = match padding {
            Some(padding) => Grow::Padded(L::splat(padding)),
            None if margin > 0.0 => Grow::Widened(L::splat(round_up(margin))),
            None => Grow::None,
        };
        // Plain loops: what an iterator's adaptor does not inline is not compiled for the lanes.
        match pairs {
            Pairs::Listed(pairs) => {
                masks.resize(pairs.len(), 0);
                for (mask, &[i, j]) in masks.iter_mut().zip(pairs) {
                    *mask = grow.meet(&a[i as usize], &b[j as usize]);
                }
            }
            Pairs::Neighbours(seconds) => {
                masks.resize(seconds.len(), 0);
                let mut rows = seconds.rows();
                for (index, mask) in masks.iter_mut().enumerate() {
                    let [i, j] = seconds.next(index, &mut rows);
                    *mask = grow.meet(&a[i as usize], &b[j as usize]);
                }
            }
        }
    }
}

/// How boxes are made larger by a margin.
#[derive(Clone, Copy)]
enum Grow<L> {
    None,
    Padded(L),
    Widened(L),
}

impl<L: Lanes> Grow<L> {
    /// b grows, which a kernel holds in registers; a may be read number by number.
    #[inline(always)]
    fn meet(self, a: &Block, b: &Block) -> u64 {
        match self {
            Self::None => L::meet(a.sides(), b.sides()),
            Self::Padded(padding) => L::meet(a.sides(), padded(b, padding).sides()),
            Self::Widened(margin) => L::meet(a.sides(), widened(b, margin).sides()),
        }
    }
}

/// What makes up for a margin and for the rounding of coordinates up to `largest` that are moved by it;
/// `None` where there is no margin, or coordinates could overflow.
pub(super) fn padding(margin: f64, largest: f32) -> Option<f32> {
    const ROUNDING: f32 = 2.0 * f32::EPSILON;
    let padding = round_up(margin) * (1.0 + ROUNDING) + largest * ROUNDING;
    (margin > 0.0 && padding + largest < f32::MAX / 2.0).then_some(padding)
}

/// Boxes grown by [`padding`].
#[inline(always)]
fn padded<L: Lanes>(block: &Block, padding: L) -> Block {
    let mut wide = Block::EMPTY;
    for axis in 0..3 {
        L::load(&block.min[axis]).sub(padding).store(&mut wide.min[axis]);
        L::load(&block.max[axis]).add(padding).store(&mut wide.max[axis]);
    }
    wide
}

/// Boxes of any size grown by `margin` and rounded outwards. Empty boxes stay empty along x.
#[inline(always)]
fn widened<L: Lanes>(block: &Block, margin: L) -> Block {
    let mut wide = Block::EMPTY;
    for axis in 0..3 {
        let (least, largest) = (L::load(&block.min[axis]), L::load(&block.max[axis]));
        let (min, max) = (least.sub(margin), largest.add(margin));
        let mut min = at_least_lowest(min.sub(rounding(min)));
        let mut max = at_most_largest(max.add(rounding(max)));
        if axis == 0 {
            let empty = least.gt(largest);
            min = min.blend(L::splat(f32::INFINITY), empty);
            max = max.blend(L::splat(f32::NEG_INFINITY), empty);
        }
        min.store(&mut wide.min[axis]);
        max.store(&mut wide.max[axis]);
    }
    wide
}
