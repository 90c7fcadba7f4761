//! Numbers of a legacy `.vtk` file: words in ASCII, big-endian bytes in binary.

use std::io::Read;

use super::super::tokens::{ReadError, Tokens, quoted, syntax};

/// Data types of the format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    Bit,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
    Text,
}

impl Scalar {
    fn of(name: &str) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_str() {
            "bit" => Self::Bit,
            "char" | "signed_char" | "vtktypeint8" => Self::I8,
            "unsigned_char" | "vtktypeuint8" => Self::U8,
            "short" | "vtktypeint16" => Self::I16,
            "unsigned_short" | "vtktypeuint16" => Self::U16,
            // vtkIdType is written as int, whatever its size in memory.
            "int" | "vtktypeint32" | "vtkidtype" => Self::I32,
            "unsigned_int" | "vtktypeuint32" => Self::U32,
            "long" | "long_long" | "vtktypeint64" => Self::I64,
            "unsigned_long" | "unsigned_long_long" | "vtktypeuint64" => Self::U64,
            "float" | "vtktypefloat32" => Self::F32,
            "double" | "vtktypefloat64" => Self::F64,
            "string" | "utf8_string" => Self::Text,
            _ => return None,
        })
    }

    fn size(self) -> u64 {
        match self {
            Self::Bit | Self::I8 | Self::U8 | Self::Text => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    pub(super) fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64 | Self::Text | Self::Bit)
    }
}

/// The file as a sequence of words and numbers.
pub(super) struct Values<R> {
    pub(super) tokens: Tokens<R>,
    pub(super) binary: bool,
}

impl<R: Read> Values<R> {
    /// The next word, which must exist.
    pub(super) fn word(&mut self, expected: &str) -> Result<String, ReadError> {
        match self.tokens.next()? {
            Some(word) => Ok(word.to_owned()),
            None => syntax(format!("expected {expected}, found the end of the file")),
        }
    }

    /// A count after a keyword.
    pub(super) fn count(&mut self, keyword: &str) -> Result<usize, ReadError> {
        let word = self.word(&format!("a count after {keyword}"))?;
        match word.parse() {
            Ok(count) => Ok(count),
            Err(_) => syntax(format!("{keyword}: expected a count, found {}", quoted(&word))),
        }
    }

    /// The name of a data type.
    pub(super) fn scalar_type(&mut self) -> Result<Scalar, ReadError> {
        let word = self.word("a data type such as `double`")?;
        match Scalar::of(&word) {
            Some(scalar) => Ok(scalar),
            None => {
                syntax(format!("expected a data type such as `double`, found {}", quoted(&word)))
            }
        }
    }

    /// Ends the keyword line: in a binary file the data begin right after it.
    pub(super) fn begin_data(&mut self) -> Result<(), ReadError> {
        if self.binary {
            self.tokens.rest_of_line()?;
        }
        Ok(())
    }

    /// How many groups of `width` values to reserve room for, `count` being announced.
    pub(super) fn plausible(&self, count: usize, width: u64, scalar: Scalar) -> usize {
        self.tokens.plausible(count, width * if self.binary { scalar.size() } else { 2 })
    }

    /// The next number of a data section.
    pub(super) fn float(
        &mut self,
        scalar: Scalar,
        whose: impl FnOnce() -> String,
    ) -> Result<f64, ReadError> {
        if !self.binary {
            return self.tokens.number("a number", whose);
        }
        Ok(match scalar {
            Scalar::F32 => f32::from_be_bytes(self.tokens.bytes()?).into(),
            Scalar::F64 => f64::from_be_bytes(self.tokens.bytes()?),
            _ => self.integer(scalar, whose)? as f64,
        })
    }

    /// The next whole number of a data section.
    pub(super) fn integer(
        &mut self,
        scalar: Scalar,
        whose: impl FnOnce() -> String,
    ) -> Result<i64, ReadError> {
        if !self.binary {
            return self.tokens.number("a whole number", whose);
        }
        Ok(match scalar {
            Scalar::I8 => i8::from_be_bytes(self.tokens.bytes()?).into(),
            Scalar::U8 => u8::from_be_bytes(self.tokens.bytes()?).into(),
            Scalar::I16 => i16::from_be_bytes(self.tokens.bytes()?).into(),
            Scalar::U16 => u16::from_be_bytes(self.tokens.bytes()?).into(),
            Scalar::I32 => i32::from_be_bytes(self.tokens.bytes()?).into(),
            Scalar::U32 => u32::from_be_bytes(self.tokens.bytes()?).into(),
            Scalar::I64 => i64::from_be_bytes(self.tokens.bytes()?),
            Scalar::U64 => u64::from_be_bytes(self.tokens.bytes()?).try_into().unwrap_or(i64::MAX),
            Scalar::F32 | Scalar::F64 | Scalar::Bit | Scalar::Text => {
                return syntax(format!("{}: expected a whole-number data type", whose()));
            }
        })
    }

    /// Skips `count` values.
    pub(super) fn skip(&mut self, count: usize, scalar: Scalar) -> Result<(), ReadError> {
        match (self.binary, scalar) {
            (true, Scalar::Bit) => self.tokens.skip_bytes((count as u64).div_ceil(8)),
            (true, Scalar::Text) => (0..count).try_for_each(|_| self.skip_binary_text()),
            (true, _) => self.tokens.skip_bytes((count as u64).saturating_mul(scalar.size())),
            (false, Scalar::Text) => {
                self.tokens.rest_of_line()?;
                (0..count).try_for_each(|_| match self.tokens.rest_of_line()? {
                    Some(_) => Ok(()),
                    None => syntax("the file ends in the middle of a string array"),
                })
            }
            (false, _) => (0..count).try_for_each(|_| self.word("a number").map(drop)),
        }
    }

    /// A text is led by its length, whose own width is in its two highest bits.
    fn skip_binary_text(&mut self) -> Result<(), ReadError> {
        let [first] = self.tokens.bytes()?;
        let head = u64::from(first & 0x3f);
        let length = match first >> 6 {
            3 => head,
            2 => head << 8 | u64::from(self.tokens.bytes::<1>()?[0]),
            1 => {
                let [b, c, d] = self.tokens.bytes()?;
                head << 24 | u64::from(u32::from_be_bytes([0, b, c, d]))
            }
            _ => {
                let [b, c, d, e, f, g, h] = self.tokens.bytes()?;
                head << 56 | u64::from_be_bytes([0, b, c, d, e, f, g, h])
            }
        };
        self.tokens.skip_bytes(length)
    }
}
