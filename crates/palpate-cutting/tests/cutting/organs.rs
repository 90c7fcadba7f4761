//! The kidney of the example models.

use std::path::Path;

use palpate_cutting::{Blade, CutOptions, cut_on};
use palpate_geometry::{Point, vec3};
use palpate_model::{ReadOptions, read_mesh};
use palpate_testing::Random;

use crate::support::checked_cut;

#[test]
fn strokes_and_planes_through_a_kidney() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/kidney.seg");
    let mesh = read_mesh(&path, &ReadOptions::default()).unwrap().mesh;
    let options = CutOptions::default();
    let (center, extent) = (mesh.bounds().center(), mesh.bounds().extent());
    let size = vec3::norm(extent);
    let mut random = Random(3);
    let mut opened = 0;
    let (mut now, mut positions) = (mesh.clone(), mesh.nodes().to_vec());
    for round in 0..12 {
        let at: Point = std::array::from_fn(|axis| {
            center[axis] + 0.3 * extent[axis] * random.between(-1.0, 1.0)
        });
        let [along, depth] = [0; 2].map(|_| [0; 3].map(|_| random.between(-1.0, 1.0)));
        let edge = |k: i32| {
            let bend = 0.1 * (0.3 * f64::from(k)).sin();
            let heel = vec3::add_scaled(
                at,
                vec3::add_scaled(along, depth, bend),
                0.02 * size * f64::from(k),
            );
            [heel, vec3::add_scaled(heel, depth, 0.4 * size)]
        };
        let blade = if round % 3 == 0 {
            Blade::plane(at, along, None).unwrap()
        } else {
            Blade::stroke(&(-10..=10).map(edge).collect::<Vec<_>>()).unwrap()
        };
        if let Some(done) = checked_cut(&now, &positions, &blade, &options) {
            opened += 1;
            (now, positions) = ((*done.change.mesh).clone(), done.positions);
        }
    }
    assert!(opened >= 10, "{opened}");
    assert!((now.volume() / mesh.volume() - 1.0).abs() < 1e-12);
    let [before, after] = [&mesh, &now].map(|mesh| mesh.quality().unwrap().worst);
    assert!(after >= 0.999 * options.min_quality.min(before), "{before} {after}");
}

#[test]
fn a_kidney_cut_step_by_step_opens_as_deep_as_by_one_stroke() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/kidney.seg");
    let mesh = read_mesh(&path, &ReadOptions::default()).unwrap().mesh;
    let options = CutOptions::default();
    let (center, extent) = (mesh.bounds().center(), mesh.bounds().extent());
    // From end to end, down to the middle.
    let edge = |k: usize| {
        let s = k as f64 / 100.0;
        let x = center[0] + 1.2 * extent[0] * (s - 0.5);
        let y = center[1] + 0.1 * extent[1] * (9.0 * s).sin();
        [[x, y, center[2] + extent[2]], [x, y, center[2]]]
    };
    for length in [1, 2, 5, 100] {
        let (mut now, mut pending) = (mesh.clone(), Vec::new());
        for first in (0..100).step_by(length) {
            let edges: Vec<_> = (first..=first + length).map(edge).collect();
            let blade = Blade::stroke(&edges).unwrap();
            if let Some(done) = cut_on(&now, now.nodes(), &blade, &pending, &options).unwrap() {
                (now, pending) = ((*done.change.mesh).clone(), done.pending);
            }
        }
        assert_eq!(now.pieces().len(), 1);
        // Above the tip nothing holds the halves together.
        let is_above = |tetrahedron: &u32| {
            let corners = now.tetrahedron_corners(*tetrahedron as usize);
            corners.iter().all(|corner| corner[2] > center[2])
        };
        let below: Vec<u32> =
            (0..now.tetrahedra().len() as u32).filter(|index| !is_above(index)).collect();
        let halves = now.remove(&below).unwrap().mesh.pieces();
        assert_eq!(halves.len(), 2, "{length}");
        assert!(halves.iter().all(|half| half.len() > 2000), "{length}");
    }
}

/// With `PALPATE_DATA`, meshes of real organs.
#[test]
fn planes_through_real_organs() {
    let Some(folder) = std::env::var_os("PALPATE_DATA") else {
        return;
    };
    let mut random = Random(4);
    let mut organs = 0;
    for entry in std::fs::read_dir(Path::new(&folder).join("organs")).unwrap() {
        let path = entry.unwrap().path();
        let Ok(read) = read_mesh(&path, &ReadOptions { repair: true }) else {
            continue;
        };
        let mesh = read.mesh;
        if mesh.is_surface_only() {
            continue;
        }
        organs += 1;
        for _ in 0..3 {
            let normal = [0; 3].map(|_| random.between(-1.0, 1.0));
            let blade = Blade::plane(mesh.bounds().center(), normal, None).unwrap();
            checked_cut(&mesh, mesh.nodes(), &blade, &CutOptions::default()).unwrap();
        }
    }
    assert!(organs > 0);
}
