//! Other inputs out of known ones.

use palpate_testing::Random;

/// Longest input that is made.
const LONGEST: usize = 20_000;

/// Numbers where formats and arithmetic have edges, as texts have them.
const NUMBERS: [&str; 24] = [
    "0",
    "-0",
    "1",
    "-1",
    "2",
    "0.5",
    "NaN",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e-308",
    "5e-324",
    "1e154",
    "1e-160",
    "1e999",
    "255",
    "256",
    "2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775808",
    "18446744073709551615",
    "1e16",
];

/// A few changes of one of `pool`; `words` are what its language knows.
pub(crate) fn mutated(pool: &[Vec<u8>], words: &[&str], random: &mut Random) -> Vec<u8> {
    let mut bytes = random.of(pool).clone();
    for _ in 0..=random.below(6) {
        change(&mut bytes, pool, words, random);
        bytes.truncate(LONGEST);
    }
    bytes
}

fn change(bytes: &mut Vec<u8>, pool: &[Vec<u8>], words: &[&str], random: &mut Random) {
    let at = random.below(bytes.len());
    let power = random.below(8);
    let length = 1 + random.below(1 << power);
    let span = at..(at + length).min(bytes.len());
    match random.below(14) {
        0 if !bytes.is_empty() => bytes[at] ^= 1 << random.below(8),
        1 if !bytes.is_empty() => bytes[at] = random.bits() as u8,
        2 => drop(bytes.drain(span)),
        3 => {
            let part = bytes[span].to_vec();
            let to = random.below(bytes.len());
            bytes.splice(to..to, part);
        }
        4 => {
            let other = random.of(pool);
            let from = random.below(other.len());
            let part = other[from..(from + length).min(other.len())].to_vec();
            bytes.splice(span, part);
        }
        5 => {
            let other = random.of(pool);
            bytes.truncate(at);
            bytes.extend_from_slice(&other[random.below(other.len())..]);
        }
        6 => bytes.truncate(at),
        7 | 8 => {
            let word = word_at(bytes, at);
            bytes.splice(word, random.of(&NUMBERS).bytes());
        }
        9 if !words.is_empty() => {
            let word = word_at(bytes, at);
            bytes.splice(word, random.of(words).bytes());
        }
        10 if !words.is_empty() => {
            let word = [b" ", random.of(words).as_bytes(), b" "].concat();
            bytes.splice(at..at, word);
        }
        11 => {
            // A line once more, or moved.
            let line = line_at(bytes, at);
            let text = bytes[line.clone()].to_vec();
            if random.below(2) == 0 {
                bytes.drain(line);
            }
            let to = line_at(bytes, random.below(bytes.len())).start;
            bytes.splice(to..to, text);
        }
        _ => {
            let number = match random.below(4) {
                0 => [0, 1, u64::MAX, 1 << 31, u64::from(u32::MAX), 1 << 63][random.below(6)],
                1 => {
                    [f64::NAN, f64::INFINITY, 1e308, 5e-324, -0.0, 1e154][random.below(6)].to_bits()
                }
                2 => u64::from([f32::NAN, f32::INFINITY, 1e38, 1e-45][random.below(4)].to_bits()),
                _ => random.bits(),
            };
            let count = *random.of(&[1, 2, 4, 8]);
            let raw = if random.below(2) == 0 {
                number.to_le_bytes()[..count].to_vec()
            } else {
                number.to_be_bytes()[8 - count..].to_vec()
            };
            let end = (at + count).min(bytes.len());
            bytes.splice(at..end, raw);
        }
    }
}

/// The word around a place.
fn word_at(bytes: &[u8], at: usize) -> std::ops::Range<usize> {
    let is_part = |byte: &u8| byte.is_ascii_alphanumeric() || b"+-._".contains(byte);
    let start = bytes[..at].iter().rposition(|byte| !is_part(byte)).map_or(0, |place| place + 1);
    let length = bytes[at..].iter().position(|byte| !is_part(byte));
    start..length.map_or(bytes.len(), |length| at + length)
}

/// The line around a place, with its end.
fn line_at(bytes: &[u8], at: usize) -> std::ops::Range<usize> {
    let start = bytes[..at].iter().rposition(|&byte| byte == b'\n').map_or(0, |place| place + 1);
    let length = bytes[at..].iter().position(|&byte| byte == b'\n');
    start..length.map_or(bytes.len(), |length| at + length + 1)
}
