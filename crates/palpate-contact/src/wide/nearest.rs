//! The triangles of a body from near to far, through the blocks.

use palpate_geometry::Point;

use super::boxes::Block;
use super::{WIDTH, WideBody};
use crate::nearest::Measure;
use crate::simd::{Isa, Kernel, Lanes};

/// Blocks that wait: at most seven of each level, and there are fewer levels than 12.
const WAITING: usize = WIDTH * 12;

/// A [`Measure`] of eight boxes at a time.
pub(crate) trait BlockMeasure: Copy {
    /// At most the keys of the triangles in each box; infinite where none can matter, or the box is
    /// empty. To be `#[inline(always)]`.
    fn of_block<L: Lanes>(&self, block: &Block) -> L;
}

/// A body in the wide layout, to be searched.
#[derive(Clone, Copy)]
pub(crate) struct WideSurface<'a> {
    pub(crate) isa: Isa,
    pub(crate) origin: Point,
    pub(crate) body: &'a WideBody,
}

#[derive(Clone, Copy)]
struct Waiting {
    key: f32,
    level: u32,
    block: u32,
}

impl WideSurface<'_> {
    /// See [`crate::nearest::Surfaces::search`].
    pub(crate) fn search<M: Measure>(
        &self,
        measure: &M,
        mut limit: f64,
        mut visit: impl FnMut(u32) -> f64,
    ) {
        let triangles = &self.body.triangles;
        let Some(measure) = measure.of_blocks(self.origin, triangles.boxes.largest_coordinate())
        else {
            for slot in 0..triangles.count as u32 {
                visit(triangles.element(slot));
            }
            return;
        };
        let mut waiting = [Waiting { key: 0.0, level: 0, block: 0 }; WAITING];
        let mut count = 0_usize;
        if let Some(top) = triangles.boxes.depth().checked_sub(1) {
            waiting[0].level = top as u32;
            count = 1;
        }
        while let Some(next) = count.checked_sub(1) {
            count = next;
            let Waiting { key, level, block } = waiting[count];
            if f64::from(key) > limit {
                continue;
            }
            let boxes = &triangles.boxes.level(level as usize)[block as usize];
            let keys = self.isa.run(Measured { measure, boxes });
            let (lanes, found) = near_last(&keys, limit);
            for &lane in &lanes[..found] {
                let (key, child) = (keys[lane as usize], block * WIDTH as u32 + u32::from(lane));
                if level > 0 {
                    waiting[count] = Waiting { key, level: level - 1, block: child };
                    count += 1;
                }
            }
            if level == 0 {
                for &lane in lanes[..found].iter().rev() {
                    if f64::from(keys[lane as usize]) <= limit {
                        limit = visit(triangles.element(block * WIDTH as u32 + u32::from(lane)));
                    }
                }
            }
        }
    }
}

/// The lanes within the limit, the nearest last, and their number.
fn near_last(keys: &[f32; WIDTH], limit: f64) -> ([u8; WIDTH], usize) {
    let mut lanes = [0; WIDTH];
    let mut count = 0;
    for (lane, &key) in keys.iter().enumerate() {
        if key == f32::INFINITY || f64::from(key) > limit {
            continue;
        }
        let mut place = count;
        while place > 0 && keys[lanes[place - 1] as usize] < key {
            lanes[place] = lanes[place - 1];
            place -= 1;
        }
        lanes[place] = lane as u8;
        count += 1;
    }
    (lanes, count)
}

struct Measured<'a, M> {
    measure: M,
    boxes: &'a Block,
}

impl<M: BlockMeasure> Kernel for Measured<'_, M> {
    type Output = [f32; WIDTH];

    #[inline(always)]
    fn run<L: Lanes>(self) -> [f32; WIDTH] {
        let mut keys = [0.0; WIDTH];
        self.measure.of_block::<L>(self.boxes).store(&mut keys);
        keys
    }
}
