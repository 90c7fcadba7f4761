//! What a body's factor costs after a small cut: made from nothing, and from the one before.
//!
//! `cargo run --release -p palpate-solver --example change_cost MESH.vtk...`

#![allow(clippy::print_stdout)] // it is what the example is for

#[path = "support/system.rs"]
mod system;

use std::error::Error;
use std::path::Path;

use palpate_model::{ReadOptions, read_mesh};
use palpate_solver::{Cholesky, NodeOrder, Precision};
use system::{system, times};

/// Nodes that the cut splits.
const SPLIT: usize = 30;

/// A mesh with `SPLIT` nodes around one split along a plane, and where each node comes from.
struct Cut {
    nodes: Vec<[f64; 3]>,
    tetrahedra: Vec<[u32; 4]>,
    origins: Vec<u32>,
}

fn cut(nodes: &[[f64; 3]], tetrahedra: &[[u32; 4]], center: [f64; 3], axis: usize) -> Cut {
    // Nodes off the plane are further away.
    let distance = |x: &[f64; 3]| {
        let part = |k: usize| (x[k] - center[k]) * if k == axis { 4.0 } else { 1.0 };
        (0..3).map(|k| part(k).powi(2)).sum::<f64>()
    };
    let mut order: Vec<u32> = (0..nodes.len() as u32).collect();
    order.sort_by(|&a, &b| distance(&nodes[a as usize]).total_cmp(&distance(&nodes[b as usize])));
    let mut copies = vec![None; nodes.len()];
    let mut result = Cut {
        nodes: nodes.to_vec(),
        tetrahedra: tetrahedra.to_vec(),
        origins: (0..nodes.len() as u32).collect(),
    };
    for &node in &order[..SPLIT] {
        copies[node as usize] = Some(result.nodes.len() as u32);
        result.nodes.push(nodes[node as usize]);
        result.origins.push(node);
    }
    for corners in &mut result.tetrahedra {
        let middle = corners.iter().map(|&node| nodes[node as usize][axis]).sum::<f64>() / 4.0;
        if middle > center[axis] {
            *corners = corners.map(|node| copies[node as usize].unwrap_or(node));
        }
    }
    // Copies that no tetrahedron has taken are none.
    let mut is_used = vec![false; result.nodes.len()];
    result.tetrahedra.as_flattened().iter().for_each(|&node| is_used[node as usize] = true);
    let mut numbers = vec![0; is_used.len()];
    let mut count = 0;
    for (node, number) in numbers.iter_mut().enumerate() {
        *number = count;
        count += u32::from(is_used[node]);
    }
    let mut used = is_used.iter();
    result.nodes.retain(|_| *used.next().expect("one per node"));
    let mut used = is_used.iter();
    result.origins.retain(|_| *used.next().expect("one per node"));
    for corners in &mut result.tetrahedra {
        *corners = corners.map(|node| numbers[node as usize]);
    }
    result
}

fn main() -> Result<(), Box<dyn Error>> {
    for path in std::env::args().skip(1) {
        let mesh = read_mesh(Path::new(&path), &ReadOptions::default())?.mesh;
        let (nodes, tetrahedra) = (mesh.nodes(), mesh.tetrahedra());
        let matrix = system(nodes, tetrahedra);
        let order = NodeOrder::new(matrix.pattern());
        let factor = Cholesky::in_order(&matrix, Precision::Single, order.clone())?;
        let origins: Vec<Option<u32>> = (0..nodes.len() as u32).map(Some).collect();
        let first = times(
            9,
            [
                &mut || drop(factor.changed(&matrix, Precision::Single, order.clone(), &origins)),
                &mut || {
                    drop(Cholesky::in_order(&matrix, Precision::Single, order.clone()));
                },
            ],
        );
        let factor = factor.changed(&matrix, Precision::Single, order.clone(), &origins)?;
        println!(
            "{path}: first change {:.2} ms, from nothing {:.2} ms; {:.1} MB kept, factor {:.1} MB",
            first[0],
            first[1],
            factor.stats().kept_bytes as f64 / 1e6,
            factor.stats().bytes as f64 / 1e6,
        );
        let extreme = |axis: usize, sign: f64| {
            let by = |a: &&[f64; 3], b: &&[f64; 3]| (sign * a[axis]).total_cmp(&(sign * b[axis]));
            nodes.iter().max_by(by).copied().unwrap_or_default()
        };
        let middle: [f64; 3] = std::array::from_fn(|k| {
            nodes.iter().map(|node| node[k]).sum::<f64>() / nodes.len() as f64
        });
        let places = [
            ("middle", middle, 0),
            ("left", extreme(0, -1.0), 1),
            ("right", extreme(0, 1.0), 2),
            ("front", extreme(1, -1.0), 0),
            ("back", extreme(1, 1.0), 2),
            ("bottom", extreme(2, -1.0), 0),
            ("top", extreme(2, 1.0), 1),
        ];
        for (name, center, axis) in places {
            let cut = cut(nodes, tetrahedra, center, axis);
            let changed_matrix = system(&cut.nodes, &cut.tetrahedra);
            let mut places: Vec<(u32, u32)> = (0..)
                .zip(&cut.origins)
                .map(|(node, &old)| (factor.elimination_place(old as usize) as u32, node))
                .collect();
            places.sort_unstable();
            let places: Vec<u32> = places.into_iter().map(|(_, node)| node).collect();
            let changed_order = NodeOrder::given(changed_matrix.pattern(), &places);
            let origins: Vec<Option<u32>> = cut.origins.iter().copied().map(Some).collect();
            let mut stats = factor.stats();
            let [changed, whole, order] = times(
                25,
                [
                    &mut || {
                        let changed = factor.changed(
                            &changed_matrix,
                            Precision::Single,
                            changed_order.clone(),
                            &origins,
                        );
                        stats = changed.expect("still positive definite").stats();
                    },
                    &mut || {
                        let order = changed_order.clone();
                        drop(Cholesky::in_order(&changed_matrix, Precision::Single, order));
                    },
                    &mut || drop(NodeOrder::given(changed_matrix.pattern(), &places)),
                ],
            );
            println!(
                "{path}: {name}: {} new nodes: changed {changed:.2} ms ({} of {} supernodes), from \
                 nothing {whole:.2} ms, order {order:.2} ms",
                cut.nodes.len() - nodes.len(),
                stats.computed,
                stats.supernodes,
            );
        }
    }
    Ok(())
}
