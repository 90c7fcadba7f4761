//! `.seg` and `.vtk`, ASCII and binary: an error or a mesh, and a mesh comes back as it was written.

use std::path::Path;

use palpate::Mesh;
use palpate::model::files::{ReadOptions, VtkEncoding, read_mesh, write_mesh, write_vtk};

use super::{Target, ensure};

/// Files of one extension.
pub(crate) struct MeshFile {
    pub(crate) extension: &'static str,
}

impl Target for MeshFile {
    fn name(&self) -> &'static str {
        self.extension
    }

    fn words(&self) -> &'static [&'static str] {
        if self.extension == "seg" {
            &["nodes", "tetrahedra", "triangles", "regions", "fibres", "fibres_2", "set", "//", ","]
        } else {
            &[
                "POINTS",
                "CELLS",
                "CELL_TYPES",
                "POLYGONS",
                "TRIANGLE_STRIPS",
                "LINES",
                "VERTICES",
                "POINT_DATA",
                "CELL_DATA",
                "SCALARS",
                "VECTORS",
                "FIELD",
                "LOOKUP_TABLE",
                "METADATA",
                "OFFSETS",
                "CONNECTIVITY",
                "vtktypeint64",
                "float",
                "double",
                "int",
                "long",
                "char",
                "unsigned_char",
                "short",
                "bit",
                "string",
                "NORMALS",
                "TENSORS",
                "COLOR_SCALARS",
                "TEXTURE_COORDINATES",
                "GLOBAL_IDS",
                "BINARY",
                "ASCII",
                "POLYDATA",
                "UNSTRUCTURED_GRID",
                "DATASET",
                "\n",
                "region",
                "fibres",
                "material",
            ]
        }
    }

    fn warranted_memory(&self, input: usize) -> usize {
        // The window, and for each byte less than a tetrahedron with four nodes and their surface.
        512 * 1024 + 400 * input
    }

    fn try_input(&self, input: &[u8], scratch: &Path) -> Result<String, String> {
        let file = scratch.join(format!("mesh.{}", self.extension));
        std::fs::write(&file, input).map_err(|error| error.to_string())?;
        let strict = read_mesh(&file, &ReadOptions::default());
        let mended = read_mesh(&file, &ReadOptions { repair: true });
        let outcome = match (&strict, &mended) {
            (Err(error), Err(_)) => return Ok(error.to_string()),
            (Ok(_), Err(error)) => return Err(format!("repair refuses a sound mesh: {error}")),
            (Ok(strict), Ok(mended)) => {
                comes_back(&strict.mesh, scratch)?;
                format!("read, mended: {}", strict.mesh == mended.mesh)
            }
            (Err(error), Ok(_)) => format!("mended: {error}"),
        };
        let mesh = mended.map_err(|error| error.to_string())?.mesh;
        comes_back(&mesh, scratch)?;
        // What only has to end: it says something of any mesh.
        let defects = mesh.validate();
        ensure(!mesh.volume().is_nan() || huge(&mesh), || "the volume is not a number".into())?;
        Ok(format!("{outcome} {}", defects.len()))
    }
}

/// Whether the products of coordinates overflow.
fn huge(mesh: &Mesh) -> bool {
    mesh.nodes().as_flattened().iter().any(|x| x.abs() > 1e100)
}

fn comes_back(mesh: &Mesh, scratch: &Path) -> Result<(), String> {
    let same = |read: &Mesh| {
        let bits = |mesh: &Mesh| -> Vec<u64> {
            mesh.nodes().as_flattened().iter().map(|x| x.to_bits()).collect()
        };
        read == mesh && bits(read) == bits(mesh)
    };
    let seg = scratch.join("again.seg");
    match write_mesh(&seg, mesh) {
        Ok(()) => {
            let read = read_mesh(&seg, &ReadOptions::default())
                .map_err(|error| format!("a written .seg is not read: {error}"))?;
            ensure(same(&read.mesh), || "a .seg comes back as another mesh".into())?;
        }
        Err(error) => {
            ensure(error.io_error().is_none(), || error.to_string())?;
        }
    }
    let mut data = mesh.clone().into_data();
    data.node_sets.clear();
    let without_sets = Mesh::new(data).map_err(|error| format!("its own data: {error}"))?;
    for encoding in [VtkEncoding::Ascii, VtkEncoding::Binary] {
        let vtk = scratch.join("again.vtk");
        write_vtk(&vtk, mesh, encoding).map_err(|error| error.to_string())?;
        let read = read_mesh(&vtk, &ReadOptions::default())
            .map_err(|error| format!("a written .vtk ({encoding:?}) is not read: {error}"))?;
        ensure(read.mesh == without_sets, || {
            format!("a .vtk ({encoding:?}) comes back as another mesh")
        })?;
    }
    Ok(())
}
