//! The canonical text of a document.

use std::fmt::{self, Display, Write};

use palpate_geometry::Point;

use super::document::{
    AttachmentEntries, Block, Document, FixedRegion, PathKey, RegionEntries, Rotation, Settings,
    Transform, Tree, Unit,
};
use super::lexer::is_one_word;
use super::parser::{is_entry, is_keyword};
use crate::body::{Material, MaterialEntries};
use crate::number::{Shortest, Triple};

impl Document {
    /// The document in canonical form: the text that reads back to the same document.
    pub fn to_text(&self) -> String {
        let mut text = String::new();
        if self.unit != Unit::default() {
            let _ = writeln!(text, "unit {}", self.unit.name());
        }
        if self.gravity != Self::GRAVITY {
            let _ = writeln!(text, "gravity {}", Triple(self.gravity));
        }
        write_block(&mut text, &self.root, 0);
        text
    }
}

fn line(text: &mut String, depth: usize, content: impl Display) {
    let _ = writeln!(text, "{:indent$}{content}", "", indent = 2 * depth);
}

fn write_block(text: &mut String, block: &Block, depth: usize) {
    match block {
        Block::Branch(branch) => {
            line(text, depth, "BRANCH{");
            write_transform(text, &branch.settings, depth + 1);
            write_settings(text, &branch.settings, depth + 1);
            branch.children.iter().for_each(|child| write_block(text, child, depth + 1));
            branch.attachments.iter().for_each(|each| write_attachment(text, each, depth + 1));
        }
        Block::Tree(tree) => write_tree(text, tree, depth),
    }
    line(text, depth, "}");
}

fn write_attachment(text: &mut String, attachment: &AttachmentEntries, depth: usize) {
    let [first, second] = &attachment.bodies;
    // Unquoted, an entry would be read as the next one.
    let quoted = |name: &str| {
        if is_entry(name) { format!("\"{name}\"") } else { Name(name).to_string() }
    };
    let mut entries = vec![format!("join {} {}", quoted(first), quoted(second))];
    let numbers = [("within", attachment.within), ("stiffness", attachment.stiffness)];
    for (name, value) in numbers {
        entries.extend(value.map(|value| format!("{name} {}", Shortest(value))));
    }
    line(text, depth, format_args!("AT{{ {} }}", entries.join("  ")));
}

fn write_tree(text: &mut String, tree: &Tree, depth: usize) {
    match &tree.name {
        Some(name) => line(text, depth, format_args!("TREE {}{{", Name(name))),
        None => line(text, depth, "TREE{"),
    }
    let depth = depth + 1;
    write_transform(text, &tree.settings, depth);
    if let Some(processor) = tree.processor {
        line(text, depth, format_args!("PE {processor}"));
    }
    line(text, depth, format_args!("NE {}", Name(&tree.file)));
    for fixed in &tree.fixed {
        match &fixed.region {
            FixedRegion::Box(a, b) => {
                line(text, depth, format_args!("FX{{ box {} {} }}", Triple(*a), Triple(*b)));
            }
            FixedRegion::Sphere { center, radius } => {
                let (center, radius) = (Triple(*center), Shortest(*radius));
                line(text, depth, format_args!("FX{{ sphere {center} {radius} }}"));
            }
            FixedRegion::Set(name) => line(text, depth, format_args!("FX{{ set {} }}", Name(name))),
        }
    }
    match tree.rigid.as_deref() {
        None => {}
        Some([]) => line(text, depth, "RG fixed"),
        Some(keys) => {
            line(text, depth, "RG{");
            for key in keys {
                line(text, depth + 1, Key(key));
            }
            line(text, depth, "}");
        }
    }
    if let Some(velocity) = tree.initial_velocity {
        line(text, depth, format_args!("IV {}", Triple(velocity)));
    }
    write_settings(text, &tree.settings, depth);
}

fn write_transform(text: &mut String, settings: &Settings, depth: usize) {
    if let Some(Transform { translation, rotation, scale }) = settings.transform {
        let (translation, rotation) = (Triple(translation), RotationText(rotation));
        let scale = Triple(scale);
        line(
            text,
            depth,
            format_args!("ME{{ trans {translation}  rot {rotation}  scale {scale} }}"),
        );
    }
}

fn write_settings(text: &mut String, settings: &Settings, depth: usize) {
    let number =
        |name, value: Option<f64>| value.map(|value| format!("{name} {}", Shortest(value)));
    let contact = settings.contact;
    let switch = |on: bool| format!("self {}", if on { "on" } else { "off" });
    let appearance = settings.appearance;
    write_material(text, None, &settings.material, depth);
    for RegionEntries { region, entries, .. } in &settings.regions {
        write_material(text, Some(*region), entries, depth);
    }
    let blocks: [(&str, Vec<Option<String>>); 2] = [
        (
            "CN",
            vec![
                number("friction", contact.friction),
                number("distance", contact.distance),
                number("stiffness", contact.stiffness),
                contact.self_contact.map(switch),
            ],
        ),
        (
            "VE",
            vec![
                appearance.color.map(|color| format!("color {}", Triple(color))),
                number("opacity", appearance.opacity),
            ],
        ),
    ];
    for (name, entries) in blocks {
        let entries: Vec<String> = entries.into_iter().flatten().collect();
        if !entries.is_empty() {
            line(text, depth, format_args!("{name}{{ {} }}", entries.join("  ")));
        }
    }
}

fn write_material(
    text: &mut String,
    region: Option<i32>,
    material: &MaterialEntries,
    depth: usize,
) {
    let fibre = |name, fibre: Option<Point>| fibre.map(|d| format!("{name} {}", Triple(d)));
    let numbers = Material::PARAMETERS.iter().zip(material.values()).map(|(parameter, value)| {
        value.map(|value| format!("{} {}", parameter.name, Shortest(value)))
    });
    let entries = [material.law.map(|law| format!("law {law}"))].into_iter().chain(numbers);
    let [first, second] = material.fibres;
    let fibres = [fibre("fibre", first), fibre("fibre_2", second)];
    let entries: Vec<String> = entries.chain(fibres).flatten().collect();
    match region {
        Some(region) => {
            line(text, depth, format_args!("MT region {region} {{ {} }}", entries.join("  ")));
        }
        None if entries.is_empty() => {}
        None => line(text, depth, format_args!("MT{{ {} }}", entries.join("  "))),
    }
}

struct RotationText(Rotation);

impl Display for RotationText {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Rotation::Quaternion([w, x, y, z]) => {
                write!(out, "{},{}", Shortest(w), Triple([x, y, z]))
            }
            Rotation::AxisAngle { axis, degrees } => {
                write!(out, "axis {} angle {}", Triple(axis), Shortest(degrees))
            }
        }
    }
}

struct Key<'a>(&'a PathKey);

impl Display for Key<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PathKey { time, translation, rotation } = *self.0;
        let (translation, rotation) = (Triple(translation), RotationText(rotation));
        write!(out, "at {}  trans {translation}  rot {rotation}", Shortest(time))
    }
}

/// A name or file, quoted where it would not read back as one word.
struct Name<'a>(&'a str);

impl Display for Name<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if is_one_word(self.0) && !is_keyword(self.0) {
            out.write_str(self.0)
        } else {
            write!(out, "\"{}\"", self.0.replace('"', "\"\""))
        }
    }
}
