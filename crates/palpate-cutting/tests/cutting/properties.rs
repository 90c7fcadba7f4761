//! Random blades in random boxes.

use palpate_cutting::{Blade, CutOptions, cut};
use palpate_geometry::{Point, TriangleFeature, point_triangle, vec3};
use palpate_model::Mesh;
use palpate_testing::Random;
use proptest::prelude::*;

use crate::support::{box_mesh, checked_cut};

fn point(low: f64, high: f64) -> impl Strategy<Value = Point> {
    proptest::array::uniform3(low..high)
}

fn options() -> impl Strategy<Value = CutOptions> {
    let or_none = |most: f64| prop_oneof![Just(0.0), 0.0..most];
    (or_none(0.4), or_none(0.3), or_none(0.5), or_none(3.0)).prop_map(
        |(snap, min_quality, min_edge, min_piece)| CutOptions {
            snap,
            min_quality,
            min_edge: Some(min_edge),
            min_piece,
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn a_whole_plane_separates(
        seed in 0_u64..1000,
        at in point(0.7, 3.3),
        normal in point(-1.0, 1.0),
        options in options(),
    ) {
        prop_assume!(vec3::norm(normal) > 0.1);
        let mesh = box_mesh([4, 4, 4], 0.18, seed);
        let blade = Blade::plane(at, normal, None).unwrap();
        let Some(cut) = checked_cut(&mesh, mesh.nodes(), &blade, &options) else {
            // Only what is as thin as snapping reaches is left on.
            return Ok(());
        };
        prop_assert!(cut.report.pieces >= 2);
        // Every tetrahedron of the result is on one side, as far as the report says.
        let normal = vec3::normalized(normal).unwrap();
        let slack = cut.report.deviation + 1e-12;
        for corners in cut.change.mesh.tetrahedra() {
            let heights = corners.map(|node| {
                vec3::dot(vec3::sub(cut.positions[node as usize], at), normal)
            });
            prop_assert!(
                heights.iter().all(|&h| h <= slack) || heights.iter().all(|&h| h >= -slack),
                "{heights:?} {slack}"
            );
        }
    }

    #[test]
    fn a_bent_stroke_leaves_nothing_across_away_from_its_border(
        seed in 0_u64..1000,
        start in point(-1.0, 1.0),
        turn in 0.0..0.08,
        depth in 0.5..7.0,
        tilt in -0.3..0.3,
        options in options(),
    ) {
        let mesh = box_mesh([5, 5, 4], 0.18, seed);
        // A circle of at least five cells' radius, from above the box.
        let [mut x, mut y, mut angle] = [start[0], 2.5 + start[1], -8.0 * turn];
        let mut edges = Vec::new();
        for _ in 0..16 {
            edges.push([[x, y, 5.0], [x - tilt * depth * angle.sin(), y + tilt * depth, 5.0 - depth]]);
            (x, y, angle) = (x + 0.4 * angle.cos(), y + 0.4 * angle.sin(), angle + turn);
        }
        let blade = Blade::stroke(&edges).unwrap();
        let Some(cut) = checked_cut(&mesh, mesh.nodes(), &blade, &options) else {
            return Ok(());
        };
        prop_assume!(blade.parts().len() == 1);
        let slow = SlowSides::new(&blade);
        let slack = cut.report.deviation + 1e-9;
        for corners in cut.change.mesh.tetrahedra() {
            let found = corners.map(|node| slow.height(cut.positions[node as usize]));
            // Beyond the border a tetrahedron may be left whole.
            let [Some(a), Some(b), Some(c), Some(d)] = found else { continue };
            let heights = [a, b, c, d];
            prop_assert!(
                heights.iter().all(|&h| h <= slack) || heights.iter().all(|&h| h >= -slack),
                "{heights:?} {slack}"
            );
        }
    }

    #[test]
    fn a_body_bent_out_of_shape_is_cut_all_the_same(
        seed in 0_u64..1000,
        noise in prop_oneof![Just(0.0), 0.1..3.0],
        scale in prop_oneof![Just(0.0), Just(1.0), Just(1e-60), Just(1e60)],
        at in point(0.0, 3.0),
        normal in point(-1.0, 1.0),
        size in proptest::option::of(0.5..5.0),
        options in options(),
    ) {
        // Nodes anywhere: flat and inverted tetrahedra, or all in one point.
        let mesh = box_mesh([3, 3, 3], 0.18, seed);
        let mut random = Random(seed);
        let positions: Vec<Point> = (mesh.nodes().iter())
            .map(|point| point.map(|value| scale * (value + noise * random.between(-1.0, 1.0))))
            .collect();
        prop_assume!(vec3::norm(normal) > 0.1);
        let size = size.map(|size: f64| size * if scale > 0.0 { scale } else { 1.0 });
        let blade = Blade::plane(at.map(|value| scale * value), normal, size).unwrap();
        checked_cut(&mesh, &positions, &blade, &options);
    }

    #[test]
    fn size_does_not_matter(
        seed in 0_u64..1000,
        at in point(0.7, 3.3),
        normal in point(-1.0, 1.0),
        exponent in -30_i32..30,
        options in options(),
    ) {
        prop_assume!(vec3::norm(normal) > 0.1);
        let factor = 2.0_f64.powi(exponent);
        let scaled = |points: &[Point]| -> Vec<Point> {
            points.iter().map(|point| point.map(|value| factor * value)).collect()
        };
        let mesh = box_mesh([4, 4, 4], 0.18, seed);
        let edge = |x: f64| [[x, at[1], 5.0], vec3::add_scaled([x, at[1], 5.0], normal, 4.0)];
        let edges = [edge(-1.0), edge(at[0]), edge(6.0)];
        let cut_at = |mesh: &Mesh, edges: &[[Point; 2]], options: &CutOptions| {
            Blade::stroke(edges).ok().and_then(|blade| cut(mesh, mesh.nodes(), &blade, options).unwrap())
        };
        let small = cut_at(&mesh, &edges, &options);
        let edges = edges.map(|edge| edge.map(|point| point.map(|value| factor * value)));
        let large = mesh.with_nodes(scaled(mesh.nodes())).unwrap();
        let options = CutOptions { min_edge: options.min_edge.map(|edge| factor * edge), ..options };
        let large = cut_at(&large, &edges, &options);
        prop_assert_eq!(small.is_some(), large.is_some());
        if let (Some(small), Some(large)) = (small, large) {
            prop_assert_eq!(small.change.mesh.tetrahedra(), large.change.mesh.tetrahedra());
            prop_assert_eq!(scaled(small.change.mesh.nodes()), large.change.mesh.nodes());
        }
    }

    #[test]
    fn cutting_again_at_the_same_place_finds_nothing(
        seed in 0_u64..1000,
        at in point(0.7, 3.3),
        normal in point(-1.0, 1.0),
    ) {
        prop_assume!(vec3::norm(normal) > 0.1);
        let mesh = box_mesh([4, 4, 4], 0.18, seed);
        let blade = Blade::plane(at, normal, None).unwrap();
        let options = CutOptions::default();
        let Some(first) = checked_cut(&mesh, mesh.nodes(), &blade, &options) else {
            return Ok(());
        };
        let second = cut(&first.change.mesh, &first.positions, &blade, &options).unwrap();
        prop_assert_eq!(second.map(|cut| cut.report), None);
    }
}

/// The obvious way to find on which side of a blade a point is.
struct SlowSides {
    triangles: Vec<[Point; 3]>,
    /// For each triangle, which of its edges have no other.
    is_border: Vec<[bool; 3]>,
}

impl SlowSides {
    fn new(blade: &Blade) -> Self {
        let corners: Vec<[u32; 3]> = blade.triangles().collect();
        let has = |a: u32, b: u32| {
            corners.iter().any(|other| (0..3).any(|k| [other[k], other[(k + 1) % 3]] == [b, a]))
        };
        let is_border =
            corners.iter().map(|&[a, b, c]| [!has(a, b), !has(b, c), !has(c, a)]).collect();
        let at = |point: u32| blade.points()[point as usize];
        Self { triangles: corners.iter().map(|corners| corners.map(at)).collect(), is_border }
    }

    /// The distance from the closest triangle's plane, of equally close ones the furthest; `None`
    /// where the closest point is on the border.
    fn height(&self, point: Point) -> Option<f64> {
        let found: Vec<_> =
            self.triangles.iter().map(|triangle| point_triangle(point, triangle)).collect();
        let least = found.iter().map(|found| found.distance_squared).fold(f64::INFINITY, f64::min);
        let mut best: f64 = 0.0;
        for (index, found) in found.iter().enumerate() {
            if found.distance_squared > least * (1.0 + 1e-9) {
                continue;
            }
            let is_border = match found.feature {
                TriangleFeature::Face => false,
                TriangleFeature::Edge(edge) => self.is_border[index][edge as usize],
                TriangleFeature::Vertex(_) => true,
            };
            if is_border {
                return None;
            }
            let [a, b, c] = self.triangles[index];
            let normal = vec3::normalized(vec3::cross(vec3::sub(b, a), vec3::sub(c, a)))?;
            let height = vec3::dot(vec3::sub(point, a), normal);
            if height.abs() > best.abs() {
                best = height;
            }
        }
        Some(best)
    }
}
