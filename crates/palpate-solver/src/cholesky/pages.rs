//! Memory for numbers that are read again and again, in huge pages where there are many.
//!
//! A factor of some megabytes in pages of 4 kB has more of them than a processor keeps the addresses
//! of, so that reading it waits for those, in a virtual machine twice as long. Linux gives huge pages to
//! memory that asks for them (`madvise`); elsewhere, and for little memory, this is a vector.

use bytemuck::{Pod, Zeroable};
use memmap2::MmapMut;

/// Bytes of a huge page; less than half of one is not worth it.
const HUGE: usize = 2 << 20;

/// What vectors of any length are aligned to.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
struct Line([u8; 64]);

/// Memory for values of any type, zero to begin with.
#[derive(Debug)]
pub(super) struct Pages(Kind);

#[derive(Debug)]
enum Kind {
    Heap(Vec<Line>),
    /// From the first huge page on that begins in it.
    Mapped {
        map: MmapMut,
        start: usize,
    },
}

impl Default for Pages {
    fn default() -> Self {
        Self(Kind::Heap(Vec::new()))
    }
}

impl Pages {
    fn new(size: usize) -> Self {
        let mapped = if size < HUGE / 2 { None } else { huge_pages(size) };
        Self(
            mapped.unwrap_or_else(|| {
                Kind::Heap(vec![Line::zeroed(); size.div_ceil(size_of::<Line>())])
            }),
        )
    }

    /// Bytes that there are.
    pub(super) fn size(&self) -> usize {
        self.bytes().len()
    }

    /// Memory of `size` bytes: this one, with any values in it, if it is large enough and not far too large.
    pub(super) fn fitting(self, size: usize) -> Self {
        let fits = self.size() >= size && self.size() / 2 <= size.next_multiple_of(HUGE);
        if fits { self } else { Self::new(size) }
    }

    /// The first `count` values.
    pub(super) fn values<T: Pod>(&self, count: usize) -> &[T] {
        bytemuck::cast_slice(&self.bytes()[..count * size_of::<T>()])
    }

    /// As [`Pages::values`].
    pub(super) fn values_mut<T: Pod>(&mut self, count: usize) -> &mut [T] {
        let bytes = match &mut self.0 {
            Kind::Heap(lines) => bytemuck::cast_slice_mut(lines),
            Kind::Mapped { map, start } => &mut map[*start..],
        };
        bytemuck::cast_slice_mut(&mut bytes[..count * size_of::<T>()])
    }

    fn bytes(&self) -> &[u8] {
        match &self.0 {
            Kind::Heap(lines) => bytemuck::cast_slice(lines),
            Kind::Mapped { map, start } => &map[*start..],
        }
    }
}

#[cfg(target_os = "linux")]
fn huge_pages(size: usize) -> Option<Kind> {
    // Room for a whole number of them wherever the mapping begins; what is not touched takes no memory.
    let map = MmapMut::map_anon(size.checked_next_multiple_of(HUGE)?.checked_add(HUGE)?).ok()?;
    // A system without huge pages says no, and small ones do as well.
    let _ = map.advise(memmap2::Advice::HugePage);
    let start = map.as_ptr().align_offset(HUGE);
    (start < HUGE).then_some(Kind::Mapped { map, start })
}

#[cfg(not(target_os = "linux"))]
fn huge_pages(_: usize) -> Option<Kind> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_of_any_size_is_aligned_and_keeps_its_values() {
        for size in [0, 1, 64, 100, HUGE / 2 - 1, HUGE / 2, HUGE, HUGE + 1, 3 * HUGE] {
            let mut pages = Pages::default().fitting(size);
            assert!(pages.size() >= size);
            let count = size / size_of::<u64>();
            assert!(pages.values::<u64>(count).iter().all(|&value| value == 0), "new memory");
            for (value, place) in pages.values_mut::<u64>(count).iter_mut().zip(0..) {
                *value = place;
            }
            assert!(pages.values::<u64>(count).iter().copied().eq(0..count as u64));
            assert!(pages.values::<u8>(size).as_ptr().addr().is_multiple_of(align_of::<Line>()));
        }
    }

    #[test]
    fn memory_that_fits_is_used_again_and_other_is_not() {
        let place = |pages: &Pages| pages.values::<u8>(1).as_ptr().addr();
        let pages = Pages::default().fitting(4 * HUGE);
        let before = place(&pages);
        let pages = pages.fitting(3 * HUGE);
        assert_eq!((place(&pages), pages.size() >= 4 * HUGE), (before, true));
        assert!(pages.fitting(HUGE / 4).size() < HUGE, "far too large");
        assert!(Pages::default().fitting(100).fitting(5 * HUGE).size() >= 5 * HUGE);
    }
}
