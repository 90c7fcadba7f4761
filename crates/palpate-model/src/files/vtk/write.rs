//! Writes legacy `.vtk`, version 4.2: every program that reads the format reads this.

use std::io::{self, Write};
use std::path::Path;

use super::super::{FileError, write_atomically};
use crate::mesh::Mesh;
use crate::number::Shortest;

/// How numbers are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VtkEncoding {
    /// Big-endian bytes: small and exact.
    #[default]
    Binary,
    /// Shortest decimals that read back to the same bits.
    Ascii,
}

/// Writes an unstructured grid of tetrahedra, or of triangles for a surface-only mesh; regions
/// become the cell data `region`, fibres `fibres` and `fibres_2`. Node sets have no place in the
/// format.
///
/// # Errors
/// If the file cannot be written.
pub fn write_vtk(path: &Path, mesh: &Mesh, encoding: VtkEncoding) -> Result<(), FileError> {
    write_atomically(path, |out| write(out, mesh, encoding))
}

fn write(out: &mut dyn Write, mesh: &Mesh, encoding: VtkEncoding) -> io::Result<()> {
    let name = match encoding {
        VtkEncoding::Binary => "BINARY",
        VtkEncoding::Ascii => "ASCII",
    };
    writeln!(out, "# vtk DataFile Version 4.2\nmesh\n{name}\nDATASET UNSTRUCTURED_GRID")?;
    writeln!(out, "POINTS {} double", mesh.nodes().len())?;
    points(out, mesh.nodes(), encoding)?;
    if mesh.is_surface_only() {
        cells(out, mesh.triangles(), 5, encoding)?;
    } else {
        cells(out, mesh.tetrahedra(), 10, encoding)?;
    }
    if !mesh.regions().is_empty() || mesh.fibres().iter().any(|fibres| !fibres.is_empty()) {
        writeln!(out, "CELL_DATA {}", mesh.tetrahedra().len())?;
    }
    if !mesh.regions().is_empty() {
        writeln!(out, "SCALARS region int 1\nLOOKUP_TABLE default")?;
        mesh.regions().iter().try_for_each(|&region| row(out, &[region], encoding))?;
        end_section(out, encoding)?;
    }
    for (name, fibres) in ["fibres", "fibres_2"].iter().zip(mesh.fibres()) {
        if !fibres.is_empty() {
            writeln!(out, "VECTORS {name} double")?;
            points(out, fibres, encoding)?;
        }
    }
    Ok(())
}

fn points(out: &mut dyn Write, points: &[[f64; 3]], encoding: VtkEncoding) -> io::Result<()> {
    for point in points {
        match encoding {
            VtkEncoding::Binary => {
                point.iter().try_for_each(|x| out.write_all(&x.to_be_bytes()))?;
            }
            VtkEncoding::Ascii => {
                let [x, y, z] = point.map(Shortest);
                writeln!(out, "{x} {y} {z}")?;
            }
        }
    }
    end_section(out, encoding)
}

fn cells<const N: usize>(
    out: &mut dyn Write,
    elements: &[[u32; N]],
    cell_type: i32,
    encoding: VtkEncoding,
) -> io::Result<()> {
    writeln!(out, "CELLS {} {}", elements.len(), (N + 1) * elements.len())?;
    for nodes in elements {
        let mut numbers = [N as i32; 5];
        for (number, &node) in numbers[1..].iter_mut().zip(nodes) {
            *number = i32::try_from(node).map_err(|_| {
                io::Error::new(
                    io::ErrorKind::InvalidData,
                    "legacy .vtk numbers nodes to 2147483647",
                )
            })?;
        }
        row(out, &numbers[..=N], encoding)?;
    }
    end_section(out, encoding)?;
    writeln!(out, "CELL_TYPES {}", elements.len())?;
    elements.iter().try_for_each(|_| row(out, &[cell_type], encoding))?;
    end_section(out, encoding)
}

fn row(out: &mut dyn Write, numbers: &[i32], encoding: VtkEncoding) -> io::Result<()> {
    match encoding {
        VtkEncoding::Binary => numbers.iter().try_for_each(|n| out.write_all(&n.to_be_bytes())),
        VtkEncoding::Ascii => {
            for (position, number) in numbers.iter().enumerate() {
                write!(out, "{}{number}", if position == 0 { "" } else { " " })?;
            }
            writeln!(out)
        }
    }
}

fn end_section(out: &mut dyn Write, encoding: VtkEncoding) -> io::Result<()> {
    if encoding == VtkEncoding::Binary { writeln!(out) } else { Ok(()) }
}
