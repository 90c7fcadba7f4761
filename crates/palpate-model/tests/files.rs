//! `.seg` and `.vtk`: exact round trips, errors with their place, and what readers leave out.

#[path = "support/grid.rs"]
mod grid;

use std::fs;
use std::path::{Path, PathBuf};

use grid::box_data;
use insta::assert_snapshot;
use palpate_model::files::{VtkEncoding, write_vtk};
use palpate_model::{Mesh, MeshData, ReadMesh, ReadOptions, read_mesh, write_mesh};
use proptest::prelude::*;
use tempfile::TempDir;

fn read(path: &Path) -> ReadMesh {
    read_mesh(path, &ReadOptions::default()).unwrap()
}

/// The error of a file with this text, without its folder.
fn error_of(name: &str, text: impl AsRef<[u8]>) -> String {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, text).unwrap();
    let error = read_mesh(&path, &ReadOptions::default()).unwrap_err();
    assert_eq!(error.path(), path);
    error.to_string().replace(&format!("{}/", folder.path().display()), "")
}

fn full_mesh() -> Mesh {
    let mut data = box_data([3, 2, 1], [0.3, 0.2, 0.1]);
    data.regions = (0..data.tetrahedra.len() as i32).map(|index| index % 5 - 2).collect();
    let fibres = |turn: f64| {
        let angles = (0..data.tetrahedra.len()).map(|index| turn + 0.1 * index as f64);
        angles.map(|angle| [angle.cos(), 0.3 * angle.sin(), 1e-9]).collect()
    };
    data.fibres = [fibres(0.0), fibres(1.0)];
    data.fibres[1][2] = [0.0; 3];
    data.node_sets.insert("hilum".into(), vec![0, 4, 7]);
    data.node_sets.insert("none".into(), Vec::new());
    Mesh::new(data).unwrap()
}

#[test]
fn a_written_mesh_reads_back_the_same() {
    let folder = TempDir::new().unwrap();
    let mesh = full_mesh();
    let mut bare = mesh.clone().into_data();
    bare.node_sets.clear();
    let bare = Mesh::new(bare).unwrap();
    let mut second_only = bare.clone().into_data();
    second_only.regions.clear();
    second_only.fibres[0].clear();
    let second_only = Mesh::new(second_only).unwrap();
    let shell = MeshData {
        nodes: mesh.nodes().to_vec(),
        triangles: mesh.triangles().to_vec(),
        ..MeshData::default()
    };
    let shell = Mesh::new(shell).unwrap();
    let path = folder.path().join("mesh.seg");
    for mesh in [&mesh, &second_only, &shell] {
        write_mesh(&path, mesh).unwrap();
        assert_eq!(read(&path), ReadMesh { mesh: mesh.clone(), notes: Vec::new() });
    }
    let path = folder.path().join("mesh.vtk");
    for encoding in [VtkEncoding::Binary, VtkEncoding::Ascii] {
        for mesh in [&bare, &second_only, &shell] {
            write_vtk(&path, mesh, encoding).unwrap();
            assert_eq!(read(&path), ReadMesh { mesh: mesh.clone(), notes: Vec::new() });
        }
    }
    let left: Vec<_> =
        fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 2, "{left:?}");
}

#[test]
fn a_failed_write_leaves_the_old_file() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("mesh.seg");
    write_mesh(&path, &full_mesh()).unwrap();
    let before = fs::read(&path).unwrap();
    let mut data = full_mesh().into_data();
    data.node_sets.insert("two words".into(), vec![1]);
    let error = write_mesh(&path, &Mesh::new(data).unwrap()).unwrap_err();
    assert!(error.to_string().contains("node set \"two words\""), "{error}");
    assert_eq!(fs::read(&path).unwrap(), before);
    assert!(write_mesh(&folder.path().join("no/mesh.seg"), &full_mesh()).is_err());
    let error = write_mesh(Path::new("mesh.stl"), &full_mesh()).unwrap_err();
    assert_snapshot!(error, @"mesh.stl: .stl is no mesh format known here; this reads and writes .seg and .vtk, the Python package converts others");
}

const CORNER: &str = "seg 1\nnodes 4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n";

#[test]
fn errors_of_seg_files_name_file_line_and_index() {
    let cases = [
        (String::new(), "empty"),
        ("nodes 4".to_owned(), "no header"),
        ("seg 2".to_owned(), "version"),
        (format!("{CORNER}tetrahedra 1\n0 1 2 99\n"), "out of range"),
        (format!("{CORNER}tetrahedra 2\n// first\n0 1 2 3\n\n0 1 2\n-3\n"), "negative index"),
        (format!("{CORNER}tetrahedra 2\n0 1 2 3\n"), "too few"),
        (format!("{CORNER}0 0 1\ntetrahedra 1\n0 1 2 3\n"), "too many"),
        ("seg 1\nnodes 2\n0 0\n0 0\ntetrahedra 1".to_owned(), "short node"),
        (format!("{CORNER}tetrahedra 1\n0 1 2 3\nedges 3\n"), "unknown section"),
        (format!("{CORNER}nodes 1\n0 0 0\n"), "twice"),
        (format!("{CORNER}tetrahedra 2 0 1 2 3\n // the second\n 1 0 2 3"), "inverted"),
        ("seg 1\nnodes 3\n0 0 0\n1 0\nnan\n0 1 0\ntriangles 1 0 1 2".to_owned(), "nan"),
        (format!("{CORNER}triangles 2\n0 1 2\n2 1 2"), "repeated node"),
        (format!("{CORNER}regions 1\n"), "regions first"),
        (format!("{CORNER}tetrahedra 1 0 1 2 3\nset a 1 9\n"), "set range"),
        (format!("{CORNER}tetrahedra 1 0 1 2 3\nset a 1 1\nset a 1 2\n"), "set twice"),
        (format!("{CORNER}tetrahedra 1 0 1 2 3\nregions\n1.5"), "region"),
        (CORNER.to_owned(), "no elements"),
    ];
    let text: Vec<String> = cases
        .iter()
        .map(|(text, name)| format!("{name}: {}", error_of("kidney.seg", text)))
        .collect();
    assert_snapshot!(text.join("\n"), @r"
    empty: kidney.seg:1: the file is empty; expected `seg 1`
    no header: kidney.seg:1: expected `seg 1` at the start, found `nodes`
    version: kidney.seg:1: version 2 of .seg is not known; this reads version 1
    out of range: kidney.seg:8: tetrahedron 0: node index 99 is out of range (the mesh has 4 nodes)
    negative index: kidney.seg:12: tetrahedron 1 of 2: expected a node index, found `-3`
    too few: kidney.seg:9: tetrahedron 1 of 2: expected a node index, found the end of the file
    too many: kidney.seg:7: expected a section (nodes, tetrahedra, triangles, regions, fibres, fibres_2, set) or the end of the file, found `0`; `nodes` announces fewer values
    short node: kidney.seg:5: node 1 of 2: expected a coordinate, found `tetrahedra`
    unknown section: kidney.seg:9: expected a section (nodes, tetrahedra, triangles, regions, fibres, fibres_2, set) or the end of the file, found `edges`
    twice: kidney.seg:7: a second `nodes` section; a mesh has one
    inverted: kidney.seg:9: 1 tetrahedron is inverted (negative volume): 1; repair re-orients them
    nan: kidney.seg:4: node 1: position (1, 0, NaN) is not finite; give coordinates in metres
    repeated node: kidney.seg:9: triangle 1: node 2 is named twice; name different nodes
    regions first: kidney.seg:7: `regions` has one number for each tetrahedron: give `tetrahedra` first
    set range: kidney.seg: set `a`: node index 9 is out of range (the mesh has 4 nodes)
    set twice: kidney.seg:9: a second set `a`; give each name once
    region: kidney.seg:9: region of tetrahedron 0 of 1: expected a whole number, found `1.5`
    no elements: kidney.seg: the mesh has neither tetrahedra nor triangles; give one of them
    ");
    assert!(error_of("kidney.seg", [b's', b'e', 0xff, 0xfe]).contains("no text file"));
}

#[test]
fn a_missing_file_and_an_unknown_format_are_told() {
    let error = read_mesh(Path::new("nowhere/kidney.seg"), &ReadOptions::default()).unwrap_err();
    assert!(error.to_string().starts_with("nowhere/kidney.seg: No such file"), "{error}");
    assert_eq!(error.line(), None);
    let error = read_mesh(Path::new("kidney.msh"), &ReadOptions::default()).unwrap_err();
    assert_snapshot!(error, @"kidney.msh: .msh is no mesh format known here; this reads and writes .seg and .vtk, the Python package converts others");
}

#[test]
fn repair_is_an_option_and_is_noted() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("inverted.seg");
    fs::write(&path, format!("{CORNER}tetrahedra 1\n0 2 1 3\n")).unwrap();
    assert!(read_mesh(&path, &ReadOptions::default()).is_err());
    let read = read_mesh(&path, &ReadOptions { repair: true }).unwrap();
    assert_eq!(read.mesh.tetrahedra(), [[0, 2, 3, 1]]);
    assert_eq!(read.notes, ["re-oriented 1 inverted tetrahedron: 0"]);
}

fn vtk(body: &str) -> String {
    format!("# vtk DataFile Version 3.0\na title\nASCII\nDATASET UNSTRUCTURED_GRID\n{body}")
}

const POINTS: &str = "POINTS 6 float\n0 0 0 1 0 0 0 1 0\n0 0 1 5 5 5\n6 6 6\n";

#[test]
fn tetrahedra_are_found_among_mixed_cells_and_the_rest_is_reported() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("mixed.vtk");
    let body = format!(
        "{POINTS}CELLS 4 17\n3 0 1 2\n4 0 1 2 3\n4 0 1 2 4\n2 4 5\nCELL_TYPES 4\n5 10 10 3\n\
         CELL_DATA 4\nSCALARS quality float\nLOOKUP_TABLE default\n1 2 3 4\nSCALARS Region int 1\n\
         LOOKUP_TABLE default\n7 8 9 10\nPOINT_DATA 6\nFIELD data 2\nlabels 1 6 string\na b\nc\n\
         d\ne\nf\ng\nsize 1 6 int\n1 2 3 4 5 6\n"
    );
    fs::write(&path, vtk(&body)).unwrap();
    let found = read(&path);
    assert_eq!(found.mesh.tetrahedra(), [[0, 1, 2, 3], [0, 1, 2, 4]]);
    assert_eq!(found.mesh.regions(), [8, 9]);
    assert_snapshot!(found.notes.join("\n"), @r"
    cells of type line (3) left out: 1
    cells of type triangle (5) left out: 1
    1 node of no cell that was read left out: 5
    ");
}

#[test]
fn quadratic_tetrahedra_are_read_by_their_corners() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("quadratic.vtk");
    let body = "POINTS 10 float\n0 0 0 .5 0 0 1 0 0 0 1 0 0 0 1 .5 .5 0 0 .5 0 0 0 .5 .5 0 .5 0 .5 .5\n\
        CELLS 1 11\n10 0 2 3 4 1 5 6 7 8 9\nCELL_TYPES 1\n24\n";
    fs::write(&path, vtk(body)).unwrap();
    let found = read(&path);
    assert_eq!(found.mesh.tetrahedra(), [[0, 1, 2, 3]]);
    assert_eq!(found.mesh.nodes()[1], [1.0, 0.0, 0.0]);
    assert_snapshot!(found.notes.join("\n"), @r"
    quadratic tetrahedra read by their four corners: 1
    6 nodes of no cell that was read left out: 1, 5, 6, 7, 8, 9
    ");
}

#[test]
fn polygons_become_a_surface() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("surface.vtk");
    let text = "# vtk DataFile Version 2.0\n\nASCII\nDATASET POLYDATA\nPOINTS 5 int\n0 0 0 1 0 0 1 1 0\
        \n0 1 0 2 2 2\nVERTICES 1 2\n1 0\nPOLYGONS 2 9\n4 0 1 2 3\n3 1 4 2\nLINES 1 3\n2 0 1\n";
    fs::write(&path, text).unwrap();
    let found = read(&path);
    assert_eq!(found.mesh.triangles(), [[0, 1, 2], [0, 2, 3], [1, 4, 2]]);
    assert_snapshot!(found.notes.join("\n"), @r"
    quadrilaterals split into two triangles each: 1
    cells of type vertex (1) left out: 1
    cells of type line (3) left out: 1
    ");
}

#[test]
fn version_5_stores_offsets_and_connectivity_in_binary() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("v5.vtk");
    let mut bytes = b"# vtk DataFile Version 5.1\nvtk output\nBINARY\nDATASET UNSTRUCTURED_GRID\n\
        FIELD FieldData 1\nTime 1 1 double\n\0\0\0\0\0\0\0\0\nMETADATA\nINFORMATION 0\n\nPOINTS 5 double\n"
        .to_vec();
    let nodes: [[f64; 3]; 5] =
        [[0.1, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0; 3]];
    bytes.extend(nodes.as_flattened().iter().flat_map(|x| x.to_be_bytes()));
    bytes.extend(b"\nMETADATA\nINFORMATION 0\n\nCELLS 3 8\nOFFSETS vtktypeint64\n");
    bytes.extend([0_i64, 4, 8].iter().flat_map(|x| x.to_be_bytes()));
    bytes.extend(b"\nCONNECTIVITY vtktypeint64\n");
    bytes.extend([0_i64, 1, 2, 3, 1, 2, 3, 4].iter().flat_map(|x| x.to_be_bytes()));
    bytes.extend(
        b"\nCELL_TYPES 2\n\0\0\0\x0a\0\0\0\x0a\nCELL_DATA 2\nFIELD FieldData 2\nnames 1 2 string\n",
    );
    bytes.extend(b"\xc1a\xc2bc\nmaterial 1 2 vtktypeint64\n");
    bytes.extend([3_i64, -4].iter().flat_map(|x| x.to_be_bytes()));
    fs::write(&path, bytes).unwrap();
    let found = read(&path);
    assert_eq!(found.mesh.nodes(), nodes);
    assert_eq!(found.mesh.tetrahedra(), [[0, 1, 2, 3], [1, 2, 3, 4]]);
    assert_eq!(found.mesh.regions(), [3, -4]);
    assert!(found.notes.is_empty(), "{:?}", found.notes);
}

#[test]
fn errors_of_vtk_files_name_the_place() {
    let cases = [
        ("seg 1".to_owned(), "not vtk"),
        ("<?xml version=\"1.0\"?>".to_owned(), "xml"),
        ("# vtk DataFile Version 9.0\n".to_owned(), "version"),
        ("# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_POINTS\n".to_owned(), "dataset"),
        (vtk("POINTS 2 float 0 0 0\n 1 x"), "number"),
        (vtk("POINTS 2 complex 0 0 0\n 1 x"), "type"),
        (vtk("POINTS 2 float\n0 0 0"), "too few"),
        (vtk(&format!("{POINTS}CELLS 1 5\n4 0 1 2 77\nCELL_TYPES 1\n10\n")), "out of range"),
        (
            vtk(&format!("{POINTS}CELLS 2 10\n4 0 1 2 3\n4 1 0 2 3\nCELL_TYPES 2\n10 10\n")),
            "inverted",
        ),
        (vtk(&format!("{POINTS}CELLS 1 5\n4 0 1 -2 3\nCELL_TYPES 1\n10\n")), "negative"),
        (vtk(&format!("{POINTS}CELLS 1 5\n9 0 1 2 3\nCELL_TYPES 1\n10\n")), "too long"),
        (vtk(&format!("{POINTS}CELLS 1 4\n3 0 1 2\nCELL_TYPES 1\n10\n")), "three corners"),
        (vtk(&format!("{POINTS}CELLS 1 5\n4 0 1 2 3\n")), "no types"),
        (vtk(&format!("{POINTS}WHAT 3\n")), "unknown"),
        (vtk(&format!("{POINTS}CELLS 1 9\n8 0 1 2 3 4 5 0 1\nCELL_TYPES 1\n12\n")), "hexahedron"),
        (vtk(""), "no points"),
    ];
    let text: Vec<String> = cases
        .iter()
        .map(|(text, name)| format!("{name}: {}", error_of("kidney.vtk", text)))
        .collect();
    assert_snapshot!(text.join("\n"), @r#"
    not vtk: kidney.vtk:1: expected `# vtk DataFile Version 4.2` at the start, found `seg 1`
    xml: kidney.vtk:1: expected `# vtk DataFile Version 4.2` at the start, found `<?xml version="1.0"?>`; this is VTK's XML format, which belongs in a .vtu file
    version: kidney.vtk:1: version `9.0` of legacy .vtk is not known; this reads 1.0 to 5.1
    dataset: kidney.vtk:4: expected UNSTRUCTURED_GRID or POLYDATA, found `STRUCTURED_POINTS`; other datasets have no tetrahedra
    number: kidney.vtk:6: point 1 of 2: expected a number, found `x`
    type: kidney.vtk:5: expected a data type such as `double`, found `complex`
    too few: kidney.vtk:6: point 1 of 2: expected a number, found the end of the file
    out of range: kidney.vtk:10: tetrahedron 0: node index 77 is out of range (the mesh has 6 nodes)
    inverted: kidney.vtk:11: 1 tetrahedron is inverted (negative volume): 1; repair re-orients them
    negative: kidney.vtk:10: cell 0: -2 is no node index
    too long: kidney.vtk:10: cell 0 of 1: it exceeds the 5 numbers announced for all cells
    three corners: kidney.vtk: cell 0: a tetrahedron has 4 nodes, found 3
    no types: kidney.vtk: 0 cell types for 1 cells; give one for each
    unknown: kidney.vtk:9: expected a section of a .vtk file such as POINTS or CELLS, found `WHAT`
    hexahedron: kidney.vtk: the mesh has neither tetrahedra nor triangles; give one of them
    no points: kidney.vtk: the file has no POINTS section
    "#);
}

#[test]
fn real_organs_are_sound_and_survive_conversion() {
    let Some(data) = std::env::var_os("PALPATE_DATA") else { return };
    let folder = TempDir::new().unwrap();
    for entry in fs::read_dir(PathBuf::from(data).join("organs")).unwrap() {
        let path = entry.unwrap().path();
        let found = read(&path);
        assert!(found.notes.is_empty(), "{}: {:?}", path.display(), found.notes);
        let copy = folder.path().join("copy.seg");
        write_mesh(&copy, &found.mesh).unwrap();
        assert!(read(&copy).mesh == found.mesh, "{}", path.display());
    }
}

proptest! {
    #[test]
    fn any_numbers_survive_the_round_trip(
        nodes in prop::collection::vec(prop::array::uniform3(prop::num::f64::ANY), 1..20),
        picks in prop::collection::vec(prop::array::uniform3(any::<prop::sample::Index>()), 1..20),
        ascii in any::<bool>(),
    ) {
        let triangles = picks.iter().map(|pick| pick.map(|index| index.index(nodes.len()) as u32));
        let data = MeshData { triangles: triangles.collect(), nodes, ..MeshData::default() };
        let Ok((mesh, _)) = Mesh::repaired(data) else { return Ok(()) };
        let bits = |mesh: &Mesh| mesh.nodes().as_flattened().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let folder = TempDir::new().unwrap();
        let seg = folder.path().join("mesh.seg");
        write_mesh(&seg, &mesh).unwrap();
        let vtk = folder.path().join("mesh.vtk");
        write_vtk(&vtk, &mesh, if ascii { VtkEncoding::Ascii } else { VtkEncoding::Binary }).unwrap();
        for path in [seg, vtk] {
            let back = read(&path).mesh;
            prop_assert_eq!(bits(&back), bits(&mesh));
            prop_assert_eq!(back.triangles(), mesh.triangles());
        }
    }
}
