//! Cells of a legacy `.vtk` file, and which of them make the mesh.

use std::collections::BTreeMap;
use std::io::Read;

use super::super::tokens::{ReadError, syntax};
use super::scalar::{Scalar, Values};
use crate::mesh::{MeshData, counted, drop_unused_nodes};

const VERTEX: u8 = 1;
const POLY_VERTEX: u8 = 2;
const LINE: u8 = 3;
const POLY_LINE: u8 = 4;
const TRIANGLE: u8 = 5;
const TRIANGLE_STRIP: u8 = 6;
const POLYGON: u8 = 7;
const QUAD: u8 = 9;
const TETRAHEDRON: u8 = 10;
const QUADRATIC_TETRAHEDRON: u8 = 24;

pub(super) fn polygon_type(size: usize) -> u8 {
    match size {
        3 => TRIANGLE,
        4 => QUAD,
        _ => POLYGON,
    }
}

pub(super) fn vertex_type(size: usize) -> u8 {
    if size == 1 { VERTEX } else { POLY_VERTEX }
}

pub(super) fn line_type(size: usize) -> u8 {
    if size == 2 { LINE } else { POLY_LINE }
}

pub(super) fn strip_type(size: usize) -> u8 {
    if size == 3 { TRIANGLE } else { TRIANGLE_STRIP }
}

fn type_name(cell_type: u8) -> &'static str {
    match cell_type {
        VERTEX => "vertex",
        POLY_VERTEX => "poly-vertex",
        LINE => "line",
        POLY_LINE => "poly-line",
        TRIANGLE => "triangle",
        TRIANGLE_STRIP => "triangle strip",
        POLYGON => "polygon",
        8 => "pixel",
        QUAD => "quadrilateral",
        TETRAHEDRON => "tetrahedron",
        11 => "voxel",
        12 => "hexahedron",
        13 => "wedge",
        14 => "pyramid",
        21 => "quadratic edge",
        22 => "quadratic triangle",
        23 => "quadratic quadrilateral",
        QUADRATIC_TETRAHEDRON => "quadratic tetrahedron",
        25 => "quadratic hexahedron",
        26 => "quadratic wedge",
        27 => "quadratic pyramid",
        42 => "polyhedron",
        _ => "other",
    }
}

/// All cells of the file: nodes in compressed rows, and types.
#[derive(Default)]
pub(super) struct Cells {
    /// End of each cell in `connectivity`.
    ends: Vec<u32>,
    connectivity: Vec<u32>,
    pub(super) types: Vec<u8>,
    /// Line of each cell; kept only when somebody asks for a line.
    lines: Vec<usize>,
}

/// What was taken from the cells.
pub(super) struct Selection {
    pub(super) data: MeshData,
    pub(super) notes: Vec<String>,
    /// Line of each element taken, where lines were kept.
    pub(super) lines: Vec<usize>,
}

impl Cells {
    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    fn nodes(&self, cell: usize) -> &[u32] {
        let start = cell.checked_sub(1).map_or(0, |previous| self.ends[previous]);
        &self.connectivity[start as usize..self.ends[cell] as usize]
    }

    /// Versions before 5: each cell is its number of nodes and the nodes.
    pub(super) fn read_counted<R: Read>(
        &mut self,
        values: &mut Values<R>,
        with_lines: bool,
    ) -> Result<(), ReadError> {
        let count = values.count("CELLS")?;
        let total = values.count("CELLS")?;
        values.begin_data()?;
        self.ends.reserve_exact(values.plausible(count, 2, Scalar::I32));
        self.connectivity.reserve_exact(values.plausible(
            total.saturating_sub(count),
            1,
            Scalar::I32,
        ));
        let mut left = total;
        for cell in 0..count {
            let size = values.integer(Scalar::I32, || format!("cell {cell} of {count}"))?;
            let size = usize::try_from(size).unwrap_or(usize::MAX);
            if size >= left {
                return syntax(format!(
                    "cell {cell} of {count}: it exceeds the {total} numbers announced for all cells"
                ));
            }
            left -= size + 1;
            if with_lines {
                self.lines.push(values.tokens.word_line());
            }
            for _ in 0..size {
                self.push_node(values, Scalar::I32, cell)?;
            }
            self.ends.push(self.connectivity.len() as u32);
        }
        if left > 0 {
            return syntax(format!(
                "{left} of the {total} numbers announced for cells are missing"
            ));
        }
        Ok(())
    }

    /// Version 5: the offsets of all cells, one more than there are, then the nodes of all.
    pub(super) fn read_offsets<R: Read>(
        &mut self,
        values: &mut Values<R>,
        with_lines: bool,
    ) -> Result<(), ReadError> {
        let count = values.count("CELLS")?;
        let total = values.count("CELLS")?;
        let base = self.connectivity.len() as i64;
        let scalar = section(values, "OFFSETS")?;
        let mut previous = 0;
        for index in 0..count {
            let offset = values.integer(scalar, || format!("offset {index} of {count}"))?;
            if offset < previous || offset > total as i64 || (index == 0 && offset != 0) {
                return syntax(format!("offset {index} of {count}: {offset} is out of order"));
            }
            previous = offset;
            if index > 0 {
                self.ends.push((base + offset) as u32);
            }
        }
        if previous != total as i64 {
            return syntax(format!("the last offset is {previous}, but cells have {total} nodes"));
        }
        let scalar = section(values, "CONNECTIVITY")?;
        self.connectivity.reserve_exact(values.plausible(total, 1, scalar));
        let mut cell = self.lines.len();
        for _ in 0..total {
            self.push_node(values, scalar, cell)?;
            let read = self.connectivity.len();
            while with_lines && cell < self.len() && (self.ends[cell] as usize) <= read {
                self.lines.push(values.tokens.word_line());
                cell += 1;
            }
        }
        Ok(())
    }

    fn push_node<R: Read>(
        &mut self,
        values: &mut Values<R>,
        scalar: Scalar,
        cell: usize,
    ) -> Result<(), ReadError> {
        let node = values.integer(scalar, || format!("cell {cell}"))?;
        let Ok(node) = u32::try_from(node) else {
            return syntax(format!("cell {cell}: {node} is no node index"));
        };
        if self.connectivity.len() >= u32::MAX as usize {
            return syntax("the cells have more than 4294967295 nodes in all");
        }
        self.connectivity.push(node);
        Ok(())
    }

    /// Gives the cells from `first` on the types that follow from their sizes.
    pub(super) fn type_by_size(&mut self, first: usize, type_of: fn(usize) -> u8) {
        let types: Vec<u8> =
            (first..self.len()).map(|cell| type_of(self.nodes(cell).len())).collect();
        self.types.extend(types);
    }

    /// Takes the tetrahedra, or the triangles where there are none, and reports the rest.
    pub(super) fn select(
        self,
        nodes: Vec<[f64; 3]>,
        regions: Option<Vec<i32>>,
        fibres: [Option<Vec<[f64; 3]>>; 2],
        mut notes: Vec<String>,
    ) -> Result<Selection, String> {
        if self.types.len() != self.len() {
            return Err(format!(
                "{} cell types for {} cells; give one for each",
                self.types.len(),
                self.len()
            ));
        }
        let volumetric = |cell_type: u8| [TETRAHEDRON, QUADRATIC_TETRAHEDRON].contains(&cell_type);
        let has_tetrahedra = self.types.iter().any(|&cell_type| volumetric(cell_type));
        let wanted = |cell_type: u8| {
            if has_tetrahedra {
                volumetric(cell_type)
            } else {
                [TRIANGLE, QUAD].contains(&cell_type)
            }
        };
        let mut left_out: BTreeMap<u8, usize> = BTreeMap::new();
        let (mut quadratic, mut quads) = (0, 0);
        let mut taken = Vec::new();
        let mut data = MeshData { nodes, ..MeshData::default() };
        for (cell, &cell_type) in self.types.iter().enumerate() {
            if !wanted(cell_type) {
                *left_out.entry(cell_type).or_default() += 1;
                continue;
            }
            let expected = match cell_type {
                TRIANGLE => 3,
                QUADRATIC_TETRAHEDRON => 10,
                _ => 4,
            };
            let corners = self.nodes(cell);
            if corners.len() != expected {
                return Err(format!(
                    "cell {cell}: a {} has {expected} nodes, found {}",
                    type_name(cell_type),
                    corners.len()
                ));
            }
            taken.push(cell as u32);
            match (cell_type, corners) {
                (TRIANGLE, &[a, b, c]) => data.triangles.push([a, b, c]),
                (QUAD, &[a, b, c, d]) => {
                    quads += 1;
                    taken.push(cell as u32);
                    data.triangles.extend([[a, b, c], [a, c, d]]);
                }
                (_, corners) => {
                    quadratic += usize::from(cell_type == QUADRATIC_TETRAHEDRON);
                    data.tetrahedra.push([corners[0], corners[1], corners[2], corners[3]]);
                }
            }
        }
        let regions = regions.filter(|regions| has_tetrahedra && regions.len() == self.len());
        if let Some(regions) = regions {
            data.regions = taken.iter().map(|&cell| regions[cell as usize]).collect();
        }
        for (of_cells, kept) in fibres.into_iter().zip(&mut data.fibres) {
            let fibres = of_cells.filter(|fibres| has_tetrahedra && fibres.len() == self.len());
            if let Some(fibres) = fibres {
                *kept = taken.iter().map(|&cell| fibres[cell as usize]).collect();
            }
        }
        if quadratic > 0 {
            notes.push(format!("quadratic tetrahedra read by their four corners: {quadratic}"));
        }
        if quads > 0 {
            notes.push(format!("quadrilaterals split into two triangles each: {quads}"));
        }
        for (&cell_type, &count) in &left_out {
            let name = type_name(cell_type);
            notes.push(format!("cells of type {name} ({cell_type}) left out: {count}"));
        }
        if quadratic > 0 || !left_out.is_empty() {
            drop_loose_nodes(&mut data, &mut notes);
        }
        let lines = taken.iter().filter_map(|&cell| self.lines.get(cell as usize).copied());
        Ok(Selection { lines: lines.collect(), data, notes })
    }
}

/// Drops nodes that only cells left out use; a mesh with faults is left as it is for its error.
fn drop_loose_nodes(data: &mut MeshData, notes: &mut Vec<String>) {
    let in_range = |&node: &u32| (node as usize) < data.nodes.len();
    let sound = data.nodes.as_flattened().iter().all(|x| x.is_finite())
        && data.tetrahedra.as_flattened().iter().all(in_range)
        && data.triangles.as_flattened().iter().all(in_range);
    if !sound {
        return;
    }
    let loose = drop_unused_nodes(data);
    if !loose.is_empty() {
        let nodes = counted(loose.count, "node", "nodes");
        notes.push(format!("{nodes} of no cell that was read left out: {loose}"));
    }
}

/// The head of an array of version 5.
fn section<R: Read>(values: &mut Values<R>, keyword: &str) -> Result<Scalar, ReadError> {
    let word = values.word(keyword)?;
    if !word.eq_ignore_ascii_case(keyword) {
        return syntax(format!("expected {keyword}, found `{word}`"));
    }
    let scalar = values.scalar_type()?;
    values.begin_data()?;
    Ok(scalar)
}
