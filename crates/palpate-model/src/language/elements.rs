//! The elements that stand in blocks, entry by entry, with the ranges of their values.

use super::diagnostic::Span;
use super::document::{
    AppearanceEntries, AttachmentEntries, ContactEntries, Fixed, FixedRegion, RegionEntries,
};
use super::lexer::Token;
use super::parser::{Parser, is_entry, is_keyword};
use super::values::{NONE_AGAIN, looks_numeric};
use crate::body::{Law, Material, MaterialEntries, Parameter};

impl Parser<'_> {
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
}
