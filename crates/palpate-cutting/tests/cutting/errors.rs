//! What is refused, and how it is said.

use std::path::Path;

use palpate_cutting::{
    Blade, BladeError, CutError, CutOptions, When, cut, cut_on, parse_strokes, read_strokes,
};
use palpate_geometry::Point;
use palpate_model::{Mesh, MeshData};

use crate::support::box_mesh;

const NAN: f64 = f64::NAN;

fn said<T: std::fmt::Debug>(result: Result<T, BladeError>) -> String {
    result.unwrap_err().to_string()
}

#[test]
fn blades_that_are_none() {
    let point = |x: f64| [x, 0.0, 0.0];
    let edge = |x: f64| [[x, 0.0, 0.0], [x, 1.0, 0.0]];
    let far = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let cases = [
        (said(Blade::stroke(&[edge(0.0)])), "1 edges of the stroke are too few"),
        (said(Blade::stroke(&[edge(0.0), edge(0.0)])), "span no area"),
        (
            said(Blade::stroke(&[[point(0.0), point(1.0)], [point(2.0), point(3.0)]])),
            "span no area",
        ),
        (said(Blade::stroke(&[edge(0.0), edge(NAN)])), "point 2 of the blade"),
        (
            said(Blade::closed_loop(&[point(0.0), point(1.0), point(1.0), point(0.0)])),
            "2 points of the loop",
        ),
        (said(Blade::closed_loop(&[point(0.0), point(1.0), point(2.0)])), "span no area"),
        (
            said(Blade::closed_loop(&[point(0.0), point(1.0), point(f64::INFINITY)])),
            "point 2 of the blade",
        ),
        (said(Blade::plane([0.0; 3], [0.0; 3], None)), "no direction"),
        (said(Blade::plane([0.0; 3], [NAN, 0.0, 0.0], None)), "not finite"),
        (
            said(Blade::plane([0.0; 3], point(1.0), Some(0.0))),
            "size 0 of the plane is not positive",
        ),
        (said(Blade::plane([0.0; 3], point(1.0), Some(NAN))), "size NaN"),
        (said(Blade::new(&far, &[])), "0 triangles are too few"),
        (said(Blade::new(&far, &[[0, 1, 2], [0, 1, 3]])), "triangle 1 of the blade: point index 3"),
        (said(Blade::new(&far, &[[0, 1, 1]])), "triangle 0 of the blade has no area"),
        (said(Blade::joined(&[])), "too few"),
    ];
    for (found, expected) in cases {
        assert!(found.contains(expected), "{found}: {expected}");
    }
    let crossed = [[0.0, 0.0, 0.0], [2.0, 2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.9, 0.0]];
    let found = Blade::closed_loop(&crossed);
    assert!(matches!(found, Err(BladeError::CrossedLoop { .. })), "{found:?}");
}

#[test]
fn a_strip_with_one_side_is_no_blade() {
    // Half a turn on the way round.
    let edges: Vec<[Point; 2]> = (0..=24)
        .map(|k| {
            let around = std::f64::consts::TAU * f64::from(k % 24) / 24.0;
            let half = if k == 24 { std::f64::consts::PI } else { 0.5 * around };
            let at = |r: f64| {
                let out = 3.0 + r * half.cos();
                [out * around.cos(), out * around.sin(), r * half.sin()]
            };
            // Exactly the first edge, turned over.
            if k == 24 { [[2.0, 0.0, -0.0], [4.0, 0.0, 0.0]] } else { [at(1.0), at(-1.0)] }
        })
        .collect();
    let found = Blade::stroke(&edges);
    assert!(matches!(found, Err(BladeError::OneSided { .. })), "{found:?}");
}

#[test]
fn cuts_that_cannot_be() {
    let mesh = box_mesh([1; 3], 0.0, 0);
    let blade = Blade::plane([0.5; 3], [0.0, 0.0, 1.0], None).unwrap();
    let options = CutOptions::default();
    let mut positions = mesh.nodes().to_vec();
    assert_eq!(
        cut(&mesh, &positions[1..], &blade, &options),
        Err(CutError::PositionCount { found: 7, expected: 8 })
    );
    positions[3][1] = NAN;
    let error = cut(&mesh, &positions, &blade, &options).unwrap_err();
    assert!(error.to_string().contains("node 3"), "{error}");
    for (name, options) in [
        ("snap", CutOptions { snap: 0.6, ..options }),
        ("min_quality", CutOptions { min_quality: NAN, ..options }),
        ("min_edge", CutOptions { min_edge: Some(-1.0), ..options }),
        ("min_piece", CutOptions { min_piece: f64::INFINITY, ..options }),
    ] {
        let error = cut(&mesh, mesh.nodes(), &blade, &options).unwrap_err();
        assert!(error.to_string().contains(name), "{error}");
    }
    let surface = Mesh::new(MeshData {
        nodes: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        triangles: vec![[0, 1, 2]],
        ..MeshData::default()
    });
    let surface = surface.unwrap();
    assert_eq!(cut(&surface, surface.nodes(), &blade, &options), Err(CutError::SurfaceOnly));
}

#[test]
fn pending_faces_that_are_none_are_ignored() {
    let mesh = box_mesh([2; 3], 0.1, 0);
    let blade = Blade::plane([1.1; 3], [0.2, 0.1, 1.0], None).unwrap();
    let options = CutOptions::default();
    let expected = cut(&mesh, mesh.nodes(), &blade, &options).unwrap();
    for pending in [[u32::MAX; 3], [0, 0, 0], [0, 1, 26], [0, 26, 9999]] {
        let found = cut_on(&mesh, mesh.nodes(), &blade, &[pending], &options).unwrap();
        assert_eq!(found, expected);
    }
    assert!(expected.is_some());
}

#[test]
fn files_of_strokes() {
    let text = "// comment\n\nblade 1\nstroke at 0.25 s\n 0,0,0  0 0 1 // heel, tip\n 1 0 0  1 0 1\n\
                plane at step 7\n0 0 0 0 0 1\nloop at 0 s\n0 0 0\n1 0 0\n0 1 0\n";
    let strokes = parse_strokes(text, "a.blade").unwrap();
    let found: Vec<_> = strokes.iter().map(|stroke| (stroke.when, stroke.line)).collect();
    assert_eq!(found, [(When::Time(0.25), 4), (When::Step(7), 7), (When::Time(0.0), 9)]);
    assert_eq!(
        strokes[0].blade,
        Blade::stroke(&[[[0.0; 3], [0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0], [1.0, 0.0, 1.0]]]).unwrap()
    );

    // The example of the manual.
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/cutting.md");
    let page = std::fs::read_to_string(page).unwrap();
    let example = page.split("```blade\n").nth(1).and_then(|rest| rest.split("```").next());
    let whens =
        parse_strokes(example.unwrap(), "manual").unwrap().into_iter().map(|stroke| stroke.when);
    assert_eq!(whens.collect::<Vec<_>>(), [When::Time(0.2), When::Step(30), When::Time(0.5)]);

    let cases = [
        ("", "a.blade:1: a file of strokes begins"),
        ("blade 2\n", "a.blade:1: a file of strokes begins"),
        ("blade 1\n", "a.blade:1: no stroke"),
        ("blade 1\n1 2 3\n", "a.blade:2: numbers before the first"),
        ("blade 1\nsaw at 1 s\n", "a.blade:2: `saw` is no kind of cut"),
        ("blade 1\nstroke\n", "a.blade:2: say when: `stroke at 0.2 s`"),
        ("blade 1\nstroke at -1 s\n", "a.blade:2: say when"),
        ("blade 1\nstroke at step 1.5\n", "a.blade:2: say when"),
        ("blade 1\nloop at 1 s\n1 2\n", "a.blade:3: 2 numbers; expected 3 numbers, a point"),
        ("blade 1\nloop at 1 s\n1 2 x\n", "a.blade:3: `x` is no number"),
        ("blade 1\nloop at 1 s\n1 2 nan\n", "a.blade:3: `nan` is not finite"),
        ("blade 1\nloop at 1 s\nnan 1 2\n", "a.blade:3: `nan` is not finite"),
        ("blade 1\nloop at 1 s\n1 2 3\n", "a.blade:2: 1 points of the loop are too few"),
        ("blade 1\nplane at 1 s\n", "a.blade:2: the plane has no line of numbers"),
        ("blade 1\nplane at 1 s\n0 0 0 0 0 1\n0 0 0 0 0 1\n", "a.blade:4: a plane has one line"),
    ];
    for (text, expected) in cases {
        let found = parse_strokes(text, "a.blade").unwrap_err().to_string();
        assert!(found.starts_with(expected), "{found}: {expected}");
    }
    let missing = read_strokes(Path::new("no/such.blade")).unwrap_err();
    assert!(missing.to_string().starts_with("no/such.blade: "), "{missing}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("b.blade");
    std::fs::write(&path, text).unwrap();
    assert_eq!(read_strokes(&path).unwrap(), strokes);
}
