//! Planes: known cuts of a box.

use palpate_cutting::{Blade, CutOptions, cut};
use palpate_geometry::Point;

use crate::support::{box_mesh, checked_cut};

fn plane(point: Point, normal: Point) -> Blade {
    Blade::plane(point, normal, None).unwrap()
}

#[test]
fn a_plane_between_the_nodes_halves_a_box() {
    let mesh = box_mesh([4, 4, 4], 0.0, 0);
    let options = CutOptions::default();
    let blade = plane([0.0, 0.0, 1.5], [0.0, 0.0, 2.0]);
    let cut = checked_cut(&mesh, mesh.nodes(), &blade, &options).unwrap();
    assert_eq!((cut.report.pieces_before, cut.report.pieces), (1, 2));
    assert!((cut.report.cut_area - 16.0).abs() < 1e-12);
    assert_eq!(cut.report.deviation, 0.0);
    assert_eq!(cut.report.snapped_nodes, 0);
}

#[test]
fn a_plane_through_nodes_opens_faces_and_splits_nothing() {
    let mesh = box_mesh([4, 4, 4], 0.0, 0);
    let options = CutOptions::default();
    let blade = plane([0.0, 0.0, 2.0], [0.0, 0.0, 1.0]);
    let cut = checked_cut(&mesh, mesh.nodes(), &blade, &options).unwrap();
    assert_eq!((cut.report.pieces, cut.report.new_nodes), (2, 25));
    assert_eq!((cut.report.new_tetrahedra, cut.report.smallest_quality), (0, None));
    assert_eq!(cut.report.cut_area, 16.0);
}

#[test]
fn the_second_cut_at_the_same_place_finds_nothing() {
    for (height, tilt) in [(2.0, 0.0), (1.5, 0.0), (1.7, 0.3), (1.05, 0.1)] {
        let mesh = box_mesh([4, 4, 4], 0.2, 7);
        let options = CutOptions::default();
        let blade = plane([2.0, 2.0, height], [tilt, 0.5 * tilt, 1.0]);
        let first = checked_cut(&mesh, mesh.nodes(), &blade, &options).unwrap();
        let second = cut(&first.change.mesh, &first.positions, &blade, &options).unwrap();
        assert_eq!(second.map(|cut| cut.report), None, "{height} {tilt}");
    }
}

#[test]
fn a_plane_that_grazes_or_passes_by_does_nothing() {
    let mesh = box_mesh([3, 3, 3], 0.0, 0);
    for height in [-1.0, 0.0, 3.0, 3.5] {
        let blade = plane([0.0, 0.0, height], [0.0, 0.0, 1.0]);
        assert_eq!(cut(&mesh, mesh.nodes(), &blade, &CutOptions::default()), Ok(None), "{height}");
    }
}

#[test]
fn a_square_that_ends_inside_leaves_a_joined_front() {
    let mesh = box_mesh([6, 6, 6], 0.0, 0);
    let options = CutOptions::default();
    // From outside to the middle of the box.
    let blade = Blade::plane([0.0, 3.0, 3.5], [0.0, 0.0, 1.0], Some(7.0)).unwrap();
    let cut = checked_cut(&mesh, mesh.nodes(), &blade, &options).unwrap();
    assert_eq!(cut.report.pieces, 1);
    // It ends at 3.5: no less, and no more than a cell beyond.
    assert!(cut.report.cut_area >= 3.5 * 6.0 && cut.report.cut_area <= 4.0 * 6.0 + 1e-12);
}

#[test]
fn a_square_whose_border_lies_on_the_grid_ends_there() {
    let mesh = box_mesh([6, 6, 6], 0.0, 0);
    let options = CutOptions::default();
    let blade = Blade::plane([0.0, 3.0, 3.0], [0.0, 0.0, 1.0], Some(8.0)).unwrap();
    let cut = checked_cut(&mesh, mesh.nodes(), &blade, &options).unwrap();
    assert_eq!((cut.report.pieces, cut.report.cut_area), (1, 24.0));
}

#[test]
fn cuts_that_cross_make_four_pieces() {
    let mesh = box_mesh([5, 5, 5], 0.15, 3);
    let options = CutOptions::default();
    let first = plane([2.5, 2.5, 2.5], [1.0, 0.2, 0.1]);
    let second = plane([2.5, 2.5, 2.5], [0.1, 1.0, 0.3]);
    let halves = checked_cut(&mesh, mesh.nodes(), &first, &options).unwrap();
    let old = &halves.change.mesh;
    let quarters = checked_cut(old, &halves.positions, &second, &options).unwrap();
    assert_eq!((halves.report.pieces, quarters.report.pieces), (2, 4));
}

#[test]
fn the_blade_lives_where_the_body_is_now() {
    let mesh = box_mesh([4, 4, 4], 0.1, 5);
    let options = CutOptions::default();
    let positions: Vec<Point> = mesh
        .nodes()
        .iter()
        .map(|[x, y, z]| [2.0 * x + 10.0, *y + 0.3 * x, z - 0.2 * x * x])
        .collect();
    let blade = plane([14.3, 0.0, 0.0], [1.0, 0.0, 0.0]);
    let cut = checked_cut(&mesh, &positions, &blade, &options).unwrap();
    assert_eq!(cut.report.pieces, 2);
    assert!((cut.report.cut_area - 16.0).abs() < 3.0, "{:?}", cut.report);
}
