//! Forces, energy, tangent and stiffness of whole bodies.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use palpate_geometry::Point;
use palpate_model::Material;
use palpate_solver::BlockMatrix;
use proptest::prelude::*;

use super::super::law::{Law, Name};
use super::super::{Inverted, Tissue, TissueInput, VolumeAveraging, von_mises};
use super::support::{
    TestBody, YOUNG, block, inner, law_named, laws, material, matrix, moved, norm, stress,
};

fn forces(tissue: &mut Tissue, x: &[Point]) -> Vec<Point> {
    let mut forces = vec![[0.0; 3]; x.len()];
    tissue.forces(x, &mut forces);
    forces
}

fn product(tissue: &mut Tissue, x: &[Point], vector: &[Point]) -> Vec<Point> {
    let mut product = vec![[0.0; 3]; x.len()];
    tissue.multiply(x, vector, &mut product);
    product
}

fn stiffness(tissue: &mut Tissue, x: &[Point]) -> BlockMatrix {
    let mut matrix = BlockMatrix::zeros(Arc::clone(tissue.pattern()));
    tissue.add_stiffness(x, &mut matrix);
    matrix
}

fn largest(vectors: &[Point]) -> f64 {
    vectors.as_flattened().iter().fold(0.0, |largest: f64, value| largest.max(value.abs()))
}

/// A body of two laws, perhaps nearly incompressible, perhaps viscous, and where it is.
#[derive(Debug)]
struct Case {
    first: usize,
    second: usize,
    stiff: bool,
    viscosity: f64,
    shift: Vec<f64>,
    displacement: Vec<Point>,
    velocity: Vec<Point>,
    along: Vec<Point>,
}

impl Case {
    fn body(&self) -> TestBody {
        let mut pair = [laws()[self.first], laws()[self.second]];
        if self.stiff {
            pair[0] = pair[0].with_lambda(60.0 * pair[0].lame().mu);
        }
        TestBody::new(&pair, self.viscosity, &self.shift)
    }

    /// The tissue in a step, and the positions.
    fn tissue(&self, averaging: VolumeAveraging) -> (Tissue, Vec<Point>) {
        let body = self.body();
        let mut tissue = body.tissue(averaging);
        let start = moved(&body.rest, 1.0, &self.displacement);
        tissue.begin_step(&start, 0.01);
        (tissue, moved(&start, 1.0, &self.velocity))
    }
}

fn cases() -> impl Strategy<Value = Case> {
    let vectors = |size: f64| prop::collection::vec(prop::array::uniform3(-size..size), 18);
    let choice = (0..6_usize, 0..6_usize, any::<bool>(), prop::sample::select(vec![0.0, 0.02]));
    let shift = prop::collection::vec(-0.15..0.15_f64, 20);
    (choice, shift, vectors(0.02), vectors(0.01), vectors(1.0)).prop_map(
        |((first, second, stiff, viscosity), shift, displacement, velocity, along)| Case {
            first,
            second,
            stiff,
            viscosity,
            shift,
            displacement,
            velocity,
            along,
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn forces_are_minus_the_gradient_of_the_energy(case in cases()) {
        let (mut tissue, x) = case.tissue(VolumeAveraging::Automatic);
        let h = 1e-7;
        let slope = (tissue.energy(&moved(&x, h, &case.along))
            - tissue.energy(&moved(&x, -h, &case.along)))
            / (2.0 * h);
        let forces = forces(&mut tissue, &x);
        let analytic = -inner(&forces, &case.along);
        let scale = largest(&forces) * (3 * x.len()) as f64;
        prop_assert!((analytic - slope).abs() <= 1e-6 * scale, "{analytic} {slope} of {scale}");
    }

    #[test]
    fn the_product_is_the_derivative_of_the_forces(case in cases()) {
        let (mut tissue, x) = case.tissue(VolumeAveraging::Automatic);
        let h = 1e-8;
        let ahead = forces(&mut tissue, &moved(&x, h, &case.along));
        let behind = forces(&mut tissue, &moved(&x, -h, &case.along));
        let numeric = moved(&behind, -1.0, &ahead);
        let numeric = numeric.iter().map(|f| f.map(|f| f / (2.0 * h))).collect::<Vec<_>>();
        let analytic = product(&mut tissue, &x, &case.along);
        let error = largest(&moved(&analytic, -1.0, &numeric));
        // A fibre may go slack between the two.
        let scale = largest(&analytic) * if case.first.max(case.second) > 3 { 100.0 } else { 1.0 };
        prop_assert!(error <= 2e-6 * scale, "{error} of {scale}");
    }

    #[test]
    fn internal_forces_neither_push_nor_turn(case in cases()) {
        let (mut tissue, x) = case.tissue(VolumeAveraging::Automatic);
        let forces = forces(&mut tissue, &x);
        let (mut sum, mut torque) = (DVec3::ZERO, DVec3::ZERO);
        for (&x, &f) in x.iter().zip(&forces) {
            sum += DVec3::from_array(f);
            torque += DVec3::from_array(x).cross(DVec3::from_array(f));
        }
        let scale = largest(&forces);
        prop_assert!(sum.length() <= 1e-12 * scale && torque.length() <= 1e-12 * scale);
    }

    #[test]
    fn viscosity_takes_energy_and_leaves_rotation_alone(case in cases()) {
        let mut case = case;
        case.viscosity = 0.05;
        let (mut viscous, x) = case.tissue(VolumeAveraging::Automatic);
        case.viscosity = 0.0;
        let (mut elastic, _) = case.tissue(VolumeAveraging::Automatic);
        let start = moved(&x, -1.0, &case.velocity);
        let drag = moved(&forces(&mut viscous, &x), -1.0, &forces(&mut elastic, &x));
        // With the midpoint's velocity the work is that of the strain; at the end it is more.
        prop_assert!(viscous.energy(&x) >= elastic.energy(&x));
        prop_assert!(viscous.energy(&start) - elastic.energy(&start) <= 1e-12);
        prop_assert!(inner(&drag, &case.velocity) <= 1e-9 * largest(&drag));
        let turn = DMat3::from_rotation_y(0.9);
        let turned: Vec<Point> =
            start.iter().map(|&x| (turn * DVec3::from_array(x)).to_array()).collect();
        let drag = moved(&forces(&mut viscous, &turned), -1.0, &forces(&mut elastic, &turned));
        prop_assert!(largest(&drag) <= 1e-9 * YOUNG);
    }

    #[test]
    fn the_stiffness_is_never_negative(case in cases(), squeeze in 1.0..8.0_f64) {
        let (mut tissue, x) = case.tissue(VolumeAveraging::Automatic);
        // Far enough to turn elements inside out.
        let x = moved(&x, squeeze, &case.displacement);
        let matrix = stiffness(&mut tissue, &x);
        for k in 0..x.len() {
            let place = matrix.pattern().find(k as u32, k as u32).unwrap();
            let diagonal = matrix.blocks()[place];
            for a in 0..3 {
                for b in 0..3 {
                    prop_assert_eq!(diagonal[a][b], diagonal[b][a]);
                }
            }
        }
        let size = largest(&matrix.blocks().iter().flatten().copied().collect::<Vec<_>>());
        for vector in [&case.along, &case.velocity, &case.displacement] {
            let mut product = vec![[0.0; 3]; x.len()];
            matrix.multiply(vector, &mut product);
            prop_assert!(inner(vector, &product) >= -1e-12 * size * inner(vector, vector));
        }
    }

    #[test]
    fn the_stiffness_is_the_tangent_where_that_is_positive(
        case in cases(),
        stretch in 1.02..1.3_f64,
        at_rest in any::<bool>(),
    ) {
        let mut case = case;
        case.viscosity = 0.0;
        // Every law is stable at rest, these two under tension as well.
        let stretch = if at_rest { 1.0 } else { stretch };
        if !at_rest {
            (case.first, case.second) = (case.first % 2, case.second % 2);
        }
        let (mut tissue, _) = case.tissue(VolumeAveraging::Never);
        let x: Vec<Point> = case.body().rest.iter().map(|x| x.map(|x| stretch * x)).collect();
        let matrix = stiffness(&mut tissue, &x);
        let mut assembled = vec![[0.0; 3]; x.len()];
        matrix.multiply(&case.along, &mut assembled);
        let exact = product(&mut tissue, &x, &case.along);
        let error = largest(&moved(&assembled, -1.0, &exact));
        prop_assert!(error <= 1e-11 * largest(&exact), "{error} of {}", largest(&exact));
    }

    #[test]
    fn uniform_deformation_has_uniform_stress(
        entries in prop::array::uniform9(-0.2..0.2_f64),
        shift in prop::collection::vec(-0.15..0.15_f64, 20),
        choice in 0..4_usize,
        ratio in prop::sample::select(vec![2.0, 60.0, 5_000.0]),
    ) {
        let law = laws()[choice].with_lambda(ratio * laws()[choice].lame().mu);
        let body = TestBody::new(&[law; 2], 0.0, &shift);
        let f = DMat3::IDENTITY + DMat3::from_cols_array(&entries);
        let x: Vec<Point> =
            body.rest.iter().map(|&x| (f * DVec3::from_array(x)).to_array()).collect();
        let mut tissue = body.tissue(VolumeAveraging::Automatic);
        let mut found = vec![[0.0; 6]; body.tetrahedra.len()];
        tissue.cauchy_stress(&x, &mut found);
        let first = found[0];
        let size = norm(matrix(&[
            [first[0], first[3], first[5]],
            [first[3], first[1], first[4]],
            [first[5], first[4], first[2]],
        ])) + YOUNG;
        for other in &found {
            for k in 0..6 {
                prop_assert!((other[k] - first[k]).abs() <= 1e-10 * size);
            }
        }
        if ratio < 9.0 {
            let exact = stress(law, f) * f.transpose() * (1.0 / f.determinant());
            let exact = [exact.x_axis.x, exact.y_axis.y, exact.z_axis.z, exact.y_axis.x,
                exact.z_axis.y, exact.z_axis.x];
            for k in 0..6 {
                prop_assert!((first[k] - exact[k]).abs() <= 1e-10 * size);
            }
            prop_assert!(von_mises(&first) <= 3.0 * size);
        }
        // The virial of the forces is that of the stress.
        let forces = forces(&mut tissue, &x);
        let mut virial = DMat3::ZERO;
        for (&x, &f) in body.rest.iter().zip(&forces) {
            let f = DVec3::from_array(f);
            virial += DMat3::from_cols(x[0] * f, x[1] * f, x[2] * f);
        }
        let volume: f64 = body.tetrahedra.iter().map(|t| {
            let [a, b, c, d] = t.map(|node| DVec3::from_array(body.rest[node as usize]));
            (b - a).cross(c - a).dot(d - a) / 6.0
        }).sum();
        let cauchy = matrix(&[
            [first[0], first[3], first[5]],
            [first[3], first[1], first[4]],
            [first[5], first[4], first[2]],
        ]);
        let piola = f.determinant() * cauchy * f.inverse().transpose();
        prop_assert!(norm(virial + volume * piola) <= 1e-9 * volume * size);
    }
}

#[test]
fn inner_nodes_are_in_balance_under_uniform_deformation() {
    let (rest, tetrahedra) = block([4, 4, 4], 0.05);
    let f = DMat3::from_cols_array(&[1.2, 0.1, 0.0, -0.2, 0.9, 0.1, 0.05, 0.0, 1.1]);
    let x: Vec<Point> = rest.iter().map(|&x| (f * DVec3::from_array(x)).to_array()).collect();
    let with_poisson = |name, poisson| Law::new(&Material { poisson, ..material(name) }, 1);
    for poisson in [0.3, 0.499] {
        for law in [
            with_poisson(Name::Corotated, poisson),
            with_poisson(Name::SaintVenantKirchhoff, poisson),
            with_poisson(Name::NeoHookean, poisson),
        ] {
            let mut tissue = Tissue::new(&TissueInput {
                rest: &rest,
                tetrahedra: &tetrahedra,
                laws: &[law],
                regions: &[],
                fibres: &[],
                viscosity: 0.0,
                averaging: VolumeAveraging::Automatic,
            });
            let forces = forces(&mut tissue, &x);
            for (node, force) in rest.iter().zip(&forces) {
                if node.iter().all(|&x| x > 0.01 && x < 0.19) {
                    assert!(largest(&[*force]) < 1e-10 * largest(&forces), "{force:?} at {node:?}");
                }
            }
        }
    }
}

#[test]
fn inverted_elements_are_counted() {
    let (rest, tetrahedra) = block([1, 1, 1], 1.0);
    let mut tissue = Tissue::new(&TissueInput {
        rest: &rest,
        tetrahedra: &tetrahedra,
        laws: &[law_named(Name::NeoHookean)],
        regions: &[],
        fibres: &[],
        viscosity: 0.0,
        averaging: VolumeAveraging::Automatic,
    });
    assert_eq!(tissue.inverted(&rest), Inverted::default());
    let mirrored: Vec<Point> = rest.iter().map(|&[x, y, z]| [-x, y, z]).collect();
    assert_eq!(tissue.inverted(&mirrored), Inverted { count: 6, first: Some(0) });
    let mut pulled = rest.clone();
    // Node 2 belongs to tetrahedra 1 and 2 only; through the opposite face both turn over.
    pulled[2] = [2.0, -1.0, 0.5];
    assert_eq!(tissue.inverted(&pulled), Inverted { count: 2, first: Some(1) });
}
