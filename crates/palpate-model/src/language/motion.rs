//! Where a body stands and how a rigid one moves: ME and RG.

use super::diagnostic::Span;
use super::document::{PathKey, Rotation, Transform};
use super::near::near_miss;
use super::parser::Parser;
use super::values::{NONE_AGAIN, looks_numeric};

/// How far the length of a quaternion may be off 1.
const QUATERNION_TOLERANCE: f64 = 1e-3;

impl Parser<'_> {
    pub(super) fn transform(&mut self, span: Span) -> Transform {
        let mut transform = Transform::default();
        self.entries(
            "ME",
            span,
            &["trans", "rot", "scale"],
            NONE_AGAIN,
            |parser, keyword, span| match keyword {
                "trans" => {
                    if let Some(value) = parser.numbers("trans", span) {
                        transform.translation = value;
                    }
                }
                "rot" => transform.rotation = parser.rotation(span).unwrap_or_default(),
                _ => {
                    if let Some(value) = parser.scale(span) {
                        transform.scale = value;
                    }
                }
            },
        );
        transform
    }

    fn scale(&mut self, span: Span) -> Option<[f64; 3]> {
        let scale = self.numbers::<3>("scale", span)?;
        if scale.contains(&0.0) {
            let hint = "write 1 for an axis that keeps its size";
            self.error_with_hint(span, "a scale of 0 flattens the body", hint);
            return None;
        }
        Some(scale)
    }

    fn rotation(&mut self, span: Span) -> Option<Rotation> {
        let word = self.peek_word().unwrap_or_default().to_owned();
        if !looks_numeric(&word) && near_miss(&word, &["axis"]).is_some() {
            let here = self.advance();
            if word != "axis" {
                self.unknown(here, &word, "axis", Some("axis"));
            }
            return self.axis_and_angle(here);
        }
        let quaternion = self.numbers::<4>("rot", span)?;
        let length = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
        if (length - 1.0).abs() <= QUATERNION_TOLERANCE {
            return Some(Rotation::Quaternion(quaternion));
        }
        self.error_with_hint(
            span,
            format!("rot w,x,y,z is a quaternion of length 1, found length {length:.4}"),
            "the real part comes first; to give axis and angle, write `rot axis x,y,z angle DEG`",
        );
        None
    }

    fn axis_and_angle(&mut self, span: Span) -> Option<Rotation> {
        let axis = self.numbers::<3>("axis", span);
        let here = self.peek().1;
        let word = self.peek_word().unwrap_or_default().to_owned();
        if near_miss(&word, &["angle"]).is_none() {
            let found = self.found();
            let hint = "write rot axis x,y,z angle DEG";
            self.error_with_hint(
                here,
                format!("expected angle after the axis, found {found}"),
                hint,
            );
            return None;
        }
        self.advance();
        if word != "angle" {
            self.unknown(here, &word, "angle", Some("angle"));
        }
        let [degrees] = self.numbers::<1>("angle", here)?;
        let axis = axis?;
        if axis == [0.0; 3] {
            self.error(span, "the axis 0,0,0 has no direction");
            return None;
        }
        Some(Rotation::AxisAngle { axis, degrees })
    }

    /// RG: no keys for `fixed`.
    pub(super) fn rigid(&mut self, span: Span) -> Vec<PathKey> {
        let mut rigid = RigidEntries::default();
        let errors_before = self.errors_so_far();
        let allowed = ["fixed", "at", "trans", "rot"];
        self.entries("RG", span, &allowed, &["at", "trans", "rot"], |parser, keyword, span| {
            rigid.take(parser, keyword, span);
        });
        let says_nothing = !rigid.fixed && !rigid.follows_path;
        if says_nothing && self.errors_so_far() == errors_before {
            let hint = "write RG fixed, or a path: RG{ at 0 trans 0,0,0  at 1.5 trans 0,0,0.05 }";
            self.error_with_hint(span, "this RG says nothing", hint);
        }
        rigid.keys
    }
}

/// What an RG has said so far.
#[derive(Default)]
struct RigidEntries {
    fixed: bool,
    follows_path: bool,
    keys: Vec<PathKey>,
    /// Entries of the last key.
    of_key: Vec<&'static str>,
}

impl RigidEntries {
    fn take(&mut self, parser: &mut Parser<'_>, keyword: &'static str, span: Span) {
        match keyword {
            "fixed" => self.fixed = true,
            "at" => self.time(parser, span),
            _ => self.pose(parser, keyword, span),
        }
        if self.fixed && self.follows_path && ["fixed", "at"].contains(&keyword) {
            parser.error(span, "a rigid body is fixed or follows a path, not both");
        }
    }

    fn time(&mut self, parser: &mut Parser<'_>, span: Span) {
        self.follows_path = true;
        self.of_key.clear();
        let Some([time]) = parser.numbers::<1>("at", span) else { return };
        if let Some(last) = self.keys.last().map(|key| key.time).filter(|&last| time <= last) {
            let message = format!("times of a path must increase: {time} comes after {last}");
            parser.error(span, message);
        }
        self.keys.push(PathKey { time, translation: [0.0; 3], rotation: Rotation::default() });
    }

    fn pose(&mut self, parser: &mut Parser<'_>, keyword: &'static str, span: Span) {
        if !self.follows_path {
            let message = format!("{keyword} of a path stands after its time");
            let hint = "write RG{ at 0 trans 0,0,0  at 1.5 trans 0,0,0.05 }";
            parser.error_with_hint(span, message, hint);
        } else if self.of_key.contains(&keyword) {
            parser.error(span, format!("a second {keyword} for one time of the path"));
        }
        self.of_key.push(keyword);
        let key = self.keys.last_mut();
        if keyword == "trans" {
            let translation = parser.numbers::<3>("trans", span);
            if let (Some(key), Some(translation)) = (key, translation) {
                key.translation = translation;
            }
        } else {
            let rotation = parser.rotation(span);
            if let (Some(key), Some(rotation)) = (key, rotation) {
                key.rotation = rotation;
            }
        }
    }
}
