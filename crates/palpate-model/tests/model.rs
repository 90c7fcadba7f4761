//! Loading a model: meshes read once, placed, mirrored, held and named.

#[path = "support/grid.rs"]
mod grid;

use std::cell::RefCell;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3};
use grid::box_data;
use insta::assert_snapshot;
use palpate_model::{
    Body, BodyError, Document, Law, LoadError, Mesh, MeshData, MeshLoader, Model, ReadMesh,
    ReadOptions, Structure, load_model, write_mesh, write_model,
};
use tempfile::TempDir;

/// Hands out one mesh for every name that ends in .seg, and remembers the names.
struct OneMesh {
    mesh: Mesh,
    asked: RefCell<Vec<PathBuf>>,
}

impl MeshLoader for OneMesh {
    fn load(&self, path: &Path) -> Result<ReadMesh, LoadError> {
        self.asked.borrow_mut().push(path.to_owned());
        if path.extension().is_none_or(|extension| extension != "seg") {
            return Err(LoadError::new(format!("{}: unknown format", path.display())));
        }
        Ok(ReadMesh { mesh: self.mesh.clone(), notes: vec!["a note".into()] })
    }
}

fn loader() -> OneMesh {
    let mut data = box_data([2, 2, 2], [2.0, 2.0, 2.0]);
    data.node_sets.insert("hilum".into(), vec![0, 26]);
    OneMesh { mesh: Mesh::new(data).unwrap(), asked: RefCell::default() }
}

fn load(text: &str) -> Model {
    let document = Document::parse(text, Path::new("models/case.bml"));
    document.unwrap().load(&loader()).unwrap_or_else(|error| panic!("{error}"))
}

fn load_errors(text: &str) -> String {
    let document = Document::parse(text, Path::new("models/case.bml"));
    let error = document.unwrap().load(&loader()).unwrap_err();
    let lines = error.diagnostics.iter().map(|diagnostic| {
        let hint = diagnostic.hint.as_ref().map(|hint| format!(" ({hint})")).unwrap_or_default();
        format!("{}:{}: {}{hint}", diagnostic.line, diagnostic.column, diagnostic.message)
    });
    lines.collect::<Vec<_>>().join("\n")
}

fn close(left: [f64; 3], right: [f64; 3]) -> bool {
    DVec3::from(left).distance(right.into()) < 1e-12
}

#[test]
fn the_canonical_sample_loads() {
    let folder = TempDir::new().unwrap();
    for name in ["kidney.seg", "aorta.seg"] {
        write_mesh(&folder.path().join(name), &loader().mesh).unwrap();
    }
    let path = folder.path().join("case1.bml");
    let text = "BRANCH{
      ME{ trans 0,0,0  rot 1,0,0,0  scale 1,1,1 }
      TREE{
        ME{ trans 2,0,0  rot 1,0,0,0  scale 1,1,2 }
        PE 1
        NE kidney.seg
      }
      TREE{
        ME{ trans 0,-2.5,-1.4  rot 1,0,0,0  scale 1,1,2 }
        PE 2
        NE aorta.seg
      }
    }";
    fs::write(&path, text).unwrap();
    let model = load_model(&path, &ReadOptions::default()).unwrap();
    let names: Vec<&str> = model.bodies.iter().map(|body| body.name.as_str()).collect();
    assert_eq!(names, ["kidney", "aorta"]);
    assert_eq!(model.bodies[1].processor, Some(2));
    assert_eq!(model.bodies[0].source, folder.path().join("kidney.seg"));
    assert_eq!(model.bodies[0].mesh.bounds().min, [2.0, 0.0, 0.0]);
    assert_eq!(model.bodies[0].mesh.bounds().max, [4.0, 2.0, 4.0]);
    assert_eq!(model.gravity, [0.0, 0.0, -9.81]);
    let bodies = [Structure::Body(0), Structure::Body(1)];
    assert_eq!(model.structure, Structure::chain(bodies).unwrap());
    let document = Document::parse(&model.to_text().unwrap(), &path).unwrap();
    assert_eq!(Some(&document), model.document.as_ref());
    let again = document.load(&ReadOptions::default()).unwrap();
    assert!(again.bodies[1].mesh == model.bodies[1].mesh);
}

#[test]
fn nested_placements_compose_as_matrices_do() {
    let model = load(
        "BRANCH{ ME{ trans 1,2,3 rot axis 0,0,1 angle 90 scale 2,1,1 }
           BRANCH{ ME{ rot 0.5,0.5,0.5,0.5 }
             TREE{ ME{ trans 5,0,0 scale 1,2,3 } NE a.seg } } TREE{ NE a.seg } }",
    );
    // Scale, then rotation, then translation; inner first. The second quaternion turns x to y to z.
    let by_hand = |[x, y, z]: [f64; 3]| {
        let [x, y, z] = [x + 5.0, 2.0 * y, 3.0 * z];
        let [x, y, z] = [z, x, y];
        let [x, y, z] = [2.0 * x, y, z];
        let [x, y, z] = [-y, x, z];
        [x + 1.0, y + 2.0, z + 3.0]
    };
    let (raw, body) = (loader().mesh, &model.bodies[0]);
    for (index, &node) in raw.nodes().iter().enumerate() {
        assert!(close(body.mesh.nodes()[index], by_hand(node)), "{node:?}");
        assert!(close(body.placement.apply(node), by_hand(node)));
    }
    let outer = model.bodies[1].placement.describe();
    assert!(close(outer.axis, [0.0, 0.0, 1.0]) && (outer.angle_degrees - 90.0).abs() < 1e-12);
    assert!(close(outer.scale, [2.0, 1.0, 1.0]) && close(outer.translation, [1.0, 2.0, 3.0]));
    let linear = DMat3::from_quat(DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2))
        * DMat3::from_diagonal(DVec3::new(2.0, 1.0, 1.0))
        * DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X)
        * DMat3::from_diagonal(DVec3::new(1.0, 2.0, 3.0));
    assert!(body.placement.linear.abs_diff_eq(linear, 1e-12));
}

#[test]
fn negative_scales_keep_tetrahedra_positive() {
    let model = load("TREE{ ME{ scale -1,1,1 } NE a.seg }");
    let mesh = &model.bodies[0].mesh;
    assert!((mesh.volume() - 8.0).abs() < 1e-12);
    assert!(mesh.validate().is_empty());
    assert_eq!(mesh.bounds().min, [-2.0, 0.0, 0.0]);
    let twice = load("BRANCH{ ME{ scale -1,1,1 } TREE{ ME{ scale 1,1,-1 } NE a.seg } }");
    assert!((twice.bodies[0].mesh.volume() - 8.0).abs() < 1e-12);
    assert_eq!(twice.bodies[0].mesh.tetrahedra(), loader().mesh.tetrahedra());
}

#[test]
fn one_unit_scales_every_length() {
    let model = load(
        "unit mm TREE{ ME{ trans 10,0,0 } NE a.seg IV 5,0,0 CN{ distance 2 stiffness 7 }
           RG{ at 0 at 1 trans 0,0,50 } FX{ box -1,-1,-1 0.5,0.5,0.5 } }",
    );
    let body = &model.bodies[0];
    assert!(close(body.mesh.bounds().max, [0.012, 0.002, 0.002]));
    assert!(close(body.initial_velocity, [0.005, 0.0, 0.0]));
    assert_eq!((body.contact.distance, body.contact.stiffness), (Some(0.002), Some(7.0)));
    let motion = body.rigid.as_ref().unwrap();
    assert!(close(motion.pivot, [0.01, 0.0, 0.0]));
    assert!(close(motion.pose(0.5).apply([0.01, 0.0, 0.0]), [0.01, 0.0, 0.025]));
    assert_eq!(body.fixed_nodes, [0]);
    assert_eq!(model.gravity, [0.0, 0.0, -9.81]);
    assert_eq!(body.validate(), Ok(()));
}

#[test]
fn inner_settings_win_entry_by_entry() {
    let model = load(
        "BRANCH{ MT{ young 1000 density 900 } CN{ friction 0.5 self off } VE{ opacity 0.5 }
           BRANCH{ MT{ young 2000 } TREE{ MT{ poisson 0.3 } CN{ self on } NE a.seg }
                   TREE{ VE{ color 1,0,0 } NE a.seg } }
           TREE{ NE a.seg } }",
    );
    let [a, b, c] = [0, 1, 2].map(|index| &model.bodies[index]);
    assert_eq!((a.material.young, a.material.density, a.material.poisson), (2000.0, 900.0, 0.3));
    assert_eq!((b.material.young, c.material.young, c.material.law), (2000.0, 1000.0, Law::Linear));
    assert!(a.contact.self_contact && !b.contact.self_contact);
    assert_eq!((a.contact.friction, b.appearance.opacity), (0.5, 0.5));
    assert_eq!((b.appearance.color, c.appearance.color), (Some([1.0, 0.0, 0.0]), None));
}

#[test]
fn files_are_read_once_and_names_are_unique() {
    let loader = loader();
    let text =
        "BRANCH{ TREE{ NE a.seg } TREE{ NE a.seg } TREE a_2{ NE b/a.seg } TREE{ NE a.seg } }";
    let document = Document::parse(text, Path::new("models/case.bml")).unwrap();
    let model = document.load(&loader).unwrap();
    let names: Vec<&str> = model.bodies.iter().map(|body| body.name.as_str()).collect();
    assert_eq!(names, ["a", "a_3", "a_2", "a_4"]);
    assert_eq!(*loader.asked.borrow(), [Path::new("models/a.seg"), Path::new("models/b/a.seg")]);
    assert!(Arc::ptr_eq(&model.bodies[0].mesh, &model.bodies[1].mesh));
    assert_eq!(model.notes, ["models/a.seg: a note", "models/b/a.seg: a note"]);
    let body = Structure::Body;
    let join = |left, right| Structure::Join(Box::new(left), Box::new(right));
    assert_eq!(model.structure, join(join(join(body(0), body(1)), body(2)), body(3)));
}

#[test]
fn held_nodes_are_those_of_any_region() {
    let model = load("TREE{ NE a.seg FX{ set hilum } FX{ box 2,2,2 2,2,0 sphere 0,0,0 0.1 } }");
    assert_eq!(model.bodies[0].fixed_nodes, [0, 8, 17, 26]);
    let moved = load("TREE{ ME{ trans 9,9,9 scale 3,3,3 } NE a.seg FX{ box 2,2,2 2,2,0 } }");
    assert_eq!(moved.bodies[0].fixed_nodes, [8, 17, 26]);
}

#[test]
fn errors_of_meshes_stand_at_their_elements() {
    let text = "BRANCH{
  TREE{ NE a.msh }
  TREE{ NE a.msh }
  TREE{ NE a.seg FX{ set hilun } FX{ sphere 9,9,9 1 } }
  TREE{ NE a.seg ME{ scale 2,2,2 } }
  TREE{ NE a.seg ME{ scale 1e300,1,1 trans 1e308,0,0 rot axis 0,0,1 angle 45 } }
  TREE{ NE \"b c.obj\" }
}";
    assert_snapshot!(load_errors(text), @r"
    2:12: models/a.msh: unknown format
    4:22: the mesh has no node set `hilun` (hilun: did you mean hilum?)
    4:38: this FX holds no node of the mesh (in its file the mesh lies between 0,0,0 and 2,2,2)
    6:12: a.seg cannot be placed: 36 of its tetrahedra lose their volume (numbers of the ME blocks around it are too large or too small)
    7:12: models/b c.obj: unknown format
    ");
}

#[test]
fn core_loader_errors_are_shown_at_the_file_name() {
    let folder = TempDir::new().unwrap();
    write_mesh(&folder.path().join("kidney.seg"), &loader().mesh).unwrap();
    fs::write(folder.path().join("bad.seg"), "seg 1\nnodes 1\n0 0 zero\n").unwrap();
    fs::write(
        folder.path().join("case.bml"),
        "BRANCH{\n TREE{ NE kidny.seg }\n TREE{ NE bad.seg }\n TREE{ NE kidney.stl }\n}\n",
    )
    .unwrap();
    let error = load_model(&folder.path().join("case.bml"), &ReadOptions::default()).unwrap_err();
    assert_eq!((error.first().line, error.first().column), (2, 11));
    let text = error.to_string().replace(&format!("{}/", folder.path().display()), "");
    assert_snapshot!(text, @r"
    error: kidny.seg: No such file or directory (os error 2)
     --> case.bml:2:11
      |
    2 |  TREE{ NE kidny.seg }
      |           ^^^^^^^^^
      |
      = help: kidny.seg: did you mean kidney.seg?

    error: bad.seg:3: node 0 of 1: expected a coordinate, found `zero`
     --> case.bml:3:11
      |
    3 |  TREE{ NE bad.seg }
      |           ^^^^^^^

    error: kidney.stl: .stl is no mesh format known here; this reads and writes .seg and .vtk, the Python package converts others
     --> case.bml:4:11
      |
    4 |  TREE{ NE kidney.stl }
      |           ^^^^^^^^^^
      |
      = help: kidney.stl: did you mean kidney.seg?
    ");
    let error = load_model(Path::new("nowhere.bml"), &ReadOptions::default()).unwrap_err();
    assert_snapshot!(error, @"error: nowhere.bml: No such file or directory (os error 2)");
    fs::write(folder.path().join("binary.bml"), [0xff, 0xfe]).unwrap();
    let error = load_model(&folder.path().join("binary.bml"), &ReadOptions::default()).unwrap_err();
    assert!(error.to_string().contains("not UTF-8"), "{error}");
}

#[test]
fn bodies_from_arrays_make_a_model_without_a_text() {
    let mesh = Arc::new(loader().mesh);
    let bodies = ["a", "b", "c"].map(|name| Body::new(name, Arc::clone(&mesh)));
    let model = Model::from_bodies(bodies.to_vec());
    assert_eq!(model.to_text(), None);
    assert_eq!(model.gravity, Document::GRAVITY);
    assert_eq!(model.structure, Structure::chain([0, 1, 2].map(Structure::Body)).unwrap());

    let mut body = model.bodies[0].clone();
    assert_eq!(body.validate(), Ok(()));
    body.material.poisson = 0.5;
    assert_snapshot!(body.validate().unwrap_err(), @"poisson must be greater than -1 and less than 0.5, found 0.5");
    body.material = palpate_model::Material::default();
    body.fixed_nodes = vec![0, 27];
    assert_eq!(body.validate(), Err(BodyError::FixedNodeOutOfRange { node: 27, node_count: 27 }));
    assert_snapshot!("plastic".parse::<Law>().unwrap_err(), @r#"law "plastic" is not known; it must be one of linear, corotated, stvk, neo-hookean, mooney-rivlin, hgo"#);
    for name in Law::NAMES {
        assert_eq!(name.parse::<Law>().unwrap().to_string(), name);
    }
}

/// The mesh of [`loader`] in two regions, 1 and 4, with fibres in the first of them only.
fn two_regions() -> OneMesh {
    let mut data = loader().mesh.into_data();
    let half = data.tetrahedra.len() / 2;
    data.regions =
        (0..data.tetrahedra.len()).map(|index| if index < half { 1 } else { 4 }).collect();
    let along = |&region: &i32| [if region == 1 { 2.0 } else { 0.0 }, 0.0, 0.0];
    data.fibres[0] = data.regions.iter().map(along).collect();
    OneMesh { mesh: Mesh::new(data).unwrap(), asked: RefCell::default() }
}

#[test]
fn regions_have_materials_of_their_own() {
    let text = "BRANCH{
        MT{ young 1000 law neo-hookean }  MT region 1 { poisson 0.3 k1 5 }  MT region 9 { young 7 }
        TREE{ ME{ rot axis 0,0,1 angle 90  scale 2,2,-1 } NE a.seg
              MT{ density 900 } MT region 1 { law hgo fibre_2 3,0,1 } MT region 4 { k1 6 } } }";
    let document = Document::parse(text, Path::new("a.bml")).unwrap();
    let model = document.load(&two_regions()).unwrap();
    let body = &model.bodies[0];
    assert_eq!(body.validate(), Ok(()));
    assert_eq!(body.regions.iter().map(|(region, _)| *region).collect::<Vec<_>>(), [1, 4]);
    let (first, second) = (body.material_of(1), body.material_of(4));
    assert_eq!((first.law, second.law), (Law::HolzapfelGasserOgden, Law::NeoHookean));
    assert_eq!((first.young, first.poisson, first.density, first.k1), (1000.0, 0.3, 900.0, 5.0));
    assert_eq!((second.poisson, second.k1), (0.45, 6.0));
    assert_eq!(body.material_of(9), &body.material);
    // Fibres turn and mirror with the mesh: those of the text and those of the mesh.
    let turned = first.fibres[1].unwrap();
    assert!(close(turned.map(|x| x * 37.0_f64.sqrt()), [0.0, 6.0, -1.0]), "{turned:?}");
    assert!(close(body.mesh.fibres()[0][0], [0.0, 1.0, 0.0]));
    assert_eq!(body.mesh.fibres()[0].last(), Some(&[0.0; 3]));
    let counted = body.materials().filter(|material| material.law == Law::NeoHookean).count();
    assert_eq!(counted, body.mesh.tetrahedra().len() / 2);
}

#[test]
fn laws_that_do_not_fit_together_are_refused() {
    let error = |material: &str| {
        let text = format!("TREE{{ NE a.seg {material} }}");
        let document = Document::parse(&text, Path::new("a.bml")).unwrap();
        document.load(&two_regions()).unwrap_err().diagnostics[0].message.clone()
    };
    let cases = [
        "MT region 2 { young 1 }",
        "MT region 1 { law corotated }",
        "MT{ law hgo }",
        "MT{ law corotated } MT region 4 { law hgo }",
    ];
    assert_snapshot!(cases.map(error).join("\n"), @r"
    regions: the mesh has no region 2; it has 1, 4
    law linear holds for a whole body: give all of its regions law linear, or none (corotated is its like)
    law hgo: tetrahedron 24 has no fibre direction; give the material one, or the mesh the cell data `fibres`
    law hgo: tetrahedron 24 has no fibre direction; give the material one, or the mesh the cell data `fibres`
    ");
    let mut body = Body::new("a", Arc::new(two_regions().mesh));
    body.regions = vec![(4, body.material), (4, body.material)];
    assert_eq!(body.validate(), Err(BodyError::RegionOrder { region: 4 }));
    body.regions = vec![(4, palpate_model::Material { kappa: 0.34, ..body.material })];
    assert_snapshot!(body.validate().unwrap_err(), @"kappa must be from 0 to 1/3, found 0.34");
}

#[test]
fn the_longest_chain_of_bodies_is_handled() {
    let model = load(&format!("BRANCH{{ {} }}", "TREE{ NE a.seg }\n".repeat(10_000)));
    assert_eq!(model.bodies.len(), 10_000);
    assert_eq!(model.bodies[9_999].name, "a_10000");
    let copy = model.clone();
    assert_eq!(copy.structure, model.structure);
}

#[test]
fn an_open_surface_is_a_body_too() {
    let data = MeshData {
        nodes: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        triangles: vec![[0, 1, 2]],
        ..MeshData::default()
    };
    let loader = OneMesh { mesh: Mesh::new(data).unwrap(), asked: RefCell::default() };
    let text = "BRANCH{ TREE{ ME{ scale 1,1,-1 } NE table.seg RG fixed } TREE{ NE cloth.seg } }";
    let model = Document::parse(text, Path::new("a.bml")).unwrap().load(&loader).unwrap();
    assert_eq!(model.bodies[0].rigid.as_ref().unwrap().keys, []);
    assert_eq!(model.bodies[0].mesh.triangles(), [[0, 2, 1]]);
    assert_eq!(model.bodies[1].rigid, None);
}

#[test]
fn attachments_tie_the_nodes_within_reach() {
    let text = |attachments: &str| {
        format!(
            "unit mm BRANCH{{ TREE low{{ NE a.seg }} TREE{{ ME{{ trans 0,0,2.125 scale 1,1,2 }} NE b.seg }}
TREE table{{ ME{{ trans 0,0,-2 }} NE a.seg RG fixed }} TREE far{{ ME{{ trans 40,0,0 }} NE a.seg RG fixed }}
{attachments} }}"
        )
    };
    let model = load(&text("AT{ join b low }  AT{ join table low  within 0.01  stiffness 2e5 }"));
    let [above, below] = &model.attachments[..] else { panic!("{:?}", model.attachments) };
    assert_eq!((above.bodies, above.stiffness), ([1, 0], None));
    let nodes: Vec<u32> = above.ties.iter().map(|tie| tie.node).collect();
    assert_eq!(nodes, (0..9).collect::<Vec<_>>(), "the lower face of the upper box");
    for tie in &above.ties {
        let corner = |k: usize| DVec3::from(model.bodies[0].mesh.nodes()[tie.corners[k] as usize]);
        let corners = [corner(0), corner(1), corner(2)];
        let axes = palpate_model::triangle_axes(corners);
        let place: DVec3 = (0..3).map(|k| tie.weights[k] * corners[k]).sum();
        let node = place + axes * DVec3::from(tie.offset);
        assert!(close(node.to_array(), model.bodies[1].mesh.nodes()[tie.node as usize]));
        assert!((DVec3::from(tie.offset).length() - 0.125e-3).abs() < 1e-12, "{:?}", tie.offset);
    }
    // A rigid body's nodes cannot be pulled: those of the other one are tied.
    assert_eq!((below.bodies, below.stiffness, below.ties.len()), ([0, 2], Some(2e5), 9));
    let again = Document::parse(&model.to_text().unwrap(), Path::new("")).unwrap();
    assert_eq!(again, model.document.unwrap());

    let wrong =
        "AT{ join b lo }  AT{ join b far within 3 }  AT{ join low low }  AT{ join table far }";
    assert_snapshot!(load_errors(&text(wrong)), @r"
    3:1: no body is named `lo` (lo: did you mean low?)
    3:18: no node of `b` is within 0.003 m of `far`; the nearest is 0.038 m away (place the bodies closer, or say within how far)
    3:45: a body cannot be attached to itself
    3:65: `far` and `table` are both rigid: there is nothing to attach
    ");
}

#[test]
fn held_nodes_need_no_tie() {
    let model = load(
        "BRANCH{ TREE low{ NE a.seg }
TREE up{ ME{ trans 0,0,2 } NE a.seg FX{ box 0,0,0 2,0,0 } } AT{ join up low } }",
    );
    let nodes: Vec<u32> = model.attachments[0].ties.iter().map(|tie| tie.node).collect();
    assert_eq!(nodes, (3..9).collect::<Vec<_>>());
}

#[test]
fn a_model_of_many_bodies_is_written_so_that_it_can_be_read() {
    // Nested two by two they would be deeper than a text may be.
    let mesh = Arc::new(loader().mesh);
    let body = |index: usize| Body::new(format!("body {index}"), Arc::clone(&mesh));
    let mut model = Model::from_bodies((0..90).map(body).collect());
    let last = Structure::Body(89);
    let rest = Structure::chain((0..89).map(Structure::Body)).unwrap();
    model.structure = Structure::Join(Box::new(last), Box::new(rest));
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("many.bml");
    write_model(&path, &model).unwrap();
    let read = load_model(&path, &ReadOptions::default()).unwrap();
    let names = |model: &Model| -> Vec<String> {
        model.bodies.iter().map(|body| body.name.clone()).collect()
    };
    assert_eq!(names(&read)[1..], names(&model)[..89]);
    let first = Structure::Body(0);
    let rest = Structure::chain((1..90).map(Structure::Body)).unwrap();
    assert_eq!(read.structure, Structure::Join(Box::new(first), Box::new(rest)));
}
