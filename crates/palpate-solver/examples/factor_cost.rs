//! What a body's factor costs: ordering and analysis, numeric factorisation and packing, solves in
//! both precisions, and the time to read its bytes.
//!
//! `cargo run --release -p palpate-solver --example factor_cost MESH.vtk...`

#![allow(clippy::print_stdout)] // it is what the example is for

#[path = "support/system.rs"]
mod system;

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use palpate_model::{ReadOptions, read_mesh};
use palpate_solver::{Cholesky, HalfSolution, Precision, half_products};
use system::{system, times};

/// Median time of `work` [ms].
fn time(mut work: impl FnMut()) -> f64 {
    times(25, [&mut work])[0]
}

fn main() -> Result<(), Box<dyn Error>> {
    for path in std::env::args().skip(1) {
        let mesh = read_mesh(Path::new(&path), &ReadOptions::default())?.mesh;
        let matrix = system(mesh.nodes(), mesh.tetrahedra());
        let count = mesh.nodes().len();
        for precision in [Precision::Double, Precision::Single, Precision::BlockFloat] {
            let start = Instant::now();
            let mut factor = Cholesky::with_precision(&matrix, precision)?;
            let build = start.elapsed().as_secs_f64() * 1e3;
            let again = time(|| factor.refactor(&matrix).expect("as before"));
            let mut workspace = factor.workspace();
            let mut rhs = vec![[1.0, -0.5, 0.25]; count];
            let one = time(|| factor.solve_in_place(&mut rhs, &mut workspace));
            let mut three = vec![[0.0; 9]; count];
            let sides = time(|| factor.solve_three_in_place(&mut three, &mut workspace));
            let mut nodes: Vec<u32> = (0..count as u32).step_by(7).collect();
            nodes.sort_by_key(|&node| factor.elimination_place(node as usize));
            let mut halves = vec![HalfSolution::default(); nodes.len()];
            let half = time(|| factor.half_solve(&nodes, &mut halves, &mut workspace));
            let alone = time(|| factor.half_solve(&nodes[..1], &mut halves[..1], &mut workspace));
            let mut lengths = Vec::new();
            let products = time(|| {
                let mut sum = 0.0;
                for (first, &node) in nodes.iter().enumerate() {
                    factor.common_lengths(node as usize, &mut lengths);
                    let pairs = (0..=first).map(|second| {
                        let common = lengths[factor.branch(nodes[second] as usize)];
                        ([&halves[second], &halves[first]], common)
                    });
                    half_products(pairs, |product| sum += product[0]);
                }
                assert!(sum.is_finite());
            });
            let bytes = halves.iter().map(HalfSolution::bytes).sum::<usize>();
            println!(
                "{path} {precision:?}: {} half solutions {half:.3} ms, one {alone:.3} ms, their \
                 products {products:.3} ms, {:.2} MB",
                nodes.len(),
                bytes as f64 / 1e6,
            );
            let product = time(|| matrix.multiply(&rhs, &mut vec![[0.0; 3]; count]));
            let stats = factor.stats();
            let bytes = vec![1_u64; stats.bytes / 8];
            let mut sum = 0_u64;
            let read = time(|| sum = sum.wrapping_add(bytes.iter().sum::<u64>()));
            println!(
                "{path} {precision:?}: build {build:.1} refactor {again:.2} solve {one:.3} three \
                 {sides:.3} product {product:.3} ms; {:.2} MB, twice read \
                 {:.3} ms ({})",
                stats.bytes as f64 / 1e6,
                2.0 * read,
                sum % 10,
            );
        }
    }
    Ok(())
}
