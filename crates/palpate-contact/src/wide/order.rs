//! The order of the elements: split by count, so that blocks and the groups above them are full.

use palpate_geometry::{Point, vec3};

use super::WIDTH;

/// Up to so many elements ranks are counted, all pairs compared: no branch of it can go wrong.
const FEW: usize = 32;

/// An element's center in `f32`, relative to some center, and the bits of its index.
type Placed = [f32; 4];

/// Elements in the order of the leaves of a tree that halves them along the longest axis of their
/// centers, at multiples of the largest group of blocks that still fits.
pub(super) fn block_order(centers: &[Point]) -> Vec<u32> {
    let Some(&origin) = centers.first() else {
        return Vec::new();
    };
    let place = |(element, &center): (usize, &Point)| -> Placed {
        let [x, y, z] = vec3::sub(center, origin).map(|value| value as f32);
        [x, y, z, f32::from_bits(element as u32)]
    };
    let mut placed: Vec<Placed> = centers.iter().enumerate().map(place).collect();
    let mut pending = vec![(0, placed.len())];
    while let Some((start, end)) = pending.pop() {
        let range = &mut placed[start..end];
        if range.len() <= WIDTH {
            continue;
        }
        let axis = longest_axis(range);
        let count = left_count(range.len());
        if range.len() <= FEW {
            split_few(range, axis, count);
        } else {
            // Ties by index: the same order on every machine.
            range.select_nth_unstable_by_key(count, |placed| {
                i64::from(key(placed[axis])) << 32 | i64::from(placed[3].to_bits())
            });
        }
        pending.push((start, start + count));
        pending.push((start + count, end));
    }
    placed.into_iter().map(|placed| placed[3].to_bits()).collect()
}

/// Brings the `count` least along `axis` to the front; of equal ones those that stand first.
fn split_few(range: &mut [Placed], axis: usize, count: usize) {
    // Padded with the largest key: behind all others in rank.
    let mut keys = [i32::MAX; FEW];
    for (key_of, placed) in keys.iter_mut().zip(range.iter()) {
        *key_of = key(placed[axis]);
    }
    let mut former = [[0.0; 4]; FEW];
    former[..range.len()].copy_from_slice(range);
    let (mut left, mut right) = (0, count);
    for (i, &placed) in former[..range.len()].iter().enumerate() {
        let before = keys[..i].iter().map(|&other| u32::from(other <= keys[i])).sum::<u32>();
        let after = keys[i + 1..].iter().map(|&other| u32::from(other < keys[i])).sum::<u32>();
        let place = if ((before + after) as usize) < count { &mut left } else { &mut right };
        range[*place] = placed;
        *place += 1;
    }
}

/// A number that orders as `value` does.
fn key(value: f32) -> i32 {
    let bits = value.to_bits() as i32;
    // Of negative numbers all bits but the sign the other way round.
    bits ^ (bits >> 31) & i32::MAX
}

fn longest_axis(range: &[Placed]) -> usize {
    let (mut min, mut max) = ([f32::INFINITY; 4], [f32::NEG_INFINITY; 4]);
    for placed in range {
        // All four: one instruction each.
        for axis in 0..4 {
            min[axis] = if placed[axis] < min[axis] { placed[axis] } else { min[axis] };
            max[axis] = if placed[axis] > max[axis] { placed[axis] } else { max[axis] };
        }
    }
    let length = |axis: usize| max[axis] - min[axis];
    let longest = usize::from(length(1) > length(0));
    if length(2) > length(longest) { 2 } else { longest }
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
    use palpate_testing::Random;

    use super::{block_order, key, left_count};

    #[test]
    fn halves_are_neither_empty_nor_all() {
        for count in 9..5000 {
            let left = left_count(count);
            assert!(0 < left && left < count, "{left} of {count}");
            assert!(left.is_multiple_of(8));
            assert!(count <= 64 || left.is_multiple_of(64));
        }
    }

    #[test]
    fn keys_order_as_numbers_do() {
        let numbers = [f32::MIN, -1.5, -1e-45, 0.0, 1e-45, 1.0, 2.5, f32::MAX, f32::INFINITY];
        assert!(numbers.is_sorted_by_key(|&number| key(number)));
    }

    #[test]
    fn blocks_are_halves_of_halves() {
        let mut random = Random(7);
        for count in [0, 1, 8, 9, 16, 17, 31, 32, 33, 64, 65, 300] {
            // Few values, so that many are equal.
            let mut value = || random.below(7) as f64;
            let centers: Vec<_> = (0..count).map(|_| [value(), value(), value()]).collect();
            let order = block_order(&centers);
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq(0..count));
            check(&centers, &order);
        }
    }

    fn check(centers: &[[f64; 3]], order: &[u32]) {
        if order.len() > 8 {
            let (left, right) = order.split_at(left_count(order.len()));
            let along = |axis: usize| {
                let value = move |element: &u32| centers[*element as usize][axis];
                let least = right.iter().map(value).fold(f64::INFINITY, f64::min);
                left.iter().map(value).all(|value| value <= least)
            };
            assert!((0..3).any(along));
            check(centers, left);
            check(centers, right);
        }
    }
}
