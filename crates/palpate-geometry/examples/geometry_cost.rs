//! What the narrow phase costs: nanoseconds per call on one core.
//!
//! `cargo run --release -p palpate-geometry --example geometry_cost`
#![allow(clippy::print_stdout)]

use std::{hint::black_box, time::Instant};

use palpate_geometry::{
    Aabb, Point, edge_edge, point_triangle, predicates::orient3d, triangles_intersect,
};

const COUNT: usize = 4096;
const ROUNDS: usize = 200;

type Pair = [[Point; 3]; 2];

fn main() {
    let mut random = Random(7);
    let mut overlapping = || loop {
        let pair = random.pair();
        if Aabb::from_points(&pair[0]).intersects(&Aabb::from_points(&pair[1])) {
            return pair;
        }
    };
    let (mut apart, mut meeting) = (Vec::new(), Vec::new());
    while apart.len() < COUNT || meeting.len() < COUNT {
        let pair = overlapping();
        let list = if triangles_intersect(&pair[0], &pair[1]) { &mut meeting } else { &mut apart };
        if list.len() < COUNT {
            list.push(pair);
        }
    }
    let intersect = |[a, b]: &Pair| u64::from(triangles_intersect(a, b));
    report("triangles apart, boxes overlap", &apart, intersect);
    report("triangles that meet", &meeting, intersect);

    let flat = |pairs: &[Pair]| -> Vec<Pair> {
        let flatten = |[x, y, _]: Point| [x, y, 0.25];
        pairs.iter().map(|pair| pair.map(|triangle| triangle.map(flatten))).collect()
    };
    report("coplanar triangles, axis-aligned", &flat(&meeting), intersect);
    let shared: Vec<Pair> = meeting.iter().map(|[a, b]| [*a, [a[0], b[1], b[2]]]).collect();
    report("triangles with a common corner", &shared, intersect);
    let tilted: Vec<Pair> = flat(&meeting)
        .iter()
        .map(|pair| pair.map(|triangle| triangle.map(|[x, y, _]| [x, y, x + y])))
        .collect();
    report("coplanar triangles up to rounding, tilted", &tilted, intersect);
    let tiny: Vec<Pair> = tilted
        .iter()
        .map(|pair| pair.map(|triangle| triangle.map(|point| point.map(|value| value * 1e-160))))
        .collect();
    report("the same at 1e-160 (integers)", &tiny, intersect);

    report("orient3d", &apart, |[a, b]| orient3d(a[0], a[1], a[2], b[0]) as u64);
    report("point_triangle", &apart, |[a, b]| point_triangle(b[0], a).distance_squared.to_bits());
    report("edge_edge", &apart, |[a, b]| {
        edge_edge(&[a[0], a[1]], &[b[0], b[1]]).distance_squared.to_bits()
    });
}

fn report(what: &str, pairs: &[Pair], call: impl Fn(&Pair) -> u64) {
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        let start = Instant::now();
        for _ in 0..ROUNDS / 5 {
            for pair in pairs {
                black_box(call(black_box(pair)));
            }
        }
        let calls = (ROUNDS / 5 * pairs.len()) as f64;
        best = best.min(start.elapsed().as_secs_f64() * 1e9 / calls);
    }
    println!("{what:44} {best:9.1} ns");
}

/// Marsaglia's xorshift, so that the numbers are the same everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn point(&mut self, reach: f64) -> Point {
        [0; 3].map(|_| reach * (2.0 * self.next() - 1.0))
    }

    /// Two triangles about 1 in size, their centres up to 1 apart on each axis.
    fn pair(&mut self) -> Pair {
        [0; 2].map(|_| {
            let centre = self.point(0.5);
            [0; 3].map(|_| {
                let corner = self.point(0.5);
                [0, 1, 2].map(|axis| centre[axis] + corner[axis])
            })
        })
    }
}
