//! Entries and their values: numbers, and words of a few.

use super::diagnostic::Span;
use super::lexer::Token;
use super::near::near_miss;
use super::parser::{Parser, is_entry, is_keyword};

/// That no entry of an element may come more than once.
pub(super) const NONE_AGAIN: &[&str] = &[];

/// A word that is meant as a number, right or wrong.
pub(super) fn looks_numeric(word: &str) -> bool {
    let digits = word.trim_start_matches(['+', '-', '.']);
    digits.starts_with(|c: char| c.is_ascii_digit())
}

impl Parser<'_> {
    /// The numbers after `keyword`: exactly `N`, all finite; `None` when reported.
    pub(super) fn numbers<const N: usize>(
        &mut self,
        keyword: &str,
        span: Span,
    ) -> Option<[f64; N]> {
        let mut values = Vec::new();
        let (mut last, mut sound) = (span, true);
        while let Some(word) = self.peek_word().filter(|word| looks_numeric(word)) {
            let parsed = word.parse::<f64>();
            let (found, here) = (self.found(), self.peek().1);
            match parsed {
                Ok(value) if value.is_finite() => values.push(value),
                Ok(_) => {
                    self.error(here, format!("{found} is larger than any number here may be"));
                    sound = false;
                }
                Err(_) => {
                    self.error(here, format!("{found} is not a number"));
                    sound = false;
                }
            }
            last = self.advance();
        }
        if !sound {
            return None;
        }
        let count = values.len();
        if let Ok(values) = values.try_into() {
            return Some(values);
        }
        let takes = if N == 1 { "one number".to_owned() } else { format!("{N} numbers") };
        let found = if count == 0 { self.found() } else { count.to_string() };
        self.error(span.to(last), format!("{keyword} takes {takes}, found {found}"));
        // A word in the place of the number must not be an error of its own.
        if count == 0 && self.peek_word().is_some_and(|word| !is_entry(word) && !is_keyword(word)) {
            self.advance();
        }
        None
    }

    /// One number that must fulfil `valid`.
    pub(super) fn checked(
        &mut self,
        keyword: &str,
        span: Span,
        valid: impl Fn(f64) -> bool,
        range: &str,
    ) -> Option<f64> {
        let here = self.peek().1;
        let [value] = self.numbers::<1>(keyword, span)?;
        if valid(value) {
            return Some(value);
        }
        self.error(here, format!("{keyword} must be {range}, found {value}"));
        None
    }

    pub(super) fn positive(&mut self, keyword: &str, span: Span) -> Option<f64> {
        self.checked(keyword, span, |value| value > 0.0, "greater than 0")
    }

    pub(super) fn not_negative(&mut self, keyword: &str, span: Span) -> Option<f64> {
        self.checked(keyword, span, |value| value >= 0.0, "0 or more")
    }

    /// The entries of an element, with or without brackets around them.
    ///
    /// Each goes to `take` with its place; those of `repeatable` may come more than once.
    pub(super) fn entries(
        &mut self,
        element: &str,
        element_span: Span,
        allowed: &[&'static str],
        repeatable: &[&str],
        mut take: impl FnMut(&mut Self, &'static str, Span),
    ) {
        let opening = self.open_optional();
        let mut seen: Vec<&str> = Vec::new();
        let errors_before = self.errors_so_far();
        loop {
            let span = self.peek().1;
            let word = match (self.peek().0, opening) {
                (Token::Close(_), Some(opening)) => {
                    self.close_bracket(opening);
                    break;
                }
                (Token::End, Some(opening)) => {
                    self.unclosed(opening);
                    break;
                }
                (Token::Word(word), Some(opening)) if is_keyword(word) => {
                    self.unclosed(opening);
                    break;
                }
                (Token::Word(word), None) if is_keyword(word) => break,
                (Token::Close(_) | Token::End, None) => break,
                (Token::Word(word), _) => word.clone(),
                (Token::Open(_) | Token::Quoted(_), _) => {
                    let (found, expected) = (self.found(), allowed.join(", "));
                    self.error(
                        span,
                        format!("expected one of {expected} in {element}, found {found}"),
                    );
                    self.skip_to_element();
                    continue;
                }
            };
            let known = allowed.iter().find(|entry| **entry == word).copied();
            let keyword = known.or_else(|| near_miss(&word, allowed));
            if known.is_none() {
                // After an element without brackets, the next element may be what is misspelt.
                if opening.is_none() && keyword.is_none() && !looks_numeric(&word) {
                    break;
                }
                self.unknown(span, &word, &allowed.join(", "), keyword);
            }
            self.advance();
            let Some(keyword) = keyword else {
                self.skip_values(allowed);
                continue;
            };
            if seen.contains(&keyword) && !repeatable.contains(&keyword) {
                self.error(
                    span,
                    format!("a second {keyword} in this {element}; it may stand once"),
                );
            }
            seen.push(keyword);
            take(self, keyword, span);
        }
        if opening.is_none() && seen.is_empty() && self.errors_so_far() == errors_before {
            let (found, expected) = (self.found(), allowed.join(", "));
            self.error(
                element_span,
                format!("{element} is followed by `{{` or by one of {expected}, found {found}"),
            );
        }
    }

    /// Skips what an unknown entry may have been followed by.
    fn skip_values(&mut self, allowed: &[&str]) {
        while let Some(word) = self.peek_word() {
            if is_keyword(word) || allowed.contains(&word) {
                return;
            }
            self.advance();
        }
    }

    /// One of a few words.
    pub(super) fn choice(
        &mut self,
        keyword: &str,
        allowed: &[&'static str],
    ) -> Option<&'static str> {
        let (found, span) = (self.found(), self.peek().1);
        let word = self.peek_word().unwrap_or_default().to_owned();
        let choice = allowed.iter().find(|choice| **choice == word).copied();
        if choice.is_some() {
            self.advance();
            return choice;
        }
        let choices = match allowed {
            [first, second] => format!("{first} or {second}"),
            _ => format!("one of {}", allowed.join(", ")),
        };
        let message = format!("{keyword} is {choices}, found {found}");
        match near_miss(&word, allowed) {
            Some(meant) => {
                self.error_with_hint(span, message, format!("{word}: did you mean {meant}?"));
            }
            None => self.error(span, message),
        }
        if !word.is_empty() && !is_keyword(&word) {
            self.advance();
        }
        None
    }
}
