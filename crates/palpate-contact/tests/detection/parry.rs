//! A second opinion: parry's distances and projections on scenes without degenerate elements.

use std::sync::Arc;

use palpate_contact::{PairKind, SceneOptions};
use palpate_model::Mesh;
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query::PointQuery;
use parry3d_f64::query::details::closest_points_segment_segment_with_locations;
use parry3d_f64::shape::{Segment, TriMesh, Triangle};

use crate::intersections::scene;
use crate::scenes::{Point, Random, horseshoe, jittered};

fn meshes(random: &mut Random) -> Vec<Arc<Mesh>> {
    vec![
        jittered([4, 4, 4], [0.0; 3], 0.12, random),
        horseshoe(12, 2, [4.05, 1.0, 1.0]),
        jittered([3, 3, 3], [0.5, 4.03, 0.4], 0.12, random),
    ]
}

fn vector([x, y, z]: Point) -> Vector {
    Vector::new(x, y, z)
}

#[test]
fn distances_of_close_pairs_agree() {
    let mut scene = scene(&meshes(&mut Random(21)), SceneOptions::default());
    let pairs = scene.proximity(&|_, _| Some(0.25)).pairs.clone();
    assert!(pairs.len() > 100);
    for pair in pairs {
        let [a, b] = pair.bodies.map(|body| scene.positions(body as usize));
        let at = |positions: &[Point], i: usize| vector(positions[pair.nodes[i] as usize]);
        let distance = match pair.kind {
            PairKind::VertexTriangle => {
                let triangle = Triangle { a: at(b, 1), b: at(b, 2), c: at(b, 3) };
                triangle.distance_to_local_point(at(a, 0), true)
            }
            PairKind::EdgeEdge => {
                let (first, second) =
                    (Segment::new(at(a, 0), at(a, 1)), Segment::new(at(b, 2), at(b, 3)));
                let (on_first, on_second) =
                    closest_points_segment_segment_with_locations(&Pose::IDENTITY, &first, &second);
                (first.point_at(&on_first) - second.point_at(&on_second)).length()
            }
        };
        assert!((distance - pair.distance).abs() < 1e-9, "{pair:?}: parry says {distance}");
    }
}

#[test]
fn closest_points_and_sides_agree() {
    let mut random = Random(22);
    let meshes = meshes(&mut random);
    let mut scene = scene(&meshes, SceneOptions::default());
    let flags = parry3d_f64::shape::TriMeshFlags::ORIENTED;
    for (body, mesh) in meshes.iter().enumerate() {
        let points = mesh.nodes().iter().copied().map(vector).collect();
        let solid = TriMesh::with_flags(points, mesh.triangles().to_vec(), flags)
            .expect("a surface is a mesh for parry too");
        let mut inside_count = 0;
        for _ in 0..500 {
            let offset = random.vector(4.0);
            let point: Point = std::array::from_fn(|axis| offset[axis] + 2.0);
            let inside = scene.contains(&[point], Some(body)).expect("finite")[0];
            let found = scene.closest(&[point], Some(body), f64::INFINITY).expect("finite")[0];
            let found = found.expect("a surface");
            let projection = solid.project_local_point(vector(point), false);
            let distance = (projection.point - vector(point)).length();
            assert!((found.distance - distance).abs() < 1e-9);
            assert_eq!(inside, projection.is_inside, "{point:?}");
            inside_count += usize::from(inside);
        }
        assert!(inside_count > 5, "{inside_count}");
    }
}
