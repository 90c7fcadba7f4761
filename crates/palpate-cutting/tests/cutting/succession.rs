//! Many random cuts of one body, one after the other.

use palpate_cutting::{Blade, CutOptions, CutReport, cut};
use palpate_geometry::{Point, vec3};
use palpate_model::Mesh;
use palpate_testing::Random;

use crate::support::{box_mesh, checked_cut, checked_cut_on};

/// A plane, a square, a stroke or a loop somewhere in the box of `size`.
fn random_blade(random: &mut Random, size: f64) -> Option<Blade> {
    let mut point = |low: f64, high: f64| -> Point { [0; 3].map(|_| random.between(low, high)) };
    let at = point(0.0, size);
    let normal = point(-1.0, 1.0);
    let kind = point(0.0, 4.0)[0];
    // Often on the grid: nodes, edges and faces in the blade.
    let at = if kind.fract() < 0.3 { at.map(f64::round) } else { at };
    let normal = if kind.fract() < 0.2 { normal.map(f64::round) } else { normal };
    if kind < 1.0 {
        Blade::plane(at, normal, None).ok()
    } else if kind < 2.0 {
        Blade::plane(at, normal, Some(0.7 * size)).ok()
    } else if kind < 3.0 {
        let [along, depth] = [point(-0.2, 0.2), point(-0.8, 0.8)];
        let edge = |k: i32| {
            let heel = vec3::add_scaled(at, along, size * f64::from(k) / 3.0);
            [heel, vec3::add_scaled(heel, depth, size)]
        };
        Blade::stroke(&(0..6).map(edge).collect::<Vec<_>>()).ok()
    } else {
        let points: Vec<Point> = (0..5).map(|_| point(-0.2 * size, 1.2 * size)).collect();
        Blade::closed_loop(&points).ok()
    }
}

/// Cuts a box again and again, from the start when it has grown much; returns how many cuts opened
/// something.
fn cut_often(cuts: usize, cells: usize, seed: u64, options: &CutOptions) -> usize {
    let mut random = Random(seed);
    let whole = box_mesh([cells; 3], 0.1, seed);
    let limit = 12 * whole.tetrahedra().len();
    let mut mesh: Mesh = whole.clone();
    let mut positions = mesh.nodes().to_vec();
    let mut pending = Vec::new();
    let mut opened = 0;
    for _ in 0..cuts {
        let Some(blade) = random_blade(&mut random, cells as f64) else {
            continue;
        };
        // Sometimes with what the last cut left pending, as a tool goes on.
        let done = if random.between(0.0, 1.0) < 0.5 && blade.parts().len() == 1 {
            checked_cut_on(&mesh, &positions, &blade, &pending, options)
        } else {
            checked_cut(&mesh, &positions, &blade, options)
        };
        let Some(done) = done else {
            continue;
        };
        pending = done.pending;
        opened += 1;
        // The body gapes a little, so that blades and lips are not where they were.
        let shift = |point: Point| {
            let bend = 0.01 * (point[0] + 2.0 * point[1]).sin();
            [point[0] + bend, point[1], point[2] - 0.5 * bend]
        };
        (mesh, positions) = ((*done.change.mesh).clone(), done.positions);
        positions = positions.into_iter().map(shift).collect();
        if mesh.tetrahedra().len() > limit {
            (mesh, positions, pending) = (whole.clone(), whole.nodes().to_vec(), Vec::new());
        }
    }
    opened
}

#[test]
fn random_cuts_leave_meshes() {
    let opened = cut_often(300, 3, 1, &CutOptions::default());
    assert!(opened > 100, "{opened}");
}

#[test]
fn the_report_of_two_cuts_as_one_counts_both() {
    let mesh = box_mesh([3; 3], 0.1, 7);
    let options = CutOptions::default();
    let first = Blade::plane([1.4, 1.5, 1.5], [1.0, 0.2, 0.1], None).unwrap();
    let second = Blade::plane([1.5, 1.6, 1.5], [0.1, 1.0, 0.3], None).unwrap();
    let first = checked_cut(&mesh, mesh.nodes(), &first, &options).unwrap();
    let between = &first.change.mesh;
    let second = checked_cut(between, &first.positions, &second, &options).unwrap();
    let after = &second.change.mesh;
    let (a, b) = (first.report, second.report);
    let both = a.then(&b);
    let change = first.change.clone().then(&second.change, &mesh);
    assert_eq!(both.new_nodes, after.nodes().len() - mesh.nodes().len());
    assert_eq!(both.new_tetrahedra, after.tetrahedra().len() - mesh.tetrahedra().len());
    assert_eq!((both.pieces_before, both.pieces), (1, 4));
    assert_eq!((a.pieces, b.pieces_before), (2, 2));
    assert_eq!(both.split_tetrahedra, a.split_tetrahedra + b.split_tetrahedra);
    assert!(a.split_tetrahedra > 0 && b.split_tetrahedra > 0);
    assert_eq!(both.snapped_nodes, a.snapped_nodes + b.snapped_nodes);
    let (p, q) = (a.smallest_quality.unwrap(), b.smallest_quality.unwrap());
    assert_eq!(both.smallest_quality, Some(p.min(q)));
    let volume = change.mesh.volume() / mesh.volume() - 1.0;
    assert!((both.volume_change - volume).abs() < 1e-14, "{} {volume}", both.volume_change);
    assert!((both.cut_area - a.cut_area - b.cut_area).abs() < 1e-14);
    assert!(a.cut_area > 8.0 && b.cut_area > 8.0, "each is as large as a side");
    assert_eq!(both.deviation, a.deviation.max(b.deviation));
    assert!(a.deviation != b.deviation);

    // Each number by itself, none of the others being like it.
    let of = |n: usize, x: f64, quality| CutReport {
        new_nodes: n,
        new_tetrahedra: n + 1,
        split_tetrahedra: n + 2,
        snapped_nodes: n + 3,
        pieces_before: n + 4,
        pieces: n + 5,
        smallest_quality: quality,
        volume_change: x,
        cut_area: x + 1.0,
        deviation: x + 2.0,
    };
    let expected = |quality| CutReport {
        new_nodes: 110,
        new_tetrahedra: 112,
        split_tetrahedra: 114,
        snapped_nodes: 116,
        pieces_before: 14,
        pieces: 105,
        smallest_quality: quality,
        volume_change: 0.875,
        cut_area: 2.75,
        deviation: 2.5,
    };
    let qualities = [
        (Some(0.2), Some(0.3), Some(0.2)),
        (Some(0.3), Some(0.2), Some(0.2)),
        (None, Some(0.3), Some(0.3)),
        (Some(0.2), None, Some(0.2)),
        (None, None, None),
    ];
    for (first, second, quality) in qualities {
        assert_eq!(of(10, 0.5, first).then(&of(100, 0.25, second)), expected(quality));
        // 10 + 100 and 100 + 10 differ in what is taken from one of them only.
        let turned = of(100, 0.25, first).then(&of(10, 0.5, second));
        let expected = CutReport { pieces_before: 104, pieces: 15, ..expected(quality) };
        assert_eq!(turned, expected);
    }
}

#[test]
fn the_shortest_edge_bounds_what_many_cuts_can_make() {
    let options = CutOptions { min_edge: Some(0.3), ..CutOptions::default() };
    let mut random = Random(5);
    let mut mesh = box_mesh([3; 3], 0.1, 5);
    let shortest = |mesh: &Mesh| {
        let edges = mesh
            .tetrahedra()
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b], [a, c], [a, d], [b, c], [b, d], [c, d]]);
        let length = |[a, b]: [u32; 2]| {
            vec3::distance_squared(mesh.nodes()[a as usize], mesh.nodes()[b as usize])
        };
        edges.map(length).fold(f64::INFINITY, f64::min).sqrt()
    };
    for _ in 0..400 {
        let at = [0; 3].map(|_| random.between(0.0, 3.0));
        let normal = [0; 3].map(|_| random.between(-1.0, 1.0));
        let blade = Blade::plane(at, normal, None).unwrap();
        if let Some(done) = cut(&mesh, mesh.nodes(), &blade, &options).unwrap() {
            mesh = (*done.change.mesh).clone();
        }
    }
    assert!(shortest(&mesh) >= 0.999 * 0.3, "{}", shortest(&mesh));
    assert!(mesh.tetrahedra().len() < 30_000, "{}", mesh.tetrahedra().len());
}

/// `PALPATE_CUTS=10000` for the long run.
#[test]
fn as_many_random_cuts_as_asked_for() {
    let asked = std::env::var("PALPATE_CUTS").ok().and_then(|count| count.parse().ok());
    let cuts: usize = asked.unwrap_or(200);
    for seed in 0..10 {
        let snap = 0.04 * seed as f64;
        let options = CutOptions {
            snap,
            min_quality: 0.03 * seed as f64,
            min_edge: Some(0.02),
            min_piece: 0.3 * seed as f64,
        };
        cut_often(cuts / 10, 2, seed, &options);
    }
}
