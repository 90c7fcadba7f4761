//! The elements that stand in blocks, entry by entry, with the ranges of their values.

use super::diagnostic::Span;
use super::document::{
    AppearanceEntries, AttachmentEntries, ContactEntries, Fixed, FixedRegion, PathKey,
    RegionEntries, Rotation, Transform,
};
use super::lexer::Token;
use super::near::near_miss;
use super::parser::{Parser, is_entry, is_keyword};
use crate::body::{Law, Material, MaterialEntries, Parameter};

const NONE_AGAIN: &[&str] = &[];

/// How far the length of a quaternion may be off 1.
const QUATERNION_TOLERANCE: f64 = 1e-3;

/// A word that is meant as a number, right or wrong.
fn looks_numeric(word: &str) -> bool {
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
    fn checked(
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

    fn positive(&mut self, keyword: &str, span: Span) -> Option<f64> {
        self.checked(keyword, span, |value| value > 0.0, "greater than 0")
    }

    fn not_negative(&mut self, keyword: &str, span: Span) -> Option<f64> {
        self.checked(keyword, span, |value| value >= 0.0, "0 or more")
    }

    /// The entries of an element, with or without brackets around them.
    ///
    /// Each goes to `take` with its place; those of `repeatable` may come more than once.
    fn entries(
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

    pub(super) fn processor(&mut self, span: Span) -> Option<u32> {
        let here = self.peek().1;
        let [value] = self.numbers::<1>("PE", span)?;
        if value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value) {
            return Some(value as u32);
        }
        self.error(here, format!("PE takes a whole number from 0 on, found {value}"));
        None
    }

    /// The file name after NE.
    pub(super) fn file(&mut self, span: Span) -> Option<(String, Span)> {
        let file = match self.peek() {
            (Token::Word(word), _) if is_keyword(word) => None,
            (Token::Word(word), here) => Some((word.clone(), here)),
            (Token::Quoted(text), here) if !text.is_empty() => Some((text.clone(), here)),
            _ => None,
        };
        let Some((name, name_span)) = file else {
            let found = self.found();
            let message = format!("NE is followed by a file name, found {found}");
            self.error_with_hint(
                span,
                message,
                "quote a name with unusual characters: NE \"a b.vtk\"",
            );
            if matches!(self.peek().0, Token::Quoted(_)) {
                self.advance();
            }
            return None;
        };
        self.advance();
        // A second word is most likely the rest of a name with blanks.
        if let Some(word) =
            self.peek_word().filter(|word| word.contains('.') && !looks_numeric(word))
        {
            let hint = format!("quote a name with blanks: NE \"{name} {word}\"");
            let last = self.peek().1;
            self.error_with_hint(name_span.to(last), "two words after NE", hint);
            self.skip_to_element();
        }
        Some((name, name_span))
    }

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

    pub(super) fn material(&mut self, span: Span) -> MaterialEntries {
        self.material_entries(span, false)
    }

    /// The number after `region`, which is next, and the entries.
    pub(super) fn region_material(&mut self, span: Span, regions: &mut Vec<RegionEntries>) {
        let word = self.advance();
        let here = self.peek().1;
        let number = self.numbers::<1>("region", word).map(|[number]| number);
        let whole = |number: &f64| number.fract() == 0.0 && number.abs() <= f64::from(i32::MAX);
        let region = number.filter(whole).map(|number| number as i32);
        if let (Some(number), None) = (number, region) {
            self.error(here, format!("region takes a whole number, found {number}"));
        }
        if region.is_some() && regions.iter().any(|block| Some(block.region) == region) {
            self.error(
                span.to(here),
                "a second MT of this region in this block; it may stand once",
            );
        }
        let entries = self.material_entries(span, true);
        if let Some(region) = region {
            regions.push(RegionEntries { region, entries, span: span.to(here) });
        }
    }

    fn material_entries(&mut self, span: Span, of_region: bool) -> MaterialEntries {
        let mut material = MaterialEntries::default();
        let names = Material::PARAMETERS.map(|parameter| parameter.name);
        let allowed = [&["law"][..], &names, &["fibre", "fibre_2"]].concat();
        self.entries("MT", span, &allowed, NONE_AGAIN, |parser, keyword, span| match keyword {
            "damping" | "mass_damping" if of_region => {
                let message = format!("{keyword} is that of the whole body, not of a region");
                parser.error_with_hint(span, message, format!("write MT{{ {keyword} ... }}"));
                parser.not_negative(keyword, span);
            }
            "law" => {
                let name = parser.choice("law", &Law::NAMES);
                material.law = name.and_then(|name| name.parse().ok());
            }
            "fibre" => material.fibres[0] = parser.fibre(keyword, span),
            "fibre_2" => material.fibres[1] = parser.fibre(keyword, span),
            _ => {
                let places = material.values_mut().into_iter().zip(Material::PARAMETERS);
                for (place, Parameter { range, .. }) in places.filter(|it| it.1.name == keyword) {
                    *place = parser.checked(keyword, span, range.holds, range.words);
                }
            }
        });
        material
    }

    fn fibre(&mut self, keyword: &str, span: Span) -> Option<[f64; 3]> {
        let here = self.peek().1;
        let fibre = self.numbers::<3>(keyword, span)?;
        if fibre == [0.0; 3] {
            self.error(here, format!("the {keyword} 0,0,0 has no direction"));
            return None;
        }
        Some(fibre)
    }

    pub(super) fn contact(&mut self, span: Span) -> ContactEntries {
        let mut contact = ContactEntries::default();
        let allowed = ["friction", "distance", "stiffness", "self"];
        self.entries("CN", span, &allowed, NONE_AGAIN, |parser, keyword, span| match keyword {
            "friction" => contact.friction = parser.not_negative("friction", span),
            "distance" => contact.distance = parser.positive("distance", span),
            "stiffness" => contact.stiffness = parser.positive("stiffness", span),
            _ => {
                contact.self_contact =
                    parser.choice("self", &["on", "off"]).map(|word| word == "on");
            }
        });
        contact
    }

    /// An AT; `None` when it does not name two bodies.
    pub(super) fn attachment(&mut self, span: Span) -> Option<AttachmentEntries> {
        let mut attachment = AttachmentEntries { span, ..AttachmentEntries::default() };
        let mut bodies = None;
        let errors_before = self.errors_so_far();
        let allowed = ["join", "within", "stiffness"];
        self.entries("AT", span, &allowed, NONE_AGAIN, |parser, keyword, span| match keyword {
            "join" => bodies = parser.two_names(span),
            "within" => attachment.within = parser.positive("within", span),
            _ => attachment.stiffness = parser.positive("stiffness", span),
        });
        if bodies.is_none() && self.errors_so_far() == errors_before {
            let hint = "write join and the names of two bodies: AT{ join kidney aorta }";
            self.error_with_hint(span, "this AT joins nothing", hint);
        }
        attachment.bodies = bodies?;
        Some(attachment)
    }

    /// The names of two bodies.
    fn two_names(&mut self, span: Span) -> Option<[String; 2]> {
        let mut names = Vec::new();
        while names.len() < 2 {
            let name = match self.peek().0 {
                Token::Word(word) if !is_keyword(word) && !is_entry(word) => word.clone(),
                Token::Quoted(text) => text.clone(),
                _ => {
                    let found = self.found();
                    self.error(span, format!("join takes the names of two bodies, found {found}"));
                    return None;
                }
            };
            names.push(name);
            self.advance();
        }
        names.try_into().ok()
    }

    pub(super) fn appearance(&mut self, span: Span) -> AppearanceEntries {
        let mut appearance = AppearanceEntries::default();
        let unit = 0.0..=1.0;
        self.entries("VE", span, &["color", "opacity"], NONE_AGAIN, |parser, keyword, span| {
            if keyword == "opacity" {
                let valid = |value| unit.contains(&value);
                appearance.opacity = parser.checked("opacity", span, valid, "from 0 to 1");
                return;
            }
            appearance.color = parser.numbers::<3>("color", span);
            if appearance.color.is_some_and(|color| color.iter().any(|c| !unit.contains(c))) {
                parser.error(span, "color takes red, green, blue from 0 to 1");
            }
        });
        appearance
    }

    /// One of a few words.
    fn choice(&mut self, keyword: &str, allowed: &[&'static str]) -> Option<&'static str> {
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

    pub(super) fn fixed(&mut self, span: Span, fixed: &mut Vec<Fixed>) {
        let allowed = ["box", "sphere", "set"];
        let before = fixed.len();
        let errors_before = self.errors_so_far();
        self.entries("FX", span, &allowed, &allowed, |parser, keyword, span| {
            let region = match keyword {
                "box" => parser
                    .numbers::<6>("box", span)
                    .map(|[a, b, c, d, e, f]| FixedRegion::Box([a, b, c], [d, e, f])),
                "sphere" => parser.sphere(span),
                _ => parser.set_name(span).map(FixedRegion::Set),
            };
            fixed.extend(region.map(|region| Fixed { region, span }));
        });
        if fixed.len() == before && self.errors_so_far() == errors_before {
            let hint = "write FX{ box x,y,z x,y,z }, FX{ sphere x,y,z radius } or FX{ set name }";
            self.error_with_hint(span, "this FX holds nothing", hint);
        }
    }

    fn sphere(&mut self, span: Span) -> Option<FixedRegion> {
        let [x, y, z, radius] = self.numbers::<4>("sphere", span)?;
        if radius > 0.0 {
            return Some(FixedRegion::Sphere { center: [x, y, z], radius });
        }
        self.error(span, format!("the radius of a sphere must be greater than 0, found {radius}"));
        None
    }

    fn set_name(&mut self, span: Span) -> Option<String> {
        let name = match self.peek().0 {
            Token::Word(word) if !is_keyword(word) => word.clone(),
            Token::Quoted(text) => text.clone(),
            _ => {
                let found = self.found();
                self.error(span, format!("set takes the name of a node set, found {found}"));
                return None;
            }
        };
        self.advance();
        Some(name)
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
