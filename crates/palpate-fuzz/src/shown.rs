//! How a value is shown, to be compared: values with NaN are not equal to themselves, their text is.

use std::fmt::{self, Debug, Write};
use std::hash::{DefaultHasher, Hasher};

/// The text of a value without its bulk: its beginning, and a hash of all.
#[derive(PartialEq)]
pub(crate) struct Shown {
    beginning: String,
    hash: u64,
}

/// Characters kept for a message.
const KEPT: usize = 2000;

impl Shown {
    pub(crate) fn new(value: &impl Debug) -> Self {
        let mut text = Text { beginning: String::new(), hasher: DefaultHasher::new() };
        // Only `write_str` below could fail.
        let _ = write!(text, "{value:?}");
        Self { beginning: text.beginning, hash: text.hasher.finish() }
    }
}

impl Debug for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (hash {:x})", self.beginning, self.hash)
    }
}

struct Text {
    beginning: String,
    hasher: DefaultHasher,
}

impl Write for Text {
    fn write_str(&mut self, piece: &str) -> fmt::Result {
        let room = KEPT.saturating_sub(self.beginning.len());
        self.beginning.extend(piece.chars().take(room));
        self.hasher.write(piece.as_bytes());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn not_a_number_is_equal_to_itself_and_the_last_of_many_counts() {
        assert_eq!(Shown::new(&f64::NAN), Shown::new(&f64::NAN));
        let mut many = vec![0; 10_000];
        let before = Shown::new(&many);
        assert_eq!(before, Shown::new(&many));
        many[9_999] = 1;
        assert_ne!(before, Shown::new(&many));
    }
}
