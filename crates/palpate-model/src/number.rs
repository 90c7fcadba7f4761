//! Numbers as text that reads back to the same bits.

use std::fmt;

/// The shortest decimal that reads back to the same `f64`.
pub(crate) struct Shortest(pub(crate) f64);

impl fmt::Display for Shortest {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Digits between 1e-5 and 1e16, an exponent beyond: never hundreds of zeros.
        if self.0 == 0.0 || (1e-5..1e16).contains(&self.0.abs()) {
            write!(out, "{}", self.0)
        } else {
            write!(out, "{:e}", self.0)
        }
    }
}

/// Three numbers with commas between them.
pub(crate) struct Triple(pub(crate) [f64; 3]);

impl fmt::Display for Triple {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.0.map(Shortest);
        write!(out, "{x},{y},{z}")
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn numbers_are_short() {
        let text = |value| Shortest(value).to_string();
        assert_eq!([2.0, -2.5, 1e-7, 1e300, -0.0].map(text), ["2", "-2.5", "1e-7", "1e300", "-0"]);
    }

    proptest! {
        #[test]
        fn every_finite_number_reads_back_to_its_bits(value in proptest::num::f64::ANY) {
            prop_assume!(value.is_finite());
            let back: f64 = Shortest(value).to_string().parse().unwrap();
            prop_assert_eq!(back.to_bits(), value.to_bits());
        }
    }
}
