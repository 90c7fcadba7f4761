//! The obvious double loops: what every other method is measured against.

use std::time::Instant;

use palpate_geometry::triangles_intersect;

use super::{Detector, DistanceOf};
use crate::leaf_pairs::share_a_node;
use crate::pairs::TrianglePair;
use crate::proximity::{edge_pair, sort, vertex_triangle};
use crate::scene::{Frame, IntersectionOptions, Intersections, Proximity};

/// The double loop over all surface elements.
#[derive(Debug)]
pub(super) struct AllPairs;

impl Detector for AllPairs {
    fn intersections(
        &mut self,
        frame: &Frame,
        options: IntersectionOptions,
        found: &mut Intersections,
    ) {
        let start = Instant::now();
        found.stats.all_pairs = frame.all_pairs(options.self_contact);
        for (body_a, a) in frame.bodies.iter().enumerate() {
            for (body_b, b) in frame.bodies.iter().enumerate().skip(body_a) {
                let same = body_a == body_b;
                if same && !options.self_contact {
                    continue;
                }
                found.stats.object_pairs += 1;
                for (triangle_a, &corners_a) in a.mesh.triangles().iter().enumerate() {
                    let points_a = a.triangle(triangle_a as u32);
                    let first = if same { triangle_a + 1 } else { 0 };
                    for (triangle_b, &corners_b) in
                        b.mesh.triangles().iter().enumerate().skip(first)
                    {
                        if same && share_a_node(corners_a, corners_b) {
                            continue;
                        }
                        found.stats.polygon_tests += 1;
                        if triangles_intersect(&points_a, &b.triangle(triangle_b as u32)) {
                            found.pairs.push(TrianglePair {
                                body_a: body_a as u32,
                                triangle_a: triangle_a as u32,
                                body_b: body_b as u32,
                                triangle_b: triangle_b as u32,
                            });
                        }
                    }
                }
            }
        }
        found.pairs.sort_unstable();
        found.stats.polygon_time = start.elapsed();
    }

    fn proximity(&mut self, frame: &Frame, distance: DistanceOf, found: &mut Proximity) {
        let start = Instant::now();
        found.stats.all_pairs = frame.all_pairs(true);
        let bodies = frame.bodies;
        for (body_a, a) in bodies.iter().enumerate() {
            for (body_b, b) in bodies.iter().enumerate().skip(body_a) {
                let Some(distance) = distance(body_a, body_b).filter(|&distance| distance > 0.0)
                else {
                    continue;
                };
                found.stats.object_pairs += 1;
                let mut nodes_against_triangles = |from: usize, to: usize| {
                    for &node in bodies[from].mesh.surface_nodes() {
                        for triangle in 0..bodies[to].mesh.triangles().len() as u32 {
                            let pair = [from as u32, to as u32];
                            let record = vertex_triangle(bodies, pair, [node, triangle], distance);
                            found.pairs.extend(record);
                            found.stats.polygon_tests += 1;
                        }
                    }
                };
                nodes_against_triangles(body_a, body_b);
                if body_a != body_b {
                    nodes_against_triangles(body_b, body_a);
                }
                for edge_a in 0..a.mesh.surface_edges().len() as u32 {
                    let first = if body_a == body_b { edge_a + 1 } else { 0 };
                    for edge_b in first..b.mesh.surface_edges().len() as u32 {
                        let pair = [body_a as u32, body_b as u32];
                        found.pairs.extend(edge_pair(bodies, pair, [edge_a, edge_b], distance));
                        found.stats.polygon_tests += 1;
                    }
                }
            }
        }
        sort(&mut found.pairs);
        found.stats.polygon_time = start.elapsed();
    }
}
