//! Object data on disk, by extension. A format is a file below and its line in `FORMATS`.

mod model;
mod seg;
mod tokens;
mod vtk;

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use crate::mesh::{Mesh, MeshData, MeshError, Place};
use tokens::ReadError;

pub use model::write_model;
pub use vtk::{VtkEncoding, write_vtk};

/// How a mesh file is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// Mend what can be mended ([`Mesh::repaired`]) instead of refusing it.
    pub repair: bool,
}

/// A mesh from a file, and what the reader has to say about it.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadMesh {
    /// The mesh, in the file's own unit of length.
    pub mesh: Mesh,
    /// What was left out, converted or repaired, one sentence each.
    pub notes: Vec<String>,
}

/// Why a mesh file could not be read or written: file, line where the format has lines, and cause.
#[derive(Debug)]
pub struct FileError {
    path: PathBuf,
    line: Option<usize>,
    cause: FileErrorCause,
}

/// What is wrong with a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileErrorCause {
    /// The operating system refused.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// The text is not in the format.
    #[error("{0}")]
    Syntax(String),
    /// The arrays do not make a mesh.
    #[error("{0}")]
    Mesh(#[from] MeshError),
    /// The extension belongs to no format that is known here.
    #[error(
        "{} is no mesh format known here; this reads and writes .{}, the Python package converts others",
        if .0.is_empty() { "a name without extension".to_owned() } else { format!(".{}", .0) },
        MESH_EXTENSIONS.join(" and .")
    )]
    UnknownFormat(String),
}

impl FileError {
    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The line, from 1, where the format has lines and the error has a place.
    pub fn line(&self) -> Option<usize> {
        self.line
    }

    /// The operating system's error, where that is what is wrong.
    pub fn io_error(&self) -> Option<&io::Error> {
        match &self.cause {
            FileErrorCause::Io(error) => Some(error),
            _ => None,
        }
    }

    /// What is wrong.
    pub fn cause(&self) -> &FileErrorCause {
        &self.cause
    }
}

impl std::fmt::Display for FileError {
    /// `kidney.seg:17: tetrahedron 3: node index 99 is out of range (the mesh has 20 nodes)`.
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "{}:", self.path.display())?;
        if let Some(line) = self.line {
            write!(out, "{line}:")?;
        }
        write!(out, " {}", self.cause)
    }
}

impl std::error::Error for FileError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.cause)
    }
}

/// What a reader hands over.
struct Parsed {
    data: MeshData,
    notes: Vec<String>,
    /// Line of the node or element that was asked for.
    sought_line: Option<usize>,
}

struct ParseFailure {
    line: Option<usize>,
    error: ReadError,
}

/// A format of mesh files.
struct Format {
    /// The end of the files' names, in lower case.
    extension: &'static str,
    /// Reads the arrays of a stream of so many bytes; nothing but their lengths is checked. The place is
    /// the node or element whose line the caller wants to know.
    read: fn(&mut dyn Read, u64, Option<Place>) -> Result<Parsed, ParseFailure>,
    /// Writes a whole file or none.
    write: fn(&Path, &Mesh) -> Result<(), FileError>,
}

/// The formats that are known.
const FORMATS: &[Format] = &[seg::FORMAT, vtk::FORMAT];

/// The extensions of the formats that are read and written here.
pub const MESH_EXTENSIONS: [&str; FORMATS.len()] = {
    let mut extensions = [""; FORMATS.len()];
    let mut index = 0;
    while index < FORMATS.len() {
        extensions[index] = FORMATS[index].extension;
        index += 1;
    }
    extensions
};

impl Format {
    fn of(path: &Path) -> Result<&'static Self, FileErrorCause> {
        let extension = path.extension().and_then(OsStr::to_str).unwrap_or_default();
        let mut known = FORMATS.iter();
        known
            .find(|format| extension.eq_ignore_ascii_case(format.extension))
            .ok_or_else(|| FileErrorCause::UnknownFormat(extension.to_owned()))
    }
}

/// Reads a mesh file, streaming; `.seg` or legacy `.vtk` by its extension.
///
/// # Errors
/// If the file cannot be read, is not in its format, or does not describe a mesh.
pub fn read_mesh(path: &Path, options: &ReadOptions) -> Result<ReadMesh, FileError> {
    let fail = |line, cause| FileError { path: path.to_owned(), line, cause };
    let format = Format::of(path).map_err(|cause| fail(None, cause))?;
    let parse = |sought| {
        let open = || -> io::Result<(File, u64)> {
            let file = File::open(path)?;
            let size = file.metadata()?.len();
            Ok((file, size))
        };
        let (mut file, size) =
            open().map_err(|error| ParseFailure { line: None, error: error.into() })?;
        (format.read)(&mut file, size, sought)
    };
    let parsed = parse(None).map_err(|failure| match failure.error {
        ReadError::Io(error) => fail(None, error.into()),
        ReadError::Syntax(message) => fail(failure.line, FileErrorCause::Syntax(message)),
    })?;
    build(parsed, *options).map_err(|error| {
        // Only a file that is wrong pays for finding the line: it is read again.
        let line = error.place().and_then(|place| parse(Some(place)).ok()?.sought_line);
        fail(line, error.into())
    })
}

fn build(parsed: Parsed, options: ReadOptions) -> Result<ReadMesh, MeshError> {
    let mut notes = parsed.notes;
    let mesh = if options.repair {
        let (mesh, report) = Mesh::repaired(parsed.data)?;
        notes.extend(report.lines());
        mesh
    } else {
        Mesh::new(parsed.data)?
    };
    Ok(ReadMesh { mesh, notes })
}

/// Writes a mesh file; `.seg` or binary legacy `.vtk` by its extension.
///
/// The file appears under its name when it is complete, never half written. `.seg` keeps everything;
/// `.vtk` keeps no node sets.
///
/// # Errors
/// If the extension is unknown, the file cannot be written, or a node set's name cannot be.
pub fn write_mesh(path: &Path, mesh: &Mesh) -> Result<(), FileError> {
    let format =
        Format::of(path).map_err(|cause| FileError { path: path.to_owned(), line: None, cause })?;
    (format.write)(path, mesh)
}

/// Writes beside `path` and renames, so that a file under that name is always complete.
fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), FileError> {
    write_whole(path, write).map_err(|error| FileError {
        path: path.to_owned(),
        line: None,
        cause: error.into(),
    })
}

/// Writes a file of any kind under a temporary name beside `path` and renames it: under its own name
/// it is complete or absent.
///
/// # Errors
/// If the file cannot be written or renamed; nothing is left behind then.
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    let result = (|| {
        let mut out = BufWriter::new(File::create(&part)?);
        write(&mut out)?;
        out.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()?;
        fs::rename(&part, path)
    })();
    // The first error is the one to tell; a leftover that cannot be removed changes nothing.
    result.inspect_err(|_| drop(fs::remove_file(&part)))
}

#[cfg(test)]
mod fuzz;
