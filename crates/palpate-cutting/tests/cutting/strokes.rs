//! Strokes of a scalpel, tubes, loops and branched surfaces.

use std::f64::consts::TAU;

use palpate_cutting::{Blade, Cut, CutOptions};
use palpate_geometry::Point;
use palpate_model::Mesh;

use crate::support::{box_mesh, checked_cut, checked_cut_on};

fn cut_by(mesh: &Mesh, blade: &Blade) -> Cut {
    checked_cut(mesh, mesh.nodes(), blade, &CutOptions::default()).expect("it meets the box")
}

/// The edge of a vertical scalpel at (x, y), from above the box down to `tip`.
fn edge(x: f64, y: f64, tip: f64) -> [Point; 2] {
    [[x, y, 9.0], [x, y, tip]]
}

#[test]
fn a_stroke_from_side_to_side_and_through_the_floor_separates() {
    let mesh = box_mesh([6, 6, 4], 0.15, 11);
    // A wavy line: forty steps, each shorter than a cell.
    let wave =
        |k: i32| edge(-0.5 + 0.175 * f64::from(k), 3.0 + 0.8 * (0.2 * f64::from(k)).sin(), -1.0);
    let done = cut_by(&mesh, &Blade::stroke(&(0..=40).map(wave).collect::<Vec<_>>()).unwrap());
    assert_eq!(done.report.pieces, 2);
    assert!(done.report.smallest_quality.unwrap() >= 0.1);
}

#[test]
fn a_shallow_stroke_opens_the_surface_only() {
    let mesh = box_mesh([6, 6, 4], 0.15, 12);
    let blade = Blade::stroke(&[edge(-1.0, 3.3, 2.4), edge(7.0, 3.1, 2.4)]).unwrap();
    let done = cut_by(&mesh, &blade);
    assert_eq!(done.report.pieces, 1);
    // 1.6 deep and 6 long, and at most a cell's diagonal deeper.
    let area = done.report.cut_area;
    assert!((1.5 * 6.0..3.4 * 6.0).contains(&area), "{area}");
}

#[test]
fn steps_shorter_than_a_tetrahedron_cut_what_one_stroke_cuts() {
    // One blade after the other, as a tool moves, with the body where it was.
    let mesh = box_mesh([4, 4, 3], 0.1, 13);
    let options = CutOptions::default();
    let places: Vec<_> = (0..=60).map(|k| edge(-0.5 + f64::from(k) / 12.0, 2.2, -1.0)).collect();
    let (mut now, mut pending) = (mesh.clone(), Vec::new());
    let mut opened = 0.0;
    for pair in places.windows(2) {
        let blade = Blade::stroke(pair).unwrap();
        if let Some(step) = checked_cut_on(&now, now.nodes(), &blade, &pending, &options) {
            opened += step.report.cut_area;
            (now, pending) = ((*step.change.mesh).clone(), step.pending);
        }
    }
    let whole = cut_by(&mesh, &Blade::stroke(&places).unwrap());
    assert_eq!((now.pieces().len(), whole.report.pieces), (2, 2));
    let area = whole.report.cut_area;
    assert!((opened - area).abs() < 0.1 * area, "{opened} {area}");
    // The same plane all along: the same pieces, as far as snapping goes.
    let sizes = |mesh: &Mesh| {
        let volume = |piece: &Vec<u32>| -> f64 {
            let corners = piece.iter().map(|&k| mesh.tetrahedron_corners(k as usize));
            corners.map(|corners| palpate_geometry::tetrahedron::signed_volume(&corners)).sum()
        };
        mesh.pieces().iter().map(volume).fold(0.0, f64::max)
    };
    let [slow, fast] = [sizes(&now), sizes(&whole.change.mesh)];
    assert!((slow - fast).abs() < 0.03 * fast, "{slow} {fast}");
}

#[test]
fn a_tube_cuts_out_a_plug() {
    let mesh = box_mesh([8, 8, 3], 0.1, 14);
    let ring = |k: i32| {
        let angle = TAU * f64::from(k % 24) / 24.0;
        edge(4.0 + 2.2 * angle.cos(), 4.0 + 2.2 * angle.sin(), -1.0)
    };
    let tube = Blade::stroke(&(0..=24).map(ring).collect::<Vec<_>>()).unwrap();
    let done = cut_by(&mesh, &tube);
    assert_eq!(done.report.pieces, 2);
    let ideal = 24.0 * 2.0 * 2.2 * (TAU / 48.0).sin() * 3.0;
    assert!((done.report.cut_area / ideal - 1.0).abs() < 0.1, "{} {ideal}", done.report.cut_area);

    // A blind hole: the tube ends inside, and a cap that shares its border frees the plug.
    let shallow = |k: i32| {
        let [[x, y, z], _] = ring(k);
        [[x, y, z], [x, y, 1.4]]
    };
    let edges: Vec<_> = (0..=24).map(shallow).collect();
    let tube = Blade::stroke(&edges).unwrap();
    assert_eq!(cut_by(&mesh, &tube).report.pieces, 1);
    let border: Vec<Point> = edges[..24].iter().map(|edge| edge[1]).collect();
    let cap = Blade::closed_loop(&border).unwrap();
    let cup = Blade::joined(&[tube, cap]).unwrap();
    assert_eq!(cut_by(&mesh, &cup).report.pieces, 2);
}

#[test]
fn a_loop_inside_opens_a_disc_and_keeps_its_border_joined() {
    let mesh = box_mesh([8, 8, 6], 0.1, 15);
    let point = |k: i32| -> Point {
        let angle = TAU * f64::from(k) / 16.0;
        [4.0 + 2.5 * angle.cos(), 4.0 + 2.5 * angle.sin(), 3.1 + 0.2 * (2.0 * angle).sin()]
    };
    let disc = Blade::closed_loop(&(0..16).map(point).collect::<Vec<_>>()).unwrap();
    let done = cut_by(&mesh, &disc);
    assert_eq!(done.report.pieces, 1);
    let area = done.report.cut_area;
    assert!((18.0..18.0 + 16.0 * 1.8).contains(&area), "{area}");
    // Nothing of the old surface was opened.
    let new = &done.change.mesh;
    let lips = new.triangles().len() - mesh.triangles().len();
    assert!(lips > 0 && lips.is_multiple_of(2));
}

#[test]
fn a_loop_larger_than_the_body_takes_a_slice_off() {
    let mesh = box_mesh([4, 4, 4], 0.1, 16);
    let square = [[-1.0, -1.0, 2.4], [5.0, -1.0, 2.2], [5.0, 5.0, 2.4], [-1.0, 5.0, 2.7]];
    let done = cut_by(&mesh, &Blade::closed_loop(&square).unwrap());
    assert_eq!(done.report.pieces, 2);
}

#[test]
fn a_branched_surface_cuts_three_ways() {
    let mesh = box_mesh([6, 6, 3], 0.1, 17);
    let mut points: Vec<Point> = vec![[3.1, 2.9, -1.0], [3.1, 2.9, 4.0]];
    let mut triangles = Vec::new();
    for (x, y) in [(-9.0, 2.9), (9.0, 10.0), (9.0, -4.0)] {
        let first = points.len() as u32;
        points.extend([[x, y, -1.0], [x, y, 4.0]]);
        triangles.extend([[0, 1, first], [first, 1, first + 1]]);
    }
    let done = cut_by(&mesh, &Blade::new(&points, &triangles).unwrap());
    assert_eq!(done.report.pieces, 3);
}

#[test]
fn a_blade_folded_back_cuts_as_one() {
    let mesh = box_mesh([5, 5, 3], 0.1, 18);
    // To and fro in one plane, further back than it came from.
    let xs = [-1.0, 2.0, 6.0, 3.0, -2.0, 1.0];
    let blade = Blade::stroke(&xs.map(|x| edge(x, 2.4, -1.0))).unwrap();
    assert_eq!(cut_by(&mesh, &blade).report.pieces, 2);
    // A sharp V with its tip in the middle of the box.
    let blade =
        Blade::stroke(&[edge(-1.0, 2.0, -1.0), edge(2.7, 2.6, -1.0), edge(-1.0, 3.2, -1.0)])
            .unwrap();
    assert_eq!(cut_by(&mesh, &blade).report.pieces, 2);
}

#[test]
fn a_stroke_that_stands_still_or_turns_about_its_tip_is_a_blade() {
    let mesh = box_mesh([4, 4, 4], 0.0, 0);
    let fan = [[-1.0, 2.3, 9.0], [2.0, 2.3, 9.0], [2.0, 2.3, 9.0], [5.0, 2.3, 9.0]];
    let blade = Blade::stroke(&fan.map(|heel| [heel, [2.0, 2.3, 0.5]])).unwrap();
    assert_eq!(blade.triangles().count(), 2);
    assert_eq!(cut_by(&mesh, &blade).report.pieces, 1);
}

#[test]
fn one_lip_alone_can_be_cut() {
    let mesh = box_mesh([5, 5, 4], 0.1, 19);
    let first = cut_by(&mesh, &Blade::plane([0.0, 2.4, 0.0], [0.1, 1.0, 0.0], None).unwrap());
    // From the side, through the one half only.
    let old = &*first.change.mesh;
    let blade = Blade::stroke(&[edge(2.6, -1.0, -1.0), edge(2.6, 2.2, -1.0)]).unwrap();
    let second = cut_by(old, &blade);
    assert_eq!(second.report.pieces, 3);
}

/// The box with what is strictly on either side of the plane y = `at` moved apart by `gap`.
fn gaping(mesh: &Mesh, at: f64, gap: f64) -> Vec<Point> {
    let mut sums = vec![(0.0, 0.0); mesh.nodes().len()];
    for (index, corners) in mesh.tetrahedra().iter().enumerate() {
        let middle: f64 =
            mesh.tetrahedron_corners(index).iter().map(|corner| 0.25 * corner[1]).sum();
        for &node in corners {
            let (sum, count) = &mut sums[node as usize];
            (*sum, *count) = (*sum + (middle - at).signum(), *count + 1.0);
        }
    }
    let shifted =
        |(&[x, y, z], (sum, count)): (&Point, (f64, f64))| [x, y + 0.5 * gap * sum / count, z];
    mesh.nodes().iter().zip(sums).map(shifted).collect()
}

#[test]
fn a_scalpel_that_opens_what_it_cuts_leaves_two_pieces() {
    for seed in 0..20_u64 {
        let gap = 0.02 * seed as f64;
        let mesh = box_mesh([5, 4, 3], 0.1, seed);
        let options = CutOptions { min_edge: Some(0.1), ..CutOptions::default() };
        // Steps of a twelfth of a cell, on a line that turns.
        let place = |k: i32| {
            let x = -0.5 + f64::from(k) / 12.0;
            edge(x, 2.2 + 0.3 * (0.5 * x).sin(), -1.0)
        };
        let places: Vec<_> = (0..=72).map(place).collect();
        let (mut now, mut pending) = (mesh.clone(), Vec::new());
        for pair in places.windows(2) {
            let positions = gaping(&now, 2.3, gap);
            let blade = Blade::stroke(pair).unwrap();
            if let Some(step) = checked_cut_on(&now, &positions, &blade, &pending, &options) {
                (now, pending) = ((*step.change.mesh).clone(), step.pending);
            }
        }
        let whole = cut_by(&mesh, &Blade::stroke(&places).unwrap());
        let [slow, fast] = [now.tetrahedra().len(), whole.change.mesh.tetrahedra().len()];
        assert_eq!(now.pieces().len(), 2, "{seed}");
        assert!(slow < 2 * fast, "{slow} {fast}");
    }
}
