//! Time per tetrahedron of the tissue laws: forces, energy, tangent times vector, stiffness matrix.
//!
//! `cargo run --release -p palpate-mechanics --example tissue_cost [cells per edge]`
#![allow(clippy::print_stdout, dead_code, unreachable_pub)]

// The laws are not public: this compiles them once more.
#[path = "../src"]
mod source {
    pub(crate) mod tissue;
}

use std::hint::black_box;
use std::time::Instant;

use palpate_geometry::Point;
use palpate_model::{Law as Name, Material};
use palpate_solver::BlockMatrix;
use palpate_testing::{Fastest, box_of_cells};
use source::tissue::law::Law;
use source::tissue::{Tissue, TissueInput, VolumeAveraging};

const ROUNDS: usize = 101;

fn main() {
    let cells: usize = std::env::args().nth(1).map_or(13, |text| text.parse().expect("a number"));
    let (rest, tetrahedra) = block(cells);
    let x: Vec<Point> = rest
        .iter()
        .map(|&[x, y, z]| {
            let (s, c) = (0.8 * z).sin_cos();
            [1.1 * (c * x - s * y), s * x + c * y + 0.1 * x * z, 0.9 * z + 0.05 * (9.0 * x).sin()]
        })
        .collect();
    println!("{} nodes, {} tetrahedra; ns per tetrahedron", rest.len(), tetrahedra.len());
    println!("law                          forces            energy   multiply  stiffness");
    let material = |law, poisson| Material { law, poisson, ..Material::default() };
    let plain = |law| Law::new(&material(law, 0.4), 1);
    let fibres = |families| {
        let hgo = material(Name::HolzapfelGasserOgden, 0.4);
        Law::new(&Material { k1: 3_000.0, k2: 5.0, kappa: 0.1, ..hgo }, families)
    };
    let laws = [
        ("corotated", plain(Name::Corotated), 0.0),
        ("St. Venant-Kirchhoff", plain(Name::SaintVenantKirchhoff), 0.0),
        ("neo-Hookean", plain(Name::NeoHookean), 0.0),
        ("neo-Hookean, viscous", plain(Name::NeoHookean), 0.01),
        ("neo-Hookean, nu 0.49", Law::new(&material(Name::NeoHookean, 0.49), 1), 0.0),
        ("Mooney-Rivlin", plain(Name::MooneyRivlin), 0.0),
        ("fibres, 1 family", fibres(1), 0.0),
        ("fibres, 2 families", fibres(2), 0.0),
    ];
    let directions = vec![[[0.6, 0.0, 0.8], [0.0, 0.6, 0.8]]; tetrahedra.len()];
    for (name, law, viscosity) in laws {
        let mut tissue = Tissue::new(&TissueInput {
            rest: &rest,
            tetrahedra: &tetrahedra,
            laws: &[law],
            regions: &[],
            fibres: &directions,
            viscosity,
            averaging: VolumeAveraging::Automatic,
        });
        tissue.begin_step(&rest, 0.01);
        let mut out = vec![[0.0; 3]; rest.len()];
        let mut stiffness = BlockMatrix::zeros(tissue.pattern().clone());
        let per_element = 1e9 / tetrahedra.len() as f64;
        let forces =
            measure(ROUNDS, || tissue.forces(black_box(&x), &mut out)).map(|t| t * per_element);
        let energy = measure(ROUNDS, || {
            black_box(tissue.energy(black_box(&x)));
        });
        let multiply = measure(ROUNDS, || tissue.multiply(black_box(&x), &rest, &mut out));
        let matrix = measure(5, || tissue.add_stiffness(black_box(&x), &mut stiffness));
        println!(
            "{name:24} {:7.1} ({:.1} ..{:5.1}) {:9.1} {:9.1} {:9.1}",
            forces[1],
            forces[0],
            forces[2],
            energy[1] * per_element,
            multiply[1] * per_element,
            matrix[1] * per_element
        );
        black_box(&out);
    }
}

/// Lower quartile, median and upper quartile of the time of a call [s].
fn measure(rounds: usize, mut call: impl FnMut()) -> [f64; 3] {
    let mut times: Vec<f64> = (0..rounds)
        .map(|_| {
            let start = Instant::now();
            call();
            start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    [rounds / 4, rounds / 2, 3 * rounds / 4].map(|place| times[place])
}

/// A unit cube of `cells`³ cells of six tetrahedra.
fn block(cells: usize) -> (Vec<Point>, Vec<[u32; 4]>) {
    box_of_cells([cells; 3], Fastest::Last, |at| at.map(|index| index / cells as f64))
}
