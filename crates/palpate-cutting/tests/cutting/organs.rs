//! The kidney of the example models.

use std::path::Path;

use palpate_cutting::{Blade, CutOptions};
use palpate_geometry::{Point, vec3};
use palpate_model::{ReadOptions, read_mesh};

use crate::support::{Random, checked_cut};

#[test]
fn strokes_and_planes_through_a_kidney() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/kidney.seg");
    let mesh = read_mesh(&path, &ReadOptions::default()).unwrap().mesh;
    let options = CutOptions { min_edge: 0.1 * mesh.mean_surface_edge(), ..CutOptions::default() };
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
