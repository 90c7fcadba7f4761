//! Decisions out of the bytes of an input; when they have run out, zeros.

/// Reads decisions.
pub(crate) struct Choices<'a>(&'a [u8]);

/// Coordinates where arithmetic has edges.
const EDGES: [f64; 16] = [
    f64::NAN,
    f64::INFINITY,
    -f64::INFINITY,
    1e308,
    -1e308,
    1e200,
    1e154,
    -1e100,
    1e16,
    1e8,
    1e-8,
    1e-100,
    -1e-160,
    5e-324,
    -0.0,
    2.0,
];

impl<'a> Choices<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    /// Whether nothing is left.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(crate) fn byte(&mut self) -> u8 {
        let Some((&first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        first
    }

    /// A number below `count`, at most 256.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        self.byte() as usize % count.max(1)
    }

    pub(crate) fn flag(&mut self) -> bool {
        self.byte() & 1 == 1
    }

    /// A number in [-1, 1] on a grid of sixteenths, so that coincidences are common; or off it.
    pub(crate) fn small(&mut self) -> f64 {
        let byte = self.byte();
        if byte < 0xe0 {
            f64::from(byte % 33) / 16.0 - 1.0
        } else {
            let fine = u16::from_le_bytes([self.byte(), self.byte()]);
            f64::from(fine) / 32768.0 - 1.0
        }
    }

    /// Mostly [`Self::small`], at times a number at an edge.
    pub(crate) fn number(&mut self) -> f64 {
        let byte = self.byte();
        if byte < 8 { EDGES[self.below(EDGES.len())] } else { self.small() }
    }

    pub(crate) fn point(&mut self) -> [f64; 3] {
        [self.number(), self.number(), self.number()]
    }

    pub(crate) fn small_point(&mut self) -> [f64; 3] {
        [self.small(), self.small(), self.small()]
    }
}
