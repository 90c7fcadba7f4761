//! Strokes of a blade in a text file: line by line, `//` for comments.

use std::io;
use std::path::Path;

use palpate_geometry::Point;

use super::{Blade, BladeError};

/// One stroke of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Stroke {
    /// When it happens.
    pub when: When,
    /// The surface that it cuts along.
    pub blade: Blade,
    /// The line of the file where it begins, from 1.
    pub line: usize,
}

/// When a stroke happens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum When {
    /// Before the first step that begins at this time [s] or later.
    Time(f64),
    /// Before this step, counted from 0.
    Step(u64),
}

/// Why a file of strokes could not be read: file, line and cause.
#[derive(Debug)]
pub struct BladeFileError {
    name: String,
    line: Option<usize>,
    cause: BladeFileErrorCause,
}

/// What is wrong with a file of strokes.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BladeFileErrorCause {
    /// The operating system refused.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// The text is not in the format.
    #[error("{0}")]
    Syntax(String),
    /// The numbers do not make a blade.
    #[error("{0}")]
    Blade(#[from] BladeError),
}

impl BladeFileError {
    /// The file, as it was named.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The line, from 1; none where the file could not be opened.
    pub fn line(&self) -> Option<usize> {
        self.line
    }

    /// What is wrong.
    pub fn cause(&self) -> &BladeFileErrorCause {
        &self.cause
    }
}

impl std::fmt::Display for BladeFileError {
    /// `open.blade:3: expected 6 numbers ...`.
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "{}:", self.name)?;
        if let Some(line) = self.line {
            write!(out, "{line}:")?;
        }
        write!(out, " {}", self.cause)
    }
}

impl std::error::Error for BladeFileError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.cause)
    }
}

/// Reads a file of strokes; see [`parse_strokes`].
///
/// # Errors
/// If the file cannot be read or is not in the format; the error names file and line.
pub fn read_strokes(path: &Path) -> Result<Vec<Stroke>, BladeFileError> {
    let name = path.display().to_string();
    match std::fs::read_to_string(path) {
        Ok(text) => parse_strokes(&text, &name),
        Err(error) => Err(BladeFileError { name, line: None, cause: error.into() }),
    }
}

/// Reads the text of a file of strokes, in the order in which they stand; `name` is for errors.
///
/// ```
/// let text = "
/// blade 1
/// stroke at 0.2 s            // an edge from place to place: heel, tip [m]
///   0 0 0.02     0 0 -0.01
///   0.01 0 0.02  0.01 0 -0.01
/// plane at step 30           // a point, a normal, and the edge length if not all of it
///   0 0 0.01  0 0 1  0.04
/// loop at 0.5 s              // points round a closed line
///   0 0 0
///   0.01 0 0
///   0 0.01 0
/// ";
/// let strokes = palpate_cutting::parse_strokes(text, "example.blade")?;
/// assert_eq!(strokes.len(), 3);
/// assert_eq!(strokes[1].when, palpate_cutting::When::Step(30));
/// # Ok::<(), palpate_cutting::BladeFileError>(())
/// ```
///
/// # Errors
/// If the text is not in the format or a stroke makes no blade; the error names the line.
pub fn parse_strokes(text: &str, name: &str) -> Result<Vec<Stroke>, BladeFileError> {
    parse(text).map_err(|(line, cause)| BladeFileError {
        name: name.to_owned(),
        line: Some(line),
        cause,
    })
}

type Located<T> = Result<T, (usize, BladeFileErrorCause)>;

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Stroke,
    Plane,
    Loop,
}

/// A stroke as far as it was read.
struct Open {
    kind: Kind,
    when: When,
    line: usize,
    rows: Vec<Vec<f64>>,
}

fn syntax<T>(line: usize, message: impl Into<String>) -> Located<T> {
    Err((line, BladeFileErrorCause::Syntax(message.into())))
}

fn parse(text: &str) -> Located<Vec<Stroke>> {
    let mut strokes = Vec::new();
    let mut open: Option<Open> = None;
    let mut has_version = false;
    let mut last = 1;
    for (place, row) in text.lines().enumerate() {
        let line = place + 1;
        let content = row.split("//").next().unwrap_or_default();
        let is_separator = |c: char| c.is_whitespace() || c == ',';
        let words: Vec<&str> =
            content.split(is_separator).filter(|word| !word.is_empty()).collect();
        let Some(&first) = words.first() else {
            continue;
        };
        last = line;
        if !has_version {
            if words != ["blade", "1"] {
                return syntax(line, "a file of strokes begins with the line `blade 1`");
            }
            has_version = true;
        } else if first.starts_with(|c: char| c.is_ascii_alphabetic()) && !is_number(first) {
            strokes.extend(open.take().as_ref().map(finish).transpose()?);
            open = Some(head(&words, line)?);
        } else {
            let Some(open) = &mut open else {
                return syntax(line, "numbers before the first `stroke`, `plane` or `loop`");
            };
            let row = numbers(&words, line)?;
            check_row(open, &row, line)?;
            open.rows.push(row);
        }
    }
    strokes.extend(open.as_ref().map(finish).transpose()?);
    if !has_version {
        return syntax(last, "a file of strokes begins with the line `blade 1`");
    }
    if strokes.is_empty() {
        return syntax(last, "no stroke; give at least one `stroke`, `plane` or `loop`");
    }
    Ok(strokes)
}

/// `inf` and `nan` begin with a letter, too.
fn is_number(word: &str) -> bool {
    word.parse::<f64>().is_ok()
}

/// `stroke at 0.2 s` or `plane at step 30`.
fn head(words: &[&str], line: usize) -> Located<Open> {
    let kind = match words[0] {
        "stroke" => Kind::Stroke,
        "plane" => Kind::Plane,
        "loop" => Kind::Loop,
        other => {
            return syntax(line, format!("`{other}` is no kind of cut: stroke, plane or loop"));
        }
    };
    let when = match words[1..] {
        ["at", "step", step] => step.parse().ok().map(When::Step),
        ["at", time, "s"] => {
            let time = time.parse().ok().filter(|time: &f64| *time >= 0.0 && time.is_finite());
            time.map(When::Time)
        }
        _ => None,
    };
    let Some(when) = when else {
        let kind = words[0];
        return syntax(line, format!("say when: `{kind} at 0.2 s` or `{kind} at step 30`"));
    };
    Ok(Open { kind, when, line, rows: Vec::new() })
}

fn numbers(words: &[&str], line: usize) -> Located<Vec<f64>> {
    let mut row = Vec::with_capacity(words.len());
    for word in words {
        match word.parse::<f64>() {
            Ok(value) if value.is_finite() => row.push(value),
            Ok(_) => return syntax(line, format!("`{word}` is not finite")),
            Err(_) => return syntax(line, format!("`{word}` is no number")),
        }
    }
    Ok(row)
}

fn check_row(open: &Open, row: &[f64], line: usize) -> Located<()> {
    let (what, counts): (_, &[usize]) = match open.kind {
        Kind::Stroke => ("6 numbers, heel and tip of the edge [m]", &[6]),
        Kind::Plane => ("6 or 7 numbers: a point [m], a normal, and a size [m] if any", &[6, 7]),
        Kind::Loop => ("3 numbers, a point of the loop [m]", &[3]),
    };
    if !counts.contains(&row.len()) {
        return syntax(line, format!("{} numbers; expected {what}", row.len()));
    }
    if open.kind == Kind::Plane && !open.rows.is_empty() {
        return syntax(line, "a plane has one line of numbers");
    }
    Ok(())
}

fn finish(open: &Open) -> Located<Stroke> {
    let point =
        |row: &[f64], first: usize| -> Point { [row[first], row[first + 1], row[first + 2]] };
    let rows = &open.rows;
    let blade = match (open.kind, rows.first()) {
        (Kind::Stroke, _) => {
            let edges: Vec<_> = rows.iter().map(|row| [point(row, 0), point(row, 3)]).collect();
            Blade::stroke(&edges)
        }
        (Kind::Loop, _) => {
            let points: Vec<_> = rows.iter().map(|row| point(row, 0)).collect();
            Blade::closed_loop(&points)
        }
        (Kind::Plane, Some(row)) => Blade::plane(point(row, 0), point(row, 3), row.get(6).copied()),
        (Kind::Plane, None) => return syntax(open.line, "the plane has no line of numbers"),
    };
    match blade {
        Ok(blade) => Ok(Stroke { when: open.when, blade, line: open.line }),
        Err(error) => Err((open.line, error.into())),
    }
}
