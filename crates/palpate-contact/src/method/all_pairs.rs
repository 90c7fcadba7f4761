//! The obvious double loops: what every other method is measured against.

use std::time::Instant;

use palpate_geometry::triangles_intersect;

use super::{Detector, LimitOf};
use crate::frame::Frame;
use crate::leaf_pairs::share_a_node;
use crate::left_out::ElementPair;
use crate::neighbours::neighbours_meet;
use crate::options::IntersectionOptions;
use crate::pairs::TrianglePair;
use crate::proximity::{edge_pair, sort, vertex_triangle};
use crate::results::{Intersections, Proximity};

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
                let wanted = options.self_contact || !same;
                let bodies = [body_a as u32, body_b as u32];
                if !wanted || frame.left_out.has_bodies(bodies[0], bodies[1]) {
                    continue;
                }
                found.stats.object_pairs += 1;
                for (triangle_a, &corners_a) in a.mesh.triangles().iter().enumerate() {
                    let points_a = a.triangle(triangle_a as u32);
                    let first = if same { triangle_a + 1 } else { 0 };
                    for (triangle_b, &corners_b) in
                        b.mesh.triangles().iter().enumerate().skip(first)
                    {
                        let triangles = [triangle_a as u32, triangle_b as u32];
                        let neighbours = same && share_a_node(corners_a, corners_b);
                        if neighbours && !options.shared_nodes
                            || frame.leaves_out(bodies, ElementPair::Triangles(triangles))
                        {
                            continue;
                        }
                        found.stats.polygon_tests += 1;
                        let meet = if neighbours {
                            neighbours_meet(a, triangles)
                        } else {
                            triangles_intersect(&points_a, &b.triangle(triangle_b as u32))
                        };
                        if meet {
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

    fn proximity(&mut self, frame: &Frame, limit_of: LimitOf, found: &mut Proximity) {
        let start = Instant::now();
        found.stats.all_pairs = frame.all_pairs(true);
        let bodies = frame.bodies;
        for (body_a, a) in bodies.iter().enumerate() {
            for (body_b, b) in bodies.iter().enumerate().skip(body_a) {
                let Some(limit) = limit_of(body_a, body_b) else {
                    continue;
                };
                found.stats.object_pairs += 1;
                let mut nodes_against_triangles = |from: usize, to: usize| {
                    for &node in bodies[from].mesh.surface_nodes() {
                        for triangle in 0..bodies[to].mesh.triangles().len() as u32 {
                            let pair = [from as u32, to as u32];
                            let record = vertex_triangle(frame, pair, [node, triangle], limit);
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
                        found.pairs.extend(edge_pair(frame, pair, [edge_a, edge_b], limit));
                        found.stats.polygon_tests += 1;
                    }
                }
            }
        }
        sort(&mut found.pairs);
        found.stats.polygon_time = start.elapsed();
    }
}
