//! The order of the elements: split by count, so that blocks and the groups above them are full.

use palpate_geometry::{Aabb, Point};

use super::WIDTH;

/// Elements in the order of the leaves of a tree that halves them along the longest axis of their
/// centers, at multiples of the largest group of blocks that still fits.
pub(super) fn block_order(centers: &[Point]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..centers.len() as u32).collect();
    let mut pending = vec![(0, order.len())];
    while let Some((start, end)) = pending.pop() {
        let range = &mut order[start..end];
        if range.len() <= WIDTH {
            continue;
        }
        let bounds = Aabb::from_points(range.iter().map(|&t| &centers[t as usize]));
        let axis = bounds.longest_axis();
        let count = left_count(range.len());
        // Ties by index: the same order on every machine.
        range.select_nth_unstable_by(count, |&left, &right| {
            let order = centers[left as usize][axis].total_cmp(&centers[right as usize][axis]);
            order.then(left.cmp(&right))
        });
        pending.push((start, start + count));
        pending.push((start + count, end));
    }
    order
}

/// About half of `count`, a multiple of the largest power of [`WIDTH`] below `count`.
fn left_count(count: usize) -> usize {
    let mut unit = WIDTH;
    while unit * WIDTH < count {
        unit *= WIDTH;
    }
    ((count + unit) / (2 * unit)).max(1) * unit
}

#[cfg(test)]
mod tests {
    use super::left_count;

    #[test]
    fn halves_are_neither_empty_nor_all() {
        for count in 9..5000 {
            let left = left_count(count);
            assert!(0 < left && left < count, "{left} of {count}");
            assert!(left.is_multiple_of(8));
            assert!(count <= 64 || left.is_multiple_of(64));
        }
    }
}
