//! Random blades in random boxes.

use palpate_cutting::{Blade, CutOptions};
use palpate_geometry::{Point, vec3};
use proptest::prelude::*;

use crate::support::{box_mesh, checked_cut};

fn point(low: f64, high: f64) -> impl Strategy<Value = Point> {
    proptest::array::uniform3(low..high)
}

fn options() -> impl Strategy<Value = CutOptions> {
    (0.0..0.4, 0.0..0.3, prop_oneof![Just(0.0), 0.0..0.5])
        .prop_map(|(snap, min_quality, min_edge)| CutOptions { snap, min_quality, min_edge })
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
}
