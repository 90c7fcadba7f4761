//! Words of a mesh file, read through a small window.

use std::io::{self, Read};
use std::str::FromStr;

/// Longer words mean that the file is no text at all.
const LONGEST_WORD: usize = 4096;
const WINDOW: usize = 64 * 1024;

/// Why a file could not be read on.
#[derive(Debug, thiserror::Error)]
pub(super) enum ReadError {
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Wrong content; the line is that of the word that was read last.
    #[error("{0}")]
    Syntax(String),
}

/// Shorthand for a syntax error.
pub(super) fn syntax<T>(message: impl Into<String>) -> Result<T, ReadError> {
    Err(ReadError::Syntax(message.into()))
}

/// A word as an error shows it: in backticks, shortened.
pub(super) fn quoted(word: &str) -> String {
    match word.char_indices().nth(40) {
        Some((end, _)) => format!("`{}...`", &word[..end]),
        None => format!("`{word}`"),
    }
}

/// How words are separated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Style {
    /// Blanks and line ends.
    Blanks,
    /// Blanks, commas and line ends; `//` starts a comment.
    BlanksCommasComments,
}

/// Splits a stream into words, counting lines; also reads the raw bytes between words.
pub(super) struct Tokens<R> {
    reader: R,
    style: Style,
    window: Vec<u8>,
    start: usize,
    end: usize,
    finished: bool,
    line: usize,
    word_line: usize,
    unread: u64,
}

impl<R: Read> Tokens<R> {
    /// `size` is the length of the stream in bytes; it bounds what a count in the file may reserve.
    pub(super) fn new(reader: R, size: u64, style: Style) -> Self {
        Self {
            reader,
            style,
            window: vec![0; WINDOW],
            start: 0,
            end: 0,
            finished: false,
            line: 1,
            word_line: 1,
            unread: size,
        }
    }

    /// The line (from 1) of the word that was read last.
    pub(super) fn word_line(&self) -> usize {
        self.word_line
    }

    /// How many items of at least `bytes_each` bytes the rest of the file can hold, at most `count`.
    pub(super) fn plausible(&self, count: usize, bytes_each: u64) -> usize {
        let rest = self.unread + (self.end - self.start) as u64;
        count.min((rest / bytes_each) as usize + 1)
    }

    /// Reads more, keeping what is between `start` and `end`; false at the end of the stream.
    fn refill(&mut self) -> io::Result<bool> {
        if self.start > 0 {
            self.window.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        while !self.finished && self.end < self.window.len() {
            match self.reader.read(&mut self.window[self.end..]) {
                Ok(0) => self.finished = true,
                Ok(count) => {
                    self.end += count;
                    self.unread = self.unread.saturating_sub(count as u64);
                    return Ok(true);
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(false)
    }

    fn peek_byte(&mut self) -> io::Result<Option<u8>> {
        if self.start == self.end && !self.refill()? {
            return Ok(None);
        }
        Ok(Some(self.window[self.start]))
    }

    fn skip_separators(&mut self) -> io::Result<()> {
        while let Some(byte) = self.peek_byte()? {
            match byte {
                b'\n' => self.line += 1,
                b' ' | b'\t' | b'\r' | 0x0b | 0x0c => {}
                b',' if self.style == Style::BlanksCommasComments => {}
                b'/' if self.starts_comment()? => {
                    self.skip_comment()?;
                    continue;
                }
                _ => return Ok(()),
            }
            self.start += 1;
        }
        Ok(())
    }

    fn starts_comment(&mut self) -> io::Result<bool> {
        if self.style != Style::BlanksCommasComments {
            return Ok(false);
        }
        if self.end - self.start < 2 {
            self.refill()?;
        }
        Ok(self.window[self.start..self.end].starts_with(b"//"))
    }

    fn skip_comment(&mut self) -> io::Result<()> {
        while let Some(byte) = self.peek_byte()? {
            if byte == b'\n' {
                break;
            }
            self.start += 1;
        }
        Ok(())
    }

    fn ends_word(&self, at: usize) -> bool {
        let separates = |byte: u8| matches!(byte, b' ' | b'\n' | b'\t' | b'\r' | 0x0b | 0x0c);
        separates(self.window[at])
            || self.style == Style::BlanksCommasComments
                && (self.window[at] == b',' || self.window[at..self.end].starts_with(b"//"))
    }

    /// The next word; `None` at the end of the file.
    pub(super) fn next(&mut self) -> Result<Option<&str>, ReadError> {
        self.skip_separators()?;
        self.word_line = self.line;
        let mut length = 0;
        loop {
            if self.start + length >= self.end {
                let more = length <= LONGEST_WORD && self.refill()?;
                if !more {
                    break;
                }
            }
            // A slash at the window's edge may begin a comment: look one byte further.
            if self.window[self.start + length] == b'/' && self.start + length + 1 == self.end {
                self.refill()?;
            }
            if self.ends_word(self.start + length) {
                break;
            }
            length += 1;
        }
        if length > LONGEST_WORD {
            return syntax("this is no text file: a word has more than 4096 bytes");
        }
        if length == 0 {
            return Ok(None);
        }
        let word = &self.window[self.start..self.start + length];
        self.start += length;
        match std::str::from_utf8(word) {
            Ok(word) => Ok(Some(word)),
            Err(_) => syntax("this is no text file: found bytes that are not UTF-8"),
        }
    }

    /// The next word as a number; `expected` and `whose` it is are for the error.
    pub(super) fn number<T: FromStr>(
        &mut self,
        expected: &str,
        whose: impl FnOnce() -> String,
    ) -> Result<T, ReadError> {
        let found = match self.next()? {
            Some(word) => match word.parse() {
                Ok(value) => return Ok(value),
                Err(_) => quoted(word),
            },
            None => "the end of the file".to_owned(),
        };
        syntax(format!("{}: expected {expected}, found {found}", whose()))
    }

    /// The rest of the current line, without its end; `None` at the end of the file.
    pub(super) fn rest_of_line(&mut self) -> Result<Option<String>, ReadError> {
        self.word_line = self.line;
        let mut bytes = Vec::new();
        if self.peek_byte()?.is_none() {
            return Ok(None);
        }
        while let Some(byte) = self.peek_byte()? {
            self.start += 1;
            if byte == b'\n' {
                self.line += 1;
                break;
            }
            if bytes.len() > LONGEST_WORD {
                return syntax("this is no text file: a line has more than 4096 bytes");
            }
            bytes.push(byte);
        }
        if bytes.last() == Some(&b'\r') {
            bytes.pop();
        }
        Ok(Some(String::from_utf8_lossy(&bytes).into_owned()))
    }

    /// The next `N` raw bytes.
    pub(super) fn bytes<const N: usize>(&mut self) -> Result<[u8; N], ReadError> {
        while self.end - self.start < N {
            if !self.refill()? {
                return syntax("the file ends in the middle of binary data");
            }
        }
        let mut bytes = [0; N];
        bytes.copy_from_slice(&self.window[self.start..self.start + N]);
        self.start += N;
        Ok(bytes)
    }

    /// Skips raw bytes.
    pub(super) fn skip_bytes(&mut self, mut count: u64) -> Result<(), ReadError> {
        while count > 0 {
            if self.peek_byte()?.is_none() {
                return syntax("the file ends in the middle of binary data");
            }
            let step = count.min((self.end - self.start) as u64);
            self.start += step as usize;
            count -= step;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hands out one byte at a time, so that every word crosses the edge of what was read.
    struct Trickle<'a>(&'a [u8]);

    impl Read for Trickle<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let Some((first, rest)) = self.0.split_first() else { return Ok(0) };
            buffer[0] = *first;
            self.0 = rest;
            Ok(1)
        }
    }

    fn words(text: &str, style: Style) -> Vec<(usize, String)> {
        let mut tokens = Tokens::new(Trickle(text.as_bytes()), text.len() as u64, style);
        let mut words = Vec::new();
        while let Some(word) = tokens.next().unwrap().map(str::to_owned) {
            words.push((tokens.word_line(), word));
        }
        words
    }

    #[test]
    fn comments_commas_and_line_ends_separate_words() {
        let found = words("a,b // c d\r\n\n e/f//g\n//h\n/i", Style::BlanksCommasComments);
        let expected = [(1, "a"), (1, "b"), (3, "e/f"), (5, "/i")];
        assert_eq!(found, expected.map(|(line, word)| (line, word.to_owned())));
        assert_eq!(words("a,b//c", Style::Blanks), [(1, "a,b//c".to_owned())]);
    }

    #[test]
    fn words_longer_than_any_number_or_name_are_refused() {
        let text = "x".repeat(100_000);
        let mut tokens = Tokens::new(text.as_bytes(), 100_000, Style::Blanks);
        assert!(matches!(tokens.next(), Err(ReadError::Syntax(_))));
    }

    #[test]
    fn raw_bytes_follow_the_line() {
        let mut tokens = Tokens::new(Trickle(b"DATA 2\n\x00\x0a\x0b\x0cEND"), 15, Style::Blanks);
        assert_eq!(tokens.rest_of_line().unwrap().unwrap(), "DATA 2");
        assert_eq!(tokens.bytes::<2>().unwrap(), [0, 10]);
        tokens.skip_bytes(2).unwrap();
        assert_eq!(tokens.next().unwrap(), Some("END"));
        assert!(tokens.skip_bytes(1).is_err());
    }
}
