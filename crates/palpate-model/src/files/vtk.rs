//! Legacy `.vtk` files, versions 1.0 to 5.1, ASCII and binary.
//!
//! Layout after the "VTK File Formats" chapter of the VTK User's Guide; version 5 stores cells as
//! offsets and connectivity.

mod attributes;
mod cells;
mod scalar;
mod write;

use std::io::Read;

use super::tokens::{ReadError, Style, Tokens, quoted, syntax};
use super::{Format, ParseFailure, Parsed};
use crate::mesh::Place;
use cells::Cells;
use scalar::{Scalar, Values};

pub use write::{VtkEncoding, write_vtk};

pub(super) const FORMAT: Format = Format {
    extension: "vtk",
    read,
    write: |path, mesh| write_vtk(path, mesh, VtkEncoding::Binary),
};

fn read(reader: &mut dyn Read, size: u64, sought: Option<Place>) -> Result<Parsed, ParseFailure> {
    let mut file = VtkFile {
        values: Values { tokens: Tokens::new(reader, size, Style::Blanks), binary: false },
        major_version: 0,
        nodes: None,
        cells: Cells::default(),
        regions: None,
        fibres: [None, None],
        notes: Vec::new(),
        sought,
        sought_line: None,
    };
    file.read().map_err(|error| {
        let line = (!file.values.binary).then(|| file.values.tokens.word_line());
        ParseFailure { line, error }
    })?;
    file.into_parsed()
        .map_err(|message| ParseFailure { line: None, error: ReadError::Syntax(message) })
}

struct VtkFile<R> {
    values: Values<R>,
    major_version: u32,
    nodes: Option<Vec<[f64; 3]>>,
    cells: Cells,
    /// Region of every cell, whatever its type.
    regions: Option<Vec<i32>>,
    /// Fibres of every cell, whatever its type.
    fibres: [Option<Vec<[f64; 3]>>; 2],
    notes: Vec<String>,
    sought: Option<Place>,
    sought_line: Option<usize>,
}

impl<R: Read> VtkFile<R> {
    fn read(&mut self) -> Result<(), ReadError> {
        self.header()?;
        // What the attributes that follow belong to: points or cells, and how many of them.
        let mut owner = attributes::Owner::Dataset;
        while let Some(word) = self.values.tokens.next()? {
            let keyword = word.to_ascii_uppercase();
            match keyword.as_str() {
                "POINTS" => self.points()?,
                "CELLS" => self.read_cells(None)?,
                "POLYGONS" => self.read_cells(Some(cells::polygon_type))?,
                "VERTICES" => self.read_cells(Some(cells::vertex_type))?,
                "LINES" => self.read_cells(Some(cells::line_type))?,
                "TRIANGLE_STRIPS" => self.read_cells(Some(cells::strip_type))?,
                "CELL_TYPES" => self.cell_types()?,
                "POINT_DATA" => {
                    owner = attributes::Owner::Points(self.values.count("POINT_DATA")?);
                }
                "CELL_DATA" => {
                    owner = attributes::Owner::Cells(self.values.count("CELL_DATA")?);
                }
                "METADATA" => self.skip_metadata()?,
                _ => self.attribute(&keyword, owner)?,
            }
        }
        Ok(())
    }

    fn header(&mut self) -> Result<(), ReadError> {
        let tokens = &mut self.values.tokens;
        let first = tokens.rest_of_line()?.unwrap_or_default();
        let version = first.strip_prefix("# vtk DataFile Version ").map(str::trim);
        let Some(version) = version else {
            let hint = if first.trim_start().starts_with("<?xml") || first.starts_with("<VTKFile") {
                "; this is VTK's XML format, which belongs in a .vtu file"
            } else {
                ""
            };
            return syntax(format!(
                "expected `# vtk DataFile Version 4.2` at the start, found {}{hint}",
                quoted(&first)
            ));
        };
        let major = version.split('.').next().and_then(|major| major.parse().ok());
        self.major_version = match major {
            Some(major @ 1..=5) => major,
            _ => {
                return syntax(format!(
                    "version {} of legacy .vtk is not known; this reads 1.0 to 5.1",
                    quoted(version)
                ));
            }
        };
        tokens.rest_of_line()?;
        let encoding = tokens.rest_of_line()?.unwrap_or_default();
        self.values.binary = match encoding.trim().to_ascii_uppercase().as_str() {
            "ASCII" => false,
            "BINARY" => true,
            _ => return syntax(format!("expected ASCII or BINARY, found {}", quoted(&encoding))),
        };
        // A FIELD of the whole file may stand before the dataset.
        loop {
            let keyword = self.values.word("DATASET")?.to_ascii_uppercase();
            match keyword.as_str() {
                "DATASET" => break,
                "FIELD" => self.attribute(&keyword, attributes::Owner::Dataset)?,
                _ => return syntax(format!("expected DATASET, found {}", quoted(&keyword))),
            }
        }
        let dataset = self.values.word("a kind of dataset")?;
        if !["UNSTRUCTURED_GRID", "POLYDATA"].contains(&dataset.to_ascii_uppercase().as_str()) {
            return syntax(format!(
                "expected UNSTRUCTURED_GRID or POLYDATA, found {}; other datasets have no \
                 tetrahedra",
                quoted(&dataset)
            ));
        }
        Ok(())
    }

    fn points(&mut self) -> Result<(), ReadError> {
        if self.nodes.is_some() {
            return syntax("a second POINTS section; a mesh has one");
        }
        let count = self.values.count("POINTS")?;
        let scalar = self.values.scalar_type()?;
        self.values.begin_data()?;
        let mut nodes = Vec::with_capacity(self.values.plausible(count, 3, scalar));
        for index in 0..count {
            let whose = || format!("point {index} of {count}");
            let x = self.values.float(scalar, whose)?;
            if self.sought == Some(Place::Node(index)) && !self.values.binary {
                self.sought_line = Some(self.values.tokens.word_line());
            }
            nodes.push([x, self.values.float(scalar, whose)?, self.values.float(scalar, whose)?]);
        }
        self.nodes = Some(nodes);
        Ok(())
    }

    /// Cells with explicit types, or of a section whose cells get their type from their size.
    fn read_cells(&mut self, type_of: Option<fn(usize) -> u8>) -> Result<(), ReadError> {
        if type_of.is_none() && !self.cells.is_empty() {
            return syntax("a second CELLS section; a mesh has one");
        }
        let first = self.cells.len();
        let with_lines = self.sought.is_some();
        if self.major_version >= 5 {
            self.cells.read_offsets(&mut self.values, with_lines)?;
        } else {
            self.cells.read_counted(&mut self.values, with_lines)?;
        }
        if let Some(type_of) = type_of {
            self.cells.type_by_size(first, type_of);
        }
        Ok(())
    }

    fn cell_types(&mut self) -> Result<(), ReadError> {
        let count = self.values.count("CELL_TYPES")?;
        self.values.begin_data()?;
        let mut types = Vec::with_capacity(self.values.plausible(count, 1, Scalar::I32));
        for index in 0..count {
            let whose = || format!("cell type {index} of {count}");
            let number = self.values.integer(Scalar::I32, whose)?;
            let Ok(number) = u8::try_from(number) else {
                return syntax(format!("cell {index}: cell type {number} is not known"));
            };
            types.push(number);
        }
        self.cells.types = types;
        Ok(())
    }

    /// Skips to the blank line that ends the section.
    fn skip_metadata(&mut self) -> Result<(), ReadError> {
        self.values.tokens.rest_of_line()?;
        while let Some(line) = self.values.tokens.rest_of_line()? {
            if line.trim().is_empty() {
                break;
            }
        }
        Ok(())
    }

    fn into_parsed(self) -> Result<Parsed, String> {
        let nodes = self.nodes.ok_or("the file has no POINTS section")?;
        let selection = self.cells.select(nodes, self.regions, self.fibres, self.notes)?;
        let sought_line = match self.sought {
            Some(Place::Element(_, index)) if !self.values.binary => {
                selection.lines.get(index).copied()
            }
            _ => self.sought_line,
        };
        Ok(Parsed { data: selection.data, notes: selection.notes, sought_line })
    }
}
