//! `.seg`: our text format of object data, specified in docs/formats.md.

use std::io::{self, Read, Write};
use std::path::Path;

use super::tokens::{ReadError, Style, Tokens, quoted, syntax};
use super::{FileError, FileErrorCause, Format, ParseFailure, Parsed, write_atomically};
use crate::mesh::{ElementKind, Mesh, MeshData, Place};
use crate::number::Shortest;

pub(super) const FORMAT: Format = Format { extension: "seg", read, write };

fn read(reader: &mut dyn Read, size: u64, sought: Option<Place>) -> Result<Parsed, ParseFailure> {
    let mut parser = Parser {
        tokens: Tokens::new(reader, size, Style::BlanksCommasComments),
        data: MeshData::default(),
        sought,
        sought_line: None,
    };
    match parser.file() {
        Ok(()) => {
            Ok(Parsed { data: parser.data, notes: Vec::new(), sought_line: parser.sought_line })
        }
        Err(error) => Err(ParseFailure { line: Some(parser.tokens.word_line()), error }),
    }
}

const SECTIONS: [&str; 7] =
    ["nodes", "tetrahedra", "triangles", "regions", "fibres", "fibres_2", "set"];

struct Parser<R> {
    tokens: Tokens<R>,
    data: MeshData,
    sought: Option<Place>,
    sought_line: Option<usize>,
}

impl<R: Read> Parser<R> {
    fn file(&mut self) -> Result<(), ReadError> {
        match self.tokens.next()? {
            Some("seg") => {}
            Some(other) => {
                return syntax(format!("expected `seg 1` at the start, found {}", quoted(other)));
            }
            None => return syntax("the file is empty; expected `seg 1`"),
        }
        let version: u32 = self.tokens.number("a version number", || "`seg`".into())?;
        if version != 1 {
            return syntax(format!("version {version} of .seg is not known; this reads version 1"));
        }
        let mut seen: Vec<&str> = Vec::new();
        loop {
            let Some(word) = self.tokens.next()? else { return Ok(()) };
            let Some(section) = SECTIONS.into_iter().find(|&section| section == word) else {
                let surplus = seen.last().filter(|_| word.parse::<f64>().is_ok());
                let hint = surplus.map(|section| format!("; `{section}` announces fewer values"));
                let found = quoted(word);
                return syntax(format!(
                    "expected a section ({}) or the end of the file, found {found}{}",
                    SECTIONS.join(", "),
                    hint.unwrap_or_default()
                ));
            };
            if section != "set" && seen.contains(&section) {
                return syntax(format!("a second `{section}` section; a mesh has one"));
            }
            seen.push(section);
            match section {
                "nodes" => self.nodes()?,
                "tetrahedra" => {
                    self.data.tetrahedra = self.elements(section, ElementKind::Tetrahedron)?;
                }
                "triangles" => {
                    self.data.triangles = self.elements(section, ElementKind::Triangle)?;
                }
                "regions" => self.regions()?,
                "fibres" => self.fibres(section, 0)?,
                "fibres_2" => self.fibres(section, 1)?,
                _ => self.set()?,
            }
        }
    }

    fn count(&mut self, section: &str) -> Result<usize, ReadError> {
        self.tokens.number("how many follow", || format!("`{section}`"))
    }

    fn nodes(&mut self) -> Result<(), ReadError> {
        let count = self.count("nodes")?;
        self.data.nodes.reserve_exact(self.tokens.plausible(count, 6));
        for index in 0..count {
            let whose = || format!("node {index} of {count}");
            let x = self.tokens.number("a coordinate", whose)?;
            self.note_line(Place::Node(index));
            let y = self.tokens.number("a coordinate", whose)?;
            let z = self.tokens.number("a coordinate", whose)?;
            self.data.nodes.push([x, y, z]);
        }
        Ok(())
    }

    fn elements<const N: usize>(
        &mut self,
        section: &str,
        kind: ElementKind,
    ) -> Result<Vec<[u32; N]>, ReadError> {
        let count = self.count(section)?;
        let mut elements = Vec::with_capacity(self.tokens.plausible(count, 2 * N as u64));
        for index in 0..count {
            let mut nodes = [0; N];
            for (corner, node) in nodes.iter_mut().enumerate() {
                *node =
                    self.tokens.number("a node index", || format!("{kind} {index} of {count}"))?;
                if corner == 0 {
                    self.note_line(Place::Element(kind, index));
                }
            }
            elements.push(nodes);
        }
        Ok(elements)
    }

    fn note_line(&mut self, place: Place) {
        if self.sought == Some(place) {
            self.sought_line = Some(self.tokens.word_line());
        }
    }

    fn regions(&mut self) -> Result<(), ReadError> {
        let count = self.data.tetrahedra.len();
        if count == 0 {
            return syntax(
                "`regions` has one number for each tetrahedron: give `tetrahedra` first",
            );
        }
        self.data.regions.reserve_exact(count);
        for index in 0..count {
            let whose = || format!("region of tetrahedron {index} of {count}");
            let region = self.tokens.number("a whole number", whose)?;
            self.data.regions.push(region);
        }
        Ok(())
    }

    fn fibres(&mut self, section: &str, family: usize) -> Result<(), ReadError> {
        let count = self.data.tetrahedra.len();
        if count == 0 {
            return syntax(format!(
                "`{section}` has one direction for each tetrahedron: give `tetrahedra` first"
            ));
        }
        self.data.fibres[family].reserve_exact(count);
        for index in 0..count {
            let whose = || format!("fibre of tetrahedron {index} of {count}");
            let mut fibre = [0.0; 3];
            for component in &mut fibre {
                *component = self.tokens.number("a component", whose)?;
            }
            self.data.fibres[family].push(fibre);
        }
        Ok(())
    }

    fn set(&mut self) -> Result<(), ReadError> {
        let Some(name) = self.tokens.next()?.map(str::to_owned) else {
            return syntax("`set`: expected a name, found the end of the file");
        };
        if self.data.node_sets.contains_key(&name) {
            return syntax(format!("a second set {}; give each name once", quoted(&name)));
        }
        let count = self.count("set")?;
        let mut nodes = Vec::with_capacity(self.tokens.plausible(count, 2));
        for index in 0..count {
            let whose = || format!("entry {index} of {count} of set `{name}`");
            nodes.push(self.tokens.number("a node index", whose)?);
        }
        self.data.node_sets.insert(name, nodes);
        Ok(())
    }
}

fn write(path: &Path, mesh: &Mesh) -> Result<(), FileError> {
    check_names(mesh).map_err(|message| {
        let cause = FileErrorCause::Syntax(message);
        FileError { path: path.to_owned(), line: None, cause }
    })?;
    write_atomically(path, |out| write_text(out, mesh))
}

/// Refuses node sets whose names the format cannot hold.
fn check_names(mesh: &Mesh) -> Result<(), String> {
    let unwritable = |name: &&String| {
        name.is_empty()
            || name.len() > 1000
            || name.contains("//")
            || name.contains(|c: char| c == ',' || c.is_ascii_whitespace() || c == '\x0b')
    };
    match mesh.node_sets().keys().find(unwritable) {
        Some(name) => Err(format!(
            "node set {name:?}: a name in a .seg file has no blanks, commas or `//`; rename it"
        )),
        None => Ok(()),
    }
}

/// Writes a mesh whose set names are fit for it.
fn write_text(out: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    writeln!(out, "seg 1")?;
    writeln!(out, "nodes {}", mesh.nodes().len())?;
    for node in mesh.nodes() {
        let [x, y, z] = node.map(Shortest);
        writeln!(out, "  {x} {y} {z}")?;
    }
    if mesh.is_surface_only() {
        writeln!(out, "triangles {}", mesh.triangles().len())?;
        for [a, b, c] in mesh.triangles() {
            writeln!(out, "  {a} {b} {c}")?;
        }
    } else {
        writeln!(out, "tetrahedra {}", mesh.tetrahedra().len())?;
        for [a, b, c, d] in mesh.tetrahedra() {
            writeln!(out, "  {a} {b} {c} {d}")?;
        }
    }
    if !mesh.regions().is_empty() {
        writeln!(out, "regions")?;
        write_wrapped(out, mesh.regions())?;
    }
    for (name, fibres) in ["fibres", "fibres_2"].iter().zip(mesh.fibres()) {
        if !fibres.is_empty() {
            writeln!(out, "{name}")?;
        }
        for fibre in fibres {
            let [x, y, z] = fibre.map(Shortest);
            writeln!(out, "  {x} {y} {z}")?;
        }
    }
    for (name, nodes) in mesh.node_sets() {
        writeln!(out, "set {name} {}", nodes.len())?;
        write_wrapped(out, nodes)?;
    }
    Ok(())
}

fn write_wrapped<T: std::fmt::Display>(out: &mut dyn Write, values: &[T]) -> io::Result<()> {
    for row in values.chunks(16) {
        write!(out, " ")?;
        for value in row {
            write!(out, " {value}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}
